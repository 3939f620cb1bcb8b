// Coulomb's law by its pieces.
//
// With λ beside d a second unknown, g = w + R λ what the material of a point has not taken yet, and y = λ − ρ
// g for any ρ > 0, the law is λ = Π(y), the projection on the cone's section at µ max(0, y_n). Newton's step
// on that takes each point as the piece that y is on,
//     open λ = 0,   sticking λ = −w/R,   sliding, e = y_t/|y_t|, β = µ y_n/|y_t|, κ = β ρ/(1 − β (1 − ρ R)):
//     λ_n = −w_n/R_n,   λ_t = µ λ_n e − κ (1 − e eᵀ) w_t
// so λ = −D w, and (1 + Σ GᵀDG) d = −Σ GᵀD w(0). ρ = 1/R is Newton's method in d alone, to which every point
// that moves by more than its depth is another piece; ρ of the size of the mass at the point sees pieces as
// forces do, and needs no line search near an answer.
#include <algorithm>
#include <cmath>

#include "compliant_rows.hpp"

namespace fork1s::internal {
namespace {

constexpr double kAtBound = 0.99;

}  // namespace

// |λ − Π(y)| of a point or row, and its rounding.
void CompliantRows::AddGap(double inverse_mass, double gap2, double rounding) {
  law_gap_ += inverse_mass * gap2;
  law_noise_ += inverse_mass * rounding * rounding;
}

void CompliantRows::TakePiece(const PairRows& pair, PointRows& point, bool first) {
  const double R_n = point.law.R_n, R_t = point.law.R_t, friction = point.law.friction;
  point.ClearPiece();
  if (!(R_n > 0)) return;
  const double rho = 1 / (point.inverse_mass + R_n), rho_t = 1 / (point.inverse_mass + R_t);
  const double y_n = point.impulse[0] - rho * (NormalSpeed(pair, point) + R_n * point.impulse[0]);
  const double rounding = kRounding * (rho * point.reach + point.impulse.cwiseAbs().sum());
  if (!(y_n > 0)) {
    AddGap(point.inverse_mass, point.impulse.squaredNorm(), rounding);
    return;
  }
  const Vector3 w = Speed(pair, point);
  point.is_clear = false;
  point.D(0, 0) = 1 / R_n;
  const Vector2 y = point.impulse.tail<2>() - rho_t * (w.tail<2>() + R_t * point.impulse.tail<2>());
  const double size = y.norm(), bound = friction * y_n;
  const double off = point.impulse[0] - y_n;
  AddGap(point.inverse_mass,
         off * off + (point.impulse.tail<2>() - (size > bound ? bound / size : 1) * y).squaredNorm(),
         rounding);
  if (bound > 0) point.use = w.tail<2>().norm() / (R_t * bound);
  // What crept a step ago stands at its bound to the last digits, on whichever side of it: as a first guess
  // it goes on.
  const bool goes_on = first && point.held_use > 1 && size > kAtBound * bound && size > 0;
  // Between sliding one way and sliding back lies sticking; leaping over it two pieces would take turns for
  // ever.
  if ((size <= bound && !goes_on) || (share_ == 1 && y.dot(point.impulse.tail<2>()) < 0)) {
    point.state = PointState::kSticking;
    point.D(1, 1) = point.D(2, 2) = 1 / R_t;
  } else {
    point.state = PointState::kSliding;
    const Vector2 e = y / size;
    const double beta = std::min(1.0, bound / size), kappa = beta * rho_t / (1 - beta * (1 - rho_t * R_t));
    point.D.block<2, 1>(1, 0) = friction / R_n * e;
    point.D.bottomRightCorner<2, 2>() = kappa * (Eigen::Matrix2d::Identity() - e * e.transpose());
    point.by_share.tail<2>() = point.friction * y_n * e;
  }
  point.by_share += point.D * point.shift;
  if (point.HasMoments()) TakeMoments(point, Turning(pair, point), y_n);
}

void CompliantRows::TakeMoments(PointRows& point, const Vector3& turning, double y_n) {
  for (int k = 0; k < 3; ++k) {
    const double radius = point.Radius(k), inverse = point.inverse_inertia[k];
    if (!(radius > 0)) continue;
    const double R = point.AngularR(k, point.law.R_t), rho = 1 / (inverse + R);
    const double m = point.moment[k] - rho * (turning[k] + R * point.moment[k]);
    const double most = share_ * radius * y_n, gap = point.moment[k] - std::clamp(m, -most, most);
    AddGap(inverse, gap * gap,
           kRounding * (rho * std::abs(point.angular_base[k]) + std::abs(point.moment[k])));
    if (std::abs(m) <= most) {
      point.D_turn(k, k) = 1 / R;
    } else {
      point.by_normal[k] = share_ * (m > 0 ? radius : -radius) / point.law.R_n;
      point.turn_by_share[k] = (m > 0 ? radius : -radius) * y_n;
    }
  }
}

void CompliantRows::TakePieces(const double* d, bool first) {
  for (PortRows& port : ports) port.SetChange(d);
  ClearPush();
  law_gap_ = law_noise_ = 0;
  for (const PairRows& pair : pairs)
    for (int i = pair.first; i < pair.first + pair.count; ++i) {
      PointRows& point = points[static_cast<std::size_t>(i)];
      const bool moments = point.HasMoments();
      TakePiece(pair, point, first);
      if (point.state == PointState::kOpen) continue;
      // What the piece bears at d = 0.
      const Vector3 w = point.base + point.offset;
      Vector3 moment = Vector3::Zero();
      if (moments)
        moment = -point.D_turn * (point.angular_base + point.angular_offset) - point.by_normal * w[0];
      AddPush(pair, point, -point.D * w, moment);
    }
  for (LimitRows& limit : limits) {
    const double at_rest = limit.base + limit.offset;
    double w = at_rest, reach = limit.reach;
    for (int i = 0; i < limit.freedoms; ++i) {
      const double part = limit.Y[i] * d[limit.begin + i];
      w += limit.sign * part;
      reach += std::abs(part);
    }
    limit.D = limit.constant = limit.at_rest = 0;
    if (!(limit.R > 0)) continue;
    const double rho = 1 / (limit.inverse_mass + limit.R),
                 y = limit.impulse - rho * (w + limit.R * limit.impulse);
    const double gap = limit.impulse - std::min(std::max(y, limit.lower), limit.upper);
    AddGap(limit.inverse_mass, gap * gap, kRounding * (rho * reach + std::abs(limit.impulse)));
    if (y > limit.lower && y < limit.upper)
      limit.D = 1 / limit.R;
    else
      limit.constant = y > limit.lower ? limit.upper : limit.lower;
    limit.at_rest = limit.constant - limit.D * at_rest;
  }
  law_gap_ = std::sqrt(law_gap_);
  law_noise_ = std::sqrt(law_noise_);
  GatherPush(&LimitRows::at_rest);
}

void CompliantRows::ImpulsesOfPieces(const double* d, double more_share) {
  for (PortRows& port : ports) port.SetChange(d);
  for (const PairRows& pair : pairs)
    for (int i = pair.first; i < pair.first + pair.count; ++i) {
      PointRows& point = points[static_cast<std::size_t>(i)];
      if (point.state == PointState::kOpen) {
        point.impulse.setZero();
        point.moment.setZero();
        continue;
      }
      const Vector3 w = Speed(pair, point);
      point.impulse = more_share * point.by_share - point.D * w;
      if (point.HasMoments())
        point.moment =
            more_share * point.turn_by_share - point.D_turn * Turning(pair, point) - point.by_normal * w[0];
    }
  for (LimitRows& limit : limits) {
    double w = limit.base + limit.offset;
    for (int i = 0; i < limit.freedoms; ++i) w += limit.sign * limit.Y[i] * d[limit.begin + i];
    limit.impulse = limit.constant - limit.D * w;
  }
}

void CompliantRows::SetFrictionShare(double share) {
  share_ = share;
  for (PointRows& point : points) {
    point.law.friction = share * point.friction;
    point.offset = (1 - share) * point.shift;
  }
}

void CompliantRows::PushByShare(double* into) {
  ClearPush();
  for (const PairRows& pair : pairs)
    for (int i = pair.first; i < pair.first + pair.count; ++i) {
      const PointRows& point = points[static_cast<std::size_t>(i)];
      AddPush(pair, point, point.by_share, point.turn_by_share);
    }
  std::fill_n(into, freedoms_, 0.0);
  for (const PortRows& port : ports) port.AddTo(port.push, into);
}

void CompliantRows::MoveOnPieces(const double* s) {
  for (PortRows& port : ports) port.SetChange(s);
  for (const PairRows& pair : pairs)
    for (int i = pair.first; i < pair.first + pair.count; ++i) {
      PointRows& point = points[static_cast<std::size_t>(i)];
      if (point.state == PointState::kOpen) continue;
      Vector3 w = Vector3::Zero(), turning = Vector3::Zero();
      const auto add = [&](int index, const Matrix36& J) {
        if (index < 0) return;
        const Vector6& change = ports[static_cast<std::size_t>(index)].change;
        w += J.lazyProduct(change);
        if (point.HasMoments()) turning += J.rightCols<3>() * change.head<3>();
      };
      add(pair.port_a, point.J_a);
      add(pair.port_b, point.J_b);
      point.impulse -= point.D * w;
      if (point.HasMoments()) point.moment -= point.D_turn * turning + point.by_normal * w[0];
    }
  for (LimitRows& limit : limits) {
    double w = 0;
    for (int i = 0; i < limit.freedoms; ++i) w += limit.sign * limit.Y[i] * s[limit.begin + i];
    limit.impulse -= limit.D * w;
  }
}

}  // namespace fork1s::internal
