#include <fork1s/study/interface_gain.hpp>

#include <algorithm>
#include <chrono>
#include <fork1s/base/percentile.hpp>
#include <fork1s/reduction/frequencies.hpp>
#include <fork1s/sim/simulation.hpp>
#include <numbers>

#include <fmt/format.h>

namespace fork1s {
namespace {

constexpr int kMostCoordinates = 200;  // of what is tried out: a reduction to all bodies is cubic in them
constexpr std::size_t kMostInterfaces = 12;
constexpr double kWorthSaying = 0.8;  // share of what there is that is a gain

std::string List(const std::vector<std::string>& names, const char* between) {
  std::string list;
  for (const std::string& n : names) list += (list.empty() ? "" : between) + n;
  return list;
}

std::string Quoted(const std::vector<std::string>& names) { return "'" + List(names, "', '") + "'"; }

std::vector<std::string> NamesOf(const Mechanism& m, const std::vector<BodyIndex>& bodies) {
  std::vector<std::string> names;
  for (const BodyIndex b : bodies) names.push_back(m.body(b).name);
  return names;
}

std::vector<BodyIndex> Without(std::vector<BodyIndex> bodies, std::size_t i) {
  bodies.erase(bodies.begin() + static_cast<std::ptrdiff_t>(i));
  return bodies;
}

// One body less each time, that one whose loss leaves the fewest coordinates.
void TryFewer(const PosedMechanism& posed, const ReducedModel& model, InterfaceGain& gain) {
  if (model.num_coordinates() > kMostCoordinates || model.interfaces.size() > kMostInterfaces) return;
  std::vector<BodyIndex> kept = model.interfaces;
  for (bool first = true; kept.size() > 1; first = false) {
    std::optional<ReducedModel> best;
    std::size_t dropped = 0;
    for (std::size_t i = 0; i < kept.size(); ++i) {
      ReductionOptions options;
      options.interfaces = Without(kept, i);
      auto reduced = Reduce(posed.mechanism, posed.q, options);
      if (!reduced) {
        if (first && reduced.error().code == ErrorCode::kUnderdetermined)
          gain.must_stay.push_back(posed.mechanism->body(kept[i]).name);
        continue;
      }
      if (best && best->size() <= reduced->size()) continue;
      best.emplace(std::move(*reduced));
      dropped = i;
    }
    if (!best) return;
    kept = Without(kept, dropped);
    const int before = gain.fewer.empty() ? gain.coordinates : gain.fewer.back().coordinates;
    if (best->size() < before)
      gain.fewer.push_back({NamesOf(*posed.mechanism, kept), best->size(), best->num_modes});
  }
}

}  // namespace

InterfaceGain MeasureInterfaceGain(const PosedMechanism& posed, const ReducedModel& model, double step_s) {
  const Mechanism& m = *posed.mechanism;
  InterfaceGain gain;
  gain.step_s = step_s;
  gain.coordinates_full = model.num_coordinates() - model.loop_rank();
  gain.coordinates = model.size();
  gain.touching = static_cast<int>(model.interfaces.size());
  for (std::size_t b = 0; b < m.definition().bodies.size(); ++b) {
    const auto& shapes = m.definition().bodies[b].geometries;
    const bool touches = std::find(model.interfaces.begin(), model.interfaces.end(),
                                   BodyIndex(static_cast<int>(b))) != model.interfaces.end();
    gain.shaped += touches || std::any_of(shapes.begin(), shapes.end(),
                                          [](const GeometryDef& g) { return g.Collides(); });
  }
  if (model.num_coordinates() <= kMostCoordinates) {
    const std::vector<double> hertz = FullFrequencies(m, posed.q, model.num_coordinates());
    if (!hertz.empty()) gain.fastest_hz = *std::max_element(hertz.begin(), hertz.end());
    if (gain.fastest_hz > 0) gain.explicit_step_s = 1 / (std::numbers::pi * gain.fastest_hz);
  }
  TryFewer(posed, model, gain);
  return gain;
}

std::vector<std::string> InterfaceGain::Sentences() const {
  std::vector<std::string> out;
  out.push_back(
      coordinates < coordinates_full
          ? fmt::format(
                "{} of {} joint coordinates are simulated, the others follow at rest with their loads",
                coordinates, coordinates_full)
      : coordinates == 1
          ? "its one joint coordinate moves an interface body and is simulated"
          : fmt::format("all {} joint coordinates move an interface body, so all are simulated and "
                        "nothing is left out",
                        coordinates));
  out.push_back(
      touching < shaped
          ? fmt::format("contact is looked for at {} of {} bodies that have shapes", touching, shaped)
          : fmt::format("contact is looked for at {}",
                        touching == 1 ? "the one body that has shapes"
                                      : fmt::format("all {} bodies that have shapes", touching)));
  if (explicit_step_s > 0 && explicit_step_s < kWorthSaying * step_s)
    out.push_back(
        fmt::format("its fastest spring swings at {:.3g} Hz: explicit steps diverge above {:.3g} ms, the "
                    "implicit ones here take {:.3g} ms",
                    fastest_hz, 1e3 * explicit_step_s, 1e3 * step_s));
  // The most telling two: the longest list that is worth it, and the shortest.
  std::vector<const Choice*> told;
  for (const Choice& c : fewer)
    if (c.coordinates <= kWorthSaying * coordinates) told.push_back(&c);
  if (told.size() > 2) told = {told.front(), told.back()};
  auto size = [](const Choice& c) {
    return c.modes > 0 ? fmt::format("{} coordinates, {} of them modes", c.coordinates, c.modes)
                       : fmt::format("{} coordinates", c.coordinates);
  };
  if (!told.empty()) {
    std::string text = "where fewer bodies touch, naming those alone gains more, for instance";
    for (std::size_t i = 0; i < told.size(); ++i)
      text += fmt::format("{} --interface {} leaves {}", i == 0 ? "" : ";", List(told[i]->interfaces, ","),
                          size(*told[i]));
    out.push_back(text);
  } else if (!must_stay.empty() && touching > 1) {
    out.push_back(
        fmt::format("{} cannot be left out: joints that no spring holds would move unseen by the others. "
                    "Springs or --pd change that ('fork1s inspect' lists what nothing holds)",
                    Quoted(must_stay)));
  } else if (touching > 1) {
    out.push_back("fewer interface bodies would leave as many coordinates: what is gained is contact alone");
  }
  return out;
}

std::optional<StepTimes> MeasureStepTimes(const Scene& scene, int initial_keyframe) {
  for (const MechanismDef& m : scene.mechanisms)
    if (static_cast<int>(m.joints.size()) > kMostCoordinates) return std::nullopt;
  SimulationOptions options;
  options.initial_keyframe = initial_keyframe;
  auto few = Simulation::Create(scene, options);
  options.detail = DetailLevel::kAll;
  auto all = Simulation::Create(scene, options);
  if (!few || !all) return std::nullopt;
  using Clock = std::chrono::steady_clock;
  constexpr auto kMoment = std::chrono::milliseconds(200);
  const auto begin = Clock::now();
  std::vector<double> few_us, all_us;
  bool finite = true;
  auto timed = [&](Simulation& simulation, std::vector<double>& us) {
    const auto start = Clock::now();
    finite &= simulation.Step().finite;
    us.push_back(std::chrono::duration<double, std::micro>(Clock::now() - start).count());
  };
  // By turns: what else the machine does slows both.
  for (int i = 0; i < 100 && finite && Clock::now() - begin < kMoment; ++i) {
    timed(*few, few_us);
    timed(*all, all_us);
  }
  if (!finite || few_us.size() < 10) return std::nullopt;
  return StepTimes{Median(few_us), Median(all_us), few->dt()};
}

}  // namespace fork1s
