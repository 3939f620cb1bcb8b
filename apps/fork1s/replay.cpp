#include <fmt/format.h>
#include <fork1s/record/recording.hpp>
#include <memory>

#include "output.hpp"
#include "print.hpp"

namespace fork1s::app {
namespace {

int RunReplay(const std::string& path, bool json) {
  auto recording = RecordingReader::Open(path);
  if (!recording) return Report(recording.error(), json);
  auto result = Replay(*recording);
  if (!result) return Report(result.error(), json);
  const RecordingHeader& header = recording->header();
  if (json) {
    const Json out = {
        {"steps", result->steps},
        {"identical", result->identical},
        {"first_difference_step",
         result->first_difference_step < 0 ? Json(nullptr) : Json(result->first_difference_step)},
        {"final_hash", fmt::format("{:016x}", result->final_hash)},
        {"finished", header.finished},
        {"program", header.program}};
    PrintText("{}\n", ToText(out, 2));
  } else {
    if (!header.finished)
      PrintText("the program that wrote this recording was stopped; it holds {} whole steps\n",
                result->steps);
    PrintText("replayed {} steps, final state hash {:016x}: ", result->steps, result->final_hash);
    if (result->identical)
      PrintText("every step is identical to the recording\n");
    else
      PrintText("the state differs from the recording from step {} on\n", result->first_difference_step);
  }
  return result->identical ? kDone : kNumericsFailed;
}

}  // namespace

void AddReplay(CLI::App& app, Action& action) {
  auto* command = app.add_subcommand("replay", "simulate a recording again and compare every state with it");
  auto path = std::make_shared<std::string>();
  auto json = std::make_shared<bool>(false);
  command->add_option("recording", *path, "HDF5 file of 'fork1s run --record'")->required();
  command->add_flag("--json", *json, "print one JSON object and nothing else");
  command->callback([&action, path, json] { action = [path, json] { return RunReplay(*path, *json); }; });
}

}  // namespace fork1s::app
