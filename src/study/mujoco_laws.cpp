#include "mujoco_laws.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace fork1s::internal {
namespace {

// How constraints of a kind give way: solref and solimp, as far as they are all alike.
struct Softness {
  double time_low = 0, time_high = 0;  // s
  bool direct = false;                 // solref that names stiffness and damping
  double impedance_low = 1;            // the least d of solimp
  double give = 0;                     // s²: largest way by unit acceleration against it

  void Take(const mjtNum* solref, const mjtNum* solimp, double timestep, bool safe) {
    impedance_low = std::min(impedance_low, solimp[0]);
    if (solref[0] <= 0) {
      direct = true;
      return;
    }
    // MuJoCo lengthens what its step could not follow ("refsafe").
    const double time = safe ? std::max(solref[0], 2 * timestep) : solref[0];
    time_low = time_low == 0 ? time : std::min(time_low, time);
    time_high = std::max(time_high, time);
    if (solimp[0] > 0) give = std::max(give, (1 - solimp[0]) / solimp[0] * time * time);
  }
  std::string Text() const {
    std::string text;
    if (time_high > 0)
      text = time_high > time_low * 1.000001
                 ? fmt::format("time constants of {:.3g} to {:.3g} s", time_low, time_high)
                 : fmt::format("a time constant of {:.3g} s", time_high);
    if (direct) text += (text.empty() ? "" : " or ") + std::string("a stiffness of their own");
    return text + fmt::format(" (solref), impedance from {:.3g} on (solimp)", impedance_low);
  }
};

bool Safe(const mjModel* m) { return (m->opt.disableflags & mjDSBL_REFSAFE) == 0; }

}  // namespace

std::vector<std::string> MuJoCoLaws(const mjModel* m) {
  std::vector<std::string> laws;
  const bool constraints = (m->opt.disableflags & mjDSBL_CONSTRAINT) == 0;
  Softness contact;
  int colliding = 0, frictional = 0;
  for (int g = 0; g < m->ngeom; ++g) {
    if (m->geom_contype[g] == 0 && m->geom_conaffinity[g] == 0) continue;
    ++colliding;
    frictional += m->geom_condim[g] > 1 && m->geom_friction[3 * g] > 0;
    contact.Take(m->geom_solref + mjNREF * g, m->geom_solimp + mjNIMP * g, m->opt.timestep, Safe(m));
  }
  if (colliding > 1 && !(constraints && (m->opt.disableflags & mjDSBL_CONTACT) == 0)) {
    laws.push_back("the file switches contact off in MuJoCo; here bodies touch");
  } else if (colliding > 1) {
    std::string text = "contacts of MuJoCo are springs, those here are hard: " + contact.Text();
    // Gravity against it: (1 - d) g = d r / tc², d least at the surface.
    const double sink = contact.give * std::hypot(m->opt.gravity[0], m->opt.gravity[1], m->opt.gravity[2]);
    if (sink > 1e-6) text += fmt::format("; a body at rest sinks in by up to {:.2g} mm", 1e3 * sink);
    laws.push_back(text);
    if (frictional > 0) {
      if (m->opt.cone == mjCONE_PYRAMIDAL)
        laws.push_back(
            "friction is bounded by a pyramid in MuJoCo (option cone), by Coulomb's cone here: between its "
            "two tangents MuJoCo holds up to 29 % less");
      if (m->opt.noslip_iterations == 0)
        laws.push_back(
            fmt::format("what is held creeps in MuJoCo, whose friction resists a rate and no way (option "
                        "impratio {:.3g}, "
                        "noslip_iterations 0); here it rests",
                        m->opt.impratio));
    }
  }
  Softness loops;
  int count = 0;
  for (int e = 0; e < m->neq && constraints && (m->opt.disableflags & mjDSBL_EQUALITY) == 0; ++e) {
    if (m->eq_type[e] != mjEQ_CONNECT && m->eq_type[e] != mjEQ_WELD && m->eq_type[e] != mjEQ_JOINT) continue;
    ++count;
    loops.Take(m->eq_solref + mjNREF * e, m->eq_solimp + mjNIMP * e, m->opt.timestep, Safe(m));
  }
  if (count > 0)
    laws.push_back("loops and couplings of MuJoCo are springs, those here stay closed: " + loops.Text());
  const bool has_limits =
      std::any_of(m->jnt_limited, m->jnt_limited + m->njnt, [](auto limited) { return limited != 0; });
  if (has_limits && constraints && (m->opt.disableflags & mjDSBL_LIMIT) == 0) {
    Softness limits;
    for (int j = 0; j < m->njnt; ++j)
      if (m->jnt_limited[j])
        limits.Take(m->jnt_solref + mjNREF * j, m->jnt_solimp + mjNIMP * j, m->opt.timestep, Safe(m));
    laws.push_back("stops of joints give way in MuJoCo and are hard here: " + limits.Text());
  }
  return laws;
}

}  // namespace fork1s::internal
