#include "resources.hpp"

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <memory>
#include <new>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "array_bytes.hpp"
#include "base/fnv1a.hpp"
#include "record/scene_json.hpp"

namespace fork1s::fmi {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char *kScene = "scene.json", *kArrays = "arrays.bin", *kOptions = "options.json",
                     *kUnit = "unit.json";

std::string WriteArrays(const ModelText& text) {
  ArrayWriter out;
  out.Count(text.meshes.size());
  for (const auto& mesh : text.meshes) {
    out.Text(mesh->name);
    out.List(mesh->vertices);
    out.List(mesh->triangles);
  }
  out.Count(text.grids.size());
  for (const auto& grid : text.grids) {
    out.Text(grid->name);
    out.Number(grid->rows);
    out.Number(grid->columns);
    for (const double x : {grid->half_x, grid->half_y, grid->max_height, grid->base_depth}) out.Number(x);
    out.List(grid->values);
  }
  return out.bytes;
}

void ReadArrays(const std::string& bytes, ModelText& text) {
  ArrayReader in(bytes);
  for (std::size_t left = in.Count(); left > 0; --left) {
    auto mesh = std::make_shared<TriangleMesh>();
    mesh->name = in.Text();
    in.List(mesh->vertices);
    in.List(mesh->triangles);
    text.meshes.push_back(std::move(mesh));
  }
  for (std::size_t left = in.Count(); left > 0; --left) {
    auto grid = std::make_shared<HeightGrid>();
    grid->name = in.Text();
    grid->rows = in.Number<int>();
    grid->columns = in.Number<int>();
    for (double* x : {&grid->half_x, &grid->half_y, &grid->max_height, &grid->base_depth})
      *x = in.Number<double>();
    in.List(grid->values);
    text.grids.push_back(std::move(grid));
  }
}

void DropPictures(std::vector<GeometryDef>& geometries) {
  for (GeometryDef& g : geometries) g.picture = nullptr;
}

constexpr const char* kUnpack = "unpack the whole archive of the unit again";

}  // namespace

Expected<std::string> ReadFile(const std::string& path, const char* remedy) {
  std::ifstream in(path, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(in), {}};
  if (!in.is_open() || in.bad())
    return Fail(ErrorCode::kFile, path,
                std::string("cannot be read (") + std::strerror(errno) + "); " + remedy);
  return bytes;
}

std::map<std::string, std::string> WriteResources(const UnitModel& model) {
  ImportedScene imported = model.imported;
  for (MechanismDef& m : imported.scene.mechanisms)
    for (auto& body : m.bodies) DropPictures(body.geometries);
  for (FreeBodyDef& body : imported.scene.free_bodies) DropPictures(body.geometries);
  DropPictures(imported.scene.world);
  const ModelText text = WriteImportedScene(imported);
  Json unit;
  unit["bodies"] = model.bodies;
  std::map<std::string, std::string> files = {
      {kScene, text.json}, {kArrays, WriteArrays(text)}, {kOptions, WriteOptions(model.options)}};
  unit["token"] = TokenOf(files);
  files[kUnit] = unit.dump(1);
  return files;
}

std::string TokenOf(const std::map<std::string, std::string>& resources) {
  if (const auto unit = resources.find(kUnit); unit != resources.end())
    return Json::parse(unit->second).at("token").get<std::string>();
  std::uint64_t words[2] = {0xcbf29ce484222325ull, 0x9e3779b97f4a7c15ull};
  for (const auto& [name, bytes] : resources)
    for (std::uint64_t& word : words) word = Fnv1a(bytes, Fnv1a(name, word));
  constexpr const char* kHex = "0123456789abcdef";
  std::string token = "{";
  for (int digit = 0; digit < 32; ++digit) {
    if (digit == 8 || digit == 12 || digit == 16 || digit == 20) token += '-';
    token += kHex[(words[digit / 16] >> (4 * (digit % 16))) & 15];
  }
  return token + '}';
}

Expected<std::string> ReadToken(const std::string& folder) {
  auto unit = ReadFile(folder + '/' + kUnit, kUnpack);
  if (!unit) return unit;
  try {
    return Json::parse(*unit).at("token").get<std::string>();
  } catch (const Json::exception& fault) {
    return Fail(ErrorCode::kFormat, folder + '/' + kUnit,
                std::string("is damaged (") + fault.what() + "); unpack the archive of the unit again");
  }
}

Expected<UnitModel> ReadResources(const std::string& folder) {
  std::map<std::string, std::string> files;
  for (const char* name : {kScene, kArrays, kOptions, kUnit}) {
    auto bytes = ReadFile(folder + '/' + name, kUnpack);
    if (!bytes) return tl::unexpected(bytes.error());
    files[name] = std::move(*bytes);
  }
  UnitModel model;
  ModelText text;
  text.json = std::move(files[kScene]);
  const auto damaged = [&](const char* name, const std::exception& fault) {
    return Fail(ErrorCode::kFormat, folder + '/' + name,
                std::string("is damaged (") + fault.what() + "); unpack the archive of the unit again");
  };
  try {
    ReadArrays(files[kArrays], text);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& fault) {
    return damaged(kArrays, fault);
  }
  try {
    model.bodies = Json::parse(files[kUnit]).at("bodies").get<std::vector<int>>();
  } catch (const Json::exception& fault) {
    return damaged(kUnit, fault);
  }
  auto imported = ReadImportedScene(text, folder + '/' + kScene);
  if (!imported) return tl::unexpected(imported.error());
  model.imported = std::move(*imported);
  auto options = ReadOptions(files[kOptions], folder + '/' + kOptions);
  if (!options) return tl::unexpected(options.error());
  model.options = std::move(*options);
  return model;
}

}  // namespace fork1s::fmi
