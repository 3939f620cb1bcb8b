#include <fork1s/record/recording.hpp>

#include "recording_file.hpp"
#include "step_reader.hpp"

namespace fork1s {

using namespace internal;

struct RecordingReader::Detail {
  OpenRecording open;
  std::optional<StepReader> steps;
  std::size_t stretch = 0;
};

RecordingReader::RecordingReader() : detail_(std::make_unique<Detail>()) {}
RecordingReader::RecordingReader(RecordingReader&&) noexcept = default;
RecordingReader& RecordingReader::operator=(RecordingReader&&) noexcept = default;
RecordingReader::~RecordingReader() = default;

Expected<RecordingReader> RecordingReader::Open(const std::string& path, std::size_t bytes) {
  return Guarded(path, [&]() -> Expected<RecordingReader> {
    auto open = OpenRecordingFile(path);
    if (!open) return tl::unexpected(open.error());
    RecordingReader reader;
    Detail& d = *reader.detail_;
    d.open = std::move(*open);
    d.steps.emplace(d.open.file.id(), d.open.header, d.open.facts);
    d.stretch = d.steps->StepsIn(bytes);
    return reader;
  });
}

const RecordingHeader& RecordingReader::header() const { return detail_->open.header; }

Expected<Recording> RecordingReader::Next() {
  Detail& d = *detail_;
  return Guarded(d.open.header.path, [&]() -> Expected<Recording> {
    Recording part;
    part.header_ = d.open.header;
    part.data_ = d.steps->Next(d.stretch);
    return part;
  });
}

}  // namespace fork1s
