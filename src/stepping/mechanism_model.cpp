// A mechanism about a reference: all that stays until the next refresh.
#include <algorithm>

#include "mechanism/limits_at_start.hpp"
#include "mechanism_detail.hpp"
#include "reduction/invariant_joints.hpp"
#include "reduction/whole_groups.hpp"

namespace fork1s {
namespace {

// Rigid groups that may touch something: one per interface body, and the base.
std::vector<ContactGroup> MakeGroups(const ReducedModel& model) {
  const Mechanism& mechanism = *model.mechanism;
  std::vector<ContactGroup> groups;
  auto add = [&](BodyIndex body) {
    const int joint = mechanism.body(body).last_joint;
    for (const ContactGroup& g : groups)
      if (g.last_joint == joint) return;
    ContactGroup group;
    group.last_joint = joint;
    group.body = body;
    for (int b = 0; b < mechanism.num_bodies(); ++b)
      if (mechanism.bodies()[static_cast<std::size_t>(b)].last_joint == joint) group.bodies.emplace_back(b);
    groups.push_back(std::move(group));
  };
  add(BodyIndex(0));
  for (BodyIndex b : model.interfaces) add(b);
  return groups;
}

// What hangs on the reference, from all that does not.
void ComputeReferenceTerms(MechanismModel& model) {
  const ReducedModel& reduced = *model.reduced;
  model.coordinate_reach.setZero(reduced.size());
  if (reduced.num_coordinates() > 0 && reduced.size() > 0)
    model.coordinate_reach = (reduced.h_inverse.cwiseSqrt().cwiseInverse().asDiagonal() * reduced.Q)
                                 .cwiseAbs()
                                 .colwise()
                                 .maxCoeff();
  FindDampers(model);
  model.whole = FindWhole(reduced);
  FindDecoupledBlocks(model);
  ComputeSpringsAtReference(model);
}

}  // namespace

MechanismModel::MechanismModel(std::shared_ptr<const ReducedModel> about, const MechanismOptions& with)
    : options(with),
      rigid_parts(*about->mechanism),
      groups(MakeGroups(*about)),
      invariant(FindInvariantJoints(*about->mechanism, about->interfaces)),
      warnings(about->warnings),
      base_size(about->mechanism->base() == BaseKind::kFloating ? 6 : 0),
      reduced(std::move(about)) {
  // The interfaces that Reduce settled on are those of every later refresh.
  options.reduction.interfaces = reduced->interfaces;
  options.reduction.promote_hidden = false;
  for (std::string& text : internal::DescribeStopsPassedAtStart(mechanism(), reduced->q_ref))
    warnings.push_back(std::move(text));
  if (options.recovery == Recovery::kExpanded) {
    const std::string what = WhatForbidsExpansion(mechanism());
    expands = what.empty() && reduced->size() > 0;
    if (!what.empty())
      warnings.push_back("mechanism '" + mechanism().name() +
                         "' is stepped by exact poses and not by expansions: " + what);
  }
  ComputeReferenceTerms(*this);
}

MechanismModel::MechanismModel(const MechanismModel& before, std::shared_ptr<const ReducedModel> about)
    : options(before.options),
      rigid_parts(before.rigid_parts),
      groups(before.groups),
      invariant(before.invariant),
      warnings(before.warnings),
      base_size(before.base_size),
      expands(before.expands),
      reduced(std::move(about)) {
  ComputeReferenceTerms(*this);
}

}  // namespace fork1s
