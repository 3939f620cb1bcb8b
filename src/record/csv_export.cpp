#include <algorithm>
#include <array>
#include <cerrno>
#include <filesystem>
#include <fork1s/record/csv.hpp>
#include <fork1s/sim/run_statistics.hpp>
#include <fstream>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "base/system_error.hpp"
#include "body_names.hpp"
#include "folder.hpp"
#include "record/output_file.hpp"

namespace fork1s {
namespace {

std::string Quoted(const std::string& name) {
  if (name.find_first_of(",\"\n\r") == std::string::npos && (name.empty() || name[0] != '#')) return name;
  std::string quoted = "\"";
  for (char c : name) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + '"';
}

class Table {
 public:
  explicit Table(const std::filesystem::path& path)
      : path_(path.string()),
        output_(OutputFile::Create(path_, {"a table of a recording", "time"})),
        row_("time") {
    if (output_) out_.open(output_->part(), std::ios::binary);
    if (!out_) error_ = errno;
  }
  void Name(const std::string& name) { row_ += ',' + Quoted(name); }
  void Start(double time) { row_ = fmt::format("{}", time); }
  void Add(double value) { fmt::format_to(std::back_inserter(row_), ",{}", value); }
  void Add(const std::string& text) { row_ += ',' + Quoted(text); }
  template <class V>
  void AddAll(const V& values) {
    for (Eigen::Index i = 0; i < values.size(); ++i) Add(values(i));
  }
  void End() { out_ << row_ << '\n'; }
  Expected<void> Close() {
    if (!output_) return tl::unexpected(output_.error());
    out_.close();
    if (out_) return output_->Commit();
    const std::string remedy = "check the folder, its permissions and the disk's room";
    return Fail(ErrorCode::kFile, path_,
                "cannot be written" + (error_ != 0 ? " " + CauseAndRemedy(error_, remedy) : "; " + remedy));
  }

 private:
  std::string path_;
  Expected<OutputFile> output_;
  std::ofstream out_;
  int error_ = 0;  // of opening, an errno value
  std::string row_;
};

// The tables of a recording, to which its steps are added stretch by stretch.
class Tables {
 public:
  Tables(const RecordingHeader& header, const std::filesystem::path& folder, const CsvOptions& options)
      : names_(internal::BodyNames(header)),
        poses_(folder / "poses.csv"),
        contacts_(folder / "contacts.csv"),
        pairs_(folder / "pairs.csv"),
        controls_(folder / "controls.csv"),
        energy_(folder / "energy.csv"),
        sensors_(folder / "sensors.csv"),
        num_sensor_values_(header.sensor_names.size()) {
    for (std::size_t b = 0; b < names_.size(); ++b) {
      const SceneBody& body = header.bodies[b];
      if (options.all_bodies || body.is_interface || body.mechanism < 0) AddPoseColumns(b);
    }
    for (std::size_t b = 0; b < names_.size(); ++b) {
      const SceneBody& body = header.bodies[b];
      if (body.mechanism < 0 || body.index != 0 || !MovesBase(header.scene, body.mechanism)) continue;
      if (!options.all_bodies && !body.is_interface) AddPoseColumns(b);
      bases_.push_back(body.mechanism);
      base_names_.push_back(names_[b]);
    }
    for (const std::string& base : base_names_)
      for (const char* part : {".vx", ".vy", ".vz", ".wx", ".wy", ".wz"}) poses_.Name(base + part);
    num_mechanisms_ = header.scene.mechanisms.size();
    for (const char* name : {"body_a", "body_b", "force.x", "force.y", "force.z", "moment.x", "moment.y",
                             "moment.z", "contacts", "friction_use"})
      pairs_.Name(name);
    for (const char* name : {"body_a", "body_b", "point.x", "point.y", "point.z", "normal.x", "normal.y",
                             "normal.z", "force.x", "force.y", "force.z", "gap", "friction", "friction_use"})
      contacts_.Name(name);
    for (const std::string& name : header.control_names) controls_.Name(name);
    for (const std::string& name : header.sensor_names) sensors_.Name(name);
    for (const char* name : {"kinetic", "potential", "total"}) energy_.Name(name);
    for (Table* table : All()) table->End();
  }

  void Add(const Recording& part) {
    for (int i = 0; i < part.num_steps(); ++i) {
      AddPoses(part, static_cast<std::size_t>(i));
      AddContacts(part, i);
      AddPairs(part, i);
      AddEnergy(part.data(), static_cast<std::size_t>(i));
      controls_.Start(part.data().time[static_cast<std::size_t>(i)]);
      controls_.AddAll(part.Controls(i));
      controls_.End();
      AddSensors(part.data(), static_cast<std::size_t>(i));
    }
  }

  Expected<void> Close() {
    for (Table* table : All())
      if (auto ok = table->Close(); !ok) return ok;
    return {};
  }

 private:
  std::array<Table*, 6> All() { return {&poses_, &contacts_, &pairs_, &controls_, &energy_, &sensors_}; }
  void AddPoseColumns(std::size_t body) {
    chosen_.push_back(body);
    for (const char* part : {".x", ".y", ".z", ".qw", ".qx", ".qy", ".qz"}) poses_.Name(names_[body] + part);
  }
  static bool MovesBase(const Scene& scene, int mechanism) {
    return scene.mechanisms[static_cast<std::size_t>(mechanism)].base != BaseKind::kFixed;
  }

  void AddPoses(const Recording& part, std::size_t i) {
    poses_.Start(part.data().time[i]);
    for (std::size_t b : chosen_)
      for (std::size_t k = 0; k < 7; ++k) poses_.Add(part.data().poses[7 * (i * names_.size() + b) + k]);
    for (const int m : bases_) AddVelocity(part.data(), i * num_mechanisms_ + static_cast<std::size_t>(m));
    poses_.End();
  }
  // Of the base's origin, world axes; the recording has it in R about R's origin.
  void AddVelocity(const RecordedSteps& data, std::size_t at) {
    const double* pose = data.base_poses.data() + 7 * at;
    const Vector6 V_R = Eigen::Map<const Vector6>(data.base_twists.data() + 6 * at);
    const Matrix3 R = Eigen::Quaterniond(pose[3], pose[4], pose[5], pose[6]).toRotationMatrix();
    poses_.AddAll(Vector3(R * V_R.tail<3>()));
    poses_.AddAll(Vector3(R * V_R.head<3>()));
  }
  // All contacts of two bodies together.
  void AddPairs(const Recording& part, int i) {
    std::map<std::pair<int, int>, std::pair<ContactLoad, int>> loads;  // and the number of contacts
    for (const RecordedContact& c : part.Contacts(i)) {
      const int a = std::min(c.body_a, c.body_b), b = std::max(c.body_a, c.body_b);
      const double sign = c.body_b == b ? 1 : -1;
      const Vector3 origin = b < 0 ? Vector3(Vector3::Zero()) : part.Pose(i, b).translation();
      ContactLoad load = ContactLoad::OfContact(sign * c.force, sign * c.normal, c.friction);
      load.moment_W = Vector3(c.point - origin).cross(load.force_W);
      auto& [sum, contacts] = loads[{a, b}];
      sum.Add(load, 1);
      ++contacts;
    }
    for (const auto& [bodies, of_pair] : loads) {
      const auto& [load, contacts] = of_pair;
      pairs_.Start(part.data().time[static_cast<std::size_t>(i)]);
      pairs_.Add(NameOf(bodies.first));
      pairs_.Add(NameOf(bodies.second));
      pairs_.AddAll(load.force_W);
      pairs_.AddAll(load.moment_W);
      pairs_.Add(contacts);
      pairs_.Add(load.FrictionUse());
      pairs_.End();
    }
  }
  std::string NameOf(int b) const {
    return b < 0 ? std::string("world") : names_[static_cast<std::size_t>(b)];
  }
  void AddContacts(const Recording& part, int i) {
    for (const RecordedContact& c : part.Contacts(i)) {
      contacts_.Start(part.data().time[static_cast<std::size_t>(i)]);
      contacts_.Add(NameOf(c.body_a));
      contacts_.Add(NameOf(c.body_b));
      for (const Vector3* v : {&c.point, &c.normal, &c.force}) contacts_.AddAll(*v);
      contacts_.Add(c.gap);
      contacts_.Add(c.friction);
      contacts_.Add(ContactLoad::OfContact(c.force, c.normal, c.friction).FrictionUse());
      contacts_.End();
    }
  }
  void AddEnergy(const RecordedSteps& data, std::size_t i) {
    energy_.Start(data.time[i]);
    energy_.Add(data.kinetic_energy[i]);
    energy_.Add(data.potential_energy[i]);
    energy_.Add(data.kinetic_energy[i] + data.potential_energy[i]);
    energy_.End();
  }
  void AddSensors(const RecordedSteps& data, std::size_t i) {
    sensors_.Start(data.time[i]);
    for (std::size_t k = 0; k < num_sensor_values_; ++k)
      sensors_.Add(data.sensors[i * num_sensor_values_ + k]);
    sensors_.End();
  }

  std::vector<std::string> names_;
  std::vector<std::size_t> chosen_;
  std::vector<int> bases_;  // mechanisms whose base moves
  std::vector<std::string> base_names_;
  std::size_t num_mechanisms_ = 0;
  Table poses_, contacts_, pairs_, controls_, energy_, sensors_;
  std::size_t num_sensor_values_ = 0;
};

}  // namespace

Expected<void> ExportCsv(const Recording& recording, const std::string& directory,
                         const CsvOptions& options) {
  const auto folder = internal::MakeFolder(directory);
  if (!folder) return tl::unexpected(folder.error());
  Tables tables(recording.header(), *folder, options);
  tables.Add(recording);
  return tables.Close();
}

Expected<std::int64_t> ExportCsv(RecordingReader& reader, const std::string& directory,
                                 const CsvOptions& options) {
  const auto folder = internal::MakeFolder(directory);
  if (!folder) return tl::unexpected(folder.error());
  Tables tables(reader.header(), *folder, options);
  std::int64_t steps = 0;
  while (true) {
    const auto part = reader.Next();
    if (!part) return tl::unexpected(part.error());
    if (part->num_steps() == 0) break;
    tables.Add(*part);
    steps += part->num_steps();
  }
  if (auto closed = tables.Close(); !closed) return tl::unexpected(closed.error());
  return steps;
}

}  // namespace fork1s
