// A recording as a glTF scene: nodes for bodies and shapes, an animation for what moves.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fork1s/record/gltf.hpp>

#include "body_names.hpp"
#include "gltf_meshes.hpp"
#include "record/output_file.hpp"

namespace fork1s {
namespace {

using internal::GltfDocument;
using internal::GltfJson;

// Of MuJoCo's convention: groups from here on hold collision shapes that models do not show.
constexpr int kFirstHiddenGroup = 3;
constexpr double kSmallestPlane = 1;  // m, half the side of planes without end
constexpr double kPlaneMargin = 1.5;  // of how far what moves gets over them

// A moment of the recording: the step after which it is, -1 for its start.
struct Key {
  int step = -1;
  float time = 0;  // s since the start
};

std::vector<Key> Keys(const Recording& recording, double fps) {
  const std::vector<double>& steps = recording.data().time;
  std::vector<double> times = {0};
  for (double t : steps) times.push_back(t - steps[0] + recording.header().options.dt);
  std::vector<std::size_t> chosen = FirstOfEachFrame(times, fps);
  if (chosen.back() + 1 < times.size()) chosen.push_back(times.size() - 1);  // the end is worth a key
  std::vector<Key> keys;
  for (std::size_t i : chosen) {
    const auto time = static_cast<float>(times[i]);
    FORK1S_REQUIRE(std::isfinite(time), i);
    // Where floats no longer tell two steps apart, one of them is enough.
    if (keys.empty() || time > keys.back().time) keys.push_back({static_cast<int>(i) - 1, time});
  }
  return keys;
}

class SceneWriter {
 public:
  SceneWriter(const Recording& recording, std::vector<Key> keys)
      : recording_(recording), keys_(std::move(keys)), document_("fork1s"), meshes_(document_) {}

  const GltfDocument& Write() {
    const Scene& scene = recording_.scene();
    document_.json()["scene"] = 0;
    document_.Add("scenes", {{"name", scene.name}, {"nodes", {0}}});
    // x y z of ours is x -z y of glTF: a quarter turn about x.
    document_.Add("nodes", {{"name", "z_up"}, {"rotation", {-std::sqrt(0.5), 0, 0, std::sqrt(0.5)}}});
    GltfJson roots = GltfJson::array();
    const std::vector<std::string> names = internal::BodyNames(recording_.header());
    for (std::size_t b = 0; b < names.size(); ++b) {
      const RigidTransform X_WB = recording_.Pose(-1, static_cast<int>(b));
      roots.push_back(AddBody(names[b], X_WB, Geometries(b)));
      Animate(static_cast<int>(b), roots.back().get<int>(), names[b]);
    }
    if (!scene.world.empty()) roots.push_back(AddBody("world", RigidTransform(), scene.world));
    if (!roots.empty()) document_.json()["nodes"][0]["children"] = std::move(roots);
    if (!channels_.empty())
      document_.Add(
          "animations",
          {{"name", scene.name}, {"channels", std::move(channels_)}, {"samplers", std::move(samplers_)}});
    return document_;
  }

 private:
  const std::vector<GeometryDef>& Geometries(std::size_t body) const {
    const SceneBody& b = recording_.bodies()[body];
    const auto index = static_cast<std::size_t>(b.index);
    return b.mechanism < 0 ? recording_.scene().free_bodies[index].geometries
                           : recording_.scene()
                                 .mechanisms[static_cast<std::size_t>(b.mechanism)]
                                 .bodies[index]
                                 .geometries;
  }

  static void SetPose(const RigidTransform& X, GltfJson& node) {
    FORK1S_REQUIRE(X.IsFinite(), X.translation().transpose());
    const Vector3& p = X.translation();
    const Quaternion q = X.quaternion().normalized();
    if (p != Vector3::Zero()) node["translation"] = {p.x(), p.y(), p.z()};
    if (q.w() != 1) node["rotation"] = {q.x(), q.y(), q.z(), q.w()};
  }

  int AddBody(const std::string& name, const RigidTransform& X_WB,
              const std::vector<GeometryDef>& geometries) {
    const int number = document_.Add("nodes", {{"name", name}});
    GltfJson body = {{"name", name}};
    SetPose(X_WB, body);
    const bool has_visible = std::any_of(geometries.begin(), geometries.end(), [](const GeometryDef& g) {
      return g.group < kFirstHiddenGroup && g.rgba(3) > 0;
    });
    for (const GeometryDef& g : geometries) {
      if (!(g.rgba(3) > 0) || (has_visible && g.group >= kFirstHiddenGroup)) continue;
      const auto mesh = meshes_.Mesh(g, PlaneHalf(g.shape, X_WB * g.X_BG));
      if (!mesh) continue;
      GltfJson node;
      if (!g.name.empty()) node["name"] = g.name;
      node["mesh"] = *mesh;
      SetPose(g.X_BG, node);
      body["children"].push_back(document_.Add("nodes", std::move(node)));
    }
    document_.json()["nodes"][static_cast<std::size_t>(number)] = std::move(body);
    return number;
  }

  // Half the side of a square in a plane's z = 0 over which all bodies stay.
  double PlaneHalf(const Shape& shape, const RigidTransform& X_WG) const {
    const auto* plane = std::get_if<Plane>(&shape);
    if (!plane || (plane->half_x > 0 && plane->half_y > 0)) return kSmallestPlane;
    double half = kSmallestPlane;
    const RigidTransform X_GW = X_WG.inverse();
    for (std::size_t b = 0; b < recording_.bodies().size(); ++b) {
      double radius = 0;
      for (const GeometryDef& g : Geometries(b))
        if (!std::holds_alternative<Plane>(g.shape))
          radius = std::max(radius, g.X_BG.translation().norm() + BoundingRadius(g.shape));
      for (const Key& key : keys_) {
        const Vector3 p_G = X_GW * recording_.Pose(key.step, static_cast<int>(b)).translation();
        half = std::max(half, kPlaneMargin * (p_G.head<2>().cwiseAbs().maxCoeff() + radius));
      }
    }
    return half;
  }

  // Channels for what of a body's pose changes from key to key, once written as floats.
  void Animate(int body, int node, const std::string& name) {
    std::vector<float> translations, rotations;
    Quaternion last = recording_.Pose(-1, body).quaternion();
    for (const Key& key : keys_) {
      const RigidTransform X = recording_.Pose(key.step, body);
      FORK1S_REQUIRE(X.IsFinite(), name, key.step + 1);
      Quaternion q = X.quaternion().normalized();
      if (q.dot(last) < 0) q.coeffs() = -q.coeffs();  // the short way from key to key
      last = q;
      for (int k = 0; k < 3; ++k) translations.push_back(static_cast<float>(X.translation()(k)));
      for (int k = 0; k < 4; ++k) rotations.push_back(static_cast<float>(q.coeffs()(k)));
    }
    AddChannel(node, "translation", translations, 3);
    AddChannel(node, "rotation", rotations, 4);
  }

  void AddChannel(int node, const char* path, const std::vector<float>& values, int width) {
    const auto w = static_cast<std::size_t>(width);
    bool changes = false;
    for (std::size_t i = w; i < values.size(); ++i) changes = changes || values[i] != values[i - w];
    if (!changes) return;
    if (time_ < 0) {
      std::vector<float> times;
      for (const Key& key : keys_) times.push_back(key.time);
      time_ = document_.AddKeys(times, 1, true);
    }
    GltfJson sampler = {{"input", time_}, {"interpolation", "LINEAR"}};
    sampler["output"] = document_.AddKeys(values, width, false);
    channels_.push_back({{"sampler", samplers_.size()}, {"target", {{"node", node}, {"path", path}}}});
    samplers_.push_back(std::move(sampler));
  }

  const Recording& recording_;
  std::vector<Key> keys_;
  GltfDocument document_;
  internal::GltfMeshes meshes_;
  int time_ = -1;  // accessor that all samplers share
  GltfJson channels_ = GltfJson::array(), samplers_ = GltfJson::array();
};

}  // namespace

Expected<void> ExportGltf(const Recording& recording, const std::string& path, const GltfOptions& options) {
  const std::string extension = std::filesystem::path(path).extension().string();
  if (extension != ".glb" && extension != ".gltf")
    return Fail(ErrorCode::kUsage, path,
                "is no name for a glTF file; it ends in .glb (binary) or .gltf (text)");
  if (!(options.fps >= 0))
    return Fail(ErrorCode::kUsage, "fps", "must be a number of keys a second, or 0 for one every step");
  std::string bytes;
  try {
    SceneWriter writer(recording, Keys(recording, options.fps));
    const GltfDocument& document = writer.Write();
    if (extension == ".gltf") {
      bytes = document.Text();
    } else {
      auto binary = document.Binary(path);
      if (!binary) return tl::unexpected(binary.error());
      bytes = std::move(*binary);
    }
  } catch (const std::invalid_argument& e) {  // numbers and meshes that no run can have had
    return Fail(ErrorCode::kFormat, recording.header().path,
                std::string("cannot be drawn (") + e.what() + "); the file is damaged, record it again");
  }
  constexpr FileKind kBinary{"a binary glTF file", "glTF"}, kText{"a glTF file", "{"};
  return WriteFile(path, extension == ".gltf" ? kText : kBinary, bytes);
}

}  // namespace fork1s
