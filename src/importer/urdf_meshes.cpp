#include <algorithm>
#include <cctype>
#include <filesystem>

#include "names.hpp"
#include "urdf_parts.hpp"

namespace fork1s::internal {
namespace {

namespace fs = std::filesystem;

bool IsFile(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

// package://robot/meshes/a.stl names a file below some folder 'robot' that may be the URDF's own folder or
// one above it; plain names are relative to the URDF.
std::optional<fs::path> Resolve(const std::string& urdf, std::string name) {
  const auto strip = [&](const std::string& prefix) {
    if (name.rfind(prefix, 0) != 0) return false;
    name = name.substr(prefix.size());
    return true;
  };
  std::string package;
  if (strip("package://") || strip("model://")) {
    const std::size_t slash = name.find('/');
    if (slash == std::string::npos) return std::nullopt;
    package = name.substr(0, slash);
    name = name.substr(slash + 1);
  } else {
    strip("file://");
    if (fs::path(name).is_absolute()) {
      if (IsFile(name)) return fs::path(name);
      return std::nullopt;
    }
  }
  std::error_code ignored;
  fs::path folder = fs::absolute(fs::path(urdf), ignored).parent_path();
  for (int level = 0; level < 6; ++level) {
    if (!package.empty() && IsFile(folder / package / name)) return folder / package / name;
    if (IsFile(folder / name)) return folder / name;
    if (folder == folder.parent_path()) break;
    folder = folder.parent_path();
  }
  return std::nullopt;
}

std::string Extension(const std::string& name) {
  std::string extension = fs::path(name).extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

}  // namespace

std::optional<MeshFault> PrepareMesh(UrdfWork& work, tinyxml2::XMLElement& mesh) {
  const char* filename = mesh.Attribute("filename");
  if (filename == nullptr) return MeshFault{"it has no filename", "name the file"};
  const std::string extension = Extension(filename);
  if (extension != ".stl" && extension != ".obj" && extension != ".msh") {
    return MeshFault{fmt::format("{} files cannot be read", extension.empty() ? "nameless" : extension),
                     "convert it to STL or OBJ"};
  }
  const std::optional<fs::path> file = Resolve(work.path, filename);
  if (!file) {
    return MeshFault{"the file was not found beside the URDF or above it", "put it there or mend the path"};
  }
  // MuJoCo knows a mesh by its base name alone, so one name must mean one file at one scale.
  const std::string scale = mesh.Attribute("scale") != nullptr ? mesh.Attribute("scale") : "";
  const std::string key = file->lexically_normal().string() + '|' + scale;
  auto known = work.mesh_names.find(key);
  if (known == work.mesh_names.end()) {
    const std::string stem = file->stem().string();
    std::string name = stem;
    const auto taken = [&](const std::string& candidate) {
      for (const auto& [other, other_name] : work.mesh_names) {
        if (Stem(other_name) == candidate) return true;
      }
      return false;
    };
    for (int i = 2; taken(name); ++i) name = fmt::format("{}_{}", stem, i);
    known = work.mesh_names.emplace(key, name + extension).first;
    work.out.source.files[name + extension] = file->string();
  }
  mesh.SetAttribute("filename", known->second.c_str());
  return std::nullopt;
}

}  // namespace fork1s::internal
