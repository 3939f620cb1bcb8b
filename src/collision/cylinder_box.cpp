#include "cylinder_box.hpp"

#include <algorithm>
#include <cmath>

#include "box_features.hpp"

// In the frame of the box, b its half sizes; c, a, r, l the cylinder's centre, axis, radius and half length. Along a unit
// vector n from the cylinder to the box they are apart by
//     s(n) = -Σ |n_i| b_i - n·c - r |n - (n·a) a| - l |n·a|
// whose largest value over all n is the gap. It lies where n is normal to a feature of each: a face, an edge or a corner of
// the box; an end, the side or the rim of the cylinder. Two points x and y on such features with y - x = d n certify n where
// d = s(n): apart no n gives more, and in penetration none beside it.
namespace fork1s::internal {
namespace {

constexpr double kParallel = 1e-10;  // sine: a line lies in a plane
constexpr double kCertain = 1e-10;   // d - s(n), as a share of both sizes
constexpr double kAside = 1e-6;      // of y - x beside n, likewise: squared it is what the gap is off by
constexpr int kNewtonSteps = 50, kProjections = 10;

constexpr double kConverged =
    1e-8;  // Newton's step [rad], whose square is what the root is off by afterwards

// f(φ) = A cos φ + B sin φ + C cos φ sin φ, φ as (cos φ, sin φ).
struct RimEquation {
  double A, B, C;

  double Evaluate(const Vector2& p) const { return A * p.x() + B * p.y() + C * p.x() * p.y(); }
  double Derivative(const Vector2& p) const {
    return B * p.x() - A * p.y() + C * (p.x() * p.x() - p.y() * p.y());
  }

  // act(root) for each of the up to four. f / (cos φ sin φ) = A / sin φ + B / cos φ + C has at most one extremum in a
  // quadrant, where tan³ φ = A / B, so that on either side of it is at most one root.
  template <class Act>
  void ForRoots(const Act& act) const {
    const Vector2 extremum = Vector2(std::cbrt(B), std::cbrt(A)).normalized();
    Vector2 from = Vector2::UnitX();
    for (int quadrant = 0; quadrant < 4; ++quadrant) {
      const Vector2 to(-from.y(), from.x());
      if (Evaluate(from) == 0) act(from);
      const double along_from = extremum.dot(from), along_to = extremum.dot(to);
      if (along_from * along_to > 0) {
        const Vector2 between = std::copysign(1, along_from) * extremum;
        FindBetween(from, between, act);
        FindBetween(between, to, act);
      } else {
        FindBetween(from, to, act);
      }
      from = to;
    }
  }

  // By Newton's method in the tangent t of half the angle from `from` on, at most 90 degrees.
  template <class Act>
  void FindBetween(const Vector2& from, const Vector2& to, const Act& act) const {
    const double f_from = Evaluate(from), f_to = Evaluate(to);
    // A root at an end is not meant.
    const bool is_below = (f_from == 0 ? Derivative(from) : f_from) < 0;
    if (is_below == ((f_to == 0 ? -Derivative(to) : f_to) < 0)) return;
    double low = 0, high = (from.x() * to.y() - from.y() * to.x()) / (1 + from.dot(to));
    double t = high * (f_from * f_to < 0 ? f_from / (f_from - f_to) : 0.5);
    Vector2 p;
    for (int step = 0; step < kNewtonSteps; ++step) {
      const double scale = 1 / (1 + t * t), cosine = (1 - t * t) * scale, sine = 2 * t * scale;
      p = {cosine * from.x() - sine * from.y(), cosine * from.y() + sine * from.x()};
      const double f = Evaluate(p), change = -f / Derivative(p);
      if (std::abs(change) < kConverged) {
        p += change * Vector2(-p.y(), p.x());
        break;
      }
      ((f < 0) == is_below ? low : high) = t;
      t += 0.5 * change / scale;
      if (!(t > low && t < high)) t = 0.5 * (low + high);
    }
    act(p);
  }
};

class Search {
 public:
  Search(double radius, double half_length, const Vector3& center, const Vector3& axis, const Vector3& half)
      : r_(radius),
        l_(half_length),
        c_(center),
        a_(axis),
        b_(half),
        enough_(kCertain * (radius + half_length + half.sum())),
        aside_(kAside * (radius + half_length + half.sum())) {}

  bool Find(double margin) {
    for (int i = 0; i < 3; ++i)
      for (const double side : {-1.0, 1.0}) TryFace(i, side);
    TryEnd(1);
    TryEnd(-1);
    if (gap >= margin) return true;
    for (int i = 0; i < 3; ++i) TryEdgeOnSide(i);
    // In penetration another pair of features may be less deep.
    if (gap >= margin || (certain && gap > 0)) return true;
    const Vector3 near = NearestByProjections();
    TryCorner(DeepestCorner(b_, near));
    if (gap >= margin || (certain && gap > 0)) return true;
    const double side_near = (near - c_).dot(a_) < 0 ? -1 : 1;
    for (int i = 0; i < 3 && most_ > enough_; ++i) {
      Vector3 edge = near;
      edge[i] = 0;
      if ((edge.cwiseAbs() + b_[i] * Vector3::Unit(i)) == b_) TryEdgeOnRim(i, edge, side_near);
    }
    if (gap >= margin || (certain && gap > 0)) return true;
    for (int k = 0; k < 8; ++k) TryCorner(Corner(b_, k));
    if (gap >= margin || (certain && gap > 0)) return true;
    // No pair of features that gives more lies farther apart.
    const double within = std::max(most_, -gap + enough_);
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 4; ++k)
        for (const double side : {-1.0, 1.0})
          if (const Vector3 edge = EdgeMiddle(b_, i, k); MayBeNear(i, edge, side, within))
            TryEdgeOnRim(i, edge, side);
    return certain || gap >= margin;
  }

  double gap = -1e300;  // largest s(n) so far
  Vector3 normal, middle;
  bool certain = false;

 private:
  double Apart(const Vector3& n) const {
    const double along = n.dot(a_);
    return -n.cwiseAbs().dot(b_) - n.dot(c_) - r_ * (n - along * a_).norm() - l_ * std::abs(along);
  }
  bool IsBetter(const Vector3& n) {
    const double s = Apart(n);
    // What is equal to rounding takes over only as long as nothing is certain.
    if (!(s > gap + (certain ? enough_ : 0))) return false;
    gap = s;
    normal = n;
    certain = false;
    return true;
  }
  // x of the cylinder and y of the box certify the normal at hand.
  void Certify(const Vector3& x, const Vector3& y) {
    const Vector3 way = y - x;
    const double d = way.dot(normal);
    if (std::abs(d - gap) > enough_ || (way - d * normal).norm() > aside_) return;
    certain = true;
    middle = 0.5 * (x + y);
  }
  // Whether two points with y - x = d n may give more: s(n) is at most d, and the gap at most `most_`.
  bool MayBeMore(double d) const { return d > gap && d <= most_; }
  bool IsOnFace(int face, const Vector3& p) const {
    for (int i = 0; i < 3; ++i)
      if (i != face && std::abs(p[i]) > b_[i]) return false;
    return true;
  }
  // Clips the parameters of the line p + t v, from..to, to the box without the axis `face`.
  bool ClipToFace(int face, const Vector3& p, const Vector3& v, double& from, double& to) const {
    for (int i = 0; i < 3; ++i) {
      if (i == face) continue;
      if (std::abs(v[i]) < kParallel) {
        if (std::abs(p[i]) > b_[i]) return false;
        continue;
      }
      const double t0 = (-b_[i] - p[i]) / v[i], t1 = (b_[i] - p[i]) / v[i];
      from = std::max(from, std::min(t0, t1));
      to = std::min(to, std::max(t0, t1));
    }
    return from <= to;
  }

  // The cylinder above the face: its lowest point, line or end.
  void TryFace(int i, double side) {
    const Vector3 n = -side * Vector3::Unit(i);
    if (!IsBetter(n)) return;
    const double along = n.dot(a_);
    const Vector3 out = n - along * a_;
    const auto certify = [&](const Vector3& x) {
      if (IsOnFace(i, x)) Certify(x, x + gap * n);
    };
    if (out.norm() < kParallel) {  // an end: its point nearest to the middle of the face
      const Vector3 middle_of_end = c_ + std::copysign(l_, along) * a_;
      Vector3 x = middle_of_end.cwiseMin(b_).cwiseMax(-b_);
      x[i] = middle_of_end[i];
      if ((x - middle_of_end).norm() <= r_) certify(x);
      return;
    }
    const Vector3 line = c_ + r_ * out.normalized();
    if (std::abs(along) < kParallel) {
      double from = -l_, to = l_;
      if (ClipToFace(i, line, a_, from, to)) certify(line + 0.5 * (from + to) * a_);
    } else {
      certify(line + std::copysign(l_, along) * a_);
    }
  }

  // The box above an end: its lowest corner, edge or face; faces are TryFace's.
  void TryEnd(double side) {
    const Vector3 n = side * a_;
    if (!IsBetter(n)) return;
    // The nearest to the axis of all that is lowest.
    Vector3 y;
    const Vector3 end = c_ + side * l_ * a_;
    for (int i = 0; i < 3; ++i)
      y[i] = std::abs(n[i]) < kParallel ? std::clamp(end[i], -b_[i], b_[i]) : -std::copysign(b_[i], n[i]);
    const Vector3 across = y - c_ - (y - c_).dot(a_) * a_;
    if (across.norm() <= r_) Certify(y - gap * n, y);
  }

  // An edge along axis i across the side.
  void TryEdgeOnSide(int i) {
    const Vector3 u = Vector3::Unit(i), product = u.cross(a_);
    const double sine = product.norm();
    if (sine < kParallel) return;  // parallel: corners and faces are as near
    for (const double side : {-1.0, 1.0}) {
      const Vector3 n = side / sine * product;
      if (!IsBetter(n)) continue;
      Vector3 edge = DeepestCorner(b_, -n);
      edge[i] = 0;
      const Vector3 w = edge - (c_ + r_ * n);
      const double ua = u.dot(a_), uw = u.dot(w), aw = a_.dot(w);
      const double t = (aw - ua * uw) / (sine * sine), s = (ua * aw - uw) / (sine * sine);
      if (std::abs(t) <= l_ && std::abs(s) <= b_[i]) Certify(c_ + r_ * n + t * a_, edge + s * u);
    }
  }

  void TryCorner(const Vector3& corner) {
    const Vector3 w = corner - c_;
    const double along = w.dot(a_);
    const Vector3 out = w - along * a_;
    const double distance = out.norm();
    if (!(distance > kParallel * r_)) return;
    const Vector3 e = out / distance;
    if (std::abs(along) <= l_ && MayBeMore(distance - r_) && IsBetter(e))
      Certify(c_ + along * a_ + r_ * e, corner);
    for (const double side : {-1.0, 1.0}) {
      const double past_rim = distance - r_, past_end = side * along - l_,
                   d = std::copysign(Vector2(past_rim, past_end).norm(), past_rim + past_end);
      if (past_rim * past_end < 0 || d == 0 || !MayBeMore(d)) continue;
      const Vector3 x = c_ + side * l_ * a_ + r_ * e;
      if (IsBetter((corner - x) / d)) Certify(x, corner);
    }
  }

  // Of the box, by way from one shape to the other and back: points of both, so no nearer than these are.
  Vector3 NearestByProjections() {
    Vector3 x = c_, y = x.cwiseMin(b_).cwiseMax(-b_);
    for (int k = 0; k < kProjections; ++k) {
      const Vector3 w = y - c_, before = y;
      const double along = w.dot(a_);
      const Vector3 out = w - along * a_;
      const double distance = out.norm();
      x = c_ + std::clamp(along, -l_, l_) * a_ + (distance > r_ ? r_ / distance : 1) * out;
      y = x.cwiseMin(b_).cwiseMax(-b_);
      if (y == before) break;
    }
    most_ = (y - x).norm() + enough_;
    return y;
  }

  // False where no point of an edge is as near to a rim as that.
  bool MayBeNear(int i, const Vector3& edge, double side, double within) const {
    const Vector3 D = edge - c_ - side * l_ * a_;
    const double height = D.dot(a_), slope = a_[i];
    if (std::abs(height) - b_[i] * std::abs(slope) > within) return false;
    const auto radial = [&](double t) {
      const Vector3 w = D + t * Vector3::Unit(i);
      return (w - w.dot(a_) * a_).norm();
    };
    // The nearest and the farthest from the axis of the part at most `within` above and beneath the rim.
    const double level = std::abs(slope) > kParallel ? -height / slope : 0,
                 reach = std::abs(slope) > kParallel ? within / std::abs(slope) : b_[i];
    const double from = std::clamp(level - reach, -b_[i], b_[i]),
                 to = std::clamp(level + reach, -b_[i], b_[i]);
    const double sine2 = 1 - slope * slope;
    const double nearest = sine2 > kParallel ? std::clamp(-(D[i] - height * slope) / sine2, from, to) : from;
    const double at_from = radial(from), at_to = radial(to);
    return std::min({radial(nearest), at_from, at_to}) <= r_ + within &&
           std::max(at_from, at_to) >= r_ - within;
  }

  // The edge along axis i through `edge`, and a rim. With e and τ along radius and rim at an angle φ, and D from the edge
  // to the rim's centre, the line between them is normal to both where D·τ = (u·D + r u·e) u·τ. With φ from e₁ on, where
  // the rim's plane has u, that is D·e₂ cos φ + (u·D u·e₁ - D·e₁) sin φ + r (u·e₁)² cos φ sin φ = 0.
  void TryEdgeOnRim(int i, const Vector3& edge, double side) {
    const Vector3 D = c_ + side * l_ * a_ - edge, across = a_.cross(Vector3(Vector3::Unit(i)));
    const double sine = across.norm();
    const Vector3 e2 = sine > kParallel ? Vector3(across / sine) : a_.unitOrthogonal(), e1 = e2.cross(a_);
    const RimEquation equation{D.dot(e2), D[i] * e1[i] - D.dot(e1), r_ * e1[i] * e1[i]};
    equation.ForRoots([&](const Vector2& p) { TryEdgeOnRimAt(i, edge, side, p.x() * e1 + p.y() * e2); });
  }

  // The same, where the rim's point lies along e from its centre.
  void TryEdgeOnRimAt(int i, const Vector3& edge, double side, const Vector3& e) {
    const Vector3 u = Vector3::Unit(i), x = c_ + side * l_ * a_ + r_ * e, y = edge + x[i] * u;
    if (std::abs(x[i]) > b_[i]) return;
    // Their common normal where they nearly meet, which leaves it unknown where edge and rim are parallel.
    Vector3 n = y - x;
    if (!(n.norm() > enough_)) n = u.cross(a_.cross(e));
    const double length = n.norm();
    if (!(length > 0)) return;
    n /= n.dot(e) + side * n.dot(a_) < 0 ? -length : length;
    if (MayBeMore(n.dot(y - x)) && IsBetter(n)) Certify(x, y);
  }

  const double r_, l_;
  const Vector3 c_, a_, b_;
  const double enough_, aside_;
  double most_ = 0;  // distance of two points of them
};

}  // namespace

std::optional<Deepest> CylinderBox(double radius, double half_length, const RigidTransform& X_A,
                                   const Vector3& half, const RigidTransform& X_B, double margin) {
  const RigidTransform X_BA = X_B.inverse() * X_A;
  Search search(radius, half_length, X_BA.translation(), X_BA.rotation().col(2), half);
  if (!search.Find(margin)) return {};
  Deepest out;
  out.gap = search.gap;
  if (search.gap >= margin) return out;
  out.normal = X_B.rotation() * search.normal;
  out.point = X_B * search.middle;
  return out;
}

// The capsule's segment is a box without width. Its radius lessens s(n) by as much along every n.
std::optional<Deepest> CylinderCapsule(double radius, double half_length, const RigidTransform& X_A,
                                       double capsule_radius, double capsule_half_length,
                                       const RigidTransform& X_B, double margin) {
  std::optional<Deepest> out =
      CylinderBox(radius, half_length, X_A, Vector3(0, 0, capsule_half_length), X_B, margin + capsule_radius);
  if (!out) return out;
  out->gap -= capsule_radius;
  out->point -= 0.5 * capsule_radius * out->normal;
  return out;
}

}  // namespace fork1s::internal
