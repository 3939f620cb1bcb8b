#include "length.hpp"

#include <algorithm>
#include <cmath>

namespace fork1s::internal {
namespace {

// Degrees of freedom that move a part of a path against another: those that some of its elements hang on, and
// not all; of a lone element, against the world.
std::vector<int> DofsOfPath(const mjModel& m, const std::vector<int>& bodies) {
  std::vector<int> on(static_cast<std::size_t>(m.nv), 0);
  for (const int body : bodies)
    for (int b = body; b > 0; b = m.body_parentid[b])
      for (int dof = m.body_dofadr[b]; dof >= 0 && dof < m.body_dofadr[b] + m.body_dofnum[b]; ++dof)
        ++on[static_cast<std::size_t>(dof)];
  std::vector<int> dofs;
  for (int dof = 0; dof < m.nv; ++dof)
    if (const int count = on[static_cast<std::size_t>(dof)];
        count > 0 && (count < static_cast<int>(bodies.size()) || bodies.size() == 1))
      dofs.push_back(dof);
  return dofs;
}

// Those with their entries in a sparse row of MuJoCo's.
std::vector<std::pair<int, double>> TermsOf(const std::vector<int>& dofs, const mjtNum* values,
                                            const int* columns, int count) {
  std::vector<std::pair<int, double>> terms;
  for (const int dof : dofs) {
    double arm = 0;
    for (int k = 0; k < count; ++k)
      if (columns[k] == dof) arm = values[k];
    terms.emplace_back(dof, arm);
  }
  return terms;
}

}  // namespace

bool IsSpatial(const mjModel& m, int t) {
  return m.tendon_num[t] > 0 && m.wrap_type[m.tendon_adr[t]] != mjWRAP_JOINT;
}

std::vector<int> BodiesOfTendon(const mjModel& m, int t) {
  std::vector<int> bodies;
  for (int w = m.tendon_adr[t]; w < m.tendon_adr[t] + m.tendon_num[t]; ++w) {
    const int id = m.wrap_objid[w];
    switch (m.wrap_type[w]) {
      case mjWRAP_JOINT:
        bodies.push_back(m.jnt_bodyid[id]);
        break;
      case mjWRAP_SITE:
        bodies.push_back(m.site_bodyid[id]);
        break;
      case mjWRAP_SPHERE:
      case mjWRAP_CYLINDER:
        bodies.push_back(m.geom_bodyid[id]);
        break;
      default:
        break;
    }
  }
  return bodies;
}

std::vector<int> BodiesOfActuator(const mjModel& m, int i) {
  if (IsOnFreeJoint(m, i)) return {m.jnt_bodyid[m.actuator_trnid[2 * i]]};
  const int type = m.actuator_trntype[i], *sites = m.actuator_trnid + 2 * i;
  if (type != mjTRN_SITE && type != mjTRN_SLIDERCRANK) return {};
  std::vector<int> bodies = {m.site_bodyid[sites[0]]};
  if (sites[1] >= 0) bodies.push_back(m.site_bodyid[sites[1]]);
  return bodies;
}

Length TendonLength(const mjModel& m, const mjData& d, int t) {
  Length length;
  if (IsSpatial(m, t)) {
    length.tendon = t;
    length.at_reference = d.ten_length[t];
    const int at = m.ten_J_rowadr[t];
    length.terms =
        TermsOf(DofsOfPath(m, BodiesOfTendon(m, t)), d.ten_J + at, m.ten_J_colind + at, m.ten_J_rownnz[t]);
    return length;
  }
  for (int w = m.tendon_adr[t]; w < m.tendon_adr[t] + m.tendon_num[t]; ++w) {
    const int joint = m.wrap_objid[w];
    if (m.wrap_prm[w] == 0) continue;
    length.terms.emplace_back(m.jnt_dofadr[joint], m.wrap_prm[w]);
    length.at_reference += m.wrap_prm[w] * m.qpos0[m.jnt_qposadr[joint]];
  }
  return length;
}

Length ActuatorLength(const mjModel& m, const mjData& d, int i) {
  const int out = m.actuator_outadr[i], target = m.actuator_trnid[2 * i];
  const mjtNum* gear = m.actuator_gear + 6 * out;
  Length length;
  switch (m.actuator_trntype[i]) {
    case mjTRN_JOINT:
    case mjTRN_JOINTINPARENT: {
      const int type = m.jnt_type[target], count = type == mjJNT_FREE ? 6 : type == mjJNT_BALL ? 3 : 1;
      for (int k = 0; k < count; ++k) {
        if (gear[k] != 0) length.terms.emplace_back(m.jnt_dofadr[target] + k, gear[k]);
      }
      // A torque in parent axes acts on the angular velocity, not on the rotation vector.
      if (count > 1 && m.actuator_trntype[i] == mjTRN_JOINTINPARENT) length.actuator = i;
      if (count == 1) length.at_reference = gear[0] * m.qpos0[m.jnt_qposadr[target]];
      return length;
    }
    case mjTRN_TENDON:
      length = TendonLength(m, d, target);
      length.at_reference *= gear[0];
      for (auto& term : length.terms) term.second *= gear[0];
      length.gear = gear[0];
      if (gear[0] == 0) length.terms.clear();
      return length;
    default: {
      const int at = d.moment_rowadr[out], count = m.actuator_trntype[i] == mjTRN_SITE ? 6 : 1;
      length.actuator = i;
      length.at_reference = d.actuator_length[out];
      if (count == 1) length.gear = gear[0];
      if (std::any_of(gear, gear + count, [](mjtNum g) { return g != 0; }))
        length.terms = TermsOf(DofsOfPath(m, BodiesOfActuator(m, i)), d.actuator_moment + at,
                               d.moment_colind + at, d.moment_rownnz[out]);
      return length;
    }
  }
}

Length BallAngle(const mjModel& m, int joint) {
  Length length;
  length.ball = joint;
  for (int i = 0; i < 3; ++i) length.terms.emplace_back(m.jnt_dofadr[joint] + i, 0.0);
  return length;
}

bool IsBallOfSeveral(const mjModel& m, int joint) {
  const int body = m.jnt_bodyid[joint];
  for (int j = m.body_jntadr[body]; j < m.body_jntadr[body] + m.body_jntnum[body]; ++j)
    if (j != joint && m.jnt_type[j] != mjJNT_SLIDE) return true;
  return false;
}

double BallLimit(const mjModel& m, int joint) {
  return std::max(m.jnt_range[2 * joint], m.jnt_range[2 * joint + 1]) - m.jnt_margin[joint];
}

}  // namespace fork1s::internal
