#include "gltf_document.hpp"
#include "base/base64.hpp"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>

namespace fork1s::internal {
namespace {

static_assert(std::endian::native == std::endian::little, "glTF numbers are little-endian");

constexpr int kUnsignedShort = 5123, kUnsignedInt = 5125, kFloat = 5126;  // 3.6.2.2
constexpr int kArrayBuffer = 34962, kElementArrayBuffer = 34963;

void Pad(std::string& bytes, char with) { bytes.resize((bytes.size() + 3) / 4 * 4, with); }

void AppendWord(std::string& out, std::size_t value) {
  const auto word = static_cast<std::uint32_t>(value);
  out.append(reinterpret_cast<const char*>(&word), sizeof word);
}

// Names may hold bytes that are no UTF-8, which JSON must be.
std::string Dump(const GltfJson& json) {
  return json.dump(-1, ' ', false, GltfJson::error_handler_t::replace);
}

}  // namespace

GltfDocument::GltfDocument(const std::string& generator) {
  json_["asset"] = {{"version", "2.0"}, {"generator", generator}};
}

int GltfDocument::Add(const char* array, GltfJson element) {
  GltfJson& all = json_[array];
  all.push_back(std::move(element));
  return static_cast<int>(all.size()) - 1;
}

int GltfDocument::AddAccessor(View view, GltfJson accessor, const void* bytes, std::size_t size) {
  auto at = std::find(used_.begin(), used_.end(), view);
  if (at == used_.end()) at = used_.insert(at, view);
  std::string& data = views_[view];
  accessor["bufferView"] = at - used_.begin();
  accessor["byteOffset"] = data.size();
  data.append(static_cast<const char*>(bytes), size);
  Pad(data, '\0');
  accessors_.push_back(std::move(accessor));
  return static_cast<int>(accessors_.size()) - 1;
}

int GltfDocument::AddFloats(View view, const float* values, std::size_t count, int width, bool with_bounds) {
  const auto w = static_cast<std::size_t>(width);
  GltfJson accessor = {{"componentType", kFloat},
                       {"count", count},
                       {"type", width == 1   ? "SCALAR"
                                : width == 2 ? "VEC2"
                                : width == 3 ? "VEC3"
                                             : "VEC4"}};
  if (with_bounds) {
    GltfJson low = GltfJson::array(), high = GltfJson::array();
    for (std::size_t k = 0; k < w; ++k) {
      float least = values[k], most = values[k];
      for (std::size_t i = 1; i < count; ++i) {
        least = std::min(least, values[w * i + k]);
        most = std::max(most, values[w * i + k]);
      }
      low.push_back(least);
      high.push_back(most);
    }
    accessor["min"] = std::move(low);
    accessor["max"] = std::move(high);
  }
  return AddAccessor(view, std::move(accessor), values, sizeof(float) * w * count);
}

int GltfDocument::AddVertices(const std::vector<Eigen::Vector3f>& values, bool with_bounds) {
  static_assert(sizeof(Eigen::Vector3f) == 3 * sizeof(float));
  return AddFloats(kVertices, values.front().data(), values.size(), 3, with_bounds);
}

int GltfDocument::AddTexturePlaces(const std::vector<Eigen::Vector2f>& values) {
  static_assert(sizeof(Eigen::Vector2f) == 2 * sizeof(float));
  return AddFloats(kPlaces, values.front().data(), values.size(), 2, false);
}

int GltfDocument::AddKeys(const std::vector<float>& values, int width, bool with_bounds) {
  return AddFloats(kKeys, values.data(), values.size() / static_cast<std::size_t>(width), width, with_bounds);
}

int GltfDocument::AddTriangles(const std::vector<Eigen::Vector3i>& triangles, std::size_t vertices) {
  // The largest number of a type is never an index: some hardware ends a strip with it (3.7.2.1).
  const bool is_short = vertices <= std::numeric_limits<std::uint16_t>::max();
  GltfJson accessor = {{"componentType", is_short ? kUnsignedShort : kUnsignedInt},
                       {"count", 3 * triangles.size()},
                       {"type", "SCALAR"}};
  std::string bytes;
  bytes.reserve(triangles.size() * 3 * (is_short ? 2 : 4));
  for (const Eigen::Vector3i& t : triangles)
    for (int vertex : t) {
      const auto wide = static_cast<std::uint32_t>(vertex);
      bytes.append(reinterpret_cast<const char*>(&wide), is_short ? 2 : 4);  // the low bytes come first
    }
  return AddAccessor(kIndices, std::move(accessor), bytes.data(), bytes.size());
}

int GltfDocument::AddImage(const std::string& name, std::string png) {
  images_.push_back(std::move(png));
  return Add("images", {{"name", name}, {"mimeType", "image/png"}});
}

GltfJson GltfDocument::Whole() const {
  GltfJson whole = json_;
  std::size_t offset = 0;
  for (View view : used_) {
    GltfJson one = {{"buffer", 0}, {"byteOffset", offset}, {"byteLength", views_[view].size()}};
    if (view == kVertices) one["byteStride"] = 3 * sizeof(float);
    if (view == kPlaces) one["byteStride"] = 2 * sizeof(float);
    if (view != kKeys) one["target"] = view == kIndices ? kElementArrayBuffer : kArrayBuffer;
    whole["bufferViews"].push_back(std::move(one));
    offset += views_[view].size();
  }
  for (std::size_t i = 0; i < images_.size(); ++i) {
    whole["images"][i]["bufferView"] = used_.size() + i;
    whole["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", offset}, {"byteLength", images_[i].size()}});
    offset += (images_[i].size() + 3) / 4 * 4;
  }
  if (used_.empty()) return whole;
  whole["accessors"] = accessors_;
  whole["buffers"] = GltfJson::array({{{"byteLength", offset}}});
  return whole;
}

std::string GltfDocument::Bytes() const {
  std::string bytes;
  for (View view : used_) bytes += views_[view];
  for (const std::string& image : images_) {
    bytes += image;
    Pad(bytes, '\0');
  }
  return bytes;
}

std::string GltfDocument::Text() const {
  GltfJson whole = Whole();
  if (!used_.empty()) {
    std::string uri = "data:application/octet-stream;base64,";
    AppendBase64(Bytes(), uri);
    whole["buffers"][0]["uri"] = std::move(uri);
  }
  return Dump(whole) + '\n';
}

Expected<std::string> GltfDocument::Binary(const std::string& where) const {
  std::string json = Dump(Whole());
  Pad(json, ' ');
  const std::string bytes = Bytes();
  const std::size_t length = 12 + 8 + json.size() + (bytes.empty() ? 0 : 8 + bytes.size());
  if (length > std::numeric_limits<std::uint32_t>::max())
    return Fail(
        ErrorCode::kFormat, where,
        "would be larger than the 4 GiB that a glb file can have; keep fewer keys a second, or record "
        "a shorter time");
  std::string out;
  out.reserve(length);
  out += "glTF";
  AppendWord(out, 2);
  AppendWord(out, length);
  AppendWord(out, json.size());
  out += "JSON";
  out += json;
  if (!bytes.empty()) {
    AppendWord(out, bytes.size());
    out += std::string("BIN\0", 4);
    out += bytes;
  }
  return out;
}

}  // namespace fork1s::internal
