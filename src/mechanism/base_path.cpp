#include <fork1s/mechanism/base_path.hpp>

#include <algorithm>
#include <cmath>

namespace fork1s {
namespace {

// Largest share of the larger rate by which the mean rate may differ from the mean of the rates at both ends, and the rate
// estimated by four poses from that by three. On smooth paths both differences are O(h²). With rates estimated by three
// poses the first is 1/6 of a sudden start or jump, 1/4 of a sudden stop or reversal, and 1/8 in the step after a constant
// acceleration has set in; the second is a third of the rate before a sudden start or stop.
constexpr double kLargestMiss = 0.15;

double Larger(const Vector3& a, const Vector3& b) { return std::max(a.norm(), b.norm()); }

// Slope at the end of the step of the polynomial through the last poses; mean rates are its first divided differences.
// The cubic through four poses is off by a quarter of h³ times the fourth derivative, the parabola through three by a
// third of h² times the third; the cubic where its last term is as small beside the rates as on smooth paths, since it
// goes on after a sudden stop. `first`: of the rotation or of the translation.
Vector3 EstimateSlope(const Vector3& mean_rate, const Vector3& rate_start, const BaseHistory& history,
                      int first, double h) {
  if (history.h == 0) return mean_rate;
  const Vector3 last = history.mean_rate.segment<3>(first),
                before = history.mean_rate_before.segment<3>(first);
  const Vector3 second = (mean_rate - last) / (h + history.h), slope = mean_rate + h * second;
  if (history.h_before == 0) return slope;
  const Vector3 second_before = (last - before) / (history.h + history.h_before);
  const Vector3 cubic = h * (h + history.h) / (h + history.h + history.h_before) * (second - second_before);
  return cubic.norm() > kLargestMiss * Larger(rate_start, slope) ? slope : slope + cubic;
}

}  // namespace

BasePath ComputeBasePath(const RigidTransform& X_start, const Vector6& rate_start,
                         const RigidTransform& X_end, const std::optional<Vector6>& rate_end,
                         const BaseHistory& history, double h) {
  BasePath path;
  path.X_start = X_start;
  path.X_end = X_end;
  path.h = h;
  path.shift << LogRotation(X_end.rotation() * X_start.rotation().transpose()),
      X_end.translation() - X_start.translation();
  const Vector6 mean_rate = path.MeanRate();
  Vector6 slope_end;
  if (rate_end) {
    slope_end << DexpInverseRotation(path.shift.head<3>()) * rate_end->head<3>(), rate_end->tail<3>();
  } else {
    for (const int first : {0, 3})
      slope_end.segment<3>(first) =
          EstimateSlope(mean_rate.segment<3>(first), rate_start.segment<3>(first), history, first, h);
  }
  for (const int first : {0, 3}) {
    const Vector3 mean = mean_rate.segment<3>(first);
    Vector3 start = rate_start.segment<3>(first), end = slope_end.segment<3>(first);
    if ((mean - 0.5 * (start + end)).norm() > kLargestMiss * Larger(start, end)) {
      path.jumps = path.jumps || start != mean;
      start = end = mean;
    }
    path.slope_start.segment<3>(first) = start;
    path.slope_end.segment<3>(first) = end;
  }
  return path;
}

Vector6 BasePath::RateAt(double share) const {
  const double s = share, t = 1 - share;
  Vector6 rate = t * slope_start + s * slope_end + 6 * s * t * (MeanRate() - 0.5 * (slope_start + slope_end));
  rate.head<3>() = DexpRotation(DisplacementAt(share).head<3>()) * rate.head<3>();
  return rate;
}

Vector6 BasePath::DisplacementAt(double share) const {
  const double s = share, t = 1 - share;
  return s * s * (3 - 2 * s) * shift + h * s * t * (t * slope_start - s * slope_end);
}

RigidTransform BasePath::PoseAt(double share) const {
  if (share >= 1) return X_end;
  const Vector6 at = DisplacementAt(share);
  return {Matrix3(ExpRotation(at.head<3>()) * X_start.rotation()),
          Vector3(X_start.translation() + at.tail<3>())};
}

std::optional<Vector6> BaseRateOf(const Vector6& coordinates, const Vector6& last_coordinates,
                                  const Vector6& derivatives) {
  Vector6 rate = derivatives;
  bool known = false;
  for (int i = 0; i < 6; ++i) {
    if (!std::isnan(rate(i))) {
      known = true;
      continue;
    }
    if (coordinates(i) != last_coordinates(i)) return std::nullopt;
    rate(i) = 0;
  }
  if (!known) return std::nullopt;
  Vector6 rate_W;
  rate_W << DexpRotation(coordinates.tail<3>()) * rate.tail<3>(), rate.head<3>();
  return rate_W;
}

}  // namespace fork1s
