// Reading the parts of a recording, for Recording::Open.
#pragma once

#include <fork1s/record/recording.hpp>

#include "columns.hpp"
#include "hdf5_file.hpp"

namespace fork1s::internal {

/// Names, scene and options; checks that they belong together. Throws Hdf5Fault.
Expected<RecordingHeader> ReadHeader(hid_t file, const std::string& path, const FileFacts& facts);
/// All whole steps. A file whose writer ended before its time may hold half a step at the end, which is left
/// out; in a finished one it is an error. Throws Hdf5Fault.
RecordedSteps ReadSteps(hid_t file, const RecordingHeader& header, const FileFacts& facts);

}  // namespace fork1s::internal
