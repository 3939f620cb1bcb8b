#include "run_inputs.hpp"

#include <fmt/format.h>

#include <cmath>
#include <fork1s/record/csv.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <optional>

namespace fork1s::app {
namespace {

std::string List(const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& n : names) list += (list.empty() ? "" : ", ") + n;
  return list.empty() ? "none" : list;
}

std::string BodyNames(const Simulation& simulation) {
  constexpr std::size_t kMost = 40;
  std::vector<std::string> names;
  for (const SceneBody& b : simulation.bodies()) {
    if (names.size() == kMost) {
      names.push_back("...");
      break;
    }
    names.push_back(b.name);
  }
  return List(names);
}

struct Range {
  double lower, upper;
};

// Nothing for driven bases, whose coordinates have none.
std::optional<Range> RangeOf(const Simulation& simulation, const std::string& control) {
  for (const MechanismDynamics& m : simulation.world().mechanisms())
    for (const auto& c : m.mechanism().controls())
      if (c.name == control) return Range{c.lower, c.upper};
  return std::nullopt;
}

// What a column asks for beyond the range, at its worst before `time`.
std::string Beyond(const ControlTrack& track, std::size_t column, const Range& range, double time) {
  double worst = 0, value = 0, when = 0;
  for (std::size_t i = 0; i < track.times.size(); ++i) {
    if (track.times[i] > time) break;
    const double v = track.rows[i][column], off = std::max(v - range.upper, range.lower - v);
    if (!(off > worst)) continue;
    worst = off;
    value = v;
    when = track.times[i];
  }
  // What rounding of a table written with six digits leaves is nobody's wish.
  if (!(worst > 1e-6 * std::max(1.0, std::abs(value)))) return "";
  return fmt::format(
      "asks '{}' for {:.6g} at {:.6g} s; its range is {:.6g} to {:.6g}, and it is held at {:.6g}",
      track.names[column], value, when, range.lower, range.upper,
      value > range.upper ? range.upper : range.lower);
}

}  // namespace

Expected<RunInputs> ReadInputs(const InputArguments& args) {
  RunInputs inputs;
  if (!args.detail.empty()) {
    Fidelity initial;
    initial.recovery = args.recovery;
    auto read = FidelityTrack::Parse(args.detail, initial);
    if (!read) return tl::unexpected(read.error());
    inputs.detail = std::move(*read);
  }
  if (!args.controls.empty()) {
    auto read = ReadControls(args.controls);
    if (!read) return tl::unexpected(read.error());
    auto pushes = PushTrack::ExtractFrom(*read, args.controls);
    if (!pushes) return tl::unexpected(pushes.error());
    inputs.controls = std::move(*read);
    inputs.pushes.push_back(std::move(*pushes));
  } else {
    inputs.pushes.emplace_back();
  }
  inputs.pushes.emplace_back();
  for (const std::string& text : args.pushes) {
    auto push = PushTrack::Parse(text, "--push");
    if (!push) return tl::unexpected(push.error());
    inputs.pushes.back().pushes.push_back(std::move(*push));
  }
  return inputs;
}

Expected<void> CheckInputs(const RunInputs& inputs, const InputArguments& args,
                           const Simulation& simulation) {
  if (const auto missing = inputs.controls.FindMissing(simulation); !missing.empty())
    return Fail(ErrorCode::kModel, args.controls,
                fmt::format("column '{}' is no control of this model; there are: {}", missing.front(),
                            List(simulation.control_names())));
  for (std::size_t i = 0; i < inputs.pushes.size(); ++i)
    if (const auto missing = inputs.pushes[i].FindMissing(simulation); !missing.empty())
      return Fail(i == 0 ? ErrorCode::kModel : ErrorCode::kUsage, i == 0 ? args.controls : "--push",
                  fmt::format("the model has no body '{}' to push; there are: {}", missing.front(),
                              BodyNames(simulation)));
  return {};
}

std::vector<std::string> InputLimits(const RunInputs& inputs, const InputArguments& args,
                                     const Simulation& simulation, double time) {
  std::vector<std::string> out;
  const ControlTrack& track = inputs.controls;
  for (std::size_t k = 0; k < track.names.size(); ++k)
    if (const auto range = RangeOf(simulation, track.names[k]))
      if (const std::string beyond = Beyond(track, k, *range, time); !beyond.empty())
        out.push_back(args.controls + " " + beyond);
  const double rounding = 1e-9 * std::max(1.0, time);
  if (!track.times.empty() && track.times.back() > time + rounding)
    out.push_back(
        fmt::format("{} goes on to {:.6g} s and the run ends at {:.6g} s: lengthen --time to see the "
                    "rest",
                    args.controls, track.times.back(), time));
  for (std::size_t i = 0; i < args.pushes.size(); ++i) {
    const Push& push = inputs.pushes.back().pushes[i];
    if (push.from >= time - rounding)
      out.push_back(fmt::format("--push {} begins after the end of the run at {:.6g} s, and does nothing",
                                args.pushes[i], time));
    else if (std::isfinite(push.to) && push.to > time + rounding)
      out.push_back(fmt::format("--push {} goes on to {:.6g} s and the run ends at {:.6g} s", args.pushes[i],
                                push.to, time));
  }
  for (const FidelityTrack::Entry& e : inputs.detail.entries)
    if (e.time > time - rounding)
      out.push_back(fmt::format("--detail names {} s, after the end of the run at {:.6g} s", e.time, time));
  return out;
}

}  // namespace fork1s::app
