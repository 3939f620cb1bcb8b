// A model that is read in a process of its own: a file that crashes or stalls its reader, or makes it ask for too
// much memory, is an error and ends no session.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/importer/importer.hpp>
#include <functional>
#include <string>

namespace fork1s {

/// First argument of a program that calls RunReader.
inline constexpr const char* kReaderArgument = "read-model";

struct ChildReader {
  std::string program = "/proc/self/exe";  // calls RunReader where its first argument is kReaderArgument
  double max_time = 60;                    // s
  std::string time_option = "ChildReader::max_time";  // what messages call max_time
};

/// LoadMechanism in a child process. The child may take half of the memory of the machine, ChildReader::max_time
/// and 256 descriptors. `stop` is called every millisecond in the calling thread; the child is killed once it returns
/// true. Errors: those of LoadMechanism; kModel where the reader crashed, met a limit, was stopped or could not be
/// started.
Expected<ImportedScene> ReadInChild(const ChildReader& reader, const std::string& path,
                                    const ImportOptions& options, const std::function<bool()>& stop);

/// The child of ReadInChild: reads with `read`, LoadMechanism or a function like it. `argv` begins at
/// kReaderArgument. Returns its exit code.
int RunReader(int argc, char** argv,
              const std::function<Expected<ImportedScene>(const std::string&, const ImportOptions&)>& read);

}  // namespace fork1s
