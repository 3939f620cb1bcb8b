#include "length.hpp"

#include <algorithm>
#include <cmath>

namespace fork1s::internal {
namespace {

// Arms below this share of the largest are rounding of the reader: what a tendon within a robot does to the
// robot as a whole, for instance.
constexpr double kNoArm = 1e-12;

std::vector<std::pair<int, double>> Row(const mjtNum* values, const int* columns, int count) {
  double largest = 0;
  for (int i = 0; i < count; ++i) largest = std::max(largest, std::abs(values[i]));
  std::vector<std::pair<int, double>> terms;
  for (int i = 0; i < count; ++i) {
    if (std::abs(values[i]) > kNoArm * largest) terms.emplace_back(columns[i], values[i]);
  }
  return terms;
}

// Degrees of freedom that move a part of a tendon's path against another: those that some of its elements
// hang on, and not all.
std::vector<int> DofsOfPath(const mjModel& m, int t) {
  const std::vector<int> bodies = BodiesOfTendon(m, t);
  std::vector<int> on(static_cast<std::size_t>(m.nv), 0);
  for (const int body : bodies)
    for (int b = body; b > 0; b = m.body_parentid[b])
      for (int dof = m.body_dofadr[b]; dof >= 0 && dof < m.body_dofadr[b] + m.body_dofnum[b]; ++dof)
        ++on[static_cast<std::size_t>(dof)];
  std::vector<int> dofs;
  for (int dof = 0; dof < m.nv; ++dof)
    if (const int count = on[static_cast<std::size_t>(dof)];
        count > 0 && count < static_cast<int>(bodies.size()))
      dofs.push_back(dof);
  return dofs;
}

}  // namespace

bool IsSpatial(const mjModel& m, int t) {
  return m.tendon_num[t] > 0 && m.wrap_type[m.tendon_adr[t]] != mjWRAP_JOINT;
}

bool HearsFreeJoint(const mjModel& m, const Length& length) {
  return std::any_of(length.terms.begin(), length.terms.end(),
                     [&](const auto& term) { return m.jnt_type[m.dof_jntid[term.first]] == mjJNT_FREE; });
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

Length TendonLength(const mjModel& m, const mjData& d, int t) {
  Length length;
  if (IsSpatial(m, t)) {
    length.tendon = t;
    length.at_reference = d.ten_length[t];
    const int at = m.ten_J_rowadr[t];
    for (const int dof : DofsOfPath(m, t)) {
      double arm = 0;
      for (int k = at; k < at + m.ten_J_rownnz[t]; ++k)
        if (m.ten_J_colind[k] == dof) arm = d.ten_J[k];
      length.terms.emplace_back(dof, arm);
    }
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
      const bool ball = m.jnt_type[target] == mjJNT_BALL;
      for (int k = 0; k < (ball ? 3 : 1); ++k) {
        if (gear[k] != 0) length.terms.emplace_back(m.jnt_dofadr[target] + k, gear[k]);
      }
      if (!ball) length.at_reference = gear[0] * m.qpos0[m.jnt_qposadr[target]];
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
      const int at = d.moment_rowadr[out];
      length.linear = false;
      length.at_reference = d.actuator_length[out];
      length.terms = Row(d.actuator_moment + at, d.moment_colind + at, d.moment_rownnz[out]);
      return length;
    }
  }
}

}  // namespace fork1s::internal
