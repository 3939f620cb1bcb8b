// Dry friction of joints and tendons, stops of tendons, and bounds on what actuators give.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>

#include "conversion.hpp"

namespace fork1s::internal {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Whether the inputs of an actuator are still there: PD control may have taken their place, under their
// names.
bool HasControls(const Conversion& c, const LinearActuator& a) {
  const auto& sources = c.controls[c.MechanismOf(a.length.terms[0].first)];
  return std::all_of(a.inputs.begin(), a.inputs.end(), [&](const ActuatorInput& input) {
    return std::any_of(sources.begin(), sources.end(),
                       [&](const ControlSource& source) { return source.ctrl == input.ctrl; });
  });
}

struct Bounds {
  double lower = -kInfinity, upper = kInfinity;
  bool Bind() const { return lower > -kInfinity || upper < kInfinity; }
};

Bounds ForceRange(const mjModel& m, int actuator) {
  if (!m.actuator_forcelimited[actuator]) return {};
  return {m.actuator_forcerange[2 * actuator], m.actuator_forcerange[2 * actuator + 1]};
}

// The actuator's F on its length L; a PD hold that took its place has no bounds.
ForceLimitDef LimitOf(Conversion& c, const LinearActuator& a, const Bounds& bounds) {
  ForceLimitDef limit;
  limit.name = a.name;
  c.PutLength(a.length, limit);
  for (const ActuatorInput& input : a.inputs) limit.inputs.emplace_back(input.name, 1.0);
  limit.stiffness = -a.b1;
  limit.damping = -a.b2;
  limit.rest = a.b1 < 0 ? a.b0 / -a.b1 - a.length.at_reference : 0;
  limit.lower = bounds.lower;
  limit.upper = bounds.upper;
  return limit;
}

// All actuators of a joint together: force on the freedom itself.
ForceLimitDef JointLimit(const Conversion& c, int dof, const std::vector<const LinearActuator*>& actuators,
                         const Bounds& bounds) {
  ForceLimitDef limit;
  limit.name = c.DofName(dof) + " actuators";
  limit.terms = {{c.Freedom(dof), 1.0}};
  double constant = 0;
  for (const LinearActuator* a : actuators) {
    const double arm = a->length.terms[0].second;
    for (const ActuatorInput& input : a->inputs) limit.inputs.emplace_back(input.name, arm);
    limit.stiffness += -a->b1 * arm * arm;
    limit.damping += -a->b2 * arm * arm;
    constant += arm * (a->b0 + a->b1 * a->length.at_reference);
  }
  limit.rest = limit.stiffness > 0 ? constant / limit.stiffness : 0;
  limit.lower = bounds.lower;
  limit.upper = bounds.upper;
  return limit;
}

void ConvertFriction(Conversion& c) {
  const mjModel& m = c.m;
  if (m.opt.disableflags & (mjDSBL_FRICTIONLOSS | mjDSBL_CONSTRAINT)) return;
  const auto add = [&](const std::string& name, const Length& length, double force) {
    const int mechanism = c.MechanismOf(length.terms[0].first);
    DryFrictionDef friction{name, {}, force, {}};
    c.PutLength(length, friction);
    c.scene.mechanisms[mechanism].frictions.push_back(std::move(friction));
  };
  std::vector<std::string> on_free;
  for (int dof = 0; dof < m.nv; ++dof) {
    if (m.dof_frictionloss[dof] == 0) continue;
    if (c.MechanismOf(dof) < 0) {
      if (on_free.empty() || on_free.back() != c.joint_names[m.dof_jntid[dof]])
        on_free.push_back(c.joint_names[m.dof_jntid[dof]]);
      continue;
    }
    Length length;
    length.terms = {{dof, 1.0}};
    add(c.DofName(dof), length, m.dof_frictionloss[dof]);
  }
  c.DroppedMany("dry friction of joint", on_free, "its body moves freely");
  for (int t = 0; t < m.ntendon; ++t) {
    if (m.tendon_frictionloss[t] == 0) continue;
    const Length length = TendonLength(m, c.d, t);
    const std::string name = NameOr(m, m.name_tendonadr[t], "tendon", t);
    if (length.terms.empty())
      c.Dropped(fmt::format("dry friction of tendon '{}'", name), "it moves nothing here");
    else
      add(name, length, m.tendon_frictionloss[t]);
  }
}

// PD control on joints that bound the force of their actuators, as effort in URDF does.
void BoundPdControls(Conversion& c, const std::vector<bool>& driven) {
  const mjModel& m = c.m;
  std::map<int, ForceLimitDef> limits;  // by degree of freedom: the bound is on the sum of what holds it
  for (std::size_t i = 0; i < c.controls.size(); ++i)
    for (std::size_t k = 0; k < c.controls[i].size(); ++k) {
      const ControlSource& source = c.controls[i][k];
      if (source.pd.empty()) continue;
      const auto [dof, rest] = source.pd[0];
      const int joint = m.dof_jntid[dof];
      if (!m.jnt_actfrclimited[joint] || driven[static_cast<std::size_t>(dof)]) continue;
      ForceLimitDef& limit = limits[dof];
      limit.name = c.DofName(dof);
      limit.terms = {{c.Freedom(dof), 1.0}};
      limit.inputs.emplace_back(c.scene.mechanisms[i].controls[k].name, 1.0);
      limit.stiffness += source.gains.kp;
      limit.damping += source.gains.kv;
      limit.rest = rest;
      limit.lower = m.jnt_actfrcrange[2 * joint];
      limit.upper = m.jnt_actfrcrange[2 * joint + 1];
    }
  for (auto& [dof, limit] : limits)
    c.scene.mechanisms[c.MechanismOf(dof)].force_limits.push_back(std::move(limit));
}

}  // namespace

void ConvertLengthLimits(Conversion& c) {
  const mjModel& m = c.m;
  if (m.opt.disableflags & (mjDSBL_LIMIT | mjDSBL_CONSTRAINT)) return;
  std::vector<std::string> shared, closed;
  for (int j = 0; j < m.njnt; ++j) {
    if (!m.jnt_limited[j] || m.jnt_type[j] != mjJNT_BALL || c.joint[j].mechanism < 0) continue;
    if (IsBallOfSeveral(m, j)) {
      shared.push_back(c.joint_names[j]);
      continue;
    }
    const double most = BallLimit(m, j);
    if (!(most < std::numbers::pi)) continue;  // no rotation is larger
    if (!(most > 0)) {
      closed.push_back(c.joint_names[j]);
      continue;
    }
    LengthLimitDef limit;
    limit.name = c.joint_names[j];
    c.PutLength(BallAngle(m, j), limit);
    limit.upper = most;
    c.scene.mechanisms[static_cast<std::size_t>(c.joint[j].mechanism)].length_limits.push_back(
        std::move(limit));
  }
  c.DroppedMany("ball joint limit", closed,
                "its range less its margin is 0: it has no direction to push in; weld the body");
  c.DroppedMany("ball joint limit", shared,
                "another joint of its body turns it too; give each a body of its own");
  for (int t = 0; t < m.ntendon; ++t) {
    if (!m.tendon_limited[t]) continue;
    const Length length = TendonLength(m, c.d, t);
    const std::string name = NameOr(m, m.name_tendonadr[t], "tendon", t);
    if (length.terms.empty()) {
      c.Dropped(fmt::format("length limit of tendon '{}'", name), "it moves nothing here");
      continue;
    }
    LengthLimitDef limit;
    limit.name = name;
    c.PutLength(length, limit);
    const auto [lower, upper] = LimitedRange(m.tendon_range + 2 * t, m.tendon_margin[t]);
    limit.lower = lower - length.at_reference;
    limit.upper = upper - length.at_reference;
    c.scene.mechanisms[c.MechanismOf(length.terms[0].first)].length_limits.push_back(std::move(limit));
  }
}

void ConvertBoundedForces(Conversion& c) {
  const mjModel& m = c.m;
  ConvertFriction(c);
  if (m.opt.disableflags & mjDSBL_ACTUATION) return;
  const std::vector<LinearActuator> actuators = LinearActuators(m, c.d);
  // Of each joint with bounds on the sum, its actuators.
  std::vector<std::vector<const LinearActuator*>> on_dof(static_cast<std::size_t>(m.nv));
  std::vector<bool> shared(static_cast<std::size_t>(m.nv), false), driven = shared;
  for (const LinearActuator& a : actuators)
    for (const auto& term : a.length.terms) {
      const auto dof = static_cast<std::size_t>(term.first);
      if (a.length.is_single() && !a.muscle)
        on_dof[dof].push_back(&a);
      else
        shared[dof] = true;
      if (HasControls(c, a)) driven[dof] = true;
    }
  std::vector<std::string> replaced, tangled;
  for (const LinearActuator& a : actuators) {
    Bounds bounds = ForceRange(m, a.actuator);
    const int dof = a.length.terms[0].first, joint = m.dof_jntid[dof];
    MechanismDef& mechanism = c.scene.mechanisms[c.MechanismOf(dof)];
    const bool bound_joint = a.length.is_single() && m.jnt_actfrclimited[joint];
    if (a.muscle) {
      if (bound_joint) tangled.push_back(c.joint_names[joint]);
      continue;
    }
    const auto& together = on_dof[static_cast<std::size_t>(dof)];
    if (bound_joint && shared[static_cast<std::size_t>(dof)]) tangled.push_back(c.joint_names[joint]);
    const bool sum = bound_joint && !shared[static_cast<std::size_t>(dof)];
    if (sum && together.size() == 1) {  // the narrower of the two
      const double arm = a.length.terms[0].second;
      double low = m.jnt_actfrcrange[2 * joint] / arm, high = m.jnt_actfrcrange[2 * joint + 1] / arm;
      if (arm < 0) std::swap(low, high);
      bounds = {std::max(bounds.lower, low), std::min(bounds.upper, high)};
    } else if (sum) {
      if (bounds.Bind()) tangled.push_back(a.name);
      if (together[0] != &a) continue;
      const bool all = std::all_of(together.begin(), together.end(),
                                   [&](const LinearActuator* b) { return HasControls(c, *b); });
      if (!all) {
        if (driven[static_cast<std::size_t>(dof)]) replaced.push_back(c.DofName(dof));
        continue;
      }
      mechanism.force_limits.push_back(
          JointLimit(c, dof, together, {m.jnt_actfrcrange[2 * joint], m.jnt_actfrcrange[2 * joint + 1]}));
      continue;
    }
    if (!bounds.Bind()) continue;
    if (HasControls(c, a))
      mechanism.force_limits.push_back(LimitOf(c, a, bounds));
    else if (ForceRange(m, a.actuator).Bind())
      replaced.push_back(a.name);
  }
  BoundPdControls(c, driven);
  c.ChangedMany("force limit of actuator", replaced, "the PD control that took its place has no limit");
  c.DroppedMany("force limit of", tangled,
                "several actuators share the joint, and only the sum or each can be bound");
}

}  // namespace fork1s::internal
