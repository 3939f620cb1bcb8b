// Tendons through space, slider-cranks and forces that turn with a body: length and arms at a pose.
//
// A straight part from point p on body P to point r on body B, u the unit vector from p to r, grows at the
// rate
//     u · (v_r - v_p) = [p x u; u]ᵀ (V_B - V_P)
// and a coordinate on the way to one of the bodies but not to the other brings its screw times that. Where a
// thread lies on an obstacle its length is stationary under shifts of the two points of touch (wrap.hpp), so
// these count as fixed to the obstacle's body.
#include "paths.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fork1s/mechanism/kinematics.hpp>

#include "wrap.hpp"

namespace fork1s {
namespace internal {
namespace {

using Kind = PathElementDef::Kind;

bool IsObstacle(const PathElementDef& e) { return e.kind == Kind::kSphere || e.kind == Kind::kCylinder; }

// Two ends of one length have no direction between them.
constexpr double kNoLength = 1e-15;  // m

// What moving body b adds to the length, F the wrench of its unit pull about R's origin.
void Pull(const Mechanism& mechanism, const Mechanism::Path& path, const Kinematics& kinematics, BodyIndex b,
          const Vector6& F, PathState& out) {
  for (int j = mechanism.body(b).last_joint; j >= 0;) {
    const Mechanism::Joint& joint = mechanism.joint(JointIndex(j));
    for (int i = joint.offset; i < joint.offset + joint.size; ++i)
      if (const int slot = path.slot[static_cast<std::size_t>(i)]; slot >= 0)
        out.arms[static_cast<std::size_t>(slot)].second += kinematics.S.col(i).dot(F);
    j = joint.previous;
  }
}

Vector6 WrenchAt(const Vector3& p_R, const Vector3& moment, const Vector3& force) {
  Vector6 F;
  F << p_R.cross(force) + moment, force;
  return F;
}

// With v from the slider's origin to the crank's pin, a the slider's axis and r the rod:
//     ℓ = a·v - s,   s = sqrt((a·v)² + r² - v·v),   ∂ℓ/∂v = (1 - a·v/s) a + v/s,   ∂ℓ/∂a = (1 - a·v/s) v
// and where the rod is too short to reach the axis ℓ = a·v, as MuJoCo has it.
void ComputeSliderCrank(const Mechanism& mechanism, const Mechanism::Path& path, const Kinematics& kinematics,
                        PathState& out) {
  const PathElementDef &slider = path.elements[0], &crank = path.elements[1];
  const RigidTransform X_RS = kinematics.X_RB[slider.body.u()] * slider.X_BE;
  const Vector3 pin = kinematics.X_RB[crank.body.u()] * crank.X_BE.translation();
  const Vector3 a = X_RS.rotation().col(2), v = pin - X_RS.translation();
  const double av = a.dot(v), square = av * av + path.rod * path.rod - v.squaredNorm();
  const double s = square > 0 ? std::sqrt(square) : 0;
  out.length = av - s;
  const double along = s > 0 ? 1 - av / s : 1;
  const Vector3 by_v = s > 0 ? Vector3(along * a + v / s) : a, by_a = along * v;
  Pull(mechanism, path, kinematics, crank.body, WrenchAt(pin, Vector3::Zero(), by_v), out);
  Pull(mechanism, path, kinematics, slider.body, WrenchAt(X_RS.translation(), a.cross(by_a), -by_v), out);
}

void ComputeWrench(const Mechanism& mechanism, const Mechanism::Path& path, const Kinematics& kinematics,
                   PathState& out) {
  const PathElementDef &on = path.elements.front(), &from = path.elements.back();
  const RigidTransform X_RO = kinematics.X_RB[on.body.u()] * on.X_BE,
                       X_RF = kinematics.X_RB[from.body.u()] * from.X_BE;
  const Vector3 moment = X_RF.rotation() * path.gear.head<3>(), force = X_RF.rotation() * path.gear.tail<3>();
  Pull(mechanism, path, kinematics, on.body, WrenchAt(X_RO.translation(), moment, force), out);
  if (path.elements.size() == 1) return;
  Pull(mechanism, path, kinematics, from.body, -WrenchAt(X_RF.translation(), moment, force), out);
  const RigidTransform X_FO = X_RF.inverse() * X_RO;
  out.length = path.gear.tail<3>().dot(X_FO.translation());
  if (!path.gear.head<3>().isZero(0)) out.length += path.gear.head<3>().dot(LogRotation(X_FO.rotation()));
}

// Its rate is n · (ω_O - ω_F) with the axis n of the turn. At no turn there is no axis, and no arm: it is the least.
void ComputeAngle(const Mechanism& mechanism, const Mechanism::Path& path, const Kinematics& kinematics,
                  PathState& out) {
  constexpr double kNoAngle = 1e-9;  // rad: rounding of the rotation is 1e-7 of it
  const PathElementDef &on = path.elements[0], &from = path.elements[1];
  const Matrix3 R_RF = (kinematics.X_RB[from.body.u()] * from.X_BE).rotation();
  const Vector3 turn = LogRotation(R_RF.transpose() * (kinematics.X_RB[on.body.u()] * on.X_BE).rotation());
  out.length = turn.norm();
  if (out.length < kNoAngle) return;
  Vector6 F;
  F << R_RF * turn / out.length, Vector3::Zero();
  Pull(mechanism, path, kinematics, on.body, F, out);
  Pull(mechanism, path, kinematics, from.body, -F, out);
}

// straight(part), along(length on an obstacle): of the whole tendon, in order.
template <class Straight, class Along>
void ForEachPart(const Mechanism::Path& path, const Kinematics& kinematics, const Straight& straight,
                 const Along& along) {
  const auto place = [&](BodyIndex b, const Vector3& p_B) -> Vector3 { return kinematics.X_RB[b.u()] * p_B; };
  double divisor = 1;
  for (std::size_t e = 0; e + 1 < path.elements.size(); ++e) {
    const PathElementDef& element = path.elements[e];
    if (element.kind == Kind::kPulley) divisor = element.divisor;
    if (element.kind != Kind::kPoint || path.elements[e + 1].kind == Kind::kPulley) continue;
    const Vector3 a = place(element.body, element.X_BE.translation());
    const PathElementDef& next = path.elements[e + 1];
    if (!IsObstacle(next)) {
      straight({element.body, next.body, a, place(next.body, next.X_BE.translation()), divisor});
      continue;
    }
    const PathElementDef& end = path.elements[e + 2];
    const Vector3 b = place(end.body, end.X_BE.translation());
    const RigidTransform X_RE = kinematics.X_RB[next.body.u()] * next.X_BE, X_ER = X_RE.inverse();
    const Vector3 side =
        next.has_side ? Vector3(X_ER * place(next.side_body, next.side_B)) : Vector3(Vector3::Zero());
    const auto wrap = next.kind == Kind::kSphere ? WrapSphere : WrapCylinder;
    const Wrap way = wrap(X_ER * a, X_ER * b, next.radius, next.has_side ? &side : nullptr);
    if (!way.touches) {
      straight({element.body, end.body, a, b, divisor});
      continue;
    }
    straight({element.body, next.body, a, X_RE * way.first, divisor});
    along(way.along / divisor);
    straight({next.body, end.body, X_RE * way.last, b, divisor});
  }
}

void ComputeTendon(const Mechanism& mechanism, const Mechanism::Path& path, const Kinematics& kinematics,
                   PathState& out) {
  const auto straight = [&](const StraightPart& part) {
    const Vector3 way = part.to_R - part.from_R;
    const double length = way.norm();
    out.length += length / part.divisor;
    if (part.from_body == part.to_body || length < kNoLength) return;
    const Vector3 u = way / (length * part.divisor);
    Vector6 F;
    F << part.to_R.cross(u), u;
    Pull(mechanism, path, kinematics, part.to_body, F, out);
    F.head<3>() = part.from_R.cross(u);
    Pull(mechanism, path, kinematics, part.from_body, -F, out);
  };
  ForEachPart(path, kinematics, straight, [&](double along) { out.length += along; });
}

// Arms of Σ c ω along the axes of rotations: rows of E.
void ComputeRates(const Mechanism& mechanism, const Mechanism::Path& path, const Kinematics& kinematics,
                  const VectorX& q, PathState& out) {
  for (const auto& [i, c] : path.rates) out.length += c * q(i);
  for (const Mechanism::Rotation& rotation : mechanism.rotations()) {
    const auto& at = rotation.coordinates;
    Vector3 weights = Vector3::Zero();
    for (const auto& [i, c] : path.rates)
      for (int k = 0; k < 3; ++k)
        if (at[static_cast<std::size_t>(k)] == i) weights(k) += c;
    if (weights.isZero(0)) continue;
    const Vector3 arms = AngularVelocityMap(mechanism, kinematics, rotation).transpose() * weights;
    for (int k = 0; k < 3; ++k) {
      const int coordinate = at[static_cast<std::size_t>(k)];
      out.arms[static_cast<std::size_t>(path.slot[static_cast<std::size_t>(coordinate)])].second += arms(k);
    }
  }
}

// Of paths that are no threads: elements are frames.
template <class Known, class Refuse>
Expected<void> CheckFrames(const MechanismDef& def, const PathDef& path, const Known& known,
                           const Refuse& refuse) {
  const bool crank = path.kind == PathKind::kSliderCrank, angle = path.kind == PathKind::kAngle;
  const std::size_t count = path.elements.size();
  if (count != 2 && (crank || angle || count != 1))
    return refuse(count,
                  crank   ? "is not the second of two: a slider-crank has a slider and a pin"
                  : angle ? "is not the second of two: an angle is between two frames"
                          : "is not the first or second: a wrench has a frame, and one it may be given in");
  if (count == 1 && def.base == BaseKind::kFloating)
    return refuse(
        0,
        "is pushed by nothing else, and the base floats, which a length of joints cannot push; use an "
        "external wrench, or give the force in a second frame");
  for (std::size_t i = 0; i < count; ++i) {
    if (!known(path.elements[i].body)) return refuse(i, "is on a body that does not exist");
    if (!path.elements[i].X_BE.IsFinite()) return refuse(i, "has a place that is not finite");
  }
  if (crank && (!std::isfinite(path.rod) || path.rod < 0))
    return refuse(1,
                  fmt::format("is at the end of a rod of {} m; it must be finite and 0 or more", path.rod));
  if (!path.gear.allFinite()) return refuse(0, "bears a gear that is not finite");
  return {};
}

// Whether body b moves with the joint of a coordinate.
bool HangsOn(const Mechanism& mechanism, BodyIndex b, int coordinate) {
  const int joint = mechanism.CoordinateJoint(coordinate).value();
  int j = mechanism.body(b).last_joint;
  while (j >= 0 && j != joint) j = mechanism.joint(JointIndex(j)).previous;
  return j >= 0;
}

}  // namespace

void ComputePath(const Mechanism& mechanism, const Mechanism::Path& path, const Kinematics& kinematics,
                 const VectorX& q, PathState& out) {
  out.length = 0;
  for (auto& arm : out.arms) arm.second = 0;
  if (!path.rates.empty()) return ComputeRates(mechanism, path, kinematics, q, out);
  switch (path.kind) {
    case PathKind::kTendon:
      return ComputeTendon(mechanism, path, kinematics, out);
    case PathKind::kSliderCrank:
      return ComputeSliderCrank(mechanism, path, kinematics, out);
    case PathKind::kWrench:
      return ComputeWrench(mechanism, path, kinematics, out);
    case PathKind::kAngle:
      return ComputeAngle(mechanism, path, kinematics, out);
  }
}

void FindStraightParts(const Mechanism::Path& path, const Kinematics& kinematics,
                       std::vector<StraightPart>& out) {
  out.clear();
  if (!path.rates.empty() || path.kind != PathKind::kTendon) return;
  ForEachPart(
      path, kinematics, [&](const StraightPart& part) { out.push_back(part); }, [](double) {});
}

void FindCoordinates(const Mechanism& mechanism, int index, Mechanism::Path& path) {
  path.slot.assign(static_cast<std::size_t>(mechanism.num_coordinates()), -1);
  for (const JointIndex j : mechanism.definition().JointsOfPath(index))
    for (int i = 0; i < mechanism.joint(j).size; ++i) {
      const int coordinate = mechanism.joint(j).offset + i;
      path.slot[static_cast<std::size_t>(coordinate)] = static_cast<int>(path.coordinates.size());
      path.coordinates.push_back(coordinate);
    }
  if (path.kind != PathKind::kWrench) return;
  // The pull back goes through the origin of the frame that the force is given in, and moments are no
  // derivative of a rotation vector. Both agree where that frame stands and there is a force alone.
  path.has_potential = path.elements.size() == 2 && path.gear.head<3>().isZero(0) &&
                       std::none_of(path.coordinates.begin(), path.coordinates.end(),
                                    [&](int i) { return HangsOn(mechanism, path.elements[1].body, i); });
}

// The moment of a constant torque in axes that move is no derivative of a rotation vector.
void FindRateCoordinates(const Mechanism& mechanism, Mechanism::Path& path) {
  path.kind = PathKind::kWrench;
  path.rod = 0;
  path.gear.setZero();
  path.has_potential = false;
  path.slot.assign(static_cast<std::size_t>(mechanism.num_coordinates()), -1);
  for (const Mechanism::Rotation& rotation : mechanism.rotations()) {
    const auto& at = rotation.coordinates;
    if (std::none_of(path.rates.begin(), path.rates.end(), [&](const auto& rate) {
          return std::find(at.begin(), at.end(), rate.first) != at.end();
        }))
      continue;
    path.coordinates.insert(path.coordinates.end(), at.begin(), at.end());
  }
  std::sort(path.coordinates.begin(), path.coordinates.end());
  for (std::size_t i = 0; i < path.coordinates.size(); ++i)
    path.slot[static_cast<std::size_t>(path.coordinates[i])] = static_cast<int>(i);
}

Expected<void> CheckPath(const MechanismDef& def, const PathDef& path) {
  const auto refuse = [&](std::size_t at, const std::string& what) -> Expected<void> {
    return Fail(ErrorCode::kModel, fmt::format("path '{}', element {}", path.name, at + 1), what);
  };
  const auto known = [&](BodyIndex b) { return b.valid() && b.u() < def.bodies.size(); };
  if (path.kind != PathKind::kTendon) return CheckFrames(def, path, known, refuse);
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
