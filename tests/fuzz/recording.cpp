// Recordings whose checksums are right and whose content is not. An input is a list of changes to a recording
// of a small scene with a mesh and a height field: values and lengths of its arrays, its description of the
// scene, its options, its links. They are applied, checksums are computed again, bytes of the file may be
// changed on top, and the file is read, looked at from every side, replayed and exported. Bytes changed at
// random alone would all be caught by the checksums.
#include <fork1s/importer/importer.hpp>
#include <fork1s/record/csv.hpp>
#include <fork1s/record/gltf.hpp>
#include <fork1s/record/recording.hpp>

#include "files.hpp"
#include "fuzz.hpp"
#include "record/columns.hpp"
#include "record/model_store.hpp"

namespace {

using namespace fork1s;
using namespace fork1s::internal;

constexpr int kRecordedSteps = 6;

struct Parts {
  RecordedSteps steps;
  Widths widths;
  ModelText scene;
  std::string options;
  std::string whole;  // the file as it was
};

std::string FileBytes(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

template <class T>
T Must(Expected<T> value) {
  if (!value) throw std::runtime_error(value.error().Text());
  if constexpr (!std::is_void_v<T>) return std::move(*value);
}

Parts MakeParts() {
  const auto model = Must(LoadMechanismFromString(
      "<mujoco><asset><mesh name=\"m\" vertex=\"0 0 0 .1 0 0 0 .1 0 0 0 .1\"/><hfield name=\"h\" nrow=\"2\" "
      "ncol=\"3\" "
      "elevation=\"0 1 0 1 0 0\" size=\"1 1 .01 .1\"/></asset><worldbody><geom type=\"hfield\" "
      "hfield=\"h\"/><body "
      "name=\"a\" pos=\"0 0 .2\"><joint name=\"j\" axis=\"0 1 0\" stiffness=\"10\" damping=\"1\"/><geom "
      "size=\".03\"/><body name=\"b\" pos=\".2 0 -.16\"><joint name=\"k\" axis=\"0 1 0\" stiffness=\"1\" "
      "damping=\".1\"/><geom size=\".05\"/></body></body><body name=\"thing\" pos=\".5 0 "
      ".01\"><freejoint/><geom "
      "type=\"mesh\" mesh=\"m\"/></body></worldbody><actuator><position name=\"u\" joint=\"j\" "
      "kp=\"20\"/></actuator>"
      "</mujoco>",
      "recorded.xml"));
  Simulation simulation = Must(Simulation::Create(model.scene));
  const std::string path = fuzz::ScratchFolder() + "/whole.h5";
  {
    Recorder recorder = Must(Recorder::Create(path, simulation));
    for (int i = 0; i < kRecordedSteps; ++i) {
      std::vector<AppliedWrench> push;
      if (i == 2) push.push_back({2, Vector3(1, 0, 0), Vector3::Zero(), Vector3(.5, 0, .1)});
      ApplyWrenches(push, simulation);
      const StepReport report = simulation.Step();
      Must(recorder.Append(simulation, report, push));
    }
    Must(recorder.Finish());
  }
  const Recording recording = Must(Recording::Open(path));
  Parts parts;
  parts.steps = recording.data();
  const RecordingHeader& h = recording.header();
  parts.widths = {.controls = static_cast<int>(h.control_names.size()),
                  .bodies = static_cast<int>(h.bodies.size()),
                  .coordinates = static_cast<int>(h.coordinate_names.size()),
                  .mechanisms = static_cast<int>(h.scene.mechanisms.size())};
  parts.scene = WriteScene(h.scene);
  parts.options = WriteOptions(h.options);
  parts.whole = FileBytes(path);
  return parts;
}

// Another number in place of the n-th of a JSON text.
void ChangeNumber(std::string& json, unsigned n, fuzz::Source& source) {
  static constexpr const char* kNumbers[] = {
      "0",       "1",       "-1",  "2",          "1e308",       "-1e308", "1e-308", "3",
      "\"nan\"", "\"inf\"", "100", "2147483647", "-2147483648", "1e18",   "null",   "[]"};
  std::vector<std::size_t> places;
  for (std::size_t i = 1; i < json.size(); ++i)
    if ((std::isdigit(static_cast<unsigned char>(json[i])) || json[i] == '-') &&
        (json[i - 1] == ' ' || json[i - 1] == '['))
      places.push_back(i);
  if (places.empty()) return;
  const std::size_t at = places[n % places.size()];
  json.replace(at, std::min(json.find_first_of(",\n]} ", at), json.size()) - at, kNumbers[source.Below(16)]);
}

void ChangeColumn(Parts& p, fuzz::Source& source) {
  const int chosen = source.Byte();
  int count = 0, next = 0;
  ForEachColumn(p.steps, p.widths, [&](const Column&, auto&) { ++count; });
  ForEachColumn(p.steps, p.widths, [&](const Column&, auto& values) {
    if (next++ != chosen % count || values.empty()) return;
    using T = typename std::decay_t<decltype(values)>::value_type;
    T& value = values[source.Word() % values.size()];
    if constexpr (std::is_floating_point_v<T>)
      value = source.Real(false);
    else
      value = static_cast<T>(source.Flag() ? source.Byte() - 8 : static_cast<int>(source.Word()));
  });
}

void ChangeAssets(ModelText& scene, fuzz::Source& source) {
  const int what = source.Below(6);
  if (what < 3 && !scene.meshes.empty()) {
    auto mesh = std::make_shared<TriangleMesh>(*scene.meshes[0]);
    if (what == 0 && !mesh->triangles.empty())
      mesh->triangles[source.Byte() % mesh->triangles.size()](source.Below(3)) =
          static_cast<int>(source.Word());
    if (what == 1 && !mesh->vertices.empty())
      mesh->vertices[source.Byte() % mesh->vertices.size()](source.Below(3)) =
          static_cast<float>(source.Real(false));
    if (what == 2) mesh->vertices.resize(source.Byte() % 8u, Eigen::Vector3f::Zero());
    scene.meshes[0] = mesh;
  } else if (what >= 3 && !scene.grids.empty()) {
    auto grid = std::make_shared<HeightGrid>(*scene.grids[0]);
    if (what == 3) (source.Flag() ? grid->rows : grid->columns) = static_cast<int>(source.Word());
    if (what == 4 && !grid->values.empty())
      grid->values[source.Byte() % grid->values.size()] = static_cast<float>(source.Real(false));
    if (what == 5) grid->values.resize(source.Byte());
    scene.grids[0] = grid;
  }
}

// Where the ends of the tables allow it; elsewhere the old ones stay.
void ComputeChecksums(RecordedSteps& s, const Widths& widths) {
  const std::size_t n = std::min({s.time.size(), s.checksum.size(), s.reduced_end.size(),
                                  s.contact_end.size(), s.wrench_end.size(), s.point_spring_end.size()});
  StepRows rows;
  for (std::size_t i = 0; i < n; ++i) {
    rows.first[0] = i;
    rows.last[0] = i + 1;
    const std::int64_t ends[] = {s.reduced_end[i], s.contact_end[i], s.wrench_end[i], s.point_spring_end[i]};
    const std::size_t most[] = {s.z.size(), s.contact_body_a.size(), s.wrench_body.size(),
                                s.point_spring_body.size()};
    for (std::size_t k = 0; k + 1 < kNumRows; ++k) {
      rows.first[k + 1] = rows.last[k + 1];
      if (ends[k] < static_cast<std::int64_t>(rows.first[k + 1]) ||
          ends[k] > static_cast<std::int64_t>(most[k]))
        return;
      rows.last[k + 1] = static_cast<std::size_t>(ends[k]);
    }
    s.checksum[i] = StepChecksum(s, widths, rows);
  }
}

void WriteParts(const std::string& path, const Parts& p, int shortened, hsize_t length,
                const std::string& removed) {
  const QuietHdf5 quiet;
  const Hdf5 file(H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT), H5Fclose);
  if (!file) throw std::runtime_error("the recording to be changed does not open");
  H5Ldelete(file.id(), "scene", H5P_DEFAULT);
  WriteModel(CreateGroup(file.id(), "scene").id(), p.scene);
  H5Ldelete(file.id(), "simulation/options", H5P_DEFAULT);
  WriteText(OpenGroup(file.id(), "simulation").id(), "options", p.options, {});
  int next = 0;
  ForEachColumn(p.steps, p.widths, [&](const Column& column, const auto& values) {
    using T = typename std::decay_t<decltype(values)>::value_type;
    if (column.width == 0) return;
    const Hdf5 dataset = OpenDataset(file.id(), column.name);
    if (!values.empty())
      H5Dwrite(dataset.id(), MemoryType<T>(), H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
    if (next++ == shortened) {
      Dims dims = DimsOf(dataset);
      dims[0] = length;
      H5Dset_extent(dataset.id(), dims.data());
    }
  });
  if (!removed.empty()) H5Ldelete(file.id(), removed.c_str(), H5P_DEFAULT);
}

// Everything that a reader can ask.
void LookAtAll(const Recording& r) {
  for (int i = -1; i < r.num_steps(); ++i)
    for (std::size_t b = 0; b < r.bodies().size(); ++b) r.Pose(i, static_cast<int>(b));
  for (int i = 0; i < r.num_steps(); ++i) {
    r.Controls(i);
    r.Coordinates(i);
    for (std::size_t m = 0; m < r.scene().mechanisms.size(); ++m) {
      r.ReducedCoordinates(i, static_cast<int>(m));
      r.ReducedRates(i, static_cast<int>(m));
    }
    r.Contacts(i);
    r.Wrenches(i);
    r.Report(i);
    r.FidelityOf(i);
  }
}

}  // namespace

FORK1S_FUZZ_TARGET(recording, 150) {
  static const Parts original = MakeParts();
  Parts parts = original;
  fuzz::Source source(input);
  int shortened = -1;
  hsize_t length = 0;
  std::string removed;
  std::vector<std::pair<std::uint32_t, std::uint8_t>> bytes;
  for (int changes = 0; !source.empty() && changes < 12; ++changes) {
    switch (source.Below(9)) {
      case 0:
      case 1:
        ChangeColumn(parts, source);
        break;
      case 2:
      case 3:
        ChangeNumber(parts.scene.json, source.Word(), source);
        break;
      case 4:
        if (const std::uint32_t at = source.Word(); !parts.scene.json.empty())
          parts.scene.json[at % parts.scene.json.size()] = static_cast<char>(source.Byte());
        break;
      case 5:
        ChangeNumber(parts.options, source.Word(), source);
        break;
      case 6:
        ChangeAssets(parts.scene, source);
        break;
      case 7: {
        static constexpr const char* kLinks[] = {"",
                                                 "scene",
                                                 "scene/meshes/0",
                                                 "scene/heightfields/0/values",
                                                 "names/bodies",
                                                 "steps",
                                                 "simulation",
                                                 "initial/poses",
                                                 "names/controls"};
        shortened = source.Byte() % 50;
        length = source.Below(2 * kRecordedSteps);
        removed = kLinks[source.Below(9)];
        break;
      }
      default: {
        const std::uint32_t at = source.Word();
        bytes.emplace_back(at, source.Byte());
      }
    }
  }
  ComputeChecksums(parts.steps, parts.widths);
  const std::string path = fuzz::WriteScratch("changed.h5", parts.whole);
  WriteParts(path, parts, shortened, length, removed);
  if (!bytes.empty()) {
    std::string changed = FileBytes(path);
    for (const auto& [at, value] : bytes) changed[at % changed.size()] = static_cast<char>(value);
    fuzz::WriteScratch("changed.h5", changed);
  }
  const auto recording = Recording::Open(path);
  if (!recording) return fuzz::DemandNamed(recording.error());
  LookAtAll(*recording);
  if (const auto replay = Replay(*recording); !replay) fuzz::DemandNamed(replay.error());
  if (const auto done = ExportGltf(*recording, fuzz::ScratchFolder() + "/out.glb"); !done)
    fuzz::DemandNamed(done.error());
  if (const auto done = ExportCsv(*recording, fuzz::ScratchFolder() + "/tables"); !done)
    fuzz::DemandNamed(done.error());
}
