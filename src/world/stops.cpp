#include "stops.hpp"
#include "stepping/step_context.hpp"

namespace fork1s {

void StopHistory::Resize(std::size_t limits, std::size_t frictions) {
  for (std::vector<double>* values : {&impulses, &start_gap}) values->assign(limits, 0.0);
  for (std::vector<char>* flags : {&carried, &is_fresh, &is_row}) flags->assign(limits, 0);
  for (std::vector<double>* values : {&friction_impulses, &friction_held}) values->assign(frictions, 0.0);
}

double MetersPerUnit(const MechanismDynamics& m, const Mechanism::Length& length) {
  return m.mechanism().IsAngle(length) ? m.mechanism().length_scale() : 1;
}

StopApproach ApproachOf(const MechanismDynamics& m, const Mechanism::LengthLimit& stop, bool upper,
                        bool at_stage_start) {
  const double scale = MetersPerUnit(m, stop.length), length = m.Length(stop.length),
               rate = at_stage_start ? LengthRateAtStageStart(m, stop.length) : LengthRate(m, stop.length);
  return {false,
          scale * (upper ? stop.upper - length : length - stop.lower),
          scale * (upper ? rate : -rate),
          0,
          m.mechanism().length_scale(),
          scale};
}

bool PassesStop(const std::vector<MechanismDynamics>& mechanisms, const std::vector<StopHistory>& stops) {
  for (std::size_t i = 0; i < mechanisms.size(); ++i) {
    const MechanismDynamics& m = mechanisms[i];
    if (m.step_model().parts.empty()) continue;
    const std::vector<char>& is_row = stops[i].is_row;
    for (std::size_t k = 0; k < m.length_limits().size(); ++k) {
      if (is_row[2 * k] && is_row[2 * k + 1]) continue;
      const Mechanism::LengthLimit& limit = m.length_limits()[k];
      const double length = m.Length(limit.length);
      if ((!is_row[2 * k] && length < limit.lower) || (!is_row[2 * k + 1] && length > limit.upper))
        return true;
    }
  }
  return false;
}

}  // namespace fork1s
