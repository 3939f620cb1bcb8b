#include "recording_file.hpp"

#include <algorithm>

#include "model_store.hpp"

namespace fork1s::internal {
namespace {

// What a damaged file may make us allocate.
std::size_t MostBytes(const FileFacts& facts) { return facts.size + (std::size_t{16} << 20); }

Widths WidthsOf(const RecordingHeader& header) {
  Widths n;
  n.controls = static_cast<int>(header.control_names.size());
  n.bodies = static_cast<int>(header.bodies.size());
  n.mechanisms = static_cast<int>(header.scene.mechanisms.size());
  n.coordinates = static_cast<int>(header.coordinate_names.size());
  return n;
}

// Rows of a dataset, after its other dimensions were compared with those of the scene.
std::size_t RowsOf(const Hdf5& dataset, const Column& column) {
  const Dims dims = DimsOf(dataset);
  hsize_t width = 1;
  for (std::size_t i = 1; i < dims.size(); ++i) width *= dims[i];
  if (dims.empty() || width != static_cast<hsize_t>(column.width))
    throw Hdf5Fault(std::string("'") + column.name + "' does not have the size that the scene asks for");
  return static_cast<std::size_t>(dims[0]);
}

class StepReader {
 public:
  StepReader(hid_t file, const RecordingHeader& header, const FileFacts& facts)
      : widths_(WidthsOf(header)), finished_(header.finished), most_(MostBytes(facts)) {
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

  std::size_t steps() const { return available_[0]; }

  // The whole ones among the first `steps` steps.
  RecordedSteps Read(std::size_t steps) const {
    RecordedSteps s;
    ReadKind(s, Rows::kSteps, steps);
    const std::size_t whole = CountCoherent(s);
    Shorten(s, whole);
    auto end = [&](const std::vector<std::int64_t>& ends) {
      return ends.empty() ? std::size_t{0} : static_cast<std::size_t>(ends.back());
    };
    ReadKind(s, Rows::kReduced, end(s.reduced_end));
    ReadKind(s, Rows::kContacts, end(s.contact_end));
    ReadKind(s, Rows::kWrenches, end(s.wrench_end));
    const std::size_t good = CountIntact(s);
    if (finished_ && good < steps)
      throw Hdf5Fault("step " + std::to_string(good + 1) + " does not match its checksum");
    Shorten(s, good);
    return s;
  }

 private:
  static constexpr std::size_t kUnknown = static_cast<std::size_t>(-1);

  void ReadKind(RecordedSteps& s, Rows kind, std::size_t rows) const {
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
      if (rows > 0) ReadRows(dataset, MemoryType<T>(), rows, values.data());
    });
  }

  // Steps whose table rows exist and whose numbers of rows agree.
  std::size_t CountCoherent(const RecordedSteps& s) const {
    std::int64_t before[3] = {0, 0, 0};
    const std::vector<std::int64_t>* ends[3] = {&s.reduced_end, &s.contact_end, &s.wrench_end};
    const auto m = static_cast<std::size_t>(widths_.mechanisms);
    for (std::size_t i = 0; i < s.time.size(); ++i) {
      for (std::size_t k = 0; k < 3; ++k) {
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

  std::size_t CountIntact(const RecordedSteps& s) const {
    const std::vector<std::int64_t>* ends[3] = {&s.reduced_end, &s.contact_end, &s.wrench_end};
    const auto bodies = static_cast<int>(widths_.bodies);
    StepRows rows;
    for (std::size_t i = 0; i < s.time.size(); ++i) {
      rows.first[0] = i;
      rows.last[0] = i + 1;
      for (std::size_t k = 0; k < 3; ++k) {
        rows.first[k + 1] = rows.last[k + 1];
        rows.last[k + 1] = static_cast<std::size_t>((*ends[k])[i]);
      }
      if (StepChecksum(s, widths_, rows) != s.checksum[i]) return i;
      for (std::size_t c = rows.first[2]; c < rows.last[2]; ++c)
        for (int b : {s.contact_body_a[c], s.contact_body_b[c]})
          if (b < -1 || b >= bodies) return i;
      for (std::size_t c = rows.first[3]; c < rows.last[3]; ++c)
        if (s.wrench_body[c] < 0 || s.wrench_body[c] >= bodies) return i;
    }
    return s.time.size();
  }

  void Shorten(RecordedSteps& s, std::size_t steps) const {
    if (steps == s.time.size()) return;
    std::size_t rows[kNumRows] = {steps, 0, 0, 0};
    if (steps > 0) {
      rows[1] = static_cast<std::size_t>(s.reduced_end[steps - 1]);
      rows[2] = static_cast<std::size_t>(s.contact_end[steps - 1]);
      rows[3] = static_cast<std::size_t>(s.wrench_end[steps - 1]);
    }
    ForEachColumn(s, widths_, [&](const Column& column, auto& values) {
      const std::size_t size =
          rows[static_cast<std::size_t>(column.rows)] * static_cast<std::size_t>(column.width);
      if (values.size() > size) values.resize(size);
    });
  }

  Widths widths_;
  bool finished_;
  std::size_t most_;
  std::vector<Hdf5> datasets_;
  std::size_t available_[kNumRows] = {kUnknown, kUnknown, kUnknown, kUnknown};
};

}  // namespace

namespace {

// Whether every body of the list is the one that stands at its place in the scene.
void CheckPlaces(const RecordingHeader& h) {
  std::size_t next = 0;
  auto check = [&](int mechanism, std::size_t index) {
    const SceneBody& b = h.bodies[next++];
    if (b.mechanism != mechanism || b.index != static_cast<int>(index))
      throw Hdf5Fault("the list of bodies does not match the scene");
  };
  for (std::size_t m = 0; m < h.scene.mechanisms.size(); ++m)
    for (std::size_t i = 0; i < h.scene.mechanisms[m].bodies.size(); ++i)
      check(static_cast<int>(m), i);
  for (std::size_t i = 0; i < h.scene.free_bodies.size(); ++i) check(-1, i);
}

}  // namespace

Expected<RecordingHeader> ReadHeader(hid_t file, const std::string& path, const FileFacts& facts) {
  RecordingHeader h;
  h.path = path;
  h.finished = !facts.is_open_for_writing;
  if (!HasAttribute(file, "format") || ReadTextAttribute(file, "format") != kFormatName)
    return Fail(ErrorCode::kFormat, path, "is an HDF5 file, but no recording of fork1s");
  const auto version = ReadNumberAttribute(file, "format_version");
  h.program = ReadTextAttribute(file, "program");
  if (version != kFormatVersion)
    return Fail(ErrorCode::kFormat, path,
                "has format version " + std::to_string(version) + ", written by " + h.program +
                    "; this program reads version " + std::to_string(kFormatVersion) +
                    ": open it with that version");
  const std::size_t most = MostBytes(facts);
  const Hdf5 scene_group = OpenGroup(file, "scene");
  auto scene = ReadScene(ReadModel(scene_group.id(), most), path);
  if (!scene) return tl::unexpected(scene.error());
  h.scene = std::move(*scene);
  const Hdf5 run = OpenGroup(file, "simulation");
  auto options = ReadOptions(ReadText(run.id(), "options", most), path);
  if (!options) return tl::unexpected(options.error());
  h.options = *options;

  const Hdf5 names = OpenGroup(file, "names");
  const auto bodies = ReadTexts(names.id(), "bodies", most);
  h.control_names = ReadTexts(names.id(), "controls", most);
  h.coordinate_names = ReadTexts(names.id(), "coordinates", most);
  const auto owner = ReadList<int>(names.id(), "body_mechanism", most);
  const auto index = ReadList<int>(names.id(), "body_index", most);
  const auto is_interface = ReadList<std::uint8_t>(names.id(), "body_is_interface", most);
  std::size_t expected = h.scene.free_bodies.size();
  for (const MechanismDef& m : h.scene.mechanisms) expected += m.bodies.size();
  if (bodies.size() != expected || owner.size() != expected || index.size() != expected ||
      is_interface.size() != expected)
    throw Hdf5Fault("the list of bodies does not match the scene");
  for (std::size_t i = 0; i < expected; ++i)
    h.bodies.push_back({bodies[i], owner[i], index[i], is_interface[i] != 0});
  CheckPlaces(h);

  const Hdf5 initial = OpenGroup(file, "initial");
  h.first_step = ReadNumberAttribute(initial.id(), "step");
  h.initial_hash = ReadHashAttribute(initial.id(), "hash");
  Dims dims;
  h.initial_poses = ReadArray<double>(initial.id(), "poses", dims, most);
  if (h.initial_poses.size() != 7 * expected) throw Hdf5Fault("the initial poses do not match the scene");
  return h;
}

RecordedSteps ReadSteps(hid_t file, const RecordingHeader& header, const FileFacts& facts) {
  const StepReader reader(file, header, facts);
  if (header.finished) return reader.Read(reader.steps());
  RecordedSteps best;
  try {
    best = reader.Read(reader.steps());
  } catch (const Hdf5Fault&) {
    // Pages of the file are missing: the most steps that can be read are found by bisection.
    std::size_t good = 0, bad = reader.steps();
    while (bad - good > 1) {
      const std::size_t middle = good + (bad - good) / 2;
      try {
        best = reader.Read(middle);
        good = middle;
      } catch (const Hdf5Fault&) {
        bad = middle;
      }
    }
  }
  if (best.time.empty() && reader.steps() > 0)
    throw Hdf5Fault("none of its " + std::to_string(reader.steps()) + " steps is whole");
  return best;
}

}  // namespace fork1s::internal
