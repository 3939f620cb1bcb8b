#include "recording_file.hpp"

#include <nlohmann/json.hpp>

#include "model_store.hpp"

namespace fork1s::internal {
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
    for (std::size_t i = 0; i < h.scene.mechanisms[m].bodies.size(); ++i) check(static_cast<int>(m), i);
  for (std::size_t i = 0; i < h.scene.free_bodies.size(); ++i) check(-1, i);
}

// Options as this version has them.
std::string OptionsOfOtherSteps(const std::string& text) {
  nlohmann::json options = nlohmann::json::parse(text, nullptr, false);
  if (options.is_object() && options.contains("step") && options["step"].is_object()) {
    auto& step = options["step"];
    step.erase("contact_curvature");
    if (step.contains("integrator") && step["integrator"] == "theta")
      step["integrator"] = Name(Integrator::kTwoStage);
  }
  return options.dump();
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
  h.has_steps_of_this_version = version > kVersionOfOtherSteps;
  if (version < kVersionOfOtherSteps || version > kFormatVersion)
    return Fail(ErrorCode::kFormat, path,
                "has format version " + std::to_string(version) + ", written by " + h.program +
                    "; this program reads version " + std::to_string(kFormatVersion) +
                    ": open it with that version");
  const std::size_t most = facts.MostBytes();
  const Hdf5 scene_group = OpenGroup(file, "scene");
  auto scene = ReadScene(ReadModel(scene_group.id(), most), path);
  if (!scene) return tl::unexpected(scene.error());
  h.scene = std::move(*scene);
  const Hdf5 run = OpenGroup(file, "simulation");
  const std::string text = ReadText(run.id(), "options", most);
  auto options = ReadOptions(h.has_steps_of_this_version ? text : OptionsOfOtherSteps(text), path);
  if (!options) return tl::unexpected(options.error());
  h.options = *options;

  const Hdf5 names = OpenGroup(file, "names");
  const auto bodies = ReadTexts(names.id(), "bodies", most);
  h.control_names = ReadTexts(names.id(), "controls", most);
  h.coordinate_names = ReadTexts(names.id(), "coordinates", most);
  if (version >= kVersionOfSensors) {
    h.sensor_names = ReadTexts(names.id(), "sensors", most);
    std::size_t values = 0;
    for (const SensorDef& sensor : h.scene.sensors)
      values += sensor.size < 0 ? most : static_cast<std::size_t>(sensor.size);
    if (h.sensor_names.size() != values || h.sensor_names != SensorValueNames(h.scene))
      throw Hdf5Fault("the list of sensors does not match the scene");
  }
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
  h.initial_controls = ReadList<double>(initial.id(), "controls", most);
  h.start_controls = ReadList<double>(initial.id(), "start_controls", most);
  if (h.initial_controls.size() != h.control_names.size() ||
      h.start_controls.size() != h.control_names.size())
    throw Hdf5Fault("the initial controls do not match the list of controls");
  return h;
}

Expected<OpenRecording> OpenRecordingFile(const std::string& path) {
  const FileFacts facts = InspectFile(path);
  if (!facts.is_hdf5)
    return Fail(facts.size == 0 ? ErrorCode::kFile : ErrorCode::kFormat, path,
                facts.size == 0 ? "is empty; the recording was never begun, record again"
                                : "is no HDF5 file; recordings are written by fork1s");
  // Where a disk ran full, the end that is written down lies beyond the last whole step: that is worth
  // reading.
  if (!facts.is_open_for_writing && facts.size < facts.stored_size)
    return Fail(ErrorCode::kFile, path,
                "is cut off: it has " + std::to_string(facts.size) + " of " +
                    std::to_string(facts.stored_size) + " bytes; copy or record it again");
  // A writer that lives or was killed has left its mark, and only this way of reading passes it.
  const unsigned flags = H5F_ACC_RDONLY | (facts.is_open_for_writing ? H5F_ACC_SWMR_READ : 0u);
  const Hdf5 access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  // Where a checksum of HDF5's own is wrong it asks again, as a writer may be at it, and waits twice as
  // long each time: 100 times by default, for ever. This is 1 ms.
  H5Pset_metadata_read_attempts(access.id(), 20);
  Hdf5 file(H5Fopen(path.c_str(), flags, access.id()), H5Fclose);
  if (!file)
    return Fail(ErrorCode::kFile, path,
                "cannot be opened as HDF5 (" + LastHdf5Message() +
                    "); it is cut off or damaged, copy or record it again");
  auto header = ReadHeader(file.id(), path, facts);
  if (!header) return tl::unexpected(header.error());
  return OpenRecording{std::move(file), facts, std::move(*header)};
}

}  // namespace fork1s::internal
