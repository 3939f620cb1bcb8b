// What every subcommand offers to the program.
#pragma once

#include <CLI/CLI.hpp>
#include <fork1s/base/error.hpp>
#include <functional>
#include <string>

namespace fork1s::app {

enum ExitCode { kDone = 0, kBadUsage = 2, kRefused = 3, kNumericsFailed = 4 };

/// Adds a subcommand; `action` is set to what runs it and returns the exit code.
using Action = std::function<int()>;
void AddInspect(CLI::App& app, Action& action);
void AddReduce(CLI::App& app, Action& action);
void AddStatics(CLI::App& app, Action& action);
void AddRun(CLI::App& app, Action& action);
void AddCompare(CLI::App& app, Action& action);
void AddReplay(CLI::App& app, Action& action);
void AddExport(CLI::App& app, Action& action);
void AddView(CLI::App& app, Action& action);
void AddBench(CLI::App& app, Action& action);

/// Prints the error to standard error (and, with json, as an object to standard output); returns its exit
/// code.
int Report(const Error& error, bool json);

}  // namespace fork1s::app
