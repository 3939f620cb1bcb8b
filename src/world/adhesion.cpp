#include "adhesion.hpp"

#include <algorithm>
#include <limits>

namespace fork1s {
namespace {

// Gaps below this share of the smaller shape are rounding of its place.
constexpr double kGapRounding = 1e-9;

// The collision body that has the shapes of a body of mechanism `i`, and which of its shapes these are.
bool FindShapes(const MechanismDynamics& m, std::size_t i, BodyIndex body, const Detection& detection,
                Adhesion& adhesion) {
  // CollisionBody 0 is the still world.
  for (std::size_t c = 1; c < detection.collision_bodies.size(); ++c) {
    const CollisionBody& collision_body = detection.collision_bodies[c];
    if (collision_body.kind == CollisionBody::Kind::kFreeBody || collision_body.index != static_cast<int>(i))
      continue;
    adhesion.is_of_body.clear();
    for (const BodyIndex b : m.groups()[static_cast<std::size_t>(collision_body.group)].bodies)
      for (const GeometryDef& g : m.mechanism().definition().bodies[b.u()].geometries)
        if (g.Collides()) adhesion.is_of_body.push_back(b == body);
    adhesion.collision_body = static_cast<int>(c);
    if (std::count(adhesion.is_of_body.begin(), adhesion.is_of_body.end(), 1) > 0) return true;
  }
  return false;
}

bool IsOf(const Adhesion& adhesion, const ContactPoint& p) {
  const auto is_of = [&](int body, int geometry) {
    return body == adhesion.collision_body && adhesion.is_of_body[static_cast<std::size_t>(geometry)] != 0;
  };
  return is_of(p.body_a, p.geometry_a) || is_of(p.body_b, p.geometry_b);
}

double ForceOf(const Adhesion& adhesion, const Bodies& bodies) {
  const double u = bodies.mechanisms[adhesion.mechanism].ActivationOf(adhesion.control);
  return std::clamp(adhesion.gain * u, adhesion.lower, adhesion.upper);
}

}  // namespace

Expected<std::vector<Adhesion>> FindAdhesions(const Bodies& bodies,
                                              const std::vector<ContactPairDef>& contact_pairs,
                                              Detection& detection) {
  std::vector<Adhesion> found;
  for (std::size_t i = 0; i < bodies.mechanisms.size(); ++i) {
    const MechanismDynamics& m = bodies.mechanisms[i];
    const MechanismDef& of = m.mechanism().definition();
    for (const AdhesionDef& def : of.adhesions) {
      Adhesion& adhesion = found.emplace_back();
      adhesion.mechanism = i;
      adhesion.gain = def.gain;
      adhesion.lower = def.lower;
      adhesion.upper = def.upper;
      for (std::size_t k = 0; k < of.controls.size(); ++k)
        if (of.controls[k].name == def.control) adhesion.control = static_cast<Eigen::Index>(k);
      if (!FindShapes(m, i, of.FindBody(def.body), detection, adhesion))
        return Fail(ErrorCode::kModel, "adhesion '" + def.name + "' of mechanism '" + of.name + "'",
                    "nothing can touch its body '" + def.body +
                        "'; give it a shape that collides and name it as an interface");
    }
  }
  double largest = 0;
  bool of_shapes = false;
  for (const auto& geometries : detection.shapes.geometries)
    for (const GeometryDef& g : geometries) {
      largest = std::max(largest, g.gap);
      of_shapes = of_shapes || g.adhesion > 0;
    }
  double reach = 2 * largest;
  for (const ContactPairDef& pair : contact_pairs) {
    reach = std::max(reach, pair.gap);
    of_shapes = of_shapes || pair.adhesion > 0;
  }
  detection.adhesion_reach = found.empty() && !of_shapes ? 0 : reach;
  detection.shapes_adhere = of_shapes;
  return found;
}

// What bears load keeps its pull although the linearized gap of a curved surface may be off by the square of the way.
// Gaps below material.depth, by which contacts give way, are not told from contact.
void AssemblePulls(const std::vector<Adhesion>& adhesions, const Bodies& bodies, const Detection& detection,
                   const ContactHistory& history, double h, double depth, ConstraintRows& rows) {
  rows.pulls.clear();
  if (adhesions.empty() && !detection.shapes_adhere) return;
  rows.pulls.resize(detection.points.size(), 0.0);
  const auto is_in_reach = [&](std::size_t i) {
    const ContactPoint& p = detection.points[i];
    if (p.gap <= p.adhesion_gap + std::max(depth, kGapRounding * detection.shapes.PairSize(p))) return true;
    const ContactRecord* before = history.Before(i);
    return before != nullptr && before->impulse(0) > 0;
  };
  for (std::size_t i = 0; i < detection.points.size(); ++i)
    if (detection.points[i].adhesion > 0 && is_in_reach(i)) rows.pulls[i] = h * detection.points[i].adhesion;
  for (const Adhesion& adhesion : adhesions) {
    const double force = ForceOf(adhesion, bodies);
    if (force == 0) continue;
    std::size_t count = 0;
    for (std::size_t i = 0; i < detection.points.size(); ++i)
      count += IsOf(adhesion, detection.points[i]) && is_in_reach(i) ? 1 : 0;
    for (std::size_t i = 0; count > 0 && i < detection.points.size(); ++i)
      if (IsOf(adhesion, detection.points[i]) && is_in_reach(i))
        rows.pulls[i] += h * force / static_cast<double>(count);
  }
}

void ApplyPulls(ConstraintRows& rows) {
  bool any = false;
  for (std::size_t i = 0; i < rows.pulls.size(); ++i) {
    if (rows.pulls[i] == 0) continue;
    if (!any) rows.pull_impulse.setZero(rows.velocities.size());
    any = true;
    const ContactConstraint& c = rows.contacts[i];
    if (c.port_a >= 0) rows.pull_impulse.segment<6>(c.port_a) -= rows.pulls[i] * c.J_a.row(0).transpose();
    if (c.port_b >= 0) rows.pull_impulse.segment<6>(c.port_b) -= rows.pulls[i] * c.J_b.row(0).transpose();
  }
  if (!any) return;
  for (const VelocityBlock& block : rows.blocks) {
    const Eigen::Map<const MatrixX, 0, Eigen::OuterStride<>> Y(block.Y, block.freedoms, block.size,
                                                               Eigen::OuterStride<>(block.stride));
    const auto impulse = rows.pull_impulse.segment(block.offset, block.size);
    if (impulse.isZero(0)) continue;
    rows.pull_scratch.noalias() = Y * impulse;
    rows.velocities.segment(block.offset, block.size).noalias() += Y.transpose() * rows.pull_scratch;
  }
}

}  // namespace fork1s
