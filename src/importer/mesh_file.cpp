#include "mesh_file.hpp"

#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <fmt/format.h>
#include <assimp/Importer.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <map>

#include "base/lower_case.hpp"
#include "xml_checks.hpp"

namespace fork1s::internal {
namespace {

constexpr std::size_t kMostVertices = 20'000'000;  // a scene may show one object a million times

std::string MeshExtension(const std::string& path) {
  std::string extension = std::filesystem::path(path).extension().string();
  extension = LowerCase(extension);
  return extension;
}

MeshFault Damaged(std::string reason) {
  while (!reason.empty() && (reason.back() == '.' || reason.back() == '\n' || reason.back() == ' '))
    reason.pop_back();
  std::replace(reason.begin(), reason.end(), '\n', ' ');
  return {ErrorCode::kFormat, std::move(reason), "write the mesh again from the program it comes from"};
}

// What the next passes take on trust.
std::optional<MeshFault> CheckScene(const aiScene* scene) {
  if (scene == nullptr || scene->mRootNode == nullptr) return Damaged("it holds no scene");
  for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
    const aiMesh& mesh = *scene->mMeshes[m];
    if (mesh.mNumFaces > 0 && !mesh.HasPositions()) return Damaged("it has faces and no vertices");
    for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
      const aiFace& face = mesh.mFaces[f];
      if (face.mNumIndices == 0) return Damaged(fmt::format("its face {} has no vertices", f));
      for (unsigned i = 0; i < face.mNumIndices; ++i) {
        if (face.mIndices[i] >= mesh.mNumVertices)
          return Damaged(fmt::format("its face {} names vertex {}, and there are {}", f, face.mIndices[i],
                                     mesh.mNumVertices));
        const aiVector3D& v = mesh.mVertices[face.mIndices[i]];
        if (!std::isfinite(v.x) || !std::isfinite(v.y) || !std::isfinite(v.z))
          return Damaged(fmt::format("vertex {} of its face {} is no finite number", i, f));
      }
    }
  }
  return std::nullopt;
}

// Gathers triangles in one frame; vertices at one place become one.
class Gatherer {
 public:
  explicit Gatherer(const Vector3& scale) : scale_(scale) {}

  bool Add(const aiScene& scene, const aiNode& node, const Eigen::Matrix4d& above) {
    const aiMatrix4x4& t = node.mTransformation;
    Eigen::Matrix4d own;
    own << t.a1, t.a2, t.a3, t.a4, t.b1, t.b2, t.b3, t.b4, t.c1, t.c2, t.c3, t.c4, t.d1, t.d2, t.d3, t.d4;
    const Eigen::Matrix4d X = above * own;
    for (unsigned i = 0; i < node.mNumMeshes; ++i) {
      if (node.mMeshes[i] < scene.mNumMeshes && !AddMesh(*scene.mMeshes[node.mMeshes[i]], X)) return false;
    }
    for (unsigned i = 0; i < node.mNumChildren; ++i) {
      if (!Add(scene, *node.mChildren[i], X)) return false;
    }
    return true;
  }

  MeshData Release() { return std::move(out_); }

 private:
  bool AddMesh(const aiMesh& mesh, const Eigen::Matrix4d& X) {
    // A mirror turns triangles inside out.
    const bool mirrored = X.topLeftCorner<3, 3>().determinant() * scale_.prod() < 0;
    std::vector<int> number(mesh.mNumVertices, -1);
    for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
      const aiFace& face = mesh.mFaces[f];
      if (face.mNumIndices != 3) continue;  // points and lines
      Eigen::Vector3i triangle;
      for (int k = 0; k < 3; ++k) {
        const unsigned index = face.mIndices[k];
        if (number[index] < 0) number[index] = Number(X, mesh.mVertices[index]);
        triangle[k] = number[index];
      }
      if (mirrored) std::swap(triangle[1], triangle[2]);
      if (triangle[0] == triangle[1] || triangle[1] == triangle[2] || triangle[2] == triangle[0]) continue;
      out_.triangles.push_back(triangle);
    }
    return out_.vertices.size() <= kMostVertices && out_.triangles.size() <= kMostVertices;
  }

  int Number(const Eigen::Matrix4d& X, const aiVector3D& v) {
    const Eigen::Vector4d p = X * Eigen::Vector4d(v.x, v.y, v.z, 1);
    const Eigen::Vector3f at =
        p.head<3>().cwiseProduct(scale_).cast<float>() + Eigen::Vector3f::Zero();  // no -0
    const auto [known, fresh] =
        known_.emplace(std::array{at.x(), at.y(), at.z()}, static_cast<int>(out_.vertices.size()));
    if (fresh) out_.vertices.push_back(at);
    return known->second;
  }

  Vector3 scale_;
  MeshData out_;
  std::map<std::array<float, 3>, int> known_;
};

std::optional<MeshFault> CheckSolid(const MeshData& mesh) {
  if (mesh.triangles.empty())
    return MeshFault{ErrorCode::kModel, "it has no triangle",
                     "give it faces, or use a box, cylinder or sphere"};
  for (const Eigen::Vector3f& v : mesh.vertices) {
    if (!v.allFinite()) return Damaged("a vertex, placed and scaled, is too large for a number");
  }
  // The best tetrahedron of four steps: the farthest point, the farthest from that line, from that plane.
  const Vector3 a = mesh.vertices[0].cast<double>();
  const auto farthest = [&](const auto& distance) {
    Vector3 best = a;
    for (const Eigen::Vector3f& v : mesh.vertices) {
      if (distance(v.cast<double>()) > distance(best)) best = v.cast<double>();
    }
    return best;
  };
  const Vector3 b = farthest([&](const Vector3& p) { return (p - a).norm(); });
  const double size = (b - a).norm();
  const Vector3 c = farthest([&](const Vector3& p) { return (p - a).cross(b - a).norm(); });
  const Vector3 normal = (b - a).cross(c - a).normalized();
  const Vector3 d = farthest([&](const Vector3& p) { return std::abs(normal.dot(p - a)); });
  const double thickness = std::abs(normal.dot(d - a));
  double reach = 0;
  for (const Eigen::Vector3f& v : mesh.vertices) reach = std::max<double>(reach, v.cwiseAbs().maxCoeff());
  // Coordinates are floats: a plane that does not lie along the axes is no flatter than their rounding.
  const double rounding = 8 * std::numeric_limits<float>::epsilon() * reach;
  if (mesh.vertices.size() < 4 || !(thickness > std::max(1e-6 * size, rounding))) {
    return MeshFault{
        ErrorCode::kModel,
        fmt::format("its {} vertices lie in one plane, so it has no volume", mesh.vertices.size()),
        "give it thickness, or use a box"};
  }
  // The engine's own bound (mjMINVAL) is 1e-15 m³; that far down lies a file in the wrong unit.
  const double volume = std::abs(normal.dot(d - a)) * (b - a).cross(c - a).norm() / 6;
  if (volume < 1e-14) {
    return MeshFault{ErrorCode::kModel, fmt::format("it is only {:.2g} m in size", size),
                     "correct its unit or its scale"};
  }
  return std::nullopt;
}

}  // namespace

bool IsKnownMesh(const std::string& path) {
  const std::string extension = MeshExtension(path);
  return extension == ".dae" || extension == ".obj" || extension == ".stl" || extension == ".glb";
}

tl::expected<MeshData, MeshFault> ReadMeshFile(const std::string& path, const Vector3& scale) {
  const auto fail = [](MeshFault fault) { return tl::unexpected<MeshFault>(std::move(fault)); };
  Expected<std::string> content = ReadFile(path);
  if (!content) return fail({ErrorCode::kFile, content.error().message, "check the path"});
  if (content->empty()) return fail(Damaged("it is empty"));
  const std::string extension = MeshExtension(path);
  std::string bytes;  // that the reader gets to see
  if (extension == ".obj" || extension == ".dae") {
    auto clean = extension == ".obj" ? CleanObj(*content) : CleanDae(*content);
    if (!clean) return fail(std::move(clean.error()));
    bytes = std::move(*clean);
  } else if (extension == ".stl") {
    if (auto fault = FindStlDamage(*content)) return fail(std::move(*fault));
    // Bytes behind the last triangle, which some programs write, would make the reader doubt that it is
    // binary.
    bytes = content->substr(0, BinaryStlSize(*content).value_or(content->size()));
  } else if (extension == ".glb") {
    if (auto fault = FindGlbDamage(*content)) return fail(std::move(*fault));
    bytes = std::move(*content);
  }
  try {
    Assimp::Importer importer;
    // ROS tools show a COLLADA file along the axes it is written in, whatever its up_axis says.
    importer.SetPropertyBool(AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, true);
    // A file without geometry would get a drawing of its skeleton.
    importer.SetPropertyBool(AI_CONFIG_IMPORT_NO_SKELETON_MESHES, true);
    const aiScene* scene = importer.ReadFileFromMemory(bytes.data(), bytes.size(), 0, extension.c_str() + 1);
    if (scene == nullptr)
      return fail(Damaged(fmt::format("it cannot be read ({})", importer.GetErrorString())));
    if (auto fault = CheckScene(scene)) return fail(std::move(*fault));
    scene = importer.ApplyPostProcessing(aiProcess_Triangulate);
    if (auto fault = CheckScene(scene)) return fail(std::move(*fault));
    Gatherer gatherer(scale);
    if (!gatherer.Add(*scene, *scene->mRootNode, Eigen::Matrix4d::Identity())) {
      return fail({ErrorCode::kModel, fmt::format("it has more than {} vertices", kMostVertices),
                   "simplify it before it is used here"});
    }
    MeshData mesh = gatherer.Release();
    if (auto fault = CheckSolid(mesh)) return fail(std::move(*fault));
    return mesh;
  } catch (const std::exception& e) {
    return fail(Damaged(fmt::format("it cannot be read ({})", e.what())));
  }
}

std::string WriteObj(const MeshData& mesh) {
  fmt::memory_buffer out;
  for (const Eigen::Vector3f& v : mesh.vertices)  // 9 digits give the same float back
    fmt::format_to(std::back_inserter(out), "v {:.9g} {:.9g} {:.9g}\n", v.x(), v.y(), v.z());
  for (const Eigen::Vector3i& t : mesh.triangles)
    fmt::format_to(std::back_inserter(out), "f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
  return fmt::to_string(out);
}

}  // namespace fork1s::internal
