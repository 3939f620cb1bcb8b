// Coulomb's law by its modes.
//
// With λ beside d a second unknown, g = w + R λ what the material of a point has not taken yet, and y = λ − ρ
// g for any ρ > 0, the law is λ = Π(y), the projection on the cone's section at µ max(0, y_n). Newton's step
// on that takes each point as the mode that y is on,
//     open λ = 0,   sticking λ = −w/R,   sliding, e = y_t/|y_t|, β = µ y_n/|y_t|, κ = β ρ/(1 − β (1 − ρ R)):
//     λ_n = −w_n/R_n,   λ_t = µ λ_n e − κ (1 − e eᵀ) w_t
// so λ = −D w, and (1 + Σ GᵀDG) d = −Σ GᵀD w(0). ρ = 1/R is Newton's method in d alone, to which every point
// that moves by more than its depth is another mode; ρ of the size of the mass at the point sees modes as
// forces do, and needs no line search near an answer.
#include <algorithm>
#include <cmath>

#include "regularized_contact_problem.hpp"

namespace fork1s::internal {
namespace {

constexpr double kAtBound = 0.99;

}  // namespace

// |λ − Π(y)|² of a point or row as inertia weighs it, and its rounding.
double RegularizedContactProblem::AddGap(double inverse_mass, double gap2, double rounding) {
  law_gap_ += inverse_mass * gap2;
  law_noise_ += inverse_mass * rounding * rounding;
  return inverse_mass * gap2;
}

double RegularizedContactProblem::AddGap(PointRows& point, double gap2) {
  // rho of the normal, since R_t is of the size of R_n
  const double rho = 1 / (point.compliance.inverse_mass + point.law.R_n);
  return AddGap(point.compliance.inverse_mass, gap2,
                kRounding * (rho * point.reach + point.impulse.cwiseAbs().sum()));
}

void RegularizedContactProblem::UpdateMode(const PairRows& pair, PointRows& point, bool first) {
  point.ClearLinearization();
  point.off2 = 0;
  if (!(point.law.R_n > 0)) return;
  const FrictionCone& law = point.law;
  const double normal =
      law.TrialNormal(point.impulse[0], NormalSpeed(pair, point), point.compliance.inverse_mass);
  if (!(normal > 0)) {
    point.off2 = AddGap(point, point.impulse.squaredNorm());
    return;
  }
  const Vector3 w = Speed(pair, point);
  const FrictionCone::Trial y = law.NaturalTrial(normal, point.impulse, w, point.compliance.inverse_mass);
  point.off2 = AddGap(point, (point.impulse - law.Project(y)).squaredNorm());
  point.utilization = law.Utilization(w.tail<2>(), y.bound);
  // What crept a step ago stands at its bound to the last digits, on whichever side of it: as a first guess
  // it goes on.
  const bool goes_on = first && point.previous.utilization > 1 && y.size > kAtBound * y.bound && y.size > 0;
  // Between sliding one way and sliding back lies sticking; leaping over it two modes would take turns for
  // ever.
  const bool slides =
      (y.Slides() || goes_on) && !(law.share == 1 && y.tangent.dot(point.impulse.tail<2>()) < 0);
  point.linearization.mode = slides ? ContactMode::kSliding : ContactMode::kSticking;
  law.Linearize(y, slides, point.linearization.D);
  if (slides) point.linearization.by_share.tail<2>() = law.ByShare(y);
  point.linearization.is_clear = false;
  point.linearization.by_share += point.linearization.D * point.velocity.shift;
  if (point.HasMoments()) UpdateMoments(point, Turning(pair, point), normal, true);
}

// Rounding of Σ |λ|, as inertia weighs them, which stays in the w of every point where impulses cancel.
double RegularizedContactProblem::NoiseOfCancellation() const {
  double size = 0, loaded = 0;
  for (const PointRows& point : points) {
    if (point.impulse.isZero(0)) continue;
    size += std::sqrt(point.compliance.inverse_mass) * point.impulse.norm();
    ++loaded;
  }
  return kRounding * size * std::sqrt(loaded);
}

void RegularizedContactProblem::UpdateMoments(PointRows& point, const Vector3& turning, double y_n,
                                              bool with_piece) {
  for (int k = 0; k < 3; ++k) {
    if (!point.moments.Has(k)) continue;
    const BoundLaw law = point.moments.At(k, y_n);
    const double moment = point.moment[k], inverse = point.compliance.inverse_inertia[k];
    const double y = law.Trial(moment, turning[k], inverse), gap = moment - law.Project(y);
    point.off2 += AddGap(
        inverse, gap * gap,
        kRounding * (NaturalMapScale(inverse, law.R) * std::abs(point.turning.base[k]) + std::abs(moment)));
    if (!with_piece) continue;
    if (law.IsWithin(y)) {
      point.linearization.D_turn(k, k) = 1 / law.R;
    } else {
      point.linearization.turn_by_normal[k] = point.moments.ByNormal(k, y) / point.law.R_n;
      point.linearization.turn_by_share[k] = point.moments.ByShare(k, y, y_n);
    }
  }
}

// y of a row.
double RegularizedContactProblem::EvaluateLimit(LimitRows& limit, const double* d) {
  limit.off2 = 0;
  if (!(limit.law.R > 0)) return 0;
  double w = limit.base + limit.offset, reach = limit.reach;
  for (int i = 0; i < limit.freedoms; ++i) {
    const double part = limit.Y[i] * d[limit.begin + i];
    w += limit.sign * part;
    reach += std::abs(part);
  }
  limit.w = w;
  const double y = limit.law.Trial(limit.impulse, w, limit.inverse_mass);
  const double gap = limit.impulse - limit.law.Project(y),
               rho = NaturalMapScale(limit.inverse_mass, limit.law.R);
  limit.off2 = AddGap(limit.inverse_mass, gap * gap, kRounding * (rho * reach + std::abs(limit.impulse)));
  return y;
}

void RegularizedContactProblem::MeasureLaw(const double* d) {
  for (PortRows& port : ports) port.SetChange(d);
  law_gap_ = law_noise_ = 0;
  for (const PairRows& pair : pairs)
    for (int i = pair.first; i < pair.first + pair.count; ++i) {
      PointRows& point = points[static_cast<std::size_t>(i)];
      const FrictionCone& law = point.law;
      point.off2 = point.utilization = 0;
      point.linearization.mode = ContactMode::kOpen;
      if (!(law.R_n > 0)) continue;
      const double normal =
          law.TrialNormal(point.impulse[0], NormalSpeed(pair, point), point.compliance.inverse_mass);
      if (!(normal > 0)) {
        point.off2 = AddGap(point, point.impulse.squaredNorm());
        continue;
      }
      point.velocity.w = Speed(pair, point);
      const FrictionCone::Trial y =
          law.NaturalTrial(normal, point.impulse, point.velocity.w, point.compliance.inverse_mass);
      point.off2 = AddGap(point, (point.impulse - law.Project(y)).squaredNorm());
      point.linearization.mode = law.ModeOf(y);
      point.utilization = law.Utilization(point.velocity.w.tail<2>(), y.bound);
      if (point.HasMoments()) UpdateMoments(point, Turning(pair, point), normal, false);
    }
  for (LimitRows& limit : limits) EvaluateLimit(limit, d);
  law_gap_ = std::sqrt(law_gap_);
  law_noise_ = std::sqrt(law_noise_) + NoiseOfCancellation();
}

void RegularizedContactProblem::UpdateModes(const double* d, bool first) {
  for (PortRows& port : ports) port.SetChange(d);
  ClearPush();
  law_gap_ = law_noise_ = 0;
  for (const PairRows& pair : pairs)
    for (int i = pair.first; i < pair.first + pair.count; ++i) {
      PointRows& point = points[static_cast<std::size_t>(i)];
      const bool moments = point.HasMoments();
      UpdateMode(pair, point, first);
      if (point.linearization.mode == ContactMode::kOpen) continue;
      // What the mode bears at d = 0.
      const Vector3 w = point.velocity.base + point.velocity.offset;
      Vector3 moment = Vector3::Zero();
      if (moments)
        moment = -point.linearization.D_turn * (point.turning.base + point.turning.offset) -
                 point.linearization.turn_by_normal * w[0];
      AddPush(pair, point, -point.linearization.D * w, moment);
    }
  for (LimitRows& limit : limits) {
    const double y = EvaluateLimit(limit, d);
    limit.D = limit.constant = limit.at_rest = 0;
    if (!(limit.law.R > 0)) continue;
    if (limit.law.IsWithin(y))
      limit.D = 1 / limit.law.R;
    else
      limit.constant = limit.law.Project(y);
    limit.at_rest = limit.constant - limit.D * (limit.base + limit.offset);
  }
  law_gap_ = std::sqrt(law_gap_);
  law_noise_ = std::sqrt(law_noise_) + NoiseOfCancellation();
  GatherPush(&LimitRows::at_rest);
}

void RegularizedContactProblem::ComputeLinearizedImpulses(const double* d, double more_share) {
  for (PortRows& port : ports) port.SetChange(d);
  for (const PairRows& pair : pairs)
    for (int i = pair.first; i < pair.first + pair.count; ++i) {
      PointRows& point = points[static_cast<std::size_t>(i)];
      if (point.linearization.mode == ContactMode::kOpen) {
        point.impulse.setZero();
        point.moment.setZero();
        continue;
      }
      const Vector3 w = Speed(pair, point);
      point.impulse = more_share * point.linearization.by_share - point.linearization.D * w;
      if (point.HasMoments())
        point.moment = more_share * point.linearization.turn_by_share -
                       point.linearization.D_turn * Turning(pair, point) -
                       point.linearization.turn_by_normal * w[0];
    }
  for (LimitRows& limit : limits) {
    double w = limit.base + limit.offset;
    for (int i = 0; i < limit.freedoms; ++i) w += limit.sign * limit.Y[i] * d[limit.begin + i];
    limit.impulse = limit.constant - limit.D * w;
  }
}

void RegularizedContactProblem::SetFrictionShare(double share) {
  for (PointRows& point : points) {
    point.law.share = point.moments.share = share;
    point.velocity.offset = (1 - share) * point.velocity.shift;
  }
}

void RegularizedContactProblem::PushByShare(double* into) {
  ClearPush();
  for (const PairRows& pair : pairs)
    for (int i = pair.first; i < pair.first + pair.count; ++i) {
      const PointRows& point = points[static_cast<std::size_t>(i)];
      AddPush(pair, point, point.linearization.by_share, point.linearization.turn_by_share);
    }
  std::fill_n(into, freedoms(), 0.0);
  for (const PortRows& port : ports) port.AddTo(port.push, into);
}

void RegularizedContactProblem::MoveInFixedModes(const double* s) {
  for (PortRows& port : ports) port.SetChange(s);
  for (const PairRows& pair : pairs)
    for (int i = pair.first; i < pair.first + pair.count; ++i) {
      PointRows& point = points[static_cast<std::size_t>(i)];
      if (point.linearization.is_clear) continue;
      ThreeSums sums;
      Vector3 turning = Vector3::Zero();
      const auto add = [&](int index, const PaddedRows& rows) {
        if (index < 0) return;
        const Padded6& change = ports[static_cast<std::size_t>(index)].change;
        sums.Add(rows, change);
        if (point.HasMoments()) turning += AxesOf(rows).transpose() * change.head<3>();
      };
      add(pair.port_a, point.rows_a);
      add(pair.port_b, point.rows_b);
      const Vector3 w = sums.Sum();
      point.impulse -= point.linearization.D * w;
      if (point.HasMoments())
        point.moment -= point.linearization.D_turn * turning + point.linearization.turn_by_normal * w[0];
    }
  for (LimitRows& limit : limits) {
    double w = 0;
    for (int i = 0; i < limit.freedoms; ++i) w += limit.sign * limit.Y[i] * s[limit.begin + i];
    limit.impulse -= limit.D * w;
  }
}

}  // namespace fork1s::internal
