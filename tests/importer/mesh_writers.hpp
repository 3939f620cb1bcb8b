// Small solids, and the formats that other programs write them in.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

namespace fork1s::testing_importer {

struct Solid {
  std::vector<std::array<float, 3>> vertices;
  std::vector<std::array<int, 3>> faces;  // outwards
};

/// Corners at the origin and on the axes: volume abc/6, centre (a, b, c)/4.
inline Solid CornerTetrahedron(double a, double b, double c) {
  const auto f = [](double x) { return static_cast<float>(x); };
  return {{{0, 0, 0}, {f(a), 0, 0}, {0, f(b), 0}, {0, 0, f(c)}},
          {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
}

/// A square tube along z, open at both ends, about the origin: half widths outside and inside, length.
inline Solid SquareTube(double outer, double inner, double length) {
  Solid solid;
  for (const double z : {0.0, length})
    for (const double r : {outer, inner})
      for (int k = 0; k < 4; ++k)
        solid.vertices.push_back({static_cast<float>(k == 0 || k == 3 ? r : -r),
                                  static_cast<float>(k < 2 ? r : -r), static_cast<float>(z)});
  for (int k = 0; k < 4; ++k) {
    const int n = (k + 1) % 4;
    // Rings of four: 0 outside and 4 inside at z = 0, 8 and 12 at the other end.
    for (const auto& [a, b, c, d] : {std::array{k, n, 8 + n, 8 + k},
                                     {4 + n, 4 + k, 12 + k, 12 + n},
                                     {n, k, 4 + k, 4 + n},
                                     {8 + k, 8 + n, 12 + n, 12 + k}}) {
      solid.faces.push_back({a, b, c});
      solid.faces.push_back({a, c, d});
    }
  }
  return solid;
}

template <class T>
void AppendBytes(std::string& text, const T& value) {
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  text.append(bytes, sizeof(T));
}

inline std::string BinaryStl(const Solid& solid) {
  std::string text(80, ' ');
  AppendBytes(text, static_cast<std::uint32_t>(solid.faces.size()));
  for (const auto& face : solid.faces) {
    AppendBytes(text, std::array<float, 3>{0, 0, 0});
    for (int i : face) AppendBytes(text, solid.vertices[static_cast<std::size_t>(i)]);
    text.append(2, '\0');
  }
  return text;
}

/// Three numbers, as some programs write them: .3 for 0.3.
inline std::string Triple(const std::array<float, 3>& v) {
  std::string text;
  for (float x : v) {
    char number[40];
    std::snprintf(number, sizeof number, "%.9g", static_cast<double>(x));
    std::string short_one = number;
    if (short_one.rfind("0.", 0) == 0) short_one.erase(0, 1);
    if (short_one.rfind("-0.", 0) == 0) short_one.erase(1, 1);
    text += short_one + " ";
  }
  return text;
}

inline std::string TextStl(const Solid& solid) {
  std::string text = "solid part\n";
  for (const auto& face : solid.faces) {
    text += "facet normal 0 0 0\nouter loop\n";
    for (int i : face) text += "vertex " + Triple(solid.vertices[static_cast<std::size_t>(i)]) + "\n";
    text += "endloop\nendfacet\n";
  }
  return text + "endsolid part\n";
}

inline std::string Obj(const Solid& solid) {
  std::string text = "o part\n";
  for (const auto& v : solid.vertices) text += "v " + Triple(v) + "\n";
  for (const auto& f : solid.faces)
    text += "f " + std::to_string(f[0] + 1) + " " + std::to_string(f[1] + 1) + " " +
            std::to_string(f[2] + 1) + "\n";
  return text;
}

struct DaeOptions {
  std::string meter = "1";
  std::string up_axis = "Z_UP";
  std::string node = "";  // transforms of the node, as COLLADA elements
};

inline std::string Dae(const Solid& solid, const DaeOptions& options = {}) {
  std::string positions, indices;
  for (const auto& v : solid.vertices) positions += Triple(v);
  for (const auto& f : solid.faces)
    for (int i : f) indices += std::to_string(i) + " ";
  const std::string n = std::to_string(solid.vertices.size()), n3 = std::to_string(3 * solid.vertices.size());
  return R"(<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="u" meter=")" +
         options.meter + R"("/><up_axis>)" + options.up_axis + R"(</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count=")" +
         n3 + "\">" + positions + R"(</float_array><technique_common><accessor source="#pa" count=")" + n +
         R"(" stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
</accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count=")" +
         std::to_string(solid.faces.size()) + R"("><input semantic="VERTEX" source="#v" offset="0"/><p>)" +
         indices +
         R"(</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n">)" +
         options.node + R"(<instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>)";
}

inline std::string Glb(const Solid& solid) {
  std::string binary;
  for (const auto& face : solid.faces)
    for (int i : face) AppendBytes(binary, static_cast<std::uint32_t>(i));
  const std::string at = std::to_string(binary.size()), indices = std::to_string(3 * solid.faces.size());
  for (const auto& v : solid.vertices) AppendBytes(binary, v);
  std::array<float, 3> low = solid.vertices[0], high = low;
  for (const auto& v : solid.vertices)
    for (std::size_t k = 0; k < 3; ++k) low[k] = std::min(low[k], v[k]), high[k] = std::max(high[k], v[k]);
  const auto list = [](const std::array<float, 3>& v) {
    return "[" + std::to_string(v[0]) + "," + std::to_string(v[1]) + "," + std::to_string(v[2]) + "]";
  };
  const std::string all = std::to_string(binary.size()), points = std::to_string(12 * solid.vertices.size());
  std::string json = R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],)"
                     R"("meshes":[{"primitives":[{"attributes":{"POSITION":1},"indices":0}]}],)"
                     R"("accessors":[{"bufferView":0,"componentType":5125,"count":)" +
                     indices + R"(,"type":"SCALAR"},{"bufferView":1,"componentType":5126,"count":)" +
                     std::to_string(solid.vertices.size()) + R"(,"type":"VEC3","min":)" + list(low) +
                     R"(,"max":)" + list(high) +
                     R"(}],"bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":)" + at +
                     R"(},{"buffer":0,"byteOffset":)" + at + R"(,"byteLength":)" + points +
                     R"(}],"buffers":[{"byteLength":)" + all + "}]}";
  while (json.size() % 4 != 0) json += ' ';
  std::string text = "glTF";
  AppendBytes(text, std::uint32_t{2});
  AppendBytes(text, static_cast<std::uint32_t>(12 + 8 + json.size() + 8 + binary.size()));
  AppendBytes(text, static_cast<std::uint32_t>(json.size()));
  text += "JSON" + json;
  AppendBytes(text, static_cast<std::uint32_t>(binary.size()));
  text.append("BIN\0", 4);
  return text + binary;
}

}  // namespace fork1s::testing_importer
