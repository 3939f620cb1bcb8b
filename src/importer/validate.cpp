#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "conversion.hpp"
#include "names.hpp"
#include "urdf.hpp"

namespace fork1s::internal {
namespace {

bool Finite(const mjtNum* p, mjtSize n) {
  for (int i = 0; i < n; ++i) {
    if (!std::isfinite(p[i])) return false;
  }
  return true;
}

std::optional<Error> CheckJoint(const Conversion& c, int j) {
  const mjModel& m = c.m;
  const std::string where = fmt::format("joint '{}'", c.joint_names[j]);
  const auto refuse = [&](const char* what, double value) {
    return c.ModelError(where, fmt::format("{} is {}; it must be a finite number of 0 or more", what, value));
  };
  const double k = m.jnt_stiffness[j];
  if (!(k >= 0) || !std::isfinite(k)) return refuse("stiffness", k);
  const int count = m.jnt_type[j] == mjJNT_FREE ? 6 : m.jnt_type[j] == mjJNT_BALL ? 3 : 1;
  for (int i = m.jnt_dofadr[j]; i < m.jnt_dofadr[j] + count; ++i) {
    if (!(m.dof_damping[i] >= 0) || !std::isfinite(m.dof_damping[i]))
      return refuse("damping", m.dof_damping[i]);
    if (!(m.dof_armature[i] >= 0) || !std::isfinite(m.dof_armature[i]))
      return refuse("armature", m.dof_armature[i]);
  }
  if (!Finite(m.jnt_axis + 3 * j, 3) || !Finite(m.jnt_pos + 3 * j, 3) || !Finite(m.jnt_range + 2 * j, 2)) {
    return c.ModelError(where, "its axis, position or range is not finite; write finite numbers");
  }
  if (m.jnt_limited[j] && m.jnt_range[2 * j] > m.jnt_range[2 * j + 1]) {
    return c.ModelError(where, "its range ends before it begins; swap the two numbers");
  }
  return std::nullopt;
}

std::optional<Error> CheckActuator(const Conversion& c, int i) {
  const mjModel& m = c.m;
  if (Finite(m.actuator_gainprm + mjNGAIN * i, mjNGAIN) &&
      Finite(m.actuator_biasprm + mjNBIAS * i, mjNBIAS) &&
      Finite(m.actuator_gear + 6 * m.actuator_outadr[i], 6)) {
    return std::nullopt;
  }
  return c.ModelError(fmt::format("actuator '{}'", c.actuator_names[i]),
                      "a gain, bias or gear is not finite; write finite numbers");
}

// Links that a joint moves and that weigh nothing, with all below them: no joint of URDF has an armature.
std::optional<Error> CheckUrdfMasses(const Conversion& c) {
  const mjModel& m = c.m;
  std::vector<bool> weighs(static_cast<std::size_t>(m.nbody), false);
  for (int b = static_cast<int>(m.nbody); b-- > 1;) {
    const auto at = static_cast<std::size_t>(b);
    weighs[at] = weighs[at] || !IsMasslessUrdf(m.body_mass[b]);
    if (weighs[at]) weighs[static_cast<std::size_t>(m.body_parentid[b])] = true;
  }
  for (int j = 0; j < m.njnt; ++j) {
    const int b = m.jnt_bodyid[j];
    if (weighs[static_cast<std::size_t>(b)]) continue;
    return c.ModelError(
        fmt::format("link '{}'", m.names + m.name_bodyadr[b]),
        fmt::format("it weighs nothing, with all that hangs on it, and joint '{}' moves it; give it "
                    "<inertial> with mass and inertia or a <collision> shape, or make the joint fixed",
                    c.joint_names[static_cast<std::size_t>(j)]));
  }
  return std::nullopt;
}

// Depth of a contact under a unit of acceleration, s²: (1 - d) / (d k) with the impedance d at first touch
// and k = 1 / (d_max T ζ)², or k = -solref[0] / d_max².
double Softness(const mjtNum* solref, const mjtNum* solimp) {
  const double d = std::clamp(solimp[0], mjMINIMP, mjMAXIMP),
               d_max = std::clamp(solimp[1], mjMINIMP, mjMAXIMP);
  const double k = solref[0] > 0 ? 1 / std::pow(solref[0] * std::max(solref[1], mjMINVAL), 2) : -solref[0];
  return (1 - d) / d * d_max * d_max / k;
}

// Contacts, stops and closures that are softer than those of which the file says nothing.
void ListSoftConstraints(Conversion& c) {
  const mjModel& m = c.m;
  mjtNum solref[mjNREF], solimp[mjNIMP];
  mj_defaultSolRefImp(solref, solimp);
  const auto is_soft = [usual = Softness(solref, solimp) * (1 + 1e-9)](  // rounding
                           const mjtNum* ref, const mjtNum* imp, int at) {
    return Softness(ref + mjNREF * at, imp + mjNIMP * at) > usual;
  };
  const bool overrides = m.opt.enableflags & mjENBL_OVERRIDE;
  std::vector<std::string> geoms, pairs, joints, tendons, equalities;
  for (int g = 0; g < m.ngeom && !overrides; ++g)
    if ((m.geom_contype[g] != 0 || m.geom_conaffinity[g] != 0) && is_soft(m.geom_solref, m.geom_solimp, g))
      geoms.push_back(NameOr(m, m.name_geomadr[g], "geom", g));
  for (int k = 0; k < m.npair; ++k) {
    const mjtNum* friction = m.pair_solreffriction + mjNREF * k;  // 0: as the normal's
    if ((!overrides && is_soft(m.pair_solref, m.pair_solimp, k)) ||
        (friction[0] != 0 && is_soft(friction, overrides ? m.opt.o_solimp : m.pair_solimp + mjNIMP * k, 0)))
      pairs.push_back(NameOr(m, m.name_pairadr[k], "pair", k));
  }
  const bool no_limits = m.opt.disableflags & (mjDSBL_LIMIT | mjDSBL_CONSTRAINT);
  for (int j = 0; j < m.njnt && !no_limits; ++j)
    if (m.jnt_limited[j] && is_soft(m.jnt_solref, m.jnt_solimp, j)) joints.push_back(c.joint_names[j]);
  for (int t = 0; t < m.ntendon && !no_limits; ++t)
    if (m.tendon_limited[t] && is_soft(m.tendon_solref_lim, m.tendon_solimp_lim, t))
      tendons.push_back(NameOr(m, m.name_tendonadr[t], "tendon", t));
  for (int e = 0; e < m.neq; ++e)
    if (c.EqualityWorks(e) && is_soft(m.eq_solref, m.eq_solimp, e))
      equalities.push_back(NameOr(m, m.name_eqadr[e], "equality", e));
  constexpr const char* kHard =
      "contact is hard here: put the body on a joint with a spring to let it give way";
  constexpr const char* kStop = "stops are hard here: a joint spring gives way";
  if (overrides && is_soft(m.opt.o_solref, m.opt.o_solimp, 0))
    c.Dropped("softness by o_solref and o_solimp in <option>", kHard);
  c.DroppedMany("softness by solref and solimp of geom", geoms, kHard);
  c.DroppedMany("softness by solref and solimp of contact pair", pairs, kHard);
  c.DroppedMany("softness by solreflimit and solimplimit of joint", joints, kStop);
  c.DroppedMany("softness by solreflimit and solimplimit of tendon", tendons, kStop);
  c.DroppedMany("softness by solref and solimp of equality", equalities,
                "closures and couplings are exact here: springs of joints or tendons give way");
}

}  // namespace

std::optional<Error> Validate(const Conversion& c) {
  const mjModel& m = c.m;
  for (int b = 1; b < m.nbody; ++b) {
    const std::string where = fmt::format("body '{}'", c.body_names[b]);
    if (!Finite(m.body_pos + 3 * b, 3) || !Finite(m.body_quat + 4 * b, 4)) {
      return c.ModelError(where, "its position or orientation is not finite; write finite numbers");
    }
    if (!Finite(m.body_mass + b, 1) || !Finite(m.body_inertia + 3 * b, 3) ||
        !Finite(m.body_ipos + 3 * b, 3) || m.body_mass[b] < 0) {
      return c.ModelError(where,
                          fmt::format("its mass {} or inertia cannot be used; give a finite mass of 0 or "
                                      "more",
                                      m.body_mass[b]));
    }
  }
  constexpr double kLargest = 1e9;  // m; beyond it squares of coordinates, kept as floats, run out of numbers
  for (int g = 0; g < m.ngeom; ++g) {
    if (m.geom_rbound[g] <= kLargest) continue;  // 0: a plane
    return c.ModelError(
        fmt::format("geom '{}'", NameOr(m, m.name_geomadr[g], "geom", g)),
        fmt::format("it reaches {:.3g} m from its middle; correct its size, or the unit or scale of its mesh",
                    m.geom_rbound[g]));
  }
  for (int j = 0; j < m.njnt; ++j) {
    if (auto error = CheckJoint(c, j)) return error;
  }
  for (int i = 0; i < m.nactuator; ++i) {
    if (auto error = CheckActuator(c, i)) return error;
  }
  for (int t = 0; t < m.ntendon; ++t) {
    if (m.tendon_stiffness[t] >= 0 && m.tendon_damping[t] >= 0) continue;
    return c.ModelError(fmt::format("tendon '{}'", NameOr(m, m.name_tendonadr[t], "tendon", t)),
                        "stiffness and damping must be 0 or more");
  }
  for (int key = 0; key < m.nkey; ++key) {
    if (Finite(m.key_qpos + key * m.nq, m.nq) && Finite(m.key_qvel + key * m.nv, m.nv) &&
        Finite(m.key_ctrl + key * m.nu, m.nu) && Finite(m.key_act + key * m.na, m.na)) {
      continue;
    }
    return c.ModelError(fmt::format("keyframe '{}'", NameOr(m, m.name_keyadr[key], "key", key)),
                        "a coordinate, speed, activation or control is not finite; write finite numbers");
  }
  if (c.is_urdf)
    if (auto error = CheckUrdfMasses(c)) return error;
  if (!Finite(m.opt.gravity, 3)) return c.ModelError("option", "gravity is not finite; write three numbers");
  return std::nullopt;
}

void ListUnsupported(Conversion& c) {
  const mjModel& m = c.m;
  const auto any = [](const mjtNum* p, int n) {
    return std::any_of(p, p + n, [](mjtNum x) { return x != 0; });
  };
  constexpr const char* kElastic = "springs are elastic here: none shifts where it comes to rest";
  std::vector<std::string> joints, rotors, bound, plastic_joints, plastic_tendons, compensated;
  for (int j = 0; j < m.njnt; ++j) {
    const int dof = m.jnt_dofadr[j];
    if (m.jnt_plasticadr[j] >= 0) plastic_joints.push_back(c.joint_names[j]);
    if (m.jnt_actgravcomp[j] && m.jnt_actfrclimited[j] && m.flg_gravcomp)
      compensated.push_back(c.joint_names[j]);
    if (m.jnt_type[j] == mjJNT_HINGE || m.jnt_type[j] == mjJNT_SLIDE) continue;
    if (any(m.jnt_stiffnesspoly + mjNPOLY * j, mjNPOLY) || any(m.dof_dampingpoly + mjNPOLY * dof, mjNPOLY))
      joints.push_back(c.joint_names[j]);
  }
  for (int t = 0; t < m.ntendon; ++t) {
    const std::string name = NameOr(m, m.name_tendonadr[t], "tendon", t);
    if (m.tendon_armature[t] != 0) rotors.push_back(name);
    if (m.tendon_actfrclimited[t]) bound.push_back(name);
    if (m.tendon_plasticadr[t] >= 0) plastic_tendons.push_back(name);
  }
  c.DroppedMany("higher terms of the spring or damper of joint", joints,
                "those of hinges, slides and tendons are simulated; of this joint its linear part is");
  c.DroppedMany("inertia of tendon", rotors, "tendons have no mass here");
  c.DroppedMany("force limit of the actuators of tendon", bound,
                "only actuators and joints have such limits here");
  ListSoftConstraints(c);
  c.DroppedMany("yield of the spring of joint", plastic_joints, kElastic);
  c.DroppedMany("yield of the spring of tendon", plastic_tendons, kElastic);
  c.DroppedMany(
      "actuatorgravcomp of joint", compensated,
      "compensation of gravity is not of the actuators here: bounds of their forces leave it alone");
  std::vector<std::string> flexes;
  for (int f = 0; f < m.nflex; ++f) flexes.push_back(NameOr(m, m.name_flexadr[f], "flex", f));
  c.DroppedMany(
      "flex", flexes,
      "it is not simulated: it touches nothing, and vertices without shapes stand still, with their mass, in the body that carries them");
  const auto count = [&](mjtSize n, const char* what, const char* why) {
    if (n > 0) c.Dropped(n == 1 ? fmt::format("1 {}", what) : fmt::format("{} {}s", n, what), why);
  };
  count(m.ncam, "camera", "the viewer has its own");
  count(m.nskin, "skin", "skins are not drawn");
  count(m.ntuple, "tuple", "it has no meaning here");
  if (m.opt.density != 0 || m.opt.viscosity != 0 || m.opt.wind[0] != 0 || m.opt.wind[1] != 0 ||
      m.opt.wind[2] != 0) {
    c.Dropped("option density, viscosity, wind", "there is no fluid here");
  }
}

}  // namespace fork1s::internal
