// The beginning of a recording.
#pragma once

#include <fork1s/record/recording.hpp>
#include <new>

#include "columns.hpp"
#include "hdf5_file.hpp"

namespace fork1s::internal {

/// Names, scene and options; checks that they belong together. Throws Hdf5Fault.
Expected<RecordingHeader> ReadHeader(hid_t file, const std::string& path, const FileFacts& facts);

struct OpenRecording {
  Hdf5 file;
  FileFacts facts;
  RecordingHeader header;
};
/// Opens the file, also while its writer lives, and reads its header.
Expected<OpenRecording> OpenRecordingFile(const std::string& path);

/// What `work` returns, or what it throws as an error that names the file.
template <class Work>
auto Guarded(const std::string& path, Work&& work) -> decltype(work()) {
  const QuietHdf5 quiet;
  try {
    return work();
  } catch (const Hdf5Fault& e) {
    return Fail(e.code(), path,
                std::string(e.what()) + (e.code() == ErrorCode::kFormat
                                             ? "; the file is cut off or damaged, copy or record it again"
                                             : ""));
  } catch (const std::bad_alloc&) {
    return Fail(
        ErrorCode::kFile, path,
        "does not fit into memory; replay it and export its tables, which take it piece by piece, or open it "
        "on a machine that has more");
  } catch (const std::exception& e) {
    return Fail(ErrorCode::kFormat, path,
                std::string("cannot be read (") + e.what() + "); the file is damaged");
  }
}

}  // namespace fork1s::internal
