#include "study/mjcf_file.hpp"

#include <filesystem>
#include <utility>

#include "base/system_error.hpp"
#include "record/output_file.hpp"

namespace fork1s {
namespace {

constexpr FileKind kWrittenModel{"a model that this program has written", "<!-- written by fork1s export"};

// Whether MuJoCo, given the file, would simulate something else. Interfaces and modes are of the reduction
// alone, and a start that no keyframe of the file has gets a keyframe of its own.
bool DiffersFromFile(const ImportOptions& o, const ImportedScene& imported) {
  const std::string start =
      imported.initial_keyframe < 0
          ? ""
          : imported.scene.keyframes[static_cast<std::size_t>(imported.initial_keyframe)].name;
  return imported.report.format != "MJCF" || o.base || o.pd || !o.joint_pd.empty() ||
         o.stiffness_scale != 1 || o.base_pose || o.ground || start != o.keyframe;
}

// Options with which a written file is read as what it was written of, whose start may be outside of limits.
ImportOptions AsWritten(const std::string& start) {
  ImportOptions options;
  options.keyframe = start;
  options.keep_start = true;
  return options;
}

}  // namespace

Expected<MjcfModel> WriteMjcfFile(const std::string& path, const ImportOptions& options,
                                  const std::string& out) {
  const std::filesystem::path place(out), folder = place.parent_path();
  const std::string meshes = place.stem().string() + "_meshes";
  auto written = ModelAsMjcf(path, options, folder.empty() ? "." : folder.string(), meshes);
  if (!written) return written;
  if (!written->meshes.empty()) {
    std::error_code error;
    std::filesystem::create_directories(folder / meshes, error);
    if (error)
      return Fail(ErrorCode::kFile, (folder / meshes).string(),
                  "cannot be made " + CauseAndRemedy(error.value(), "give its folder write permission"));
  }
  for (const auto& [name, content] : written->meshes)
    if (auto ok = WriteFile((folder / meshes / name).string(), {"a mesh", ""}, content); !ok)
      return tl::unexpected(ok.error());
  const std::string text = std::string(kWrittenModel.begin) + " -->\n" + written->text;
  if (auto ok = WriteFile(out, kWrittenModel, text); !ok) return tl::unexpected(ok.error());
  if (const auto read = LoadMechanism(out, AsWritten(written->start)); !read)
    return tl::unexpected(read.error());
  return written;
}

Expected<SharedModel> ShareWithMuJoCo(const std::string& path, const ImportOptions& options,
                                      ImportedScene imported) {
  if (!DiffersFromFile(options, imported)) return SharedModel{path, std::move(imported), nullptr};
  const auto folder = std::make_shared<const TemporaryFolder>("fork1s-model");
  if (folder->path.empty())
    return Fail(
        ErrorCode::kFile, std::filesystem::temp_directory_path().string(),
        "cannot hold a temporary folder for the model that MuJoCo is to open; make room there or set TMPDIR");
  const std::string file = folder->path + "/model.xml";
  const auto written = WriteMjcfFile(path, options, file);
  if (!written) return tl::unexpected(written.error());
  auto read = LoadMechanism(file, AsWritten(written->start));
  if (!read) return tl::unexpected(read.error());
  return SharedModel{file, std::move(*read), folder};
}

}  // namespace fork1s
