#include <algorithm>
#include <cmath>
#include <filesystem>

#include "base/lower_case.hpp"
#include "names.hpp"
#include "urdf_parts.hpp"

namespace fork1s::internal {
namespace {

// Mesh files of MuJoCo itself, which it reads as they are.
bool IsMsh(const std::string& name) { return name.size() > 4 && name.substr(name.size() - 4) == ".msh"; }

// MuJoCo knows a mesh by its base name alone, so one name must mean one file at one scale.
std::string UniqueName(const UrdfWork& work, const std::string& stem) {
  const auto taken = [&](const std::string& candidate) {
    return std::any_of(work.meshes.begin(), work.meshes.end(), [&](const auto& entry) {
      return LowerCase(Stem(entry.second.name)) == LowerCase(candidate);
    });
  };
  std::string name = stem;
  for (int i = 2; taken(name); ++i) name = fmt::format("{}_{}", stem, i);
  return name;
}

PreparedMesh ReadPreparedMesh(UrdfWork& work, const std::filesystem::path& file, const Vector3& scale) {
  const auto mesh = ReadMeshFile(file.string(), scale);
  if (!mesh) {
    MeshFault fault = mesh.error();
    fault.reason = fmt::format("file {}: {}", file.lexically_normal().string(), fault.reason);
    return {"", std::move(fault)};
  }
  const std::string name = UniqueName(work, file.stem().string()) + ".obj";
  Eigen::AlignedBox3f bounds;
  for (const Eigen::Vector3f& v : mesh->vertices) bounds.extend(v);
  work.mesh_extents[name] = bounds.sizes().cast<double>();
  work.out.source.buffers[name] = WriteObj(*mesh);
  return {name, std::nullopt};
}

}  // namespace

std::optional<MeshFault> PrepareMesh(UrdfWork& work, tinyxml2::XMLElement& mesh) {
  const char* filename = mesh.Attribute("filename");
  if (filename == nullptr) return MeshFault{ErrorCode::kModel, "it has no filename", "name the file"};
  if (!IsKnownMesh(filename) && !IsMsh(filename)) {
    const std::string extension = std::filesystem::path(filename).extension().string();
    return MeshFault{ErrorCode::kFormat,
                     fmt::format("{} files cannot be read", extension.empty() ? "nameless" : extension),
                     "convert it to STL, OBJ, COLLADA (.dae) or glTF (.glb)"};
  }
  FileFound found = FindNamedFile(work.search, filename);
  if (!found.package.empty()) work.packages.insert(found.package);
  if (!found.file) return MeshFault{ErrorCode::kModel, std::move(found.reason), std::move(found.remedy)};

  Vector3 scale = Vector3::Ones();
  const char* scale_text = mesh.Attribute("scale");
  if (scale_text != nullptr) {
    const std::vector<double> numbers = NumbersOf(&mesh, "scale");
    if (numbers.size() == 3) scale << numbers[0], numbers[1], numbers[2];
    if (numbers.size() != 3 || !scale.allFinite() || scale.prod() == 0) {
      return MeshFault{ErrorCode::kModel,
                       fmt::format("its scale '{}' is not three numbers other than 0", scale_text),
                       "write three, 1 1 1 for the size in the file"};
    }
  }
  const std::string key =
      fmt::format("{}|{}|{}|{}", found.file->lexically_normal().string(), scale.x(), scale.y(), scale.z());
  auto known = work.meshes.find(key);
  if (known == work.meshes.end()) {
    PreparedMesh prepared;
    if (IsMsh(filename)) {
      prepared.name = UniqueName(work, found.file->stem().string()) + ".msh";
      work.out.source.files[prepared.name] = found.file->string();
    } else {
      prepared = ReadPreparedMesh(work, *found.file, scale);
    }
    known = work.meshes.emplace(key, std::move(prepared)).first;
  }
  if (known->second.fault) return known->second.fault;
  mesh.SetAttribute("filename", known->second.name.c_str());
  if (!IsMsh(filename)) mesh.DeleteAttribute("scale");  // applied
  return std::nullopt;
}

}  // namespace fork1s::internal
