#include <algorithm>
#include <fork1s/sim/simulation.hpp>

namespace fork1s {

std::vector<std::string> ControlTrack::FindMissing(const Simulation& simulation) const {
  std::vector<std::string> missing;
  for (const std::string& name : names)
    if (simulation.FindControl(name) < 0) missing.push_back(name);
  return missing;
}

void ControlTrack::Apply(double time, Simulation& simulation) const {
  if (times.empty()) return;
  const auto after =
      static_cast<std::size_t>(std::upper_bound(times.begin(), times.end(), time) - times.begin());
  for (std::size_t i = 0; i < names.size(); ++i) {
    const int control = simulation.FindControl(names[i]);
    if (control < 0) continue;
    double value;
    if (after == 0) {
      value = rows.front()[i];
    } else if (after == times.size()) {
      value = rows.back()[i];
    } else {
      const double share = (time - times[after - 1]) / (times[after] - times[after - 1]);
      value = rows[after - 1][i] + share * (rows[after][i] - rows[after - 1][i]);
    }
    simulation.SetControl(control, value);
  }
}

}  // namespace fork1s
