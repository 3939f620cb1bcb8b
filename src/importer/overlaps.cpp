// Shapes of one mechanism that overlap where it starts: which of them can part, and which never touch.
//
// A contact i of depth d_i along its normal n parts by the joint displacements Δ with r_i Δ >= d_i, where
// r_i = nᵀ (J_b - J_a) is the relative velocity along n per joint rate. Of all overlaps at once
//     min Σ_i (r_i Δ - d_i - s_i)²,  s_i >= 0,  A Δ = 0 (closures and couplings),  lower <= q + Δ <= upper,
// Δ at most a radian, as far as the rows r_i hold. A pair with a contact that keeps a residual cannot part:
// no motion of the joints removes the overlap along the normal, so that the force grows without bound.
#include <fmt/format.h>

#include <algorithm>
#include <fork1s/collision/collision_world.hpp>
#include <fork1s/mechanism/kinematics.hpp>
#include <limits>
#include <map>

#include "conversion.hpp"

namespace fork1s::internal {
namespace {

using Pair = std::pair<int, int>;

// Two bodies of the mechanism that overlap.
struct Overlap {
  Pair bodies;
  double depth = 0;  // m, of the deepest point
  bool parts = true;
};

// The mechanism where it starts. A collision body is a rigid part: the base, then one for each joint that
// moves shapes.
struct StartingPose {
  explicit StartingPose(const Mechanism& m) : mechanism(m), kinematics(m) {}
  const Mechanism& mechanism;
  Kinematics kinematics;
  VectorX q;
  std::vector<int> names;  // body of the mechanism that names a collision body
  std::vector<CollisionBodyDef> bodies;
};

void AddParts(StartingPose& start) {
  std::map<int, int> of_joint;
  for (int b = 0; b < start.mechanism.num_bodies(); ++b) {
    const int joint = start.mechanism.body(BodyIndex(b)).last_joint;
    const auto [at, is_new] = of_joint.try_emplace(joint, static_cast<int>(start.bodies.size()));
    if (is_new) {
      start.names.push_back(b);
      start.bodies.emplace_back();
    }
    for (GeometryDef g : start.mechanism.definition().bodies[b].geometries) {
      g.pairs.clear();  // explicit pairs touch whatever is excluded
      if (!g.Collides()) continue;
      g.X_BG = start.kinematics.X_RB[b] * g.X_BG;
      if (start.bodies[at->second].geometries.empty()) start.names[at->second] = b;
      start.bodies[at->second].geometries.push_back(std::move(g));
    }
  }
}

// Pairs that the file keeps from touching: across a joint or a closure, and by name.
std::vector<Pair> FilteredPairs(const Scene& scene, const StartingPose& start) {
  const Mechanism& m = start.mechanism;
  std::map<int, int> of_joint;
  for (std::size_t k = 0; k < start.names.size(); ++k)
    of_joint[m.body(BodyIndex(start.names[k])).last_joint] = static_cast<int>(k);
  const auto part = [&](BodyIndex b) { return of_joint.at(m.body(b).last_joint); };
  std::vector<Pair> filtered;
  for (const auto& [a, b] : m.FilteredContacts()) filtered.emplace_back(of_joint.at(a), of_joint.at(b));
  for (const auto& [a, b] : scene.excluded_pairs)
    if (m.FindBody(a).valid() && m.FindBody(b).valid())
      filtered.emplace_back(part(m.FindBody(a)), part(m.FindBody(b)));
  std::erase_if(filtered, [](const Pair& pair) { return pair.first == pair.second; });
  return filtered;
}

// Whether each contact can part together with all others.
std::vector<bool> CanPart(const StartingPose& start, const std::vector<ContactPoint>& contacts) {
  const Mechanism& m = start.mechanism;
  const Eigen::Index n = m.num_coordinates(), k = static_cast<Eigen::Index>(contacts.size()), all = n + k;
  const double length = m.length_scale();  // rows and depths are in this unit
  MatrixX rows = MatrixX::Zero(k, all);
  VectorX depth(k);
  for (Eigen::Index i = 0; i < k; ++i) {
    const ContactPoint& c = contacts[i];
    const Vector3 normal = c.frame.row(0).transpose();
    Vector6 wrench;  // of a unit force along the normal, about R's origin
    wrench << c.point.cross(normal), normal;
    rows.row(i).head(n) = wrench.transpose() *
                          (BodyJacobian(m, start.kinematics, BodyIndex(start.names[c.body_b])) -
                           BodyJacobian(m, start.kinematics, BodyIndex(start.names[c.body_a]))) /
                          length;
    rows(i, n + i) = -1;
    depth(i) = -c.gap / length;
  }
  constexpr double kUnbounded = std::numeric_limits<double>::max() / 4;  // the solver adds two of them
  VectorX lower(all), upper(all);
  lower.tail(k).setZero();
  upper.tail(k).setConstant(kUnbounded);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double most = m.Turns(static_cast<int>(i)) ? 1 : kUnbounded;
    lower(i) = std::clamp(m.lower()(i) - start.q(i), -most, 0.0);
    upper(i) = std::clamp(m.upper()(i) - start.q(i), 0.0, most);
  }
  MatrixX closure(m.num_constraints(), n);
  if (m.num_constraints() > 0) ClosureJacobian(m, start.kinematics, start.q, closure);
  // Weights of closures and of the displacements themselves beside that of the contacts: closures open by a
  // millionth of a depth, and a joint that moves a contact by less than 1e-4 lengths per radian does not part
  // it.
  constexpr double kRigid = 1e6, kUnique = 1e-10;
  MatrixX H = rows.transpose() * rows + kUnique * MatrixX::Identity(all, all);
  H.topLeftCorner(n, n) += kRigid * closure.transpose() * closure / (length * length);
  const VectorX g = -rows.transpose() * depth;
  VectorX x = VectorX::Zero(all), factor(all * (all + 7));
  std::vector<int> index(all);
  mju_boxQP(x.data(), factor.data(), index.data(), H.data(), g.data(), static_cast<int>(all), lower.data(),
            upper.data());
  const VectorX residual = depth - rows * x;
  constexpr double kParted = 0.01;  // of the depth, which the weights above leave where r_i is 1e-4 lengths
  std::vector<bool> parts(contacts.size());
  for (Eigen::Index i = 0; i < k; ++i) parts[i] = residual(i) < kParted * depth(i);
  return parts;
}

Expected<std::vector<Overlap>> FindOverlaps(const Scene& scene, StartingPose& start) {
  ComputeKinematics(start.mechanism, start.q, start.kinematics);
  AddParts(start);
  CollisionOptions options;
  options.margin = 0;
  auto collision = CollisionWorld::Create(start.bodies, FilteredPairs(scene, start), options);
  if (!collision) return tl::unexpected<Error>(collision.error());
  std::vector<ContactPoint> contacts;
  collision->Detect(contacts);
  const double rounding = 1e-9 * start.mechanism.length_scale();  // m: surfaces that are flush do not overlap
  std::erase_if(contacts, [&](const ContactPoint& c) { return -c.gap <= rounding; });
  if (contacts.empty()) return {};
  const std::vector<bool> parts = CanPart(start, contacts);
  std::map<Pair, Overlap> overlaps;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    Overlap& overlap = overlaps[std::minmax(contacts[i].body_a, contacts[i].body_b)];
    overlap.depth = std::max(overlap.depth, -contacts[i].gap);
    overlap.parts = overlap.parts && parts[i];
  }
  std::vector<Overlap> found;
  for (auto& [pair, overlap] : overlaps) {
    overlap.bodies = {start.names[pair.first], start.names[pair.second]};
    found.push_back(overlap);
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const Overlap& a, const Overlap& b) { return a.depth > b.depth; });
  return found;
}

void NoteOverlaps(Conversion& c, const std::vector<std::string>& pairs, const std::string& message) {
  constexpr std::size_t kNamed = 8;
  if (pairs.empty()) return;
  std::string names = pairs[0];
  for (std::size_t i = 1; i < std::min(kNamed, pairs.size()); ++i) names += ", " + pairs[i];
  if (pairs.size() > kNamed) names += fmt::format(" and {} more", pairs.size() - kNamed);
  c.Note(ImportNote::Kind::kChanged,
         fmt::format("{} pair{} of bodies", pairs.size(), pairs.size() == 1 ? "" : "s"),
         fmt::format("{}: {}", names, message));
}

}  // namespace

std::optional<Error> ExcludeOverlaps(Conversion& c) {
  std::vector<std::string> excluded, kept;  // "'a' and 'b' by 2 mm"
  for (std::size_t i = 0; i < c.scene.mechanisms.size(); ++i) {
    const auto mechanism = BuildMechanism(c.scene.mechanisms[i]);
    if (!mechanism) continue;  // refused with its cause where it is simulated
    StartingPose start(*mechanism);
    start.q = c.initial_keyframe >= 0 ? c.scene.keyframes[c.initial_keyframe].mechanisms[i].q
                                      : VectorX::Zero(mechanism->num_coordinates());
    CloseLoops(*mechanism, start.q);
    const auto overlaps = FindOverlaps(c.scene, start);
    if (!overlaps) return overlaps.error();
    for (const Overlap& overlap : *overlaps) {
      const std::string &a = mechanism->body(BodyIndex(overlap.bodies.first)).name,
                        &b = mechanism->body(BodyIndex(overlap.bodies.second)).name;
      const std::string text = fmt::format("'{}' and '{}' by {:.3g} mm", a, b, 1e3 * overlap.depth);
      if (!overlap.parts) {
        excluded.push_back(text);
        c.scene.excluded_pairs.emplace_back(a, b);
      } else if (Touches(*mechanism, overlap.bodies.first) && Touches(*mechanism, overlap.bodies.second)) {
        kept.push_back(text);
      }
    }
  }
  NoteOverlaps(
      c, excluded,
      "overlap where the file starts, and no motion of the joints parts them along the contact normal: "
      "they never touch, as by <exclude>");
  NoteOverlaps(c, kept,
               "overlap where the file starts and are pushed apart; start them apart or <exclude> them");
  return std::nullopt;
}

}  // namespace fork1s::internal
