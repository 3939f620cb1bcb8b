#include "frozen_shares.hpp"

#include <cmath>

namespace fork1s::internal {
namespace {

// Cones a little narrower than those of friction: what ends at their edge is still within friction.
constexpr double kWithin = 0.99;

// To the nearest point of the cone |t| <= µ n. The rows hold minus the force.
void ProjectToCone(const FrozenContactRows& c, VectorX& x) {
  const double normal = -x(c.first);
  if (c.frictionless) {
    x(c.first) = -std::max(0.0, normal);
    return;
  }
  auto tangential = x.segment<2>(c.first + 1);
  const double t = tangential.norm(), mu = kWithin * c.friction;
  if (t <= mu * normal) return;
  if (mu * t <= -normal) {  // in the polar cone
    x.segment<3>(c.first).setZero();
    return;
  }
  const double onto = (normal + mu * t) / (1 + mu * mu);
  x(c.first) = -onto;
  tangential *= mu * onto / t;
}

bool Within(const std::vector<FrozenContactRows>& contacts, const VectorX& x) {
  for (const FrozenContactRows& c : contacts) {
    const double normal = -x(c.first);
    if (normal < 0) return false;
    if (!c.frictionless && x.segment<2>(c.first + 1).norm() > c.friction * normal) return false;
  }
  return true;
}

}  // namespace

// Projections onto the balance and onto the cones by turns, with Dykstra's correction on the cones so that
// the nearest common point is found and not just any. The balance is affine, x -> c + N x; its columns are
// found once, by asking.
VectorX ShareWithinFriction(const VectorX& balanced, const std::vector<FrozenContactRows>& contacts,
                            const std::function<VectorX(const VectorX&)>& balance) {
  if (contacts.empty() || Within(contacts, balanced)) return balanced;
  const Eigen::Index m = balanced.size();
  const VectorX c = balance(VectorX::Zero(m));
  MatrixX N = MatrixX::Zero(m, m);
  for (const FrozenContactRows& contact : contacts)
    for (Eigen::Index i = contact.first; i < contact.first + (contact.frictionless ? 1 : 3); ++i)
      N.col(i) = balance(VectorX::Unit(m, i)) - c;
  // Multipliers of other closures, of which the cones know nothing, stay.
  const VectorX rest = balanced - c - N * balanced;
  VectorX x = balanced, correction = VectorX::Zero(m);
  constexpr int kMost = 300;
  for (int i = 0; i < kMost && !Within(contacts, x); ++i) {
    const VectorX before = x + correction;
    VectorX inside = before;
    for (const FrozenContactRows& contact : contacts) ProjectToCone(contact, inside);
    correction = before - inside;
    x = c + rest + N * inside;
  }
  return x;
}

}  // namespace fork1s::internal
