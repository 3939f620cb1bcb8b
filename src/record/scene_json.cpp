#include "record/scene_json.hpp"

#include <new>

#include "scene_fields.hpp"

namespace fork1s {
namespace internal {
namespace {

template <class T>
int Place(const std::shared_ptr<const T>& item, std::vector<std::shared_ptr<const T>>& table,
          std::unordered_map<const void*, int>& known) {
  if (!item) return -1;
  const auto [at, is_new] = known.try_emplace(item.get(), static_cast<int>(table.size()));
  if (is_new) table.push_back(item);
  return at->second;
}

template <class T>
std::shared_ptr<const T> FindShared(int place, const std::vector<std::shared_ptr<const T>>& table,
                                    const JsonPath& path) {
  if (place == -1) return nullptr;
  if (place < 0 || place >= static_cast<int>(table.size()))
    throw JsonFault(path, "names number " + std::to_string(place) + " of " + std::to_string(table.size()));
  return table[static_cast<std::size_t>(place)];
}

bool IsUtf8(const std::string& text) {
  try {
    static_cast<void>(Json(text).dump());
    return true;
  } catch (const nlohmann::json::exception&) {
    return false;
  }
}

}  // namespace

// Names from files of unknown encoding must come back as they are, and JSON knows only UTF-8.
Json JsonWriter::Encode(const std::string& value) {
  if (IsUtf8(value)) return value;
  Json bytes = Json::array();
  for (char c : value) bytes.push_back(static_cast<int>(static_cast<unsigned char>(c)));
  return {{"bytes", bytes}};
}

void JsonReader::Decode(const Json& j, std::string& value, const JsonPath& path) {
  if (j.is_string()) {
    value = j.get<std::string>();
    return;
  }
  std::vector<int> bytes;
  const JsonPath inner{&path, "bytes"};
  if (!j.is_object()) throw JsonFault(path, "should be a text");
  Decode(Member(j, "bytes", inner), bytes, inner);
  value.clear();
  for (int b : bytes) value.push_back(static_cast<char>(b));
}

void JsonReader::Decode(const Json& j, double& value, const JsonPath& path) {
  if (j.is_number())
    value = j.get<double>();
  else if (j == "inf")
    value = std::numeric_limits<double>::infinity();
  else if (j == "-inf")
    value = -std::numeric_limits<double>::infinity();
  else if (j == "nan")
    value = std::numeric_limits<double>::quiet_NaN();
  else
    throw JsonFault(path, "should be a number");
}

Json JsonWriter::Encode(const std::shared_ptr<const Picture>& picture) {
  return Place(picture, tables_.pictures, known_);
}

void JsonReader::Decode(const Json& j, std::shared_ptr<const Picture>& picture, const JsonPath& path) {
  int place = -1;
  Decode(j, place, path);
  picture = FindShared(place, tables_.pictures, path);
}

Json JsonWriter::Encode(const Shape& shape) {
  Json j = {{"kind", ShapeName(shape)}};
  std::visit(
      [&](const auto& s) {
        using S = std::decay_t<decltype(s)>;
        if constexpr (std::same_as<S, MeshShape>) {
          j["mesh"] = Place(s.mesh, tables_.meshes, known_);
        } else if constexpr (std::same_as<S, HeightField>) {
          j["grid"] = Place(s.grid, tables_.grids, known_);
        } else {
          Json* outer = std::exchange(node_, &j);
          Fields(*this, s);
          node_ = outer;
        }
      },
      shape);
  return j;
}

namespace {

// The alternative of Shape whose name is `kind`.
template <std::size_t I = 0>
bool MakeShape(const std::string& kind, Shape& shape) {
  if constexpr (I == std::variant_size_v<Shape>) {
    return false;
  } else {
    shape.emplace<I>();
    return kind == ShapeName(shape) || MakeShape<I + 1>(kind, shape);
  }
}

}  // namespace

void JsonReader::Decode(const Json& j, Shape& shape, const JsonPath& path) {
  const JsonPath kind_path{&path, "kind"};
  std::string kind;
  Decode(Member(j, "kind", kind_path), kind, kind_path);
  if (!MakeShape(kind, shape)) throw JsonFault(kind_path, "has the unknown value '" + kind + "'");
  const Json* outer = std::exchange(node_, &j);
  const JsonPath* outer_path = std::exchange(path_, &path);
  std::visit(
      [&](auto& s) {
        using S = std::decay_t<decltype(s)>;
        int place = -1;
        if constexpr (std::same_as<S, MeshShape>) {
          (*this)("mesh", place);
          s.mesh = FindShared(place, tables_.meshes, {&path, "mesh"});
        } else if constexpr (std::same_as<S, HeightField>) {
          (*this)("grid", place);
          s.grid = FindShared(place, tables_.grids, {&path, "grid"});
        } else {
          Fields(*this, s);
        }
      },
      shape);
  node_ = outer;
  path_ = outer_path;
}

namespace {

template <class T>
ModelText Write(const T& value) {
  return Encoded(value, 1);
}

template <class T>
Expected<T> Read(const ModelText& text, const std::string& where) {
  try {
    return Decoded<T>(text);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& e) {
    return Fail(ErrorCode::kFormat, where,
                std::string("the description of the model cannot be read (") + e.what() +
                    "); the file is damaged or was written by another version");
  }
}

}  // namespace
}  // namespace internal

ModelText WriteScene(const Scene& scene) { return internal::Write(scene); }
ModelText WriteImportedScene(const ImportedScene& imported) { return internal::Write(imported); }
ModelText WriteMechanism(const MechanismDef& definition) { return internal::Write(definition); }
std::string WriteOptions(const SimulationOptions& options) { return internal::Write(options).json; }
std::string WriteImportOptions(const ImportOptions& options) { return internal::Write(options).json; }

Expected<Scene> ReadScene(const ModelText& text, const std::string& where) {
  return internal::Read<Scene>(text, where);
}
Expected<ImportedScene> ReadImportedScene(const ModelText& text, const std::string& where) {
  return internal::Read<ImportedScene>(text, where);
}
Expected<MechanismDef> ReadMechanism(const ModelText& text, const std::string& where) {
  return internal::Read<MechanismDef>(text, where);
}
Expected<SimulationOptions> ReadOptions(const std::string& json, const std::string& where) {
  return internal::Read<SimulationOptions>(ModelText{json, {}, {}, {}}, where);
}
Expected<ImportOptions> ReadImportOptions(const std::string& json, const std::string& where) {
  return internal::Read<ImportOptions>(ModelText{json, {}, {}, {}}, where);
}

}  // namespace fork1s
