// Springs of joints and fixed tendons. All that acts on one freedom is gathered as force = c - k q.
#include <fmt/format.h>

#include "conversion.hpp"

namespace fork1s::internal {
namespace {

void AddJointSpring(Conversion& c, int j) {
  const mjModel& m = c.m;
  const double k = m.jnt_stiffness[j];
  if (k == 0 || c.joint[j].mechanism < 0) return;
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

void AddTendonSpring(Conversion& c, int t) {
  const mjModel& m = c.m;
  SpringDef spring;
  spring.name = NameOr(m, m.name_tendonadr[t], "tendon", t);
  int mechanism = -1, only = -1;
  double factor = 0;
  for (int w = m.tendon_adr[t]; w < m.tendon_adr[t] + m.tendon_num[t]; ++w) {
    const int dof = m.jnt_dofadr[m.wrap_objid[w]];
    if (m.wrap_prm[w] == 0) continue;
    mechanism = c.MechanismOf(dof);
    spring.terms.emplace_back(c.Freedom(dof), m.wrap_prm[w]);
    only = dof;
    factor = m.wrap_prm[w];
  }
  if (mechanism < 0) return;
  const double k = m.tendon_stiffness[t];
  const double rest = m.tendon_lengthspring[t] - m.tendon_length0[t];
  if (spring.terms.size() == 1) {  // the same as a spring of that joint
    c.k[only] += k * factor * factor;
    c.c[only] += k * factor * rest;
    c.FreedomOf(only).damping += m.tendon_damping[t] * factor * factor;
    c.held_by[only].push_back(fmt::format("tendon '{}'", spring.name));
    return;
  }
  spring.stiffness = k;
  spring.damping = m.tendon_damping[t];
  spring.rest = rest;
  for (int w = m.tendon_adr[t]; w < m.tendon_adr[t] + m.tendon_num[t]; ++w) {
    const int dof = m.jnt_dofadr[m.wrap_objid[w]];
    if (k > 0) c.in_spring[dof] = true;
    c.held_by[dof].push_back(fmt::format("tendon '{}' over {} freedoms", spring.name, spring.terms.size()));
  }
  c.scene.mechanisms[mechanism].springs.push_back(std::move(spring));
}

}  // namespace

bool TendonWorks(const mjModel& m, int t) {
  for (int w = m.tendon_adr[t]; w < m.tendon_adr[t] + m.tendon_num[t]; ++w) {
    if (m.wrap_type[w] != mjWRAP_JOINT) return false;
  }
  if (m.tendon_num[t] == 0) return false;
  const bool passive = !(m.opt.disableflags & mjDSBL_PASSIVE);
  if (passive && (m.tendon_stiffness[t] != 0 || m.tendon_damping[t] != 0)) return true;
  if (m.opt.disableflags & mjDSBL_ACTUATION) return false;
  for (const LinearActuator& a : LinearActuators(m)) {
    if (m.actuator_trntype[a.actuator] == mjTRN_TENDON && m.actuator_trnid[2 * a.actuator] == t) return true;
  }
  return false;
}

void ConvertSprings(Conversion& c) {
  const mjModel& m = c.m;
  if (m.opt.disableflags & mjDSBL_PASSIVE) {
    c.Note(ImportNote::Kind::kChanged, "option", "passive forces are switched off: no springs, no damping");
    return;
  }
  for (int j = 0; j < m.njnt; ++j) AddJointSpring(c, j);
  for (int t = 0; t < m.ntendon; ++t) {
    if (TendonWorks(m, t) && (m.tendon_stiffness[t] != 0 || m.tendon_damping[t] != 0)) AddTendonSpring(c, t);
  }
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
