// The parts of a glTF 2.0 file that know nothing of mechanisms: buffer, accessors, and the two ways to write
// it. Section numbers are those of the Khronos specification.
#pragma once

#include <Eigen/Core>
#include <array>
#include <fork1s/base/error.hpp>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace fork1s::internal {

using GltfJson = nlohmann::ordered_json;

/// A document and its one buffer, which has a view for vertices, one for places in pictures, one for indices
/// and one for animations.
class GltfDocument {
 public:
  explicit GltfDocument(const std::string& generator);

  /// The document without buffers, buffer views and accessors, to be filled in; numbers are places in its
  /// arrays.
  GltfJson& json() { return json_; }
  /// Appends to one of the document's arrays and returns the place.
  int Add(const char* array, GltfJson element);

  /// Accessors (3.6.2) over values that are appended to the buffer; each returns its place. Values must be
  /// finite; `values` holds `width` numbers an element (1, 3 or 4), and at least one element.
  int AddVertices(const std::vector<Eigen::Vector3f>& values, bool with_bounds);
  int AddTexturePlaces(const std::vector<Eigen::Vector2f>& values);
  int AddTriangles(const std::vector<Eigen::Vector3i>& triangles, std::size_t vertices);
  int AddKeys(const std::vector<float>& values, int width, bool with_bounds);
  /// A PNG in a view of its own; returns its place among the images.
  int AddImage(const std::string& name, std::string png);

  /// The file as text with its buffer in base64 (3.6.1.1), or as one binary (4.4).
  /// Errors (kFormat): `where` and that a binary of 4 GiB cannot be.
  std::string Text() const;
  Expected<std::string> Binary(const std::string& where) const;

 private:
  enum View { kVertices, kPlaces, kIndices, kKeys };
  int AddFloats(View view, const float* values, std::size_t count, int width, bool with_bounds);
  int AddAccessor(View view, GltfJson accessor, const void* bytes, std::size_t size);
  /// The document with its buffer views, over views that stand one after the other.
  GltfJson Whole() const;
  std::string Bytes() const;

  GltfJson json_;
  GltfJson accessors_ = GltfJson::array();
  std::array<std::string, 4> views_;
  std::vector<View> used_;           // views by their number in the document
  std::vector<std::string> images_;  // a view each, after these
};

}  // namespace fork1s::internal
