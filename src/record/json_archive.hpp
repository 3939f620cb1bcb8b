// One list of fields per struct serves writing and reading: see scene_fields.hpp.
#pragma once

#include <array>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <unordered_map>
#include <utility>
#include <vector>

#include "record/scene_json.hpp"

namespace fork1s::internal {

using Json = nlohmann::ordered_json;  // fields stay in the order in which the headers list them

/// Where a reader stands, as a chain on the stack: the text is only made when something is wrong.
struct JsonPath {
  const JsonPath* parent = nullptr;
  const char* key = nullptr;
  std::size_t index = 0;

  std::string Text() const {
    std::string before = parent ? parent->Text() : "";
    if (!parent) return before;
    if (!key) return before + '[' + std::to_string(index) + ']';
    return before.empty() ? key : before + '.' + key;
  }
};

/// Thrown by readers, caught where the public functions return.
struct JsonFault : std::runtime_error {
  JsonFault(const JsonPath& path, const std::string& what) : std::runtime_error(path.Text() + ": " + what) {}
};

template <class T>
struct EnumNames;  // specialised with `static constexpr std::pair<T, const char*> kNames[]`

class JsonWriter;
class JsonReader;

/// T to be filled by a reader, const T for a writer.
template <class T, class Archive>
using Like = std::conditional_t<std::same_as<Archive, JsonReader>, T, const T>;

class JsonWriter {
 public:
  explicit JsonWriter(ModelText& tables) : tables_(tables) {}

  template <class T>
  void operator()(const char* key, const T& value) {
    (*node_)[key] = Encode(value);
  }

  /// A field that files of older versions which are still read do not have.
  template <class T>
  void Optional(const char* key, const T& value) {
    (*this)(key, value);
  }

  template <class T>
  Json Encode(const T& value) {
    if constexpr (std::is_enum_v<T>) {
      for (const auto& [e, name] : EnumNames<T>::kNames)
        if (e == value) return name;
      FORK1S_REQUIRE(false, "value", static_cast<int>(value), "of an enumeration has no name for files");
      return nullptr;
    } else if constexpr (std::is_array_v<T>) {
      Json array = Json::array();
      for (const auto& v : value) array.push_back(Encode(v));
      return array;
    } else {
      Json object = Json::object();
      Json* outer = std::exchange(node_, &object);
      Fields(*this, value);
      node_ = outer;
      return object;
    }
  }
  Json Encode(bool value) { return value; }
  Json Encode(int value) { return value; }
  Json Encode(double value) {
    if (std::isfinite(value)) return value;
    return std::isnan(value) ? "nan" : value > 0 ? "inf" : "-inf";
  }
  Json Encode(const std::string& value);
  template <class Tag>
  Json Encode(Index<Tag> value) {
    return value.value();
  }
  template <class T, std::size_t size>
  Json Encode(const std::array<T, size>& value) {
    Json array = Json::array();
    for (const T& v : value) array.push_back(Encode(v));
    return array;
  }
  template <class A, class B>
  Json Encode(const std::pair<A, B>& value) {
    return Json::array({Encode(value.first), Encode(value.second)});
  }
  template <class T>
  Json Encode(const std::vector<T>& values) {
    Json array = Json::array();
    for (const T& v : values) array.push_back(Encode(v));
    return array;
  }
  template <class T>
  Json Encode(const std::optional<T>& value) {
    return value ? Encode(*value) : Json(nullptr);
  }
  /// A list of pairs: keys are names of any bytes.
  template <class T>
  Json Encode(const std::map<std::string, T>& values) {
    Json array = Json::array();
    for (const auto& entry : values)
      array.push_back(Json::array({Encode(entry.first), Encode(entry.second)}));
    return array;
  }
  /// Matrices row by row.
  template <class T, int Rows, int Cols, int Flags, int MaxRows, int MaxCols>
  Json Encode(const Eigen::Matrix<T, Rows, Cols, Flags, MaxRows, MaxCols>& m) {
    Json array = Json::array();
    for (Eigen::Index i = 0; i < m.rows(); ++i)
      for (Eigen::Index j = 0; j < m.cols(); ++j) array.push_back(Encode(m(i, j)));
    return array;
  }
  Json Encode(const RigidTransform& X) {
    return {{"R", Encode(X.rotation())}, {"p", Encode(X.translation())}};
  }
  Json Encode(const Shape& shape);
  Json Encode(const std::shared_ptr<const Picture>& picture);

 private:
  ModelText& tables_;
  Json* node_ = nullptr;
  std::unordered_map<const void*, int> known_;  // mesh, grid or picture -> place in its table
};

class JsonReader {
 public:
  JsonReader(const Json& root, const ModelText& tables) : node_(&root), tables_(tables) {}

  template <class T>
  void operator()(const char* key, T& value) {
    const JsonPath path{path_, key};
    Decode(Member(*node_, key, path), value, path);
  }

  /// Without such a field the value stays as it is.
  template <class T>
  void Optional(const char* key, T& value) {
    if (!node_->is_object() || node_->contains(key)) (*this)(key, value);
  }

  template <class T>
  void Decode(const Json& j, T& value, const JsonPath& path) {
    if constexpr (std::is_enum_v<T>) {
      for (const auto& [e, name] : EnumNames<T>::kNames)
        if (j == name) {
          value = e;
          return;
        }
      throw JsonFault(path, "has the unknown value " + j.dump());
    } else if constexpr (std::is_array_v<T>) {
      CheckSize(j, std::extent_v<T>, path);
      for (std::size_t i = 0; i < std::extent_v<T>; ++i) Decode(j[i], value[i], {&path, nullptr, i});
    } else {
      if (!j.is_object()) throw JsonFault(path, "should be an object");
      const Json* outer = std::exchange(node_, &j);
      const JsonPath* outer_path = std::exchange(path_, &path);
      Fields(*this, value);
      node_ = outer;
      path_ = outer_path;
    }
  }
  template <class T, std::size_t size>
  void Decode(const Json& j, std::array<T, size>& value, const JsonPath& path) {
    CheckSize(j, size, path);
    for (std::size_t i = 0; i < size; ++i) Decode(j[i], value[i], {&path, nullptr, i});
  }
  void Decode(const Json& j, bool& value, const JsonPath& path) {
    if (!j.is_boolean()) throw JsonFault(path, "should be true or false");
    value = j.get<bool>();
  }
  void Decode(const Json& j, int& value, const JsonPath& path) {
    if (!j.is_number_integer()) throw JsonFault(path, "should be a whole number");
    const auto wide = j.get<std::int64_t>();
    if (wide < std::numeric_limits<int>::min() || wide > std::numeric_limits<int>::max())
      throw JsonFault(path, "is too large");
    value = static_cast<int>(wide);
  }
  void Decode(const Json& j, double& value, const JsonPath& path);
  void Decode(const Json& j, std::string& value, const JsonPath& path);
  template <class Tag>
  void Decode(const Json& j, Index<Tag>& value, const JsonPath& path) {
    int i = -1;
    Decode(j, i, path);
    value = Index<Tag>(i);
  }
  template <class A, class B>
  void Decode(const Json& j, std::pair<A, B>& value, const JsonPath& path) {
    CheckSize(j, 2, path);
    Decode(j[0], value.first, {&path, nullptr, 0});
    Decode(j[1], value.second, {&path, nullptr, 1});
  }
  template <class T>
  void Decode(const Json& j, std::vector<T>& values, const JsonPath& path) {
    if (!j.is_array()) throw JsonFault(path, "should be a list");
    values.assign(j.size(), T{});
    for (std::size_t i = 0; i < values.size(); ++i) Decode(j[i], values[i], {&path, nullptr, i});
  }
  template <class T>
  void Decode(const Json& j, std::optional<T>& value, const JsonPath& path) {
    value.reset();
    if (!j.is_null()) Decode(j, value.emplace(), path);
  }
  template <class T>
  void Decode(const Json& j, std::map<std::string, T>& values, const JsonPath& path) {
    std::vector<std::pair<std::string, T>> entries;
    Decode(j, entries, path);
    values = {entries.begin(), entries.end()};
  }
  template <class T, int Rows, int Cols, int Flags, int MaxRows, int MaxCols>
  void Decode(const Json& j, Eigen::Matrix<T, Rows, Cols, Flags, MaxRows, MaxCols>& m, const JsonPath& path) {
    if (!j.is_array()) throw JsonFault(path, "should be a list");
    if constexpr (Rows == Eigen::Dynamic) m.resize(static_cast<Eigen::Index>(j.size()), m.cols());
    CheckSize(j, static_cast<std::size_t>(m.size()), path);
    std::size_t next = 0;
    for (Eigen::Index i = 0; i < m.rows(); ++i)
      for (Eigen::Index k = 0; k < m.cols(); ++k, ++next) Decode(j[next], m(i, k), {&path, nullptr, next});
  }
  void Decode(const Json& j, RigidTransform& X, const JsonPath& path) {
    const JsonPath R{&path, "R"}, p{&path, "p"};
    Decode(Member(j, "R", R), X.rotation(), R);
    Decode(Member(j, "p", p), X.translation(), p);
  }
  void Decode(const Json& j, Shape& shape, const JsonPath& path);
  void Decode(const Json& j, std::shared_ptr<const Picture>& picture, const JsonPath& path);

 private:
  static const Json& Member(const Json& object, const char* key, const JsonPath& path) {
    if (!object.is_object()) throw JsonFault(path, "stands in something that is no object");
    const auto at = object.find(key);
    if (at == object.end()) throw JsonFault(path, "is missing");
    return *at;
  }
  static void CheckSize(const Json& j, std::size_t size, const JsonPath& path) {
    if (!j.is_array() || j.size() != size)
      throw JsonFault(path, "should be a list of " + std::to_string(size) + " values");
  }

  const Json* node_;
  const JsonPath* path_ = nullptr;
  const ModelText& tables_;
};

/// indent: as of nlohmann::json::dump.
template <class T>
ModelText Encoded(const T& value, int indent = -1) {
  ModelText text;
  JsonWriter writer(text);
  text.json = writer.Encode(value).dump(indent);
  return text;
}

/// What Encoded made. Throws std::exception where it is damaged.
template <class T>
T Decoded(const ModelText& text) {
  const Json root = Json::parse(text.json);
  T value;
  JsonReader(root, text).Decode(root, value, JsonPath{});
  return value;
}

}  // namespace fork1s::internal
