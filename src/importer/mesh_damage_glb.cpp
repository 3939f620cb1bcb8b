// Binary glTF: what the reader drops silently (faces that name no vertex) or takes on trust (ranges of
// bytes).
#include <fmt/format.h>

#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>

#include "mesh_file.hpp"

namespace fork1s::internal {
namespace {

using GltfJson = nlohmann::json;

struct GltfFault {
  std::string what;
};

// The two chunks of a file: description and numbers.
struct Gltf {
  GltfJson json;
  std::string_view binary;
};

std::uint32_t Word(const std::string& content, std::size_t at) {
  std::uint32_t word = 0;
  if (at + 4 > content.size()) throw GltfFault{"it ends in the middle"};
  std::memcpy(&word, content.data() + at, 4);
  return word;
}

Gltf Split(const std::string& content) {
  constexpr std::uint32_t kJson = 0x4E4F534A, kBinary = 0x004E4942;
  if (content.compare(0, 4, "glTF") != 0) throw GltfFault{"it does not begin as binary glTF does"};
  if (Word(content, 4) != 2)
    throw GltfFault{fmt::format("it is glTF {}, and only 2 is read", Word(content, 4))};
  if (Word(content, 8) > content.size())
    throw GltfFault{fmt::format("it should have {} bytes and has {}", Word(content, 8), content.size())};
  Gltf out;
  for (std::size_t at = 12; at + 8 <= content.size();) {
    const std::size_t size = Word(content, at);
    const std::uint32_t kind = Word(content, at + 4);
    if (size > content.size() - at - 8) throw GltfFault{"a chunk of it reaches past the end"};
    const std::string_view chunk(content.data() + at + 8, size);
    if (kind == kJson) out.json = GltfJson::parse(chunk, nullptr, false);
    if (kind == kBinary) out.binary = chunk;
    at += 8 + size;
  }
  if (!out.json.is_object()) throw GltfFault{"its description is no JSON object"};
  return out;
}

std::size_t Natural(const GltfJson& object, const char* key, std::size_t missing) {
  const auto found = object.find(key);
  if (found == object.end()) return missing;
  if (!found->is_number_unsigned())
    throw GltfFault{fmt::format("'{}' in its description is no number from 0 up", key)};
  return found->get<std::size_t>();
}

// `array`[index] of the description.
const GltfJson& Entry(const GltfJson& json, const char* array, std::size_t index) {
  const auto list = json.find(array);
  if (list == json.end() || !list->is_array() || index >= list->size() || !(*list)[index].is_object())
    throw GltfFault{fmt::format("its description names {}[{}], which is not there", array, index)};
  return (*list)[index];
}

// Bytes of an accessor whose elements have `size`, one every `stride`; empty where it lies in another buffer.
std::string_view BytesOf(const Gltf& gltf, const GltfJson& accessor, std::size_t size, std::size_t& stride) {
  constexpr std::size_t kNone = ~std::size_t{0};
  const std::size_t view_index = Natural(accessor, "bufferView", kNone);
  if (view_index == kNone) return {};
  const GltfJson& view = Entry(gltf.json, "bufferViews", view_index);
  if (Natural(view, "buffer", 0) != 0) return {};
  stride = Natural(view, "byteStride", size);
  const std::size_t count = Natural(accessor, "count", 0), view_size = Natural(view, "byteLength", 0);
  const std::size_t offset = Natural(accessor, "byteOffset", 0), at = Natural(view, "byteOffset", 0);
  constexpr std::size_t kHuge = std::size_t{1} << 40;  // keeps the sums below from wrapping round
  const bool sane =
      std::max({stride, count, view_size, offset, at}) < kHuge && stride >= size && stride < 256;
  if (!sane || at + view_size > gltf.binary.size() ||
      (count > 0 && offset + stride * (count - 1) + size > view_size))
    throw GltfFault{"a list of numbers in it reaches past the end"};
  return gltf.binary.substr(at + offset, view_size - offset);
}

void CheckPrimitive(const Gltf& gltf, const GltfJson& primitive) {
  constexpr std::size_t kNone = ~std::size_t{0};
  const auto attributes = primitive.find("attributes");
  if (attributes == primitive.end() || !attributes->is_object())
    throw GltfFault{"a part of it has no vertices"};
  const std::size_t position = Natural(*attributes, "POSITION", kNone);
  if (position == kNone) throw GltfFault{"a part of it has no vertices"};
  const GltfJson& points = Entry(gltf.json, "accessors", position);
  const std::size_t vertices = Natural(points, "count", 0);
  std::size_t stride = 0;
  BytesOf(gltf, points, 12, stride);
  const std::size_t indices = Natural(primitive, "indices", kNone);
  if (indices == kNone) return;
  const GltfJson& accessor = Entry(gltf.json, "accessors", indices);
  const std::size_t type = Natural(accessor, "componentType", 0);
  const std::size_t size = type == 5121 ? 1 : type == 5123 ? 2 : type == 5125 ? 4 : 0;
  if (size == 0) throw GltfFault{"its faces name vertices by something else than whole numbers"};
  const std::string_view bytes = BytesOf(gltf, accessor, size, stride);
  if (bytes.empty()) return;
  for (std::size_t i = 0; i < Natural(accessor, "count", 0); ++i) {
    std::uint32_t vertex = 0;
    std::memcpy(&vertex, bytes.data() + i * stride, size);
    if (vertex >= vertices)
      throw GltfFault{fmt::format("a face of it names vertex {}, and there are {}", vertex, vertices)};
  }
}

}  // namespace

std::optional<MeshFault> FindGlbDamage(const std::string& content) {
  try {
    const Gltf gltf = Split(content);
    if (!gltf.json.contains("meshes") || !gltf.json["meshes"].is_array()) throw GltfFault{"it has no mesh"};
    for (const GltfJson& mesh : gltf.json["meshes"]) {
      if (!mesh.is_object() || !mesh.contains("primitives") || !mesh["primitives"].is_array())
        throw GltfFault{"a mesh of it has no parts"};
      for (const GltfJson& primitive : mesh["primitives"]) {
        const auto extensions = primitive.find("extensions");
        const bool packed =
            extensions != primitive.end() && extensions->contains("KHR_draco_mesh_compression");
        if (!packed) CheckPrimitive(gltf, primitive);
      }
    }
  } catch (const GltfFault& fault) {
    return MeshFault{ErrorCode::kFormat, fault.what, "write the mesh again from the program it comes from"};
  }
  return std::nullopt;
}

}  // namespace fork1s::internal
