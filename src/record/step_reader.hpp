// The steps of a recording, one stretch after the other.
#pragma once

#include <array>
#include <cstdint>
#include <fork1s/record/recording.hpp>
#include <vector>

#include "columns.hpp"
#include "hdf5_file.hpp"

namespace fork1s::internal {

/// Every step is held against its checksum. A file whose writer ended before its time may hold half a step at
/// the end: the last whole one is the end then; in a finished file it is an error. Throws Hdf5Fault.
class StepReader {
 public:
  StepReader(hid_t file, const RecordingHeader& header, const FileFacts& facts);

  /// As the file says it.
  std::size_t steps() const { return available_[0]; }
  /// Steps of which about so many bytes are read.
  std::size_t StepsIn(std::size_t bytes) const;
  /// The next steps, at most `count`; none at the end.
  RecordedSteps Next(std::size_t count);

 private:
  static constexpr std::size_t kUnknown = static_cast<std::size_t>(-1);
  using Ends = std::array<std::int64_t, kNumRows - 1>;  // rows of the tables before some step

  RecordedSteps Read(std::size_t count) const;
  RecordedSteps ReadWhatCanBeRead(std::size_t count) const;
  void ReadKind(RecordedSteps& s, Rows kind, std::size_t first, std::size_t rows) const;
  std::size_t CountCoherent(const RecordedSteps& s) const;
  std::size_t CountIntact(const RecordedSteps& s) const;
  void Shorten(RecordedSteps& s, std::size_t steps) const;

  Widths widths_;
  bool finished_;
  std::size_t most_;
  std::vector<Hdf5> datasets_;
  std::size_t available_[kNumRows] = {kUnknown, kUnknown, kUnknown, kUnknown, kUnknown};
  std::size_t done_ = 0;  // steps read
  Ends before_{};         // rows of those
  bool ended_ = false;
};

}  // namespace fork1s::internal
