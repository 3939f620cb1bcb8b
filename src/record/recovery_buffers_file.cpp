// recovery.json and recovery.bin: the buffers as a folder that a program without this library reads.
#include <fmt/format.h>
#include <cstring>
#include <filesystem>
#include <fork1s/record/recovery_buffers.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "folder.hpp"
#include "mechanism/names.hpp"
#include "record/output_file.hpp"

namespace fork1s {
namespace {

using SortedJson = nlohmann::json;

constexpr std::string_view kMagic = "fork1s recovery\n";  // sixteen bytes
constexpr std::size_t kAlignment = 256;  // what every graphics processor takes as the offset of a buffer
constexpr FileKind kBuffersFile{"buffers of fork1s", kMagic};
// Begins the file, so that a file of somebody else's is not taken for one of these.
constexpr FileKind kBuffersText{"the description of buffers of fork1s",
                                "{\n \"format\": \"fork1s recovery buffers\""};

// A section of the file, and how the description names it.
template <class T>
SortedJson AddSection(const std::vector<T>& values, const char* type, std::string& bytes) {
  bytes.resize((bytes.size() + kAlignment - 1) / kAlignment * kAlignment, '\0');
  const std::size_t at = bytes.size();
  bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
  SortedJson section;
  section["offset"] = at;
  section["bytes"] = values.size() * sizeof(T);
  section["type"] = type;
  section["count"] = values.size();
  return section;
}

SortedJson Roots(const Simulation& simulation) {
  SortedJson roots = SortedJson::array();
  int link =
      static_cast<int>(simulation.world().mechanisms().size() + simulation.world().free_bodies().size());
  int z = 8 * link, coordinate = 0;
  for (const MechanismDynamics& m : simulation.world().mechanisms()) {
    const Mechanism& mechanism = m.mechanism();
    SortedJson root;
    root["name"] = mechanism.name();
    root["kind"] = "mechanism";
    root["base"] = Name(mechanism.base());
    root["first_link"] = link;
    root["joints"] = mechanism.num_joints();
    root["first_coordinate"] = coordinate;
    root["coordinates"] = mechanism.num_coordinates();
    root["frame_z"] = z;
    root["z"] = m.model().size();
    roots.push_back(std::move(root));
    link += mechanism.num_joints();
    coordinate += mechanism.num_coordinates();
    z += m.model().size();
  }
  for (const FreeBody& body : simulation.world().free_bodies()) {
    SortedJson root;
    root["name"] = body.name();
    root["kind"] = "free body";
    roots.push_back(std::move(root));
  }
  return roots;
}

}  // namespace

Expected<void> SaveRecoveryBuffers(const Simulation& simulation, const std::string& directory) {
  const auto folder = internal::MakeFolder(directory);
  if (!folder) return tl::unexpected(folder.error());
  const RecoveryBuffers buffers(simulation);
  std::vector<float> frame;
  buffers.WriteFrame(simulation, frame);
  const RecoveryBuffers::Trial trial = buffers.MakeTrial(simulation);
  const std::vector<std::int32_t>& t = buffers.tables();

  std::string bytes(kMagic);
  const std::uint64_t reference = buffers.reference();
  bytes.append(reinterpret_cast<const char*>(&reference), sizeof reference);
  SortedJson sections;
  sections["tables"] = AddSection(t, "int32", bytes);
  sections["numbers"] = AddSection(buffers.numbers(), "float32", bytes);
  sections["frame"] = AddSection(frame, "float32", bytes);
  sections["trial_frame"] = AddSection(trial.frame, "float32", bytes);
  sections["trial_poses"] = AddSection(trial.poses, "float32", bytes);

  SortedJson out;
  out["version"] = kRecoveryBuffersVersion;
  out["program"] = "fork1s " FORK1S_VERSION;
  out["file"] = "recovery.bin";
  out["bytes"] = bytes.size();
  out["byte_order"] = "little";
  out["reference"] = fmt::format("{:016x}", reference);
  out["recovery"] = Name(buffers.recovery());
  const bool twist = buffers.recovery() == Recovery::kTwist;
  for (const char* pass : {"recover_twist", "recover_joints", "recover_scan", "recover_exact"})
    if (twist == (pass == std::string_view("recover_twist"))) out["passes"].push_back(pass);
  SortedJson& units = out["units"];
  units["length"] = "m";
  units["angle"] = "rad";
  units["z"] = "1";
  out["quaternion"] = "x y z w";
  out["frames"] =
      "poses are X_WB, of the body in the world; numbers are in the root frame R of each mechanism";
  SortedJson& sizes = out["sizes"];
  constexpr std::pair<const char*, std::size_t> kSizes[] = {{"roots", 1},       {"links", 2}, {"bodies", 3},
                                                            {"coordinates", 4}, {"z", 5},     {"frame", 8},
                                                            {"longest_path", 9}};
  for (const auto& [name, place] : kSizes) sizes[name] = t[place];
  sizes["scan_passes"] = buffers.scan_passes();
  sizes["links_bytes"] = 32 * t[2];
  sizes["poses_bytes"] = 32 * t[3];
  out["sections"] = std::move(sections);
  out["roots"] = Roots(simulation);
  out["bodies"] = SortedJson::array();
  for (const SceneBody& b : simulation.bodies()) out["bodies"].push_back(b.name);

  const std::filesystem::path place(*folder);
  if (auto ok = WriteFile((place / "recovery.bin").string(), kBuffersFile, bytes); !ok) return ok;
  const std::string members = out.dump(1, ' ', false, SortedJson::error_handler_t::replace).substr(1);
  const std::string text = fmt::format("{},{}\n", kBuffersText.begin, members);
  return WriteFile((place / "recovery.json").string(), kBuffersText, text);
}

}  // namespace fork1s
