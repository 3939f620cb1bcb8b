#include <algorithm>
#include <cmath>
#include <fork1s/reduction/frequencies.hpp>
#include <lab/accuracy.hpp>

namespace fork1s {

Expected<FrequencyCurve> MeasureFrequencies(const StaticCase& c, const std::vector<int>& modes,
                                            ModeChoice choice, int count) {
  FrequencyCurve curve{c.name, choice, FullFrequencies(*c.mechanism, c.q0, count), {}};
  MechanismDef definition = c.mechanism->definition();
  definition.interfaces = {c.mechanism->body(c.body).name};
  definition.mode_choice = choice;
  auto built = BuildMechanism(definition);
  if (!built) return tl::unexpected(built.error());
  const auto mechanism = std::make_shared<const Mechanism>(std::move(*built));
  for (int k : modes) {
    ReductionOptions options;
    options.modes = k;
    auto model = Reduce(mechanism, c.q0, options);
    if (!model) return tl::unexpected(model.error());
    FrequencyCurve::Point point{model->num_modes, model->size(), {}};
    const std::vector<double> reduced = ReducedFrequencies(*model, count);
    for (std::size_t i = 0; i < std::min(reduced.size(), curve.full_hz.size()); ++i)
      point.percent.push_back(100 * std::abs(reduced[i] / curve.full_hz[i] - 1));
    curve.points.push_back(std::move(point));
  }
  return curve;
}

double Worst(const FrequencyCurve::Point& point) {
  return *std::max_element(point.percent.begin(), point.percent.end());
}

}  // namespace fork1s
