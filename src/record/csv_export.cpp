#include <filesystem>
#include <fork1s/record/csv.hpp>
#include <fork1s/record/output_file.hpp>
#include <fstream>

#include <fmt/format.h>

#include "body_names.hpp"

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
    if (out_) return output_->Keep();
    return Fail(ErrorCode::kFile, path_,
                "cannot be written; check the folder, its permissions and free space");
  }

 private:
  std::string path_;
  Expected<OutputFile> output_;
  std::ofstream out_;
  std::string row_;
};

Expected<void> WritePoses(const Recording& recording, const std::filesystem::path& path,
                          const CsvOptions& options, const std::vector<std::string>& names) {
  Table table(path);
  std::vector<std::size_t> chosen;
  for (std::size_t b = 0; b < names.size(); ++b) {
    const SceneBody& body = recording.bodies()[b];
    if (!options.all_bodies && !body.is_interface && body.mechanism >= 0) continue;
    chosen.push_back(b);
    for (const char* part : {".x", ".y", ".z", ".qw", ".qx", ".qy", ".qz"}) table.Name(names[b] + part);
  }
  table.End();
  const RecordedSteps& data = recording.data();
  for (std::size_t i = 0; i < data.time.size(); ++i) {
    table.Start(data.time[i]);
    for (std::size_t b : chosen)
      for (std::size_t k = 0; k < 7; ++k) table.Add(data.poses[7 * (i * names.size() + b) + k]);
    table.End();
  }
  return table.Close();
}

Expected<void> WriteContacts(const Recording& recording, const std::filesystem::path& path,
                             const std::vector<std::string>& names) {
  Table table(path);
  for (const char* name : {"body_a", "body_b", "point.x", "point.y", "point.z", "normal.x", "normal.y",
                           "normal.z", "force.x", "force.y", "force.z", "gap", "friction"})
    table.Name(name);
  table.End();
  auto body = [&](int b) { return b < 0 ? std::string("world") : names[static_cast<std::size_t>(b)]; };
  for (int i = 0; i < recording.num_steps(); ++i)
    for (const RecordedContact& c : recording.Contacts(i)) {
      table.Start(recording.data().time[static_cast<std::size_t>(i)]);
      table.Add(body(c.body_a));
      table.Add(body(c.body_b));
      for (const Vector3* v : {&c.point, &c.normal, &c.force}) table.AddAll(*v);
      table.Add(c.gap);
      table.Add(c.friction);
      table.End();
    }
  return table.Close();
}

Expected<void> WriteControls(const Recording& recording, const std::filesystem::path& path) {
  Table table(path);
  for (const std::string& name : recording.header().control_names) table.Name(name);
  table.End();
  for (int i = 0; i < recording.num_steps(); ++i) {
    table.Start(recording.data().time[static_cast<std::size_t>(i)]);
    table.AddAll(recording.Controls(i));
    table.End();
  }
  return table.Close();
}

Expected<void> WriteEnergy(const Recording& recording, const std::filesystem::path& path) {
  Table table(path);
  for (const char* name : {"kinetic", "potential", "total"}) table.Name(name);
  table.End();
  const RecordedSteps& data = recording.data();
  for (std::size_t i = 0; i < data.time.size(); ++i) {
    table.Start(data.time[i]);
    table.Add(data.kinetic_energy[i]);
    table.Add(data.potential_energy[i]);
    table.Add(data.kinetic_energy[i] + data.potential_energy[i]);
    table.End();
  }
  return table.Close();
}

}  // namespace

Expected<void> ExportCsv(const Recording& recording, const std::string& directory,
                         const CsvOptions& options) {
  const std::filesystem::path folder(directory);
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (!std::filesystem::is_directory(folder, error))
    return Fail(ErrorCode::kFile, directory, "cannot be made a folder; check the path and its permissions");
  const std::vector<std::string> names = internal::BodyNames(recording);
  if (auto ok = WritePoses(recording, folder / "poses.csv", options, names); !ok) return ok;
  if (auto ok = WriteContacts(recording, folder / "contacts.csv", names); !ok) return ok;
  if (auto ok = WriteControls(recording, folder / "controls.csv"); !ok) return ok;
  return WriteEnergy(recording, folder / "energy.csv");
}

}  // namespace fork1s
