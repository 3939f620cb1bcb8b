#include "mujoco_laws.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace fork1s::internal {
namespace {

// The impedance d at a depth r: the power curve of MuJoCo's manual ("Solver parameters").
double Impedance(const mjtNum* solimp, double r) {
  const double width = std::max(solimp[2], mjtNum(mjMINVAL)),
               middle = std::clamp(double(solimp[3]), 1e-4, 1 - 1e-4),
               power = std::max(1.0, double(solimp[4])), x = std::min(r / width, 1.0);
  const double y = x <= middle ? std::pow(x, power) / std::pow(middle, power - 1)
                               : 1 - std::pow(1 - x, power) / std::pow(1 - middle, power - 1);
  return std::clamp(solimp[0] + y * (solimp[1] - solimp[0]), mjtNum(mjMINIMP), mjtNum(mjMAXIMP));
}

// The depth at which a contact bears `load`, from its law a + d (b v + d k r) = (1 - d) load at rest, with
// k = 1 / (d_max time)².
double Sink(double time, const mjtNum* solimp, double load) {
  const double d_max = std::clamp(solimp[1], mjtNum(mjMINIMP), mjtNum(mjMAXIMP)),
               k = 1 / (d_max * d_max * time * time);
  const auto excess = [&](double r) {
    const double d = Impedance(solimp, r);
    return d * d * k * r - (1 - d) * load;
  };
  double low = 0, high = 1e-9;
  while (excess(high) < 0 && high < 1e3) high *= 2;
  for (int i = 0; i < 60; ++i) (excess(0.5 * (low + high)) < 0 ? low : high) = 0.5 * (low + high);
  return high;
}

// How constraints of a kind give way: solref and solimp, as far as they are all alike.
struct Softness {
  double time_low = 0, time_high = 0;  // s
  bool direct = false;                 // solref that names stiffness and damping
  double impedance_low = 1;            // the least d of solimp
  double sink = 0;                     // m: where `load`, an acceleration against it, comes to rest

  void Include(const mjtNum* solref, const mjtNum* solimp, double timestep, bool safe, double load = 0) {
    impedance_low = std::min(impedance_low, solimp[0]);
    if (solref[0] <= 0) {
      direct = true;
      return;
    }
    // MuJoCo lengthens what its step could not follow ("refsafe").
    const double time = safe ? std::max(solref[0], 2 * timestep) : solref[0];
    time_low = time_low == 0 ? time : std::min(time_low, time);
    time_high = std::max(time_high, time);
    sink = std::max(sink, Sink(time * solref[1], solimp, load));
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
  const double gravity = std::hypot(m->opt.gravity[0], m->opt.gravity[1], m->opt.gravity[2]);
  int colliding = 0, frictional = 0;
  for (int g = 0; g < m->ngeom; ++g) {
    if (m->geom_contype[g] == 0 && m->geom_conaffinity[g] == 0) continue;
    ++colliding;
    frictional += m->geom_condim[g] > 1 && m->geom_friction[3 * g] > 0;
    contact.Include(m->geom_solref + mjNREF * g, m->geom_solimp + mjNIMP * g, m->opt.timestep, Safe(m),
                    gravity);
  }
  if (colliding > 1 && !(constraints && (m->opt.disableflags & mjDSBL_CONTACT) == 0)) {
    laws.push_back("the file switches contact off in MuJoCo; here bodies touch");
  } else if (colliding > 1) {
    std::string text = "contacts of MuJoCo are springs, those here are hard: " + contact.Text();
    if (contact.sink > 1e-6)
      text += fmt::format("; a body at rest sinks in by up to {:.2g} mm", 1e3 * contact.sink);
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
    loops.Include(m->eq_solref + mjNREF * e, m->eq_solimp + mjNIMP * e, m->opt.timestep, Safe(m));
  }
  if (count > 0)
    laws.push_back("loops and couplings of MuJoCo are springs, those here stay closed: " + loops.Text());
  const bool has_limits =
      std::any_of(m->jnt_limited, m->jnt_limited + m->njnt, [](auto limited) { return limited != 0; });
  if (has_limits && constraints && (m->opt.disableflags & mjDSBL_LIMIT) == 0) {
    Softness limits;
    for (int j = 0; j < m->njnt; ++j)
      if (m->jnt_limited[j])
        limits.Include(m->jnt_solref + mjNREF * j, m->jnt_solimp + mjNIMP * j, m->opt.timestep, Safe(m));
    laws.push_back("stops of joints give way in MuJoCo and are hard here: " + limits.Text());
  }
  return laws;
}

}  // namespace fork1s::internal
