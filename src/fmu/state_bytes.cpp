// States of an instance as bytes: a line of format and version, one of the unit, one of a checksum, then the content.
#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "fmi/array_bytes.hpp"
#include "fmi/resources.hpp"
#include "instance.hpp"
#include "record/simulation_bytes.hpp"

namespace fork1s::fmu {
namespace {

using internal::ValueOrThrow;

constexpr std::string_view kFormat = "state of a unit of fork1s ";
constexpr std::string_view kVersion = FORK1S_VERSION;

[[noreturn]] void RefuseDamage() {
  Misuse("the bytes of the state are damaged or cut off; pass all that were written, unchanged");
}

std::string ChecksumOf(const std::string& content) { return fmi::TokenOf({{"content", content}}); }

// Takes a line off the front of `rest`.
std::string_view ReadLine(std::string_view& rest) {
  const auto end = rest.find('\n');
  if (end == std::string_view::npos) RefuseDamage();
  const std::string_view line = rest.substr(0, end);
  rest.remove_prefix(end + 1);
  return line;
}

void RequireVersion(std::string_view line) {
  if (line.substr(0, kFormat.size()) != kFormat) RefuseDamage();
  const std::string_view version = line.substr(kFormat.size());
  if (version == kVersion) return;
  if (!std::all_of(version.begin(), version.end(), [](char c) { return c > ' ' && c < 127; })) RefuseDamage();
  Misuse("the state was written by version " + std::string(version) + " of fork1s, and this is " +
         std::string(kVersion) + "; read it by a unit of its version, or write it again");
}

}  // namespace

// Values of inputs alone: the rest follows from the simulation. The scene is that of the unit.
std::string Instance::WriteState(const State& state) const {
  RequireOwn(state);
  fmi::ArrayWriter content;
  content.Number(static_cast<std::int32_t>(state.phase));
  content.Number(state.start_time);
  for (std::size_t i = 0; i < values_.size(); ++i) {
    if (variables_.all[i].causality != fmi::Causality::kInput) continue;
    content.Number(state.inputs[i]);
    content.Number(state.derivatives[i]);
  }
  for (const double value : state.report) content.Number(value);
  Simulation::Snapshot moment = state.simulation;
  moment.made_of = nullptr;
  content.Text(WriteBatchBytes({simulation_.options(), {std::move(moment)}}));
  std::string bytes;
  for (const std::string& line :
       {std::string(kFormat) + std::string(kVersion), token_, ChecksumOf(content.bytes)})
    bytes += line + '\n';
  return bytes + content.bytes;
}

std::unique_ptr<Instance::State> Instance::ReadState(const std::string& bytes) const {
  std::string_view rest = bytes;
  RequireVersion(ReadLine(rest));
  if (ReadLine(rest) != token_)
    Misuse(
        "the state is of another unit, that of another model or of other options; read it by an instance of its "
        "own unit");
  const std::string checksum(ReadLine(rest)), content(rest);
  if (ChecksumOf(content) != checksum) RefuseDamage();
  auto state = std::make_unique<State>();
  state->inputs.resize(values_.size());
  state->derivatives.resize(values_.size());
  std::string moment;
  try {
    fmi::ArrayReader in(content);
    const auto phase = in.Number<std::int32_t>();
    if (phase < 0 || phase > static_cast<std::int32_t>(Phase::kTerminated)) RefuseDamage();
    state->phase = static_cast<Phase>(phase);
    state->start_time = in.Number<double>();
    for (std::size_t i = 0; i < values_.size(); ++i) {
      const fmi::Variable& variable = variables_.all[i];
      const bool is_input = variable.causality == fmi::Causality::kInput;
      state->inputs[i] = is_input ? in.Number<double>() : variable.start;
      if (is_input) state->derivatives[i] = in.Number<double>();
    }
    for (double& value : state->report) value = in.Number<double>();
    moment = in.Text();
  } catch (const std::runtime_error&) {
    RefuseDamage();
  }
  BatchContent batch = ValueOrThrow(ReadBatchBytes(moment, "state"));
  if (batch.snapshots.size() != 1) RefuseDamage();
  state->simulation = std::move(batch.snapshots[0]);
  ValueOrThrow(CompleteSnapshot(simulation_.Save(), "state", state->simulation));
  return state;
}

std::size_t CountStateBytes(const Instance& instance, const void* state) {
  RequireGiven(state, "the state");
  return instance.WriteState(*static_cast<const Instance::State*>(state)).size();
}

void WriteStateBytes(const Instance& instance, const void* state, void* place, std::size_t size) {
  RequireGiven(state, "the state");
  RequireGiven(place, "the place of the bytes");
  const std::string bytes = instance.WriteState(*static_cast<const Instance::State*>(state));
  if (size != bytes.size())
    Misuse("the place has " + std::to_string(size) + " bytes and needs " + std::to_string(bytes.size()) +
           "; ask for the size first");
  std::copy(bytes.begin(), bytes.end(), static_cast<char*>(place));
}

void ReadStateBytes(const Instance& instance, const void* bytes, std::size_t size, void** state) {
  RequireGiven(bytes, "the array of bytes");
  RequireGiven(state, "the place of the state");
  *state = instance.ReadState(std::string(static_cast<const char*>(bytes), size)).release();
}

}  // namespace fork1s::fmu
