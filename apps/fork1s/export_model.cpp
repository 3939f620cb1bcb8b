#include "export_model.hpp"

#include <filesystem>
#include <fork1s/base/system_error.hpp>
#include <fork1s/record/output_file.hpp>

namespace fork1s::app {
namespace {

constexpr FileKind kWrittenModel{"a model that this program has written", "<!-- written by fork1s export"};

}  // namespace

Expected<MjcfModel> WriteModel(const ModelArguments& model, const std::string& out) {
  const std::filesystem::path place(out), folder = place.parent_path();
  const std::string meshes = place.stem().string() + "_meshes";
  auto written = model.AsMjcf(folder.empty() ? "." : folder.string(), meshes);
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
  ModelArguments again;
  again.path = out;
  again.keyframe = written->start;
  if (const auto read = again.Load(); !read) return tl::unexpected(read.error());
  return written;
}

}  // namespace fork1s::app
