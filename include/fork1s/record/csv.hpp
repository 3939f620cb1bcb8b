// Tables for other programs, and control inputs from them.
#pragma once

#include <fork1s/record/recording.hpp>
#include <string>

namespace fork1s {

struct CsvOptions {
  bool all_bodies = false;  // false: poses of interface bodies and free bodies only
};

/// Writes into `directory` (made if need be) poses.csv, contacts.csv, pairs.csv, controls.csv, sensors.csv and
/// energy.csv; numbers have the digits that give the same double back. Bodies that share a name are written as
/// MECHANISM/BODY. Errors: kFile.
Expected<void> ExportCsv(const Recording& recording, const std::string& directory,
                         const CsvOptions& options = {});
/// The same from the file, whatever its length; returns the number of steps. Errors: also those of the
/// reader.
Expected<std::int64_t> ExportCsv(RecordingReader& reader, const std::string& directory,
                                 const CsvOptions& options = {});

/// Reads a table with the header `time,NAME,...`: time in seconds, increasing, and one column per control, in
/// any order of columns. Lines that begin with # and empty lines are skipped; names with commas stand in
/// "quotes". Errors: kFile; kFormat names file, line and column.
Expected<ControlTrack> ReadControls(const std::string& path);

}  // namespace fork1s
