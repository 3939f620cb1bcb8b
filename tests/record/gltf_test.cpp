// glTF files, read back as any reader would: poses against the simulation, meshes against shapes.
#include <fork1s/record/gltf.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>

#include "support.hpp"

namespace fork1s::testing {
namespace {

using Json = nlohmann::json;

std::string FromBase64(const std::string& text) {
  static const std::string kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes;
  std::uint32_t bits = 0;
  int have = 0;
  for (char c : text) {
    if (c == '=') break;
    bits = bits << 6 | static_cast<std::uint32_t>(kDigits.find(c));
    if ((have += 6) >= 8) bytes += static_cast<char>(bits >> (have -= 8) & 255);
  }
  return bytes;
}

// A file, and what its numbers refer to.
struct Gltf {
  Json json;
  std::string bytes;

  static Gltf Open(const std::string& path) {
    Gltf file;
    const std::string all = Bytes(path);
    if (all.substr(0, 4) != "glTF") {
      file.json = Json::parse(all);
      const std::string uri = file.json["buffers"][0]["uri"], head = "data:application/octet-stream;base64,";
      EXPECT_EQ(uri.substr(0, head.size()), head);
      file.bytes = FromBase64(uri.substr(head.size()));
    } else {
      auto word = [&](std::size_t at) {
        std::uint32_t w = 0;
        std::memcpy(&w, all.data() + at, 4);
        return static_cast<std::size_t>(w);
      };
      EXPECT_EQ(word(4), 2u);
      EXPECT_EQ(word(8), all.size());
      const std::size_t size = word(12);
      EXPECT_EQ(size % 4, 0u);
      EXPECT_EQ(all.substr(16, 4), "JSON");
      file.json = Json::parse(all.substr(20, size));
      if (20 + size < all.size()) {
        EXPECT_EQ(all.substr(24 + size, 4), std::string("BIN\0", 4));
        EXPECT_EQ(28 + size + word(20 + size), all.size());
        file.bytes = all.substr(28 + size);
      }
    }
    EXPECT_EQ(file.json["asset"]["version"], "2.0");
    EXPECT_EQ(file.json["asset"]["generator"], "fork1s");
    if (file.json.contains("buffers")) {
      EXPECT_EQ(file.json["buffers"][0]["byteLength"], file.bytes.size());
    }
    return file;
  }

  // Elements of an accessor, and that its bounds are true.
  std::vector<std::vector<double>> Values(const Json& number) const {
    const Json& a = json["accessors"].at(number.get<std::size_t>());
    const Json& view = json["bufferViews"].at(a["bufferView"].get<std::size_t>());
    const std::map<std::string, std::size_t> widths = {{"SCALAR", 1}, {"VEC3", 3}, {"VEC4", 4}};
    const std::size_t width = widths.at(a["type"]), type = a["componentType"];
    const std::size_t size = type == 5123 ? 2 : 4, count = a["count"], begin = a["byteOffset"];
    const std::size_t stride = view.value("byteStride", size * width);
    EXPECT_EQ(begin % size, 0u);
    EXPECT_LE(begin + (count - 1) * stride + size * width, view["byteLength"].get<std::size_t>());
    std::vector<std::vector<double>> values(count, std::vector<double>(width));
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t k = 0; k < width; ++k) {
        const char* at = bytes.data() + view["byteOffset"].get<std::size_t>() + begin + i * stride + k * size;
        float number32 = 0;
        std::uint32_t index = 0;
        if (type == 5126) std::memcpy(&number32, at, 4);
        if (type != 5126) std::memcpy(&index, at, size);
        values[i][k] = type == 5126 ? static_cast<double>(number32) : index;
      }
    for (const char* bound : {"min", "max"})
      for (std::size_t k = 0; a.contains(bound) && k < width; ++k) {
        double extreme = values[0][k];
        for (const auto& v : values)
          extreme = bound == std::string("min") ? std::min(extreme, v[k]) : std::max(extreme, v[k]);
        EXPECT_EQ(a[bound][k].get<double>(), extreme);
      }
    return values;
  }

  int Node(const std::string& name) const {
    for (std::size_t i = 0; i < json["nodes"].size(); ++i)
      if (json["nodes"][i].value("name", "") == name) return static_cast<int>(i);
    return -1;
  }

  // Values of one channel at the keys; those of the node itself where it has no channel.
  struct Track {
    std::vector<std::vector<double>> values;
    bool animated = false;
  };
  Track Channel(int node, const std::string& path) const {
    const Json& n = json["nodes"][static_cast<std::size_t>(node)];
    for (const Json& c : json.contains("animations") ? json["animations"][0]["channels"] : Json::array())
      if (c["target"]["node"] == node && c["target"]["path"] == path) {
        const Json& sampler = json["animations"][0]["samplers"][c["sampler"].get<std::size_t>()];
        EXPECT_EQ(sampler["interpolation"], "LINEAR");
        EXPECT_EQ(sampler["input"], json["animations"][0]["samplers"][0]["input"]);
        return {Values(sampler["output"]), true};
      }
    const std::vector<double> rest =
        path == "rotation" ? std::vector<double>{0, 0, 0, 1} : std::vector<double>{0, 0, 0};
    return {{n.value(path, rest)}, false};
  }
  std::vector<double> Times() const {
    std::vector<double> times;
    for (const auto& t : Values(json["animations"][0]["samplers"][0]["input"])) times.push_back(t[0]);
    return times;
  }
};

// Pose in glTF's axes, y up, of a track at a key: through the node at the root as a reader composes it.
RigidTransform World(const Gltf& file, int node, std::size_t key) {
  const Json& root = file.json["nodes"][file.json["scenes"][0]["nodes"][0].get<std::size_t>()];
  auto at = [&](const char* path) {
    const auto track = file.Channel(node, path);
    return track.animated ? track.values[key] : track.values[0];
  };
  const auto r = root["rotation"].get<std::vector<double>>();
  const auto p = at("translation"), q = at("rotation");
  return RigidTransform(Quaternion(r[3], r[0], r[1], r[2]), Vector3::Zero()) *
         RigidTransform(Quaternion(q[3], q[0], q[1], q[2]), Vector3(p[0], p[1], p[2]));
}

class GltfFile : public ::testing::Test {
 protected:
  // Records `steps` of a scene and keeps every pose that the simulation had.
  void Run(const Scene& scene, int steps) {
    Simulation simulation = CreateOrThrow(scene);
    auto recorder = Recorder::Create(folder_ / "run.h5", simulation);
    ASSERT_TRUE(recorder);
    Keep(simulation);
    for (int i = 0; i < steps; ++i) {
      Record(simulation, *recorder, 1);
      Keep(simulation);
    }
    ASSERT_TRUE(recorder->Finish());
    for (const SceneBody& b : simulation.bodies()) names_.push_back(b.name);
  }
  void Keep(const Simulation& simulation) {
    times_.push_back(simulation.time());
    poses_.emplace_back();
    for (std::size_t b = 0; b < simulation.bodies().size(); ++b)
      poses_.back().push_back(simulation.Pose(static_cast<int>(b)));
  }
  Gltf Export(const std::string& name, const GltfOptions& options = {}) {
    const auto recording = Recording::Open(folder_ / "run.h5");
    EXPECT_TRUE(recording) << recording.error().Text();
    const auto ok = ExportGltf(*recording, folder_ / name, options);
    EXPECT_TRUE(ok) << ok.error().Text();
    return Gltf::Open(folder_ / name);
  }

  Folder folder_;
  std::vector<double> times_;
  std::vector<std::vector<RigidTransform>> poses_;  // step by step, from before the first
  std::vector<std::string> names_;
};

TEST_F(GltfFile, NodesMoveAsTheSimulationDid) {
  Run(TouchingScene(), 300);
  const Matrix3 y_up = Eigen::AngleAxisd(-M_PI / 2, Vector3::UnitX()).toRotationMatrix();
  EXPECT_LT((y_up * Vector3::UnitZ() - Vector3::UnitY()).norm(), 1e-15);
  for (const char* name : {"run.glb", "run.gltf"})
    for (double fps : {0.0, 60.0}) {
      const Gltf file = Export(name, {.fps = fps});
      const std::vector<double> times = file.Times();
      // 300 steps of 5 ms are 1.5 s: all and the start, or 90 frames and the start.
      EXPECT_EQ(times.size(), fps > 0 ? 91u : 301u);
      EXPECT_EQ(times.front(), 0);
      EXPECT_NEAR(times.back(), times_.back(), 1e-6);
      for (std::size_t k = 0; k < times.size(); ++k) {
        if (k > 0) {
          EXPECT_GT(times[k], times[k - 1]);
        }
        const auto step = static_cast<std::size_t>(std::lround(times[k] / 0.005));
        ASSERT_NEAR(times[k], times_[step], 1e-6);
        for (std::size_t b = 0; b < names_.size(); ++b) {
          const RigidTransform X = World(file, file.Node(names_[b]), k);
          // Floats of 24 bits hold places within 1 m to 3e-8 m and quaternions to 6e-8.
          EXPECT_LT((X.translation() - y_up * poses_[step][b].translation()).norm(), 1e-6) << names_[b];
          EXPECT_LT((X.rotation() - y_up * poses_[step][b].rotation()).norm(), 1e-6) << names_[b];
        }
      }
    }
}

TEST_F(GltfFile, WhatStandsStillHasNoChannelAndRotationsGoTheShortWay) {
  // A free body that spins three times a second without weight: its quaternion passes -1 again and again.
  Scene scene;
  scene.gravity = Vector3::Zero();
  scene.timestep = 0.01;
  FreeBodyDef top;
  top.name = "top";
  top.inertia = Ball(1, 0.1);
  top.geometries = {Geometry("top", Box{Vector3(0.1, 0.2, 0.3)})};
  FreeBodyDef still = top;
  still.name = "still";
  still.X_WB = RigidTransform(Vector3(2, 0, 0));
  scene.free_bodies = {top, still};
  KeyframeDef key;
  key.name = "spin";
  key.free_bodies = {{top.X_WB, Vector3(0, 0, 6 * M_PI), Vector3::Zero()},
                     {still.X_WB, {0, 0, 0}, {0, 0, 0}}};
  scene.keyframes = {key};
  SimulationOptions options;
  options.initial_keyframe = 0;
  Simulation simulation = CreateOrThrow(scene, options);
  auto recorder = Recorder::Create(folder_ / "run.h5", simulation);
  ASSERT_TRUE(recorder);
  for (int i = 0; i < 200; ++i) ASSERT_TRUE(recorder->Append(simulation, simulation.Step()));
  ASSERT_TRUE(recorder->Finish());

  const Gltf file = Export("run.glb", {.fps = 0});
  EXPECT_FALSE(file.Channel(file.Node("still"), "translation").animated);
  EXPECT_FALSE(file.Channel(file.Node("still"), "rotation").animated);
  EXPECT_FALSE(file.Channel(file.Node("top"), "translation").animated);
  const auto turn = file.Channel(file.Node("top"), "rotation");
  ASSERT_TRUE(turn.animated);
  int through_minus_one = 0;
  for (std::size_t k = 1; k < turn.values.size(); ++k) {
    double dot = 0;
    for (std::size_t i = 0; i < 4; ++i) dot += turn.values[k][i] * turn.values[k - 1][i];
    EXPECT_NEAR(dot, std::cos(6 * M_PI * 0.01 / 2), 1e-5) << k;  // half the angle of a step
    through_minus_one += turn.values[k][3] < 0 && turn.values[k - 1][3] >= 0;
  }
  EXPECT_EQ(through_minus_one, 3);  // 6 turns are 3 of a quaternion
}

// Lowest and highest vertex of each shape, by the name of its node.
using Extents = std::map<std::string, std::pair<Vector3, Vector3>>;
Extents ShapeExtents(const Gltf& file) {
  Extents extents;
  for (const Json& node : file.json["nodes"]) {
    if (!node.contains("mesh")) continue;
    const Json& primitive = file.json["meshes"][node["mesh"].get<std::size_t>()]["primitives"][0];
    const Json& a = file.json["accessors"][primitive["attributes"]["POSITION"].get<std::size_t>()];
    const auto low = a["min"].get<std::vector<double>>(), high = a["max"].get<std::vector<double>>();
    const auto positions = file.Values(primitive["attributes"]["POSITION"]);
    EXPECT_EQ(positions.size(), file.Values(primitive["attributes"]["NORMAL"]).size());
    for (const auto& i : file.Values(primitive["indices"]))
      EXPECT_LT(i[0], static_cast<double>(positions.size()));
    extents[node.value("name", "")] = {{low[0], low[1], low[2]}, {high[0], high[1], high[2]}};
  }
  return extents;
}

TEST_F(GltfFile, MeshesHaveTheSizeOfTheirShapes) {
  Scene scene = TouchingScene();
  auto mesh = std::make_shared<TriangleMesh>();
  mesh->vertices = {{0, 0, 0}, {0.3f, 0, 0}, {0, 0.2f, 0}, {0, 0, 0.1f}};
  mesh->triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  auto grid = std::make_shared<HeightGrid>();
  *grid = {"hills", 3, 3, 1.5, 1, 0.2, 0.1, {0, 0, 0, 0, 1, 0, 0, 0, 0.5f}};
  const std::pair<Shape, Vector3> shapes[] = {
      {Sphere{0.25}, {0.25, 0.25, 0.25}},      {Capsule{0.1, 0.3}, {0.1, 0.1, 0.4}},
      {Cylinder{0.1, 0.3}, {0.1, 0.1, 0.3}},   {Ellipsoid{{0.1, 0.2, 0.3}}, {0.1, 0.2, 0.3}},
      {Box{{0.3, 0.2, 0.1}}, {0.3, 0.2, 0.1}}, {Plane{0.5, 0.25}, {0.5, 0.25, 0}}};
  for (const auto& [shape, half] : shapes)
    scene.world.push_back(Geometry(ShapeName(shape), shape, {9, 9, -9}));
  scene.world.push_back(Geometry("tetrahedron", MeshShape{mesh}, {9, 9, -9}));
  scene.world.push_back(Geometry("same", MeshShape{mesh}, {12, 9, -9}));
  scene.world.push_back(Geometry("hills", HeightField{grid}, {9, 9, -9}));
  scene.world.back().rgba = Vector4(1, 0.5, 0, 0.25);
  for (GeometryDef& g : scene.world) g.contype = g.name == "ground", g.conaffinity = g.contype;
  GeometryDef hull = Geometry("hull", Sphere{1}), unseen = hull;
  hull.group = 3;
  unseen.name = "unseen";
  unseen.rgba(3) = 0;
  scene.world.insert(scene.world.end(), {hull, unseen});
  scene.mechanisms[0].bodies[0].geometries = {hull};
  scene.mechanisms[0].bodies[0].geometries[0].name = "only_hull";
  for (GeometryDef* g : {&scene.world[scene.world.size() - 2], &scene.world.back(),
                         &scene.mechanisms[0].bodies[0].geometries[0]})
    g->contype = g->conaffinity = 0;
  Run(scene, 40);
  const Gltf file = Export("run.glb");
  Extents extents = ShapeExtents(file);
  for (const auto& [shape, half] : shapes) {
    const auto& [low, high] = extents.at(ShapeName(shape));
    EXPECT_LT((high - half).norm(), 1e-7) << ShapeName(shape);
    EXPECT_LT((low + half).norm(), 1e-7) << ShapeName(shape);
  }
  EXPECT_LT(extents.at("tetrahedron").first.norm(), 1e-12);
  EXPECT_LT((extents.at("tetrahedron").second - Vector3(0.3, 0.2, 0.1)).norm(), 1e-7);
  EXPECT_LT((extents.at("hills").first - Vector3(-1.5, -1, 0)).norm(), 1e-7);
  EXPECT_LT((extents.at("hills").second - Vector3(1.5, 1, 0.2)).norm(), 1e-7);
  // The ground has no end; it is drawn under all that moves.
  const double half = extents.at("ground").second.x();
  for (const auto& row : poses_)
    for (const RigidTransform& X : row) EXPECT_LT(X.translation().head<2>().cwiseAbs().maxCoeff(), half);
  EXPECT_LT(half, 5);
  EXPECT_FALSE(extents.contains("hull"));
  EXPECT_FALSE(extents.contains("unseen"));
  EXPECT_TRUE(extents.contains("only_hull"));

  // What is alike is written once; what is seen through says so.
  auto shape_node = [&](const char* name) {
    return file.json["nodes"][static_cast<std::size_t>(file.Node(name))];
  };
  EXPECT_EQ(shape_node("tetrahedron")["mesh"], shape_node("same")["mesh"]);
  auto material = [&](const char* name) {
    const Json& m = file.json["meshes"][shape_node(name)["mesh"].get<std::size_t>()];
    return file.json["materials"][m["primitives"][0]["material"].get<std::size_t>()];
  };
  EXPECT_EQ(material("hills")["alphaMode"], "BLEND");
  EXPECT_FALSE(material("sphere").contains("alphaMode"));
  // sRGB 0.5 is 0.214 of the light; 1 and 0 are themselves.
  const auto color = material("hills")["pbrMetallicRoughness"]["baseColorFactor"].get<std::vector<double>>();
  EXPECT_NEAR(color[0], 1, 1e-12);
  EXPECT_NEAR(color[1], 0.21404, 1e-5);
  EXPECT_EQ(color[2], 0);
  EXPECT_EQ(color[3], 0.25);
}

TEST_F(GltfFile, StartAloneHasNoAnimation) {
  Run(TouchingScene(), 0);
  const Gltf file = Export("run.glb");
  EXPECT_FALSE(file.json.contains("animations"));
  const RigidTransform X = World(file, file.Node("box"), 0);
  EXPECT_LT((X.translation() - Vector3(0, 0.101, 0)).norm(), 1e-12);
}

TEST_F(GltfFile, NamesAreToldApartAndSpokenInUtf8) {
  Scene scene;
  for (const char* name : {"left", "right"}) {
    MechanismDef m = Chain("arm", BaseKind::kFixed, 2, RigidTransform());
    m.name = name;
    scene.mechanisms.push_back(m);
  }
  scene.mechanisms[1].bodies[1].name = "n\xE4me";  // Latin-1
  Run(scene, 0);
  const Gltf file = Export("run.glb");
  for (const char* name : {"left/arm2", "right/arm2", "arm1", "n\xEF\xBF\xBDme"})
    EXPECT_GE(file.Node(name), 0) << name;
}

TEST_F(GltfFile, RefusesWithASentence) {
  Run(TouchingScene(), 3);
  const auto recording = Recording::Open(folder_ / "run.h5");
  ASSERT_TRUE(recording);
  auto refuses = [&](const std::string& path, GltfOptions options, ErrorCode code, const std::string& what) {
    const auto ok = ExportGltf(*recording, path, options);
    ASSERT_FALSE(ok);
    EXPECT_EQ(ok.error().code, code);
    EXPECT_NE(ok.error().Text().find(what), std::string::npos) << ok.error().Text();
  };
  refuses(folder_ / "run.fbx", {}, ErrorCode::kUsage, ".glb");
  refuses(folder_ / "run.glb", {.fps = -1}, ErrorCode::kUsage, "fps");
  refuses(folder_ / "run.glb", {.fps = std::nan("")}, ErrorCode::kUsage, "fps");
  refuses(folder_ / "none/run.glb", {}, ErrorCode::kFile, "cannot be written");
}

TEST(Frames, AreTheFirstTimesOfEach) {
  using Chosen = std::vector<std::size_t>;
  EXPECT_EQ(FirstOfEachFrame({}, 60), Chosen{});
  EXPECT_EQ(FirstOfEachFrame({5, 5.25, 5.5, 5.75, 6, 6.5, 8}, 2), (Chosen{0, 2, 4, 5, 6}));
  EXPECT_EQ(FirstOfEachFrame({0, 0.1, 0.2}, 0), (Chosen{0, 1, 2}));
  // Sums of 1/60 that round either way lose no frame.
  std::vector<double> times = {0};
  for (int i = 0; i < 10000; ++i) times.push_back(times.back() + 1.0 / 60);
  EXPECT_EQ(FirstOfEachFrame(times, 60).size(), times.size());
}

}  // namespace
}  // namespace fork1s::testing
