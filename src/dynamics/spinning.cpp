#include "spinning.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace fork1s::internal {
namespace {

// How much the inertia of what turns changes when it has turned, seen from the point of the axis that is
// beside its centre: the same wherever the mechanism stands. A third of a turn tells: what is the same after
// it is the same after any.
double Unevenness(const SpatialInertia& I, const Vector6& screw) {
  const Vector3 w = screw.head<3>(), v = screw.tail<3>(), axis = w.normalized();
  if (std::abs(w.dot(v)) > 1e-9 * w.squaredNorm())
    return std::numeric_limits<double>::infinity();  // a thread
  Vector3 beside = w.cross(v) / w.squaredNorm();
  beside += axis * axis.dot(I.center - beside);
  const SpatialInertia here = Transform(RigidTransform(Vector3(-beside)), I);
  const RigidTransform turn(ExpRotation(Vector3(axis * (2 * M_PI / 3))), Vector3::Zero());
  const Matrix6 change = Transform(turn, here).Matrix() - here.Matrix();
  const double size = here.rotational.norm() + here.mass * here.center.squaredNorm();
  return std::max(change.topLeftCorner<3, 3>().norm() / size,
                  change.topRightCorner<3, 3>().norm() / std::sqrt(size * here.mass));
}

}  // namespace

std::vector<char> FindSpinning(const Mechanism& m, const RigidParts& parts,
                               const std::vector<BodyIndex>& interfaces) {
  // Meshes are even to some thousandths. Inertia of a step is that of its pose; what would be off is how
  // modes were told from each other.
  constexpr double kEven = 0.01;
  std::vector<char> spins(static_cast<std::size_t>(m.num_coordinates()), 0);
  for (int j = 0; j < m.num_joints(); ++j) {
    const Mechanism::Joint& joint = m.joints()[static_cast<std::size_t>(j)];
    const int i = joint.offset;
    if (joint.size != 1 || !m.Turns(i)) continue;
    const auto ends_here = [&](BodyIndex b) { return m.body(b).last_joint == j; };
    const auto has = [&](const std::vector<int>& coordinates) {
      return std::find(coordinates.begin(), coordinates.end(), i) != coordinates.end();
    };
    const bool alone =
        std::none_of(m.joints().begin(), m.joints().end(),
                     [&](const Mechanism::Joint& other) { return other.previous == j; }) &&
        std::none_of(m.closures().begin(), m.closures().end(),
                     [&](const ClosureDef& c) { return ends_here(c.body_a) || ends_here(c.body_b); }) &&
        std::none_of(m.couplings().begin(), m.couplings().end(),
                     [&](const Mechanism::Coupling& c) { return c.a == i || c.b == i; }) &&
        std::none_of(m.paths().begin(), m.paths().end(),
                     [&](const Mechanism::Path& p) { return has(p.coordinates); }) &&
        std::all_of(m.springs().begin(), m.springs().end(), [&](const Mechanism::Spring& s) {
          return s.is_linear() || std::none_of(s.length.terms.begin(), s.length.terms.end(),
                                               [&](const auto& term) { return term.first == i; });
        });
    const bool touches = std::any_of(interfaces.begin(), interfaces.end(), ends_here);
    const SpatialInertia& I = parts.parts[static_cast<std::size_t>(j) + 1].inertia_R0;
    spins[static_cast<std::size_t>(i)] =
        alone && touches && I.mass > 0 && Unevenness(I, m.screws().col(i)) < kEven;
  }
  return spins;
}

}  // namespace fork1s::internal
