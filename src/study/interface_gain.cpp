#include "study/interface_gain.hpp"

#include <algorithm>
#include <chrono>
#include <fork1s/reduction/frequencies.hpp>
#include <fork1s/sim/simulation.hpp>
#include <numbers>

#include <fmt/format.h>

#include "base/near_names.hpp"
#include "base/percentile.hpp"
#include "mechanism/rigid_groups.hpp"

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
      auto reduced = ReduceAtStart(posed, Without(kept, i));
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
    const bool touches = std::find(model.interfaces.begin(), model.interfaces.end(),
                                   BodyIndex(static_cast<int>(b))) != model.interfaces.end();
    gain.shaped += touches || internal::HasColliders(m.definition().bodies[b]);
  }
  gain.without_contact = NamesOf(m, internal::BodiesWithoutContact(m.definition(), model.interfaces));
  if (model.num_coordinates() <= kMostCoordinates) {
    const std::vector<double> hertz = FullFrequencies(m, posed.q, model.num_coordinates());
    if (!hertz.empty()) gain.fastest_hz = *std::max_element(hertz.begin(), hertz.end());
    if (gain.fastest_hz > 0) gain.explicit_step_s = 1 / (std::numbers::pi * gain.fastest_hz);
  }
  TryFewer(posed, model, gain);
  return gain;
}

std::vector<std::string> InterfaceGain::Sentences() const {
  const std::string simulated =
      coordinates < coordinates_full
          ? fmt::format(
                "{} of {} independent joint coordinates are simulated, the others follow their loads "
                "through load columns",
                coordinates, coordinates_full)
          : fmt::format("{} independent joint coordinate{} simulated, none left out",
                        coordinates == 1 ? "the one" : fmt::format("all {}", coordinates),
                        coordinates == 1 ? " is" : "s are");
  const std::string contact = touching < shaped ? fmt::format("{} of {} bodies", touching, shaped)
                              : touching == 1   ? "the one body"
                                                : fmt::format("all {} bodies", touching);
  std::vector<std::string> more;
  if (explicit_step_s > 0 && explicit_step_s < kWorthSaying * step_s)
    more.push_back(
        fmt::format("explicit steps diverge above {:.3g} ms (fastest spring {:.3g} Hz), implicit ones take "
                    "{:.3g} ms here",
                    1e3 * explicit_step_s, fastest_hz, 1e3 * step_s));
  // The most telling two: the longest list that is worth it, and the shortest.
  std::vector<const Choice*> told;
  for (const Choice& c : fewer)
    if (c.coordinates <= kWorthSaying * coordinates) told.push_back(&c);
  if (told.size() > 2) told = {told.front(), told.back()};
  for (const Choice* c : told)
    more.push_back(fmt::format("interface bodies {} leave {} coordinates{}", List(c->interfaces, ","),
                               c->coordinates,
                               c->modes > 0 ? fmt::format(", {} of them modes", c->modes) : ""));
  if (told.empty() && touching > 1)
    more.push_back(
        must_stay.empty()
            ? std::string("fewer interface bodies leave nearly as many coordinates")
            : fmt::format("{} cannot be left out: joints without a spring would move unseen; springs or "
                          "PD gains change that",
                          Quoted(must_stay)));
  std::vector<std::string> out{fmt::format("{}; contact at {} with shapes", simulated, contact)};
  if (!without_contact.empty())
    out.push_back(
        fmt::format("{} no interface and touch{} nothing: {}; name more interface "
                    "bodies, or run with detail all",
                    without_contact.size() == 1
                        ? "one body with colliding shapes is"
                        : fmt::format("{} bodies with colliding shapes are", without_contact.size()),
                    without_contact.size() == 1 ? "es" : "", Quoted(without_contact)));
  if (!more.empty()) out.push_back(fmt::format("{}", fmt::join(more, "; ")));
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
