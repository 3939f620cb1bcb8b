// Springs of joints and tendons. All that acts on one freedom is gathered as force = c - k q.
#include <fmt/format.h>

#include <array>

#include "conversion.hpp"

namespace fork1s::internal {
namespace {

// What <option><flag> leaves of a tendon's spring and damper.
double TendonStiffness(const mjModel& m, int t) {
  return m.opt.disableflags & mjDSBL_SPRING ? 0 : m.tendon_stiffness[t];
}
double TendonDamping(const mjModel& m, int t) {
  return m.opt.disableflags & mjDSBL_DAMPER ? 0 : m.tendon_damping[t];
}

std::array<double, 2> Higher(const mjtNum* poly, int index, bool off) {
  static_assert(mjNPOLY == 2);
  return off ? std::array<double, 2>{} : std::array<double, 2>{poly[2 * index], poly[2 * index + 1]};
}

// Higher terms make it a spring of its own; the damper's linear term stays with the joint.
bool AddBentSpring(Conversion& c, int j) {
  const mjModel& m = c.m;
  const int dof = m.jnt_dofadr[j], at = m.jnt_qposadr[j], flags = m.opt.disableflags;
  if (m.jnt_type[j] != mjJNT_HINGE && m.jnt_type[j] != mjJNT_SLIDE) return false;
  SpringDef spring;
  spring.higher_stiffness = Higher(m.jnt_stiffnesspoly, j, flags & mjDSBL_SPRING);
  spring.higher_damping = Higher(m.dof_dampingpoly, dof, flags & mjDSBL_DAMPER);
  const std::array<double, 2> none = {};
  if (spring.higher_stiffness == none && spring.higher_damping == none) return false;
  spring.name = c.joint_names[j];
  spring.terms = {{c.Freedom(dof), 1.0}};
  spring.rest = m.qpos_spring[at] - m.qpos0[at];
  const bool bends = spring.higher_stiffness != none;
  if (bends) {
    spring.stiffness = m.jnt_stiffness[j];
    c.in_spring[dof] = true;
    c.held_by[dof].push_back(fmt::format("spring {:.4g} s + {:.4g} s² + {:.4g} s³", spring.stiffness,
                                         spring.higher_stiffness[0], spring.higher_stiffness[1]));
  }
  c.scene.mechanisms[c.MechanismOf(dof)].springs.push_back(std::move(spring));
  return bends;
}

void AddJointSpring(Conversion& c, int j) {
  const mjModel& m = c.m;
  if (c.joint[j].mechanism < 0 || AddBentSpring(c, j)) return;
  const double k = m.opt.disableflags & mjDSBL_SPRING ? 0 : m.jnt_stiffness[j];
  if (k == 0) return;
  const int dof = m.jnt_dofadr[j], at = m.jnt_qposadr[j];
  const auto hold = [&](int i, double rest) {
    c.k[i] += k;
    c.c[i] += k * rest;
    c.held_by[i].push_back(fmt::format("spring {:.4g} {}", k, c.StiffnessUnit(i)));
  };
  switch (m.jnt_type[j]) {
    case mjJNT_HINGE:
    case mjJNT_SLIDE:
      hold(dof, m.qpos_spring[at] - m.qpos0[at]);
      break;
    case mjJNT_BALL: {
      const mjtNum *s = m.qpos_spring + at, *r = m.qpos0 + at;
      const Quaternion turn =
          Quaternion(r[0], r[1], r[2], r[3]).conjugate() * Quaternion(s[0], s[1], s[2], s[3]);
      const Vector3 rest = LogRotation(turn.normalized().toRotationMatrix());
      for (int i = 0; i < 3; ++i) hold(dof + i, rest[i]);
      break;
    }
    default:  // a free joint inside a mechanism, sprung at the reference
      for (int i = 0; i < 6; ++i) hold(dof + i, 0);
  }
}

bool HasSpringOrDamper(const mjModel& m, int t) {
  const std::array<double, 2> none = {};
  return TendonStiffness(m, t) != 0 || TendonDamping(m, t) != 0 ||
         Higher(m.tendon_stiffnesspoly, t, m.opt.disableflags & mjDSBL_SPRING) != none ||
         Higher(m.tendon_dampingpoly, t, m.opt.disableflags & mjDSBL_DAMPER) != none;
}

void AddTendonSpring(Conversion& c, int t) {
  const mjModel& m = c.m;
  const Length length = TendonLength(m, c.d, t);
  if (length.terms.empty()) return;
  const auto& [first, arm] = length.terms[0];
  const std::string name = NameOr(m, m.name_tendonadr[t], "tendon", t);
  const double k = TendonStiffness(m, t), damping = TendonDamping(m, t);
  const double rest = m.tendon_lengthspring[2 * t] - length.at_reference;
  const auto higher_stiffness = Higher(m.tendon_stiffnesspoly, t, m.opt.disableflags & mjDSBL_SPRING),
             higher_damping = Higher(m.tendon_dampingpoly, t, m.opt.disableflags & mjDSBL_DAMPER);
  const std::array<double, 2> none = {};
  const double slack =
      k > 0 || higher_stiffness != none ? m.tendon_lengthspring[2 * t + 1] - m.tendon_lengthspring[2 * t] : 0;
  if (length.is_single() && higher_stiffness == none && higher_damping == none &&
      slack == 0) {  // a spring of that joint
    c.k[first] += k * arm * arm;
    c.c[first] += k * arm * rest;
    c.FreedomOf(first).damping += damping * arm * arm;
    c.held_by[first].push_back(fmt::format("tendon '{}'", name));
    return;
  }
  SpringDef spring;
  spring.name = name;
  spring.stiffness = k;
  spring.damping = damping;
  spring.rest = rest;
  spring.higher_stiffness = higher_stiffness;
  spring.higher_damping = higher_damping;
  spring.slack = slack;
  const bool pulls = (k > 0 || higher_stiffness != none) && !(rest <= 0 && 0 <= rest + slack && slack > 0);
  c.PutLength(length, spring);
  for (const auto& term : length.terms) {
    const int dof = term.first;
    if (pulls) c.in_spring[dof] = true;
    c.held_by[dof].push_back(fmt::format("tendon '{}' over {} {}", name, length.terms.size(),
                                         length.terms.size() == 1 ? "freedom" : "freedoms"));
    if (slack > 0)
      c.held_by[dof].back() += fmt::format(", slack from {:.4g} to {:.4g}{}", m.tendon_lengthspring[2 * t],
                                           m.tendon_lengthspring[2 * t + 1], pulls ? "" : ", as it is here");
  }
  c.scene.mechanisms[c.MechanismOf(first)].springs.push_back(std::move(spring));
}

}  // namespace

bool TendonWorks(const mjModel& m, const mjData& d, int t) {
  if (m.tendon_num[t] == 0) return false;
  if (HasSpringOrDamper(m, t) || m.tendon_frictionloss[t] != 0 || m.tendon_limited[t]) {
    return true;
  }
  if (m.opt.disableflags & mjDSBL_ACTUATION) return false;
  for (const LinearActuator& a : LinearActuators(m, d)) {
    if (m.actuator_trntype[a.actuator] == mjTRN_TENDON && m.actuator_trnid[2 * a.actuator] == t) return true;
  }
  return false;
}

void ConvertSprings(Conversion& c) {
  const mjModel& m = c.m;
  const bool no_springs = m.opt.disableflags & mjDSBL_SPRING, no_dampers = m.opt.disableflags & mjDSBL_DAMPER;
  if (no_springs)
    c.Note(ImportNote::Kind::kChanged, "option", "springs of joints and tendons are switched off");
  if (no_dampers)
    c.Note(ImportNote::Kind::kChanged, "option", "dampers of joints and tendons are switched off");
  for (int j = 0; j < m.njnt; ++j) AddJointSpring(c, j);
  for (int t = 0; t < m.ntendon; ++t)
    if (HasSpringOrDamper(m, t)) AddTendonSpring(c, t);
}

void FinishSprings(Conversion& c) {
  for (int dof = 0; dof < c.m.nv; ++dof) {
    if (c.MechanismOf(dof) < 0) continue;
    FreedomDef& freedom = c.FreedomOf(dof);
    freedom.stiffness = c.k[dof];
    freedom.rest = c.k[dof] != 0 ? c.c[dof] / c.k[dof] : 0;
    if (c.k[dof] == 0 && c.c[dof] != 0) {
      c.Dropped(fmt::format("joint '{}'", c.DofName(dof)),
                fmt::format("a constant force of {:.4g} from actuators is left out: no spring carries it",
                            c.c[dof]));
    }
  }
}

}  // namespace fork1s::internal
