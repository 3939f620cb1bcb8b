// Tendons through space: their length and its gradient at a pose.
//
// A straight part from point p on body P to point r on body B, u the unit vector from p to r, grows at the
// rate
//     u · (v_r - v_p) = [p x u; u]ᵀ (V_B - V_P)
// and a coordinate on the way to one of the bodies but not to the other brings its screw times that. Where a
// thread lies on an obstacle its length is stationary under shifts of the two points of touch (wrap.hpp), so
// these count as fixed to the obstacle's body.
#include "paths.hpp"

#include <fmt/format.h>

#include <cmath>
#include <fork1s/mechanism/kinematics.hpp>

#include "wrap.hpp"

namespace fork1s {
namespace internal {
namespace {

using Kind = PathElementDef::Kind;

bool IsObstacle(const PathElementDef& e) { return e.kind == Kind::kSphere || e.kind == Kind::kCylinder; }

struct PathPoint {
  int body;
  Vector3 p_R;
};

// Two ends of one length have no direction between them.
constexpr double kNoLength = 1e-15;  // m

}  // namespace

void ComputePath(const Mechanism& mechanism, const Mechanism::Path& path, const Kinematics& kinematics,
                 PathState& out) {
  out.length = 0;
  for (auto& arm : out.arms) arm.second = 0;
  const auto place = [&](BodyIndex b, const Vector3& p_B) -> Vector3 { return kinematics.X_RB[b.u()] * p_B; };
  // What moving body b with the end of a straight part adds, F the wrench of its unit pull about R's origin.
  const auto pull = [&](int b, const Vector6& F) {
    for (int j = mechanism.bodies()[static_cast<std::size_t>(b)].last_joint; j >= 0;) {
      const Mechanism::Joint& joint = mechanism.joint(JointIndex(j));
      for (int i = joint.offset; i < joint.offset + joint.size; ++i)
        if (const int slot = path.slot[static_cast<std::size_t>(i)]; slot >= 0)
          out.arms[static_cast<std::size_t>(slot)].second += kinematics.S.col(i).dot(F);
      j = joint.previous;
    }
  };
  double divisor = 1;
  const auto straight = [&](const PathPoint& from, const PathPoint& to) {
    const Vector3 way = to.p_R - from.p_R;
    const double length = way.norm();
    out.length += length / divisor;
    if (from.body == to.body || length < kNoLength) return;
    const Vector3 u = way / (length * divisor);
    Vector6 F;
    F << to.p_R.cross(u), u;
    pull(to.body, F);
    F.head<3>() = from.p_R.cross(u);
    pull(from.body, -F);
  };
  for (std::size_t e = 0; e + 1 < path.elements.size(); ++e) {
    const PathElementDef& element = path.elements[e];
    if (element.kind == Kind::kPulley) divisor = element.divisor;
    if (element.kind != Kind::kPoint || path.elements[e + 1].kind == Kind::kPulley) continue;
    const PathPoint a{element.body.value(), place(element.body, element.X_BE.translation())};
    const PathElementDef& next = path.elements[e + 1];
    if (!IsObstacle(next)) {
      straight(a, {next.body.value(), place(next.body, next.X_BE.translation())});
      continue;
    }
    const PathElementDef& end = path.elements[e + 2];
    const PathPoint b{end.body.value(), place(end.body, end.X_BE.translation())};
    const RigidTransform X_RE = kinematics.X_RB[next.body.u()] * next.X_BE, X_ER = X_RE.inverse();
    const Vector3 side =
        next.has_side ? Vector3(X_ER * place(next.side_body, next.side_B)) : Vector3(Vector3::Zero());
    const auto wrap = next.kind == Kind::kSphere ? WrapSphere : WrapCylinder;
    const Wrap way = wrap(X_ER * a.p_R, X_ER * b.p_R, next.radius, next.has_side ? &side : nullptr);
    if (!way.touches) {
      straight(a, b);
      continue;
    }
    straight(a, {next.body.value(), X_RE * way.first});
    out.length += way.along / divisor;
    straight({next.body.value(), X_RE * way.last}, b);
  }
}

void FindCoordinates(const Mechanism& mechanism, int index, Mechanism::Path& path) {
  path.slot.assign(static_cast<std::size_t>(mechanism.num_coordinates()), -1);
  for (const JointIndex j : mechanism.definition().JointsOfPath(index))
    for (int i = 0; i < mechanism.joint(j).size; ++i) {
      const int coordinate = mechanism.joint(j).offset + i;
      path.slot[static_cast<std::size_t>(coordinate)] = static_cast<int>(path.coordinates.size());
      path.coordinates.push_back(coordinate);
    }
}

Expected<void> CheckPath(const MechanismDef& def, const PathDef& path) {
  const auto refuse = [&](std::size_t at, const std::string& what) -> Expected<void> {
    return Fail(ErrorCode::kModel, fmt::format("path '{}', element {}", path.name, at + 1), what);
  };
  const auto known = [&](BodyIndex b) { return b.valid() && b.u() < def.bodies.size(); };
  const auto kind = [&](std::size_t i) {
    return i < path.elements.size() ? path.elements[i].kind : Kind::kPulley;
  };
  for (std::size_t i = 0; i < path.elements.size(); ++i) {
    const PathElementDef& e = path.elements[i];
    if (e.kind == Kind::kPulley) {
      if (!std::isfinite(e.divisor) || !(e.divisor > 0))
        return refuse(i, fmt::format("divides by {}; a pulley needs a number above 0", e.divisor));
      continue;
    }
    if (!known(e.body)) return refuse(i, "is on a body that does not exist");
    if (!e.X_BE.IsFinite()) return refuse(i, "has a place that is not finite");
    if (e.kind == Kind::kPoint) {
      const bool alone = kind(i + 1) == Kind::kPulley && (i == 0 || kind(i - 1) == Kind::kPulley);
      if (alone) return refuse(i, "is the only point of its branch; a branch needs two");
      continue;
    }
    if (i == 0 || kind(i - 1) != Kind::kPoint || kind(i + 1) != Kind::kPoint)
      return refuse(i, "is an obstacle that does not stand between two points");
    if (!std::isfinite(e.radius) || e.radius < 0)
      return refuse(i, fmt::format("has the radius {}; it must be finite and 0 or more", e.radius));
    if (e.has_side && (!known(e.side_body) || !e.side_B.allFinite()))
      return refuse(i, "has a side point that is not finite, or on a body that does not exist");
  }
  return {};
}

}  // namespace internal

std::vector<int> Mechanism::CoordinatesOf(const Length& length) const {
  std::vector<int> coordinates;
  for (const auto& term : length.terms) coordinates.push_back(term.first);
  if (length.path >= 0) {
    const Path& path = paths_[static_cast<std::size_t>(length.path)];
    coordinates.insert(coordinates.end(), path.coordinates.begin(), path.coordinates.end());
  }
  return coordinates;
}

double LengthOf(const Mechanism& mechanism, const Mechanism::Length& length, const Kinematics& kinematics,
                const VectorX& q) {
  double value = 0;
  for (const auto& [i, c] : length.terms) value += c * q(i);
  if (length.path >= 0) {
    const auto at = static_cast<std::size_t>(length.path);
    value += length.gear * (kinematics.paths[at].length - mechanism.paths()[at].at_reference);
  }
  return value;
}

}  // namespace fork1s
