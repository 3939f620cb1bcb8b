#include "wrap.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace fork1s::internal {
namespace {

constexpr double kNothing = 1e-15;  // m, m²: what MuJoCo takes for no distance
constexpr double kTurn = 2 * std::numbers::pi;

struct FlatWrap {
  bool touches = false;
  Vector2 first, last;
  double along = 0;
};

double Cross(const Vector2& a, const Vector2& b) { return a.x() * b.y() - a.y() * b.x(); }

// Whether the segments a-b and c-d meet.
bool Intersect(const Vector2& a, const Vector2& b, const Vector2& c, const Vector2& d) {
  const Vector2 u = b - a, v = d - c, w = c - a;
  const double det = Cross(u, v);
  if (std::abs(det) < kNothing) return false;
  const double s = Cross(w, v) / det, t = Cross(w, u) / det;
  return s >= 0 && s <= 1 && t >= 0 && t <= 1;
}

// The share of the segment a-b at which it is nearest to the centre, beyond its ends too.
double NearestShare(const Vector2& a, const Vector2& b) {
  const Vector2 u = b - a;
  return -u.dot(a) / u.squaredNorm();
}

// Where the tangent from p touches the circle, turned from p by +angle (turn 1) or -angle (turn -1).
Vector2 Touch(const Vector2& p, double radius, int turn) {
  const double l2 = p.squaredNorm(), out = std::sqrt(l2 - radius * radius);
  return (radius / l2) * (radius * p + turn * out * Vector2(-p.y(), p.x()));
}

// Whether the segment a-b passes the centre on the side that is away from `side`: it meets the half line from
// the centre opposite to it.
bool PassesBehind(const Vector2& a, const Vector2& b, const Vector2& side) {
  const double at_a = Cross(side, a), at_b = Cross(side, b);
  if ((at_a < 0) == (at_b < 0)) return false;
  const Vector2 met = a + at_a / (at_a - at_b) * (b - a);
  return met.dot(side) < 0;
}

FlatWrap WrapWith(const Vector2& a, const Vector2& b, double radius, int turn) {
  FlatWrap way;
  way.touches = true;
  way.first = Touch(a, radius, turn);
  way.last = Touch(b, radius, -turn);
  double angle = turn * std::atan2(Cross(way.first, way.last), way.first.dot(way.last));  // (-π, π]
  if (angle < 0) angle += kTurn;
  way.along = radius * angle;
  return way;
}

FlatWrap WrapOutside(const Vector2& a, const Vector2& b, double radius, const Vector2* side) {
  FlatWrap none;
  if (a.norm() < radius || b.norm() < radius || radius < kNothing) return none;
  if ((b - a).squaredNorm() < kNothing) return none;
  // Behind the centre it goes from a to b in one sense, before it in the other.
  if (side != nullptr && PassesBehind(a, b, *side)) return WrapWith(a, b, radius, Cross(a, b) > 0 ? -1 : 1);
  const Vector2 nearest = a + std::clamp(NearestShare(a, b), 0.0, 1.0) * (b - a);
  if (nearest.norm() > radius) return none;
  // Clockwise and counter-clockwise; the way whose straight parts cross would be a loop.
  FlatWrap ways[2];
  double merit[2];
  bool crosses[2];
  for (int i = 0; i < 2; ++i) {
    ways[i] = WrapWith(a, b, radius, i == 0 ? -1 : 1);
    merit[i] = -(ways[i].first - ways[i].last).squaredNorm();
    crosses[i] = Intersect(a, ways[i].first, b, ways[i].last);
  }
  int chosen = merit[0] > merit[1] ? 0 : 1;
  if (crosses[chosen] && !crosses[1 - chosen]) chosen = 1 - chosen;
  return crosses[chosen] ? none : ways[chosen];
}

// The point of a ring that a thread through it is pulled against: seen from there both ends stand at the same
// angle to the radius. With θ that angle, A = r/|a|, B = r/|b| and G the angle between a and b,
//     asin(A sin θ) + asin(B sin θ) - 2 θ + G = 0,
// which falls and is concave on (0, π/2), so that Newton's method from π/2 comes down on its root.
FlatWrap WrapInside(const Vector2& a, const Vector2& b, double radius) {
  FlatWrap none, way;
  const double la = a.norm(), lb = b.norm();
  if (la <= radius || lb <= radius || radius < kNothing) return none;
  if ((b - a).squaredNorm() > kNothing) {
    const double share = NearestShare(a, b);
    if (share > 0 && share < 1 && (a + share * (b - a)).norm() <= radius) return none;
  }
  const double G = std::abs(std::atan2(Cross(a, b), a.dot(b)));
  // Opposite points: the line through the centre, above. What is left is its rounding.
  if (std::cos(G) < -1 + kNothing) return none;
  way.touches = true;
  way.first = radius * (0.5 * (a + b)).normalized();
  const double A = radius / la, B = radius / lb;
  const auto f = [&](double theta) {
    return std::asin(A * std::sin(theta)) + std::asin(B * std::sin(theta)) - 2 * theta + G;
  };
  const auto slope = [&](double theta, double C) {
    const double s = C * std::sin(theta);
    return C * std::cos(theta) / std::sqrt(1 - s * s);
  };
  double theta = std::numbers::pi / 2;
  if (std::cos(G) <= 1 - kNothing && f(theta) <= 0) {
    // By squares, until rounding lets it fall no more.
    for (double next = theta;; theta = next) {
      next = theta - f(theta) / (slope(theta, A) + slope(theta, B) - 2);
      if (!(next < theta)) break;
    }
    const bool from_a = Cross(a, b) > 0;
    const Vector2 axis = from_a ? Vector2(a / la) : Vector2(b / lb);
    const double angle = theta - std::asin((from_a ? A : B) * std::sin(theta));
    way.first = radius * (std::cos(angle) * axis + std::sin(angle) * Vector2(-axis.y(), axis.x()));
  }
  way.last = way.first;
  return way;
}

// `side`, where there is one, in the obstacle's axes, which the circle's axes x and y are given in too.
FlatWrap WrapCircle(const Vector2& a, const Vector2& b, double radius, const Vector3* side, const Vector3& x,
                    const Vector3& y) {
  if (side == nullptr) return WrapOutside(a, b, radius, nullptr);
  if (side->norm() < radius) return WrapInside(a, b, radius);
  const Vector2 seen(side->dot(x), side->dot(y));
  // Straight above the centre it tells no side, and MuJoCo takes x.
  const Vector2 on_rim =
      radius * (seen.norm() < kNothing ? Vector2(Vector2::UnitX()) : Vector2(seen.normalized()));
  return WrapOutside(a, b, radius, &on_rim);
}

}  // namespace

Wrap WrapSphere(const Vector3& a, const Vector3& b, double radius, const Vector3* side) {
  Wrap out;
  if (a.norm() < kNothing || b.norm() < kNothing) return out;
  // In the plane of both points and the centre.
  const Vector3 x = a.normalized();
  Vector3 normal = a.cross(b);
  if (normal.norm() < kNothing) {  // any plane through both does
    Eigen::Index largest;
    x.cwiseAbs().maxCoeff(&largest);
    Vector3 other = Vector3::Ones();
    other(largest) = 0;
    normal = x.cross(other);
  }
  const Vector3 y = normal.cross(x).normalized();
  const auto flat = [&](const Vector3& p) { return Vector2(p.dot(x), p.dot(y)); };
  const FlatWrap way = WrapCircle(flat(a), flat(b), radius, side, x, y);
  out.touches = way.touches;
  if (!way.touches) return out;
  out.first = way.first.x() * x + way.first.y() * y;
  out.last = way.last.x() * x + way.last.y() * y;
  out.along = way.along;
  return out;
}

Wrap WrapCylinder(const Vector3& a, const Vector3& b, double radius, const Vector3* side) {
  Wrap out;
  if (a.norm() < kNothing || b.norm() < kNothing) return out;
  const Vector2 flat_a = a.head<2>(), flat_b = b.head<2>();
  const FlatWrap way = WrapCircle(flat_a, flat_b, radius, side, Vector3::UnitX(), Vector3::UnitY());
  out.touches = way.touches;
  if (!way.touches) return out;
  // Rolled out flat it is one straight line, which climbs at a constant rate.
  const double to = (way.first - flat_a).norm(), from = (flat_b - way.last).norm();
  const double rate = (b.z() - a.z()) / (to + way.along + from);
  out.first << way.first, a.z() + rate * to;
  out.last << way.last, a.z() + rate * (to + way.along);
  out.along = std::hypot(way.along, rate * way.along);
  return out;
}

}  // namespace fork1s::internal
