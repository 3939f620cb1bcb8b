#include "model_store.hpp"

#include "columns.hpp"
#include "pictures.hpp"

namespace fork1s::internal {
namespace {

std::uint64_t ModelChecksum(const ModelText& text) {
  Checksum sum;
  sum.Add(text.json);
  for (const auto& mesh : text.meshes) {
    sum.Add(mesh->name);
    for (const auto& v : mesh->vertices)
      for (int k = 0; k < 3; ++k) sum.Add(v(k));
    for (const auto& t : mesh->triangles)
      for (int k = 0; k < 3; ++k) sum.Add(t(k));
    for (const auto& uv : mesh->corner_uv)
      for (int k = 0; k < 2; ++k) sum.Add(uv(k));
  }
  for (const auto& grid : text.grids) {
    sum.Add(grid->name);
    for (int n : {grid->rows, grid->columns}) sum.Add(n);
    for (double v : {grid->half_x, grid->half_y, grid->max_height, grid->base_depth}) sum.Add(v);
    for (float v : grid->values) sum.Add(v);
  }
  for (const auto& picture : text.pictures) {
    sum.Add(picture->name);
    for (int n : {picture->width, picture->height}) sum.Add(n);
    sum.Add(std::string(picture->rgb.begin(), picture->rgb.end()));
  }
  return sum.value();
}

template <class T>
std::vector<T> Flat(const std::vector<Eigen::Matrix<T, 3, 1>>& rows) {
  std::vector<T> flat;
  flat.reserve(3 * rows.size());
  for (const auto& r : rows) flat.insert(flat.end(), {r.x(), r.y(), r.z()});
  return flat;
}

template <class T>
std::vector<Eigen::Matrix<T, 3, 1>> ReadTriples(hid_t group, const char* name, std::size_t most) {
  Dims dims;
  const auto flat = ReadArray<T>(group, name, dims, most);
  if (dims.size() != 2 || dims[1] != 3)
    throw Hdf5Fault(std::string("'") + name + "' should have three columns");
  std::vector<Eigen::Matrix<T, 3, 1>> rows(flat.size() / 3);
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = {flat[3 * i], flat[3 * i + 1], flat[3 * i + 2]};
  return rows;
}

}  // namespace

void WriteModel(hid_t group, const ModelText& text) {
  WriteText(group, "json", text.json,
            {"", "the model in SI units as fork1s reads it; meshes and grids by their number"});
  const Hdf5 meshes = CreateGroup(group, "meshes");
  for (std::size_t i = 0; i < text.meshes.size(); ++i) {
    const TriangleMesh& mesh = *text.meshes[i];
    const Hdf5 g = CreateGroup(meshes.id(), std::to_string(i));
    WriteAttribute(g.id(), "name", mesh.name);
    WriteArray(g.id(), "vertices", {mesh.vertices.size(), 3}, Flat(mesh.vertices).data(), {"m", ""});
    WriteArray(g.id(), "triangles", {mesh.triangles.size(), 3}, Flat(mesh.triangles).data(),
               {"", "vertex numbers"});
    std::vector<float> uv;
    for (const Eigen::Vector2f& corner : mesh.corner_uv) uv.insert(uv.end(), {corner.x(), corner.y()});
    WriteArray(g.id(), "corner_uv", uv,
               {"1", "where a picture is seen: u and v of three corners a triangle, v down"});
  }
  const Hdf5 grids = CreateGroup(group, "heightfields");
  for (std::size_t i = 0; i < text.grids.size(); ++i) {
    const HeightGrid& grid = *text.grids[i];
    const Hdf5 g = CreateGroup(grids.id(), std::to_string(i));
    WriteAttribute(g.id(), "name", grid.name);
    WriteAttribute(g.id(), "rows", grid.rows);
    WriteAttribute(g.id(), "columns", grid.columns);
    WriteArray(g.id(), "size",
               std::vector<double>{grid.half_x, grid.half_y, grid.max_height, grid.base_depth},
               {"m", "half length in x and y, height of the value 1, solid ground below 0"});
    WriteArray(g.id(), "values", grid.values, {"1", "row after row from -x -y, in units of the height"});
  }
  const Hdf5 pictures = CreateGroup(group, "pictures");
  for (std::size_t i = 0; i < text.pictures.size(); ++i) {
    const Picture& picture = *text.pictures[i];
    const Hdf5 g = CreateGroup(pictures.id(), std::to_string(i));
    WriteAttribute(g.id(), "name", picture.name);
    WriteAttribute(g.id(), "width", picture.width);
    WriteAttribute(g.id(), "height", picture.height);
    WriteArray(g.id(), "zlib", Deflated(picture.rgb),
               {"", "rows from the top, three bytes a pixel (sRGB), compressed by zlib"});
  }
  WriteAttribute(group, "meshes", static_cast<std::int64_t>(text.meshes.size()));
  WriteAttribute(group, "heightfields", static_cast<std::int64_t>(text.grids.size()));
  WriteAttribute(group, "pictures", static_cast<std::int64_t>(text.pictures.size()));
  WriteHashAttribute(group, "checksum", ModelChecksum(text));
}

ModelText ReadModel(hid_t group, std::size_t file_size) {
  ModelText text;
  text.json = ReadText(group, "json", file_size);
  const Hdf5 meshes = OpenGroup(group, "meshes");
  for (std::int64_t i = 0; i < ReadNumberAttribute(group, "meshes"); ++i) {
    const Hdf5 g = OpenGroup(meshes.id(), std::to_string(i));
    auto mesh = std::make_shared<TriangleMesh>();
    mesh->name = ReadTextAttribute(g.id(), "name");
    mesh->vertices = ReadTriples<float>(g.id(), "vertices", file_size);
    mesh->triangles = ReadTriples<int>(g.id(), "triangles", file_size);
    const auto uv = ReadList<float>(g.id(), "corner_uv", file_size);
    if (uv.size() % 2 != 0) throw Hdf5Fault("'corner_uv' should have two numbers a corner");
    for (std::size_t k = 0; k < uv.size(); k += 2) mesh->corner_uv.emplace_back(uv[k], uv[k + 1]);
    text.meshes.push_back(std::move(mesh));
  }
  const Hdf5 grids = OpenGroup(group, "heightfields");
  for (std::int64_t i = 0; i < ReadNumberAttribute(group, "heightfields"); ++i) {
    const Hdf5 g = OpenGroup(grids.id(), std::to_string(i));
    auto grid = std::make_shared<HeightGrid>();
    grid->name = ReadTextAttribute(g.id(), "name");
    grid->rows = static_cast<int>(ReadNumberAttribute(g.id(), "rows"));
    grid->columns = static_cast<int>(ReadNumberAttribute(g.id(), "columns"));
    const auto size = ReadList<double>(g.id(), "size", file_size);
    if (size.size() != 4) throw Hdf5Fault("the size of a height field should be four numbers");
    grid->half_x = size[0];
    grid->half_y = size[1];
    grid->max_height = size[2];
    grid->base_depth = size[3];
    grid->values = ReadList<float>(g.id(), "values", file_size);
    text.grids.push_back(std::move(grid));
  }
  const Hdf5 pictures = OpenGroup(group, "pictures");
  for (std::int64_t i = 0; i < ReadNumberAttribute(group, "pictures"); ++i) {
    const Hdf5 g = OpenGroup(pictures.id(), std::to_string(i));
    auto picture = std::make_shared<Picture>();
    picture->name = ReadTextAttribute(g.id(), "name");
    const std::int64_t width = ReadNumberAttribute(g.id(), "width"),
                       height = ReadNumberAttribute(g.id(), "height");
    constexpr std::int64_t kMostPixels = std::int64_t{1} << 26;  // as of pictures in models
    if (width <= 0 || height <= 0 || width > kMostPixels / height)
      throw Hdf5Fault("a picture should have from 1 to 2^26 pixels");
    picture->width = static_cast<int>(width);
    picture->height = static_cast<int>(height);
    picture->rgb = Inflated(ReadList<std::uint8_t>(g.id(), "zlib", file_size),
                            static_cast<std::size_t>(3 * width * height));
    if (picture->rgb.empty()) throw Hdf5Fault("a picture cannot be decompressed");
    text.pictures.push_back(std::move(picture));
  }
  if (ModelChecksum(text) != ReadHashAttribute(group, "checksum"))
    throw Hdf5Fault("the description of the model does not match its checksum");
  return text;
}

}  // namespace fork1s::internal
