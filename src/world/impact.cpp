#include "impact.hpp"

#include <algorithm>
#include <cmath>

namespace fork1s {
namespace {

// An overlap of less than this share of the size of a pair is rounding, or what the search for contacts leaves open.
constexpr double kRoundingShare = 1e-6;

StepSubject ContactOf(const ContactPoint& p) { return {StepSubject::Kind::kContact, p.body_a, p.body_b}; }
StepSubject StopOf(const StopApproach& stop) { return {StepSubject::Kind::kStop, stop.mechanism, stop.stop}; }

}  // namespace

// What closes a gap by less than material.depth in a step is no impact: contacts that last press in by up to
// that, by how much depends on the step. In a short step that would be any speed: what is faster than what falls
// through that depth is an impact however short the step is.
void Approaches::SetSpeeds(const StepOptions& step) {
  const double depth = step.material.depth, fall = std::sqrt(2 * step.gravity.norm() * depth);
  impact_speed = fall > 0 ? std::min(depth / step.h, fall) : depth / step.h;
  carried_speed = std::max(step.gravity.norm() * step.h / 8, impact_speed);
}

PredictedImpact FindPredictedImpact(const ImpactView& at) {
  PredictedImpact first;
  for (std::size_t i = 0; i < at.detection.points.size(); ++i) {
    const ContactPoint& p = at.detection.points[i];
    const double closing = at.approaches.closing[i];
    if (p.gap < first.time * closing && closing > at.approaches.impact_speed && !at.CarriedLoad(i))
      first = {ContactOf(p), p.gap / closing};
  }
  return first;
}

StepSubject FindImpact(const ImpactView& at, double h) {
  const double least = at.approaches.impact_speed;
  for (std::size_t k = 0; k < at.approaches.stops.size(); ++k) {
    const StopApproach& stop = at.approaches.stops[k];
    if (!stop.bore && at.rows.limits[k].impulse > 0 && (stop.speed > least || stop.gap > h * least))
      return StopOf(stop);
  }
  for (std::size_t i = 0; i < at.detection.points.size(); ++i) {
    if (!(at.rows.contacts[i].impulse(0) > 0) || at.CarriedLoad(i)) continue;
    const ContactPoint& p = at.detection.points[i];
    if (at.approaches.closing[i] > least || p.gap > h * least) return ContactOf(p);
  }
  return {};
}

StepSubject FindParting(const ImpactView& at, const std::vector<StopHistory>& stops) {
  for (std::size_t i = 0; i < at.detection.points.size(); ++i) {
    const int before = at.history.match[i];
    if (before < 0 || !at.history.is_fresh[static_cast<std::size_t>(before)] ||
        at.rows.contacts[i].impulse(0) > 0)
      continue;
    const ContactPoint& p = at.detection.points[i];
    if (RelativeSpeed(at.rows.contacts[i], at.rows.velocities)(0) >
        kPartingRate * at.detection.shapes.PairSize(p))
      return ContactOf(p);
  }
  for (std::size_t i = 0; i < at.rows.mechanisms.size(); ++i) {
    std::size_t k = at.rows.mechanisms[i].first_limit;
    for (const PartRows& part : at.rows.mechanisms[i].parts) {
      for (const int which : part.limits) {
        const LimitConstraint& limit = at.rows.limits[k];
        const StopApproach& stop = at.approaches.stops[k++];
        if (stops[i].is_fresh[static_cast<std::size_t>(which)] && !(limit.impulse > 0) &&
            stop.scale * limit.sign * at.rows.velocities(limit.row) > kPartingRate * stop.size)
          return {StepSubject::Kind::kStop, static_cast<int>(i), which / 2};
      }
      k += part.frictions.size();
    }
  }
  return {};
}

StepSubject FindBeyondAtBasePoint(const ImpactView& at, double h, bool contacts) {
  for (const StopApproach& stop : at.approaches.stops)
    if (!stop.bore && stop.base_gap < -h * at.approaches.impact_speed) return StopOf(stop);
  for (std::size_t i = 0; contacts && i < at.detection.points.size(); ++i) {
    const ContactPoint& p = at.detection.points[i];
    if (!at.CarriedLoad(i) && p.gap < -h * at.approaches.impact_speed) return ContactOf(p);
  }
  return {};
}

bool MayHavePassed(const ImpactView& at, double h) {
  const Detection& d = at.detection;
  std::size_t end = 0;
  for (std::size_t begin = 0; begin < d.points.size(); begin = end) {
    bool carried_load = false;
    for (end = begin; end < d.points.size() && Shapes(d.points[end]) == Shapes(d.points[begin]); ++end)
      carried_load = carried_load || at.CarriedLoad(end);
    const double motion = d.PairMotion(d.points[begin].body_a, d.points[begin].body_b);
    for (std::size_t i = begin; i < end; ++i) {
      const ContactPoint& p = d.points[i];
      if (p.gap < motion && !at.CarriedLoad(i) && motion > 0.5 * d.shapes.InnerPairSize(p)) return true;
      if (!carried_load && p.gap < -kRoundingShare * d.shapes.PairSize(p) &&
          p.gap + h * RelativeSpeed(at.rows.contacts[i], at.rows.velocities)(0) < 0)
        return true;
    }
  }
  return false;
}

StepSubject FindTunnelling(const ImpactView& at) {
  const Detection& d = at.detection;
  for (std::size_t i = 0; i < d.points.size(); ++i) {
    const ContactPoint& p = d.points[i];
    const double most = 0.5 * d.shapes.InnerPairSize(p);
    if (!(d.PairMotion(p.body_a, p.body_b) > most)) continue;
    const auto moved = [&](const Vector3& p_W) -> Vector3 {
      return d.MotionInStage(p.body_a, p_W) - d.MotionInStage(p.body_b, p_W);
    };
    if (!(at.approaches.pose_gaps[i] + p.frame.row(0) * moved(p.point) < -most)) continue;
    // A spinning body may turn about the point.
    for (const Vector3& p_W : {p.point, d.poses[static_cast<std::size_t>(p.body_a)].translation(),
                               d.poses[static_cast<std::size_t>(p.body_b)].translation()})
      if (moved(p_W).norm() > most) return ContactOf(p);
  }
  return {};
}

}  // namespace fork1s
