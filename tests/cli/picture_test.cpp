// Pictures of materials: from the model through the recording into glTF, and back by another reader.
#include <string>

#include "command.hpp"

namespace fork1s::test {
namespace {

// A tetrahedron and a floor in `texture`, and the same tetrahedron without.
std::string Textured(const std::string& texture) {
  return "<mujoco><asset><texture name='squares' type='2d' " + texture +
         "/><material name='squares' texture='squares' texrepeat='3 2'/>"
         "<mesh name='tetra' vertex='0 0 0 .1 0 0 0 .1 0 0 0 .1' face='0 2 1 0 1 3 0 3 2 1 2 3' "
         "texcoord='0 0 1 0 0 1 .5 .5'/></asset><worldbody>"
         "<geom name='floor' type='plane' size='1 2 .1' material='squares'/>"
         "<body name='one' pos='0 0 .3'><freejoint/><geom name='seen' type='mesh' mesh='tetra' "
         "material='squares'/></body>"
         "<body name='two' pos='1 0 .3'><freejoint/><geom name='plain' type='mesh' mesh='tetra' rgba='1 0 0 "
         "1'/></body>"
         "</worldbody></mujoco>";
}

nlohmann::json Gltf(const std::string& name, const std::string& texture) {
  const std::string model = Write(name + ".xml", Textured(texture)),
                    file = (ScratchFolder() / (name + ".h5")).string(),
                    out = (ScratchFolder() / (name + ".gltf")).string();
  const Outcome run = Fork1s("run --time 0.1 --record " + file + " " + model);
  EXPECT_EQ(run.code, 0) << run.err;
  const Outcome made = Fork1s("export " + file + " " + out);
  EXPECT_EQ(made.code, 0) << made.err;
  return nlohmann::json::parse(Slurp(out));
}

const nlohmann::json& PrimitiveOf(const nlohmann::json& gltf, const std::string& node) {
  for (const auto& n : gltf["nodes"])
    if (n.value("name", "") == node && n.contains("mesh"))
      return gltf["meshes"][n["mesh"].get<std::size_t>()]["primitives"][0];
  throw std::runtime_error("no node " + node);
}

TEST(Pictures, AreInGltfWhereTheFileShowsThem) {
  const auto gltf = Gltf("checker", "builtin='checker' rgb1='1 0 0' rgb2='0 0 1' width='6' height='4'");
  ASSERT_EQ(gltf["images"].size(), 1u);  // three shapes, two of which show it
  const auto material = [&](const char* node) {
    return gltf["materials"][PrimitiveOf(gltf, node)["material"].get<std::size_t>()]["pbrMetallicRoughness"];
  };
  for (const char* node : {"seen", "floor"}) {
    EXPECT_TRUE(PrimitiveOf(gltf, node)["attributes"].contains("TEXCOORD_0")) << node;
    EXPECT_EQ(material(node)["baseColorTexture"]["index"], 0) << node;
  }
  EXPECT_FALSE(PrimitiveOf(gltf, "plain")["attributes"].contains("TEXCOORD_0"));
  EXPECT_FALSE(material("plain").contains("baseColorTexture"));
}

// The bytes of the only picture of a glTF file.
std::string PngOf(const nlohmann::json& gltf) {
  const std::string uri = gltf["buffers"][0]["uri"].get<std::string>();
  const std::string text = Write("buffer.txt", uri.substr(uri.find(',') + 1));
  const auto bytes = ScratchFolder() / "buffer.bin";
  EXPECT_EQ(Shell("base64 -d " + text + " > " + bytes.string()).code, 0);
  const auto& view = gltf["bufferViews"][gltf["images"].at(0)["bufferView"].get<std::size_t>()];
  return Slurp(bytes).substr(view["byteOffset"].get<std::size_t>(), view["byteLength"].get<std::size_t>());
}

// MuJoCo reads the picture that was written, checksums and all, and what comes of it is the same picture.
TEST(Pictures, AreReadBackByAnotherReader) {
  const std::string png = PngOf(Gltf(
      "noise",
      "builtin='flat' mark='random' random='.3' rgb1='.2 .5 .7' markrgb='1 1 0' width='37' height='23'"));
  ASSERT_EQ(png.substr(1, 3), "PNG");
  EXPECT_EQ(PngOf(Gltf("again", "file='" + Write("noise.png", png) + "'")), png);
}

}  // namespace
}  // namespace fork1s::test
