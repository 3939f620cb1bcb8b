#include "step_reader.hpp"

#include <algorithm>

namespace fork1s::internal {

Widths WidthsOf(const RecordingHeader& header) {
  Widths n;
  n.controls = static_cast<int>(header.control_names.size());
  n.base_rates =
      6 * static_cast<int>(std::count_if(header.scene.mechanisms.begin(), header.scene.mechanisms.end(),
                                         [](const auto& m) { return m.base == BaseKind::kDriven; }));
  n.bodies = static_cast<int>(header.bodies.size());
  n.mechanisms = static_cast<int>(header.scene.mechanisms.size());
  n.coordinates = static_cast<int>(header.coordinate_names.size());
  n.sensors = static_cast<int>(header.sensor_names.size());
  return n;
}

namespace {

// Rows of a dataset, after its other dimensions were compared with those of the scene.
std::size_t RowsOf(const Hdf5& dataset, const Column& column) {
  const Dims dims = DimsOf(dataset);
  hsize_t width = 1;
  for (std::size_t i = 1; i < dims.size(); ++i) width *= dims[i];
  if (dims.empty() || width != static_cast<hsize_t>(column.width))
    throw Hdf5Fault(std::string("'") + column.name + "' does not have the size that the scene asks for");
  return static_cast<std::size_t>(dims[0]);
}

std::array<std::vector<std::int64_t>*, kNumRows - 1> EndsOf(RecordedSteps& s) {
  return {&s.reduced_end, &s.contact_end, &s.wrench_end, &s.point_spring_end};
}
std::array<const std::vector<std::int64_t>*, kNumRows - 1> EndsOf(const RecordedSteps& s) {
  return {&s.reduced_end, &s.contact_end, &s.wrench_end, &s.point_spring_end};
}

}  // namespace

StepReader::StepReader(hid_t file, const RecordingHeader& header, const FileFacts& facts)
    : widths_(WidthsOf(header)), finished_(header.finished), most_(facts.MostBytes()) {
  RecordedSteps none;
  ForEachColumn(none, widths_, [&](const Column& column, auto&) {
    datasets_.push_back(column.width > 0 ? OpenDataset(file, column.name) : Hdf5());
    if (column.width == 0) return;
    auto& least = available_[static_cast<std::size_t>(column.rows)];
    const std::size_t rows = RowsOf(datasets_.back(), column);
    if (finished_ && least != kUnknown && least != rows)
      throw Hdf5Fault(std::string("'") + column.name + "' has another length than the arrays beside it");
    least = std::min(least, rows);
  });
}

std::size_t StepReader::StepsIn(std::size_t bytes) const {
  std::size_t of_one = 1;
  RecordedSteps none;
  ForEachColumn(none, widths_, [&](const Column& column, auto& values) {
    using T = typename std::decay_t<decltype(values)>::value_type;
    if (column.rows == Rows::kSteps) of_one += sizeof(T) * static_cast<std::size_t>(column.width);
  });
  return std::max<std::size_t>(1, bytes / of_one);
}

RecordedSteps StepReader::Next(std::size_t count) {
  count = ended_ ? 0 : std::min(count, steps() - done_);
  if (count == 0) return {};
  RecordedSteps s = finished_ ? Read(count) : ReadWhatCanBeRead(count);
  if (s.time.empty() && done_ == 0)
    throw Hdf5Fault("none of its " + std::to_string(steps()) + " steps is whole");
  ended_ = s.time.size() < count;
  done_ += s.time.size();
  // From here on, rows count from the first of this stretch.
  const auto ends = EndsOf(s);
  for (std::size_t k = 0; k < ends.size(); ++k) {
    const std::int64_t base = before_[k];
    if (!ends[k]->empty()) before_[k] = ends[k]->back();
    for (std::int64_t& end : *ends[k]) end -= base;
  }
  return s;
}

// Where pages of the file are missing, the most steps that can be read are found by bisection.
RecordedSteps StepReader::ReadWhatCanBeRead(std::size_t count) const {
  try {
    return Read(count);
  } catch (const Hdf5Fault&) {
    RecordedSteps best;
    std::size_t good = 0, bad = count;
    while (bad - good > 1) {
      const std::size_t middle = good + (bad - good) / 2;
      try {
        best = Read(middle);
        good = middle;
      } catch (const Hdf5Fault&) {
        bad = middle;
      }
    }
    return best;
  }
}

// The whole ones among the next `count` steps.
RecordedSteps StepReader::Read(std::size_t count) const {
  RecordedSteps s;
  ReadKind(s, Rows::kSteps, done_, count);
  Shorten(s, CountCoherent(s));
  constexpr Rows kTables[] = {Rows::kReduced, Rows::kContacts, Rows::kWrenches, Rows::kPointSprings};
  const auto ends = EndsOf(s);
  for (std::size_t k = 0; k < ends.size(); ++k)
    if (!ends[k]->empty())
      ReadKind(s, kTables[k], static_cast<std::size_t>(before_[k]),
               static_cast<std::size_t>(ends[k]->back() - before_[k]));
  const std::size_t good = CountIntact(s);
  if (finished_ && good < count)
    throw Hdf5Fault("step " + std::to_string(done_ + good + 1) +
                    " does not match its checksum, or holds what no run writes");
  Shorten(s, good);
  return s;
}

void StepReader::ReadKind(RecordedSteps& s, Rows kind, std::size_t first, std::size_t rows) const {
  std::size_t next = 0, bytes = 0;
  ForEachColumn(s, widths_, [&](const Column& column, auto& values) {
    using T = typename std::decay_t<decltype(values)>::value_type;
    const Hdf5& dataset = datasets_[next++];
    if (column.rows != kind || column.width == 0) return;
    const std::size_t row_bytes = sizeof(T) * static_cast<std::size_t>(column.width);
    if (rows > most_ / row_bytes)
      throw Hdf5Fault(std::string("'") + column.name + "' says it is larger than its file");
    bytes += rows * row_bytes;
    if (bytes > most_) throw Hdf5Fault("the recording says that it is larger than its file");
    values.resize(rows * static_cast<std::size_t>(column.width));
    if (rows > 0) ReadRows(dataset, MemoryType<T>(), first, rows, values.data());
  });
}

// Steps whose table rows exist and whose numbers of rows agree.
std::size_t StepReader::CountCoherent(const RecordedSteps& s) const {
  Ends before = before_;
  const auto ends = EndsOf(s);
  const auto m = static_cast<std::size_t>(widths_.mechanisms);
  for (std::size_t i = 0; i < s.time.size(); ++i) {
    for (std::size_t k = 0; k + 1 < kNumRows; ++k) {
      const std::int64_t end = (*ends[k])[i];
      if (end < before[k] || static_cast<std::size_t>(end) > available_[k + 1]) return i;
      if (k == 0) {
        std::int64_t sum = 0;
        for (std::size_t j = 0; j < m; ++j) {
          if (s.reduced_sizes[i * m + j] < 0) return i;
          sum += s.reduced_sizes[i * m + j];
        }
        if (sum != end - before[0]) return i;
      }
      before[k] = end;
    }
  }
  return s.time.size();
}

std::size_t StepReader::CountIntact(const RecordedSteps& s) const {
  const auto ends = EndsOf(s);
  const auto bodies = static_cast<int>(widths_.bodies);
  StepRows rows;
  for (std::size_t i = 0; i < s.time.size(); ++i) {
    rows.first[0] = i;
    rows.last[0] = i + 1;
    for (std::size_t k = 0; k + 1 < kNumRows; ++k) {
      rows.first[k + 1] = rows.last[k + 1];
      rows.last[k + 1] = static_cast<std::size_t>((*ends[k])[i] - before_[k]);
    }
    if (StepChecksum(s, widths_, rows) != s.checksum[i]) return i;
    if (s.detail[i] > static_cast<std::uint8_t>(DetailLevel::kAll) || s.recovery[i] >= kNumRecoveries)
      return i;
    for (std::size_t c = rows.first[2]; c < rows.last[2]; ++c)
      for (int b : {s.contact_body_a[c], s.contact_body_b[c]})
        if (b < -1 || b >= bodies) return i;
    for (std::size_t c = rows.first[3]; c < rows.last[3]; ++c)
      if (s.wrench_body[c] < 0 || s.wrench_body[c] >= bodies) return i;
    for (std::size_t c = rows.first[4]; c < rows.last[4]; ++c)
      if (s.point_spring_body[c] < 0 || s.point_spring_body[c] >= bodies) return i;
  }
  return s.time.size();
}

void StepReader::Shorten(RecordedSteps& s, std::size_t steps) const {
  if (steps == s.time.size()) return;
  std::size_t rows[kNumRows] = {steps};
  const auto ends = EndsOf(s);
  for (std::size_t k = 0; k + 1 < kNumRows && steps > 0; ++k)
    rows[k + 1] = static_cast<std::size_t>((*ends[k])[steps - 1] - before_[k]);
  ForEachColumn(s, widths_, [&](const Column& column, auto& values) {
    const std::size_t size =
        rows[static_cast<std::size_t>(column.rows)] * static_cast<std::size_t>(column.width);
    if (values.size() > size) values.resize(size);
  });
}

}  // namespace fork1s::internal
