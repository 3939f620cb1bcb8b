// Small files that crash, stall or starve MuJoCo's compiler or Assimp, made where they are needed.
#pragma once

#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

namespace fork1s::test {

template <class T>
std::string Bits(std::initializer_list<T> values) {
  std::string bytes(values.size() * sizeof(T), '\0');
  std::memcpy(bytes.data(), values.begin(), bytes.size());
  return bytes;
}

// A binary glTF whose mesh is one tetrahedron of 0.1 m. `nodes` is its JSON from "scenes" to what comes before
// "meshes"; `attributes` are those of the mesh beside POSITION: JOINTS_0 is accessor 2, WEIGHTS_0 accessor 3.
inline std::string Glb(const std::string& nodes, const std::string& attributes = "") {
  std::string json =
      R"({"asset":{"version":"2.0"},"scene":0,)" + nodes +
      R"(,"meshes":[{"primitives":[{"attributes":{"POSITION":0)" + attributes +
      R"(},"indices":1}]}],"buffers":[{"byteLength":152}],"bufferViews":[)"
      R"({"buffer":0,"byteOffset":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":24},)"
      R"({"buffer":0,"byteOffset":72,"byteLength":16},{"buffer":0,"byteOffset":88,"byteLength":64}],)"
      R"("accessors":[)"
      R"({"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[0.1,0.1,0.1]},)"
      R"({"bufferView":1,"componentType":5123,"count":12,"type":"SCALAR"},)"
      R"({"bufferView":2,"componentType":5121,"count":4,"type":"VEC4"},)"
      R"({"bufferView":3,"componentType":5126,"count":4,"type":"VEC4"}]})";
  json.resize((json.size() + 3) / 4 * 4, ' ');
  const std::string bytes = Bits<float>({0, 0, 0, .1f, 0, 0, 0, .1f, 0, 0, 0, .1f}) +
                            Bits<std::uint16_t>({0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3}) +
                            std::string(16, '\0') +
                            Bits<float>({1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0});
  const auto size = [](const std::string& part) { return static_cast<std::uint32_t>(part.size()); };
  return "glTF" + Bits<std::uint32_t>({2, 28 + size(json) + size(bytes), size(json)}) + "JSON" + json +
         Bits<std::uint32_t>({size(bytes)}) + std::string("BIN\0", 4) + bytes;
}

// A tetrahedron whose skin has no inverseBindMatrices, which glTF allows.
inline std::string SkinnedGlb() {
  return Glb(R"("scenes":[{"nodes":[0,1]}],"nodes":[{"mesh":0,"skin":0},{}],"skins":[{"joints":[1]}])",
             R"(,"JOINTS_0":2,"WEIGHTS_0":3)");
}

// `count` nodes, each with the next as its only child or, `doubling`, with two of them; the last has the mesh.
inline std::string NestedGlb(int count, bool doubling) {
  std::string nodes;
  for (int i = 0; i + 1 < count; ++i) {
    const std::string next = std::to_string(i + 1);
    nodes += R"({"children":[)" + next + (doubling ? "," + next : "") + "]},";
  }
  return Glb(R"("scenes":[{"nodes":[0]}],"nodes":[)" + nodes + R"({"mesh":0}])");
}

// A slide with a mesh that MuJoCo makes itself.
inline std::string BuiltinMesh(const std::string& builtin, const std::string& params) {
  return "<mujoco><asset><mesh name=\"m\" builtin=\"" + builtin + "\" params=\"" + params +
         "\"/></asset><worldbody><body pos=\"0 0 1\"><joint type=\"slide\" stiffness=\"10\"/><geom type=\"mesh\" "
         "mesh=\"m\"/></body></worldbody></mujoco>";
}

inline std::string MjcfOfMesh(const std::string& file) {
  return "<mujoco><asset><mesh name=\"m\" file=\"" + file +
         "\"/></asset><worldbody><body pos=\"0 0 1\"><joint name=\"j\" type=\"slide\" stiffness=\"10\"/><geom "
         "type=\"mesh\" mesh=\"m\"/></body></worldbody></mujoco>";
}

inline std::string UrdfOfMesh(const std::string& file) {
  return "<robot name=\"r\"><link name=\"a\"/><link name=\"b\"><inertial><mass value=\"1\"/><inertia "
         "ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial><collision>"
         "<geometry><mesh filename=\"" +
         file +
         "\"/></geometry></collision></link><joint name=\"j\" type=\"revolute\"><parent link=\"a\"/><child "
         "link=\"b\"/><axis xyz=\"0 0 1\"/><limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/></joint>"
         "</robot>";
}

// "v" lines of `count` corners on a circle of 0.1 m, and a face of all of them.
inline std::string ObjOfOneFace(int count) {
  std::string corners = "v 0 0 0.1\n", face = "f";
  for (int i = 0; i < count; ++i) {
    corners += "v 0.1 " + std::to_string(1e-6 * i) + " 0\n";
    face += " " + std::to_string(i + 2);
  }
  return corners + face + "\n";
}

struct HostileModel {
  std::string name, text;
  std::vector<std::pair<std::string, std::string>> beside;  // other files: name, bytes
  std::vector<std::string> pipes;
};

inline std::vector<HostileModel> HostileModels() {
  std::vector<HostileModel> models;
  const std::pair<const char*, const char*> builtin[] = {{"supersphere", "20000 1 1"},
                                                         {"supertorus", "20000 0.2 1 1"},
                                                         {"wedge", "20000 20000 60 60 0"},
                                                         {"plate", "20000 20000"},
                                                         {"cone", "100000000 1"}};
  for (const auto& [shape, params] : builtin)
    models.push_back({std::string(shape) + ".xml", BuiltinMesh(shape, params), {}, {}});
  const std::pair<std::string, std::string> meshes[] = {{"skinned.glb", SkinnedGlb()},
                                                        {"nested.glb", NestedGlb(100000, false)},
                                                        {"doubling.glb", NestedGlb(40, true)},
                                                        {"one_face.obj", ObjOfOneFace(200000)}};
  for (const auto& mesh : meshes)
    models.push_back({mesh.first + ".urdf", UrdfOfMesh(mesh.first), {mesh}, {}});
  const std::string body = "<body><joint stiffness=\"1\"/><geom size=\".1\"/></body>";
  std::string bodies, fields;
  for (int i = 0; i < 20000; ++i) bodies += body;
  for (int i = 0; i < 200; ++i)
    fields += "<hfield name=\"h" + std::to_string(i) + "\" nrow=\"4000\" ncol=\"4000\" size=\"1 1 1 1\"/>";
  models.push_back({"user_numbers.xml",
                    "<mujoco><size nuser_body=\"100000\"/><worldbody>" + bodies + "</worldbody></mujoco>",
                    {},
                    {}});
  models.push_back({"fields.xml",
                    "<mujoco><asset>" + fields + "</asset><worldbody>" + body + "</worldbody></mujoco>",
                    {},
                    {}});
  models.push_back(
      {"cells.xml",
       "<mujoco><worldbody><body name=\"grid\"><flexcomp name=\"f\" type=\"grid\" count=\"46 46 46\" spacing=\".1 .1 .1\" "
       "radius=\".01\" dim=\"3\"/></body></worldbody></mujoco>",
       {},
       {}});
  models.push_back(
      {"attaching.xml",
       "<mujoco><asset><model name=\"m\" file=\"attached.xml\"/></asset><worldbody><body>"
       "<joint stiffness=\"1\"/><geom size=\".1\"/><attach model=\"m\" body=\"b\" prefix=\"p\"/>"
       "</body></worldbody></mujoco>",
       {{"attached.xml",
         "<mujoco><compiler meshdir=\"meshes\"/><asset><mesh name=\"m\" file=\"pipe.stl\"/></asset>"
         "<worldbody><body name=\"b\"><geom type=\"mesh\" mesh=\"m\"/></body></worldbody></mujoco>"}},
       {"meshes/pipe.stl"}});
  return models;
}

}  // namespace fork1s::test
