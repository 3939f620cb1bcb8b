// Mesh files of other programs: the same solid from each format, and damage refused.
#include <cmath>
#include <limits>

#include "foreign_leaks.hpp"
#include "helpers.hpp"
#include "mesh_writers.hpp"
#include "urdf_text.hpp"

namespace fork1s::testing_importer {
namespace {

constexpr double kA = .3, kB = .2, kC = .1;  // m

// Vertices pass through floats: 6e-8 of a length, so 2e-7 of a volume and 3e-7 of an inertia.
constexpr double kFloatDigits = 1e-6;

const MeshShape& MeshOf(const GeometryDef& geometry) { return std::get<MeshShape>(geometry.shape); }

// Divergence theorem; positive where triangles face outwards.
double VolumeOf(const TriangleMesh& mesh) {
  double volume = 0;
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const auto v = [&](int k) {
      return Vector3(mesh.vertices[static_cast<std::size_t>(t[k])].cast<double>());
    };
    volume += v(0).dot(v(1).cross(v(2))) / 6;
  }
  return volume;
}

// Vertices in the link's frame: MuJoCo moves a mesh to its own centre and axes.
Vector3 Extreme(const GeometryDef& geometry, bool largest) {
  Vector3 extreme = Vector3::Constant(largest ? -1e9 : 1e9);
  for (const Eigen::Vector3f& v : MeshOf(geometry).mesh->vertices) {
    const Vector3 p = geometry.X_BG * Vector3(v.cast<double>());
    extreme = largest ? Vector3(extreme.cwiseMax(p)) : Vector3(extreme.cwiseMin(p));
  }
  return extreme;
}

Expected<ImportedScene> LoadArm(const std::string& file, const std::string& content,
                                const std::string& scale = "", const std::string& kind = "collision") {
  WriteFile(file, content);
  return LoadMechanism(
      WriteFile("arm.urdf", Arm((kind == "visual" ? kInertial : "") + MeshPart(kind, file, scale))));
}

// A tetrahedron of water on the axes: 1000 kg/m³ where a link has no <inertial>.
void ExpectTetrahedron(const Expected<ImportedScene>& loaded, double a, double b, double c) {
  ASSERT_TRUE(loaded) << loaded.error().Text();
  const BodyDef& body = loaded->scene.mechanisms[0].bodies[1];
  ASSERT_EQ(body.geometries.size(), 1u);
  const double volume = a * b * c / 6, mass = 1000 * volume;
  EXPECT_NEAR(VolumeOf(*MeshOf(body.geometries[0]).mesh), volume, kFloatDigits * volume);
  EXPECT_LT(Extreme(body.geometries[0], false).norm(), kFloatDigits * a);
  EXPECT_LT((Extreme(body.geometries[0], true) - Vector3(a, b, c)).norm(), kFloatDigits * a);
  EXPECT_NEAR(body.inertia.mass, mass, kFloatDigits * mass);
  EXPECT_LT((body.inertia.center - Vector3(a, b, c) / 4).norm(), kFloatDigits * a);
  // About the centre: ∫x² = V 3a²/80, ∫xy = -V ab/80.
  Matrix3 I;
  I << 3 * (b * b + c * c), a * b, a * c, a * b, 3 * (a * a + c * c), b * c, a * c, b * c,
      3 * (a * a + b * b);
  I *= mass / 80;
  EXPECT_LT((body.inertia.rotational - I).norm(), kFloatDigits * I.norm());
}

TEST(ImportMeshes, EveryFormatGivesTheSameSolid) {
  const Solid solid = CornerTetrahedron(kA, kB, kC);
  ExpectTetrahedron(LoadArm("part.stl", BinaryStl(solid)), kA, kB, kC);
  ExpectTetrahedron(LoadArm("text.stl", TextStl(solid)), kA, kB, kC);
  ExpectTetrahedron(LoadArm("part.obj", Obj(solid)), kA, kB, kC);
  ExpectTetrahedron(LoadArm("part.dae", Dae(solid)), kA, kB, kC);
  ExpectTetrahedron(LoadArm("part.glb", Glb(solid)), kA, kB, kC);
  ExpectTetrahedron(LoadArm("PART.STL", BinaryStl(solid)), kA, kB, kC);
}

TEST(ImportMeshes, UnitOfColladaCounts) {
  const Solid centimetres = CornerTetrahedron(100 * kA, 100 * kB, 100 * kC);
  ExpectTetrahedron(LoadArm("cm.dae", Dae(centimetres, {"0.01"})), kA, kB, kC);
  ExpectTetrahedron(LoadArm("cm.dae", Dae(centimetres, {"0.01"}), "2 2 2"), 2 * kA, 2 * kB, 2 * kC);
}

TEST(ImportMeshes, AxesOfColladaAreNotTurned) {
  // RViz and MoveIt take coordinates as they are written, whatever up_axis says.
  for (const char* up : {"X_UP", "Y_UP", "Z_UP"})
    ExpectTetrahedron(LoadArm("up.dae", Dae(CornerTetrahedron(kA, kB, kC), {"1", up})), kA, kB, kC);
}

TEST(ImportMeshes, TransformsOfTheSceneCount) {
  // A shift in the file's unit; a turn by -90° about x, [x; y; z] -> [x; z; -y], which undoes one that we
  // write.
  Solid shifted = CornerTetrahedron(100 * kA, 100 * kB, 100 * kC);
  for (auto& v : shifted.vertices) v[0] -= 7;
  ExpectTetrahedron(LoadArm("shift.dae", Dae(shifted, {"0.01", "Z_UP", "<translate>7 0 0</translate>"})), kA,
                    kB, kC);
  Solid turned = CornerTetrahedron(kA, kB, kC);
  for (auto& v : turned.vertices) v = {v[0], -v[2], v[1]};
  ExpectTetrahedron(LoadArm("turn.dae", Dae(turned, {"1", "Y_UP", "<rotate>1 0 0 -90</rotate>"})), kA, kB,
                    kC);
}

TEST(ImportMeshes, ScaleMirrorsToo) {
  const Solid solid = CornerTetrahedron(kA, kB, kC);
  ExpectTetrahedron(LoadArm("part.obj", Obj(solid), ".5 2 3"), .5 * kA, 2 * kB, 3 * kC);
  const auto mirrored = LoadArm("part.obj", Obj(solid), "1 -1 1");
  ASSERT_TRUE(mirrored) << mirrored.error().Text();
  const GeometryDef& geometry = mirrored->scene.mechanisms[0].bodies[1].geometries[0];
  EXPECT_NEAR(Extreme(geometry, false).y(), -kB, kFloatDigits * kB);
  EXPECT_GT(VolumeOf(*MeshOf(geometry).mesh), 0);  // still outwards
  for (const char* bad : {"1 1", "1 0 1", "a b c"}) {
    const auto refused = LoadArm("part.obj", Obj(solid), bad);
    ASSERT_FALSE(refused) << bad;
    EXPECT_CONTAINS(refused.error().message, "its scale");
  }
}

TEST(ImportMeshes, ObjectsOfOneFileAreOneMesh) {
  // The tetrahedron and a smaller one beside it, with a square face of four corners.
  std::string text = Obj(CornerTetrahedron(kA, kB, kC));
  text +=
      "o second\nv -1 0 0\nv -1.1 0 0\nv -1.1 .1 0\nv -1 .1 0\nv -1.05 .05 .1\n"
      "f 5 6 7 8\nf -5 -2 -1\nf 8 7 9\nf 7 6 9\nf 6 5 9\n";
  const auto loaded = LoadArm("two.obj", text);
  ASSERT_TRUE(loaded) << loaded.error().Text();
  const auto& geometries = loaded->scene.mechanisms[0].bodies[1].geometries;
  ASSERT_EQ(geometries.size(), 1u);
  EXPECT_EQ(MeshOf(geometries[0]).mesh->vertices.size(), 9u);
  EXPECT_EQ(MeshOf(geometries[0]).mesh->triangles.size(), 4u + 2u + 4u);
  EXPECT_NEAR(Extreme(geometries[0], false).x(), -1.1, kFloatDigits);
}

TEST(ImportMeshes, OneNameInTwoCasesAndFormatsStaysTwo) {
  WriteFile("l/part.obj", Obj(CornerTetrahedron(.1, .1, .1)));
  WriteFile("r/PART.dae", Dae(CornerTetrahedron(.2, .2, .2)));
  WriteFile("m/part_2.obj", Obj(CornerTetrahedron(.3, .3, .3)));
  const auto loaded = LoadMechanism(
      WriteFile("arm.urdf", Arm(MeshPart("collision", "l/part.obj") + MeshPart("collision", "r/PART.dae") +
                                MeshPart("collision", "m/part_2.obj") + MeshPart("visual", "l/part.obj"))));
  ASSERT_TRUE(loaded) << loaded.error().Text();
  std::vector<double> sizes;
  for (const GeometryDef& g : loaded->scene.mechanisms[0].bodies[1].geometries)
    sizes.push_back(std::cbrt(6 * VolumeOf(*MeshOf(g).mesh)));
  std::sort(sizes.begin(), sizes.end());
  ASSERT_EQ(sizes.size(), 4u);
  const double expected[] = {.1, .1, .2, .3};
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(sizes[i], expected[i], kFloatDigits);
}

struct Damage {
  const char* name;
  std::string file, content, says;
  ErrorCode code = ErrorCode::kFormat;
};

std::vector<Damage> Damages() {
  const Solid solid = CornerTetrahedron(kA, kB, kC);
  const auto replaced = [](std::string text, const std::string& from, const std::string& to) {
    return text.replace(text.find(from), from.size(), to);
  };
  const std::string obj = Obj(solid), stl = BinaryStl(solid), dae = Dae(solid), glb = Glb(solid);
  std::string wild = stl, nan_stl = stl;
  const std::uint32_t many = 0xffffffff;
  std::memcpy(wild.data() + 80, &many, 4);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(nan_stl.data() + 84 + 12, &nan, 4);
  Solid flat = CornerTetrahedron(kA, kB, 0), small = CornerTetrahedron(1e-5, 1e-5, 1e-5), past = solid;
  past.faces[2][1] = 77;
  // A flat square whose plane does not lie along an axis: rounding makes it no solid.
  Solid tilted;
  for (const auto& [u, v] : {std::pair{0., 0.}, {.1, 0.}, {.1, .1}, {0., .1}}) {
    const double x = 3 + .8 * u, y = 2 + .6 * u + .1 * v, z = .3 * u + .9 * v;
    tilted.vertices.push_back({static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)});
  }
  tilted.faces = {{0, 1, 2}, {0, 2, 3}};
  std::string glb_past = glb, glb_long = glb;
  const std::uint32_t large = 1000000;
  std::memcpy(glb_past.data() + glb.size() - 48 - 48, &large, 4);  // 12 indices before 4 vertices
  std::memcpy(glb_long.data() + 12, &many, 4);                     // length of the JSON chunk
  return {
      {"empty_stl", "e.stl", "", "it is empty"},
      {"empty_obj", "e.obj", "", "it is empty"},
      {"empty_dae", "e.dae", "", "it is empty"},
      {"empty_glb", "e.glb", "", "it is empty"},
      {"face_without_vertices", "a.obj", obj + "f\n", "line 10 has a face with 0 vertices"},
      {"face_with_two_vertices", "a.obj", obj + "f 1 2\n", "a face with 2 vertices"},
      {"index_past_the_end", "b.obj", obj + "f 1 2 99\n", "vertex 99, but the file has 4"},
      {"index_before_the_start", "b.obj", obj + "f 1 2 -9\n", "vertex -9, and only 4"},
      {"index_zero", "b.obj", obj + "f 0 1 2\n", "'0'"},
      {"nan_vertex", "c.obj", replaced(obj, "v .300000012", "v nan"), "line 3 has the coordinate 'nan'"},
      {"word_vertex", "c.obj", replaced(obj, "v .300000012", "v 1e"), "'1e'"},
      {"vertex_of_two", "c.obj", obj + "v 1 2\n", "without three coordinates"},
      {"no_face", "d.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", ""},
      {"wild_count", "f.stl", wild, "it says that it has 4294967295 triangles, and there is room for 4"},
      {"cut_off", "g.stl", stl.substr(0, stl.size() - 60), "there is room for 2"},
      {"nan_stl", "h.stl", nan_stl, "no finite number"},
      {"short_stl", "i.stl", "abc", "neither a binary STL"},
      {"cut_text_stl", "j.stl", TextStl(solid).substr(0, 90), ""},
      {"dae_index", "k.dae", Dae(past), "it cannot be read"},
      {"dae_cut", "l.dae", dae.substr(0, dae.size() / 2), "not well-formed XML"},
      {"dae_short_list", "l.dae", replaced(dae, "count=\"12\"", "count=\"9\""),
       "says that it has 9 values and has 12"},
      {"dae_past_list", "l.dae", replaced(dae, "count=\"4\" stride", "count=\"5\" stride"),
       "past the 12 values"},
      {"dae_faces", "l.dae", replaced(dae, "<p>", "<p/><p>"), "has 4 faces and has 2 lists"},
      {"dae_words", "l.dae", replaced(dae, "<p>", "<p>0 2VVV "),
       "<p> holds '2VVV', which is no whole number"},
      {"dae_skew", "l.dae", Dae(solid, {"1", "Z_UP", "<skew>1 1 0 0 0 1 0</skew>"}), "<skew> is not read"},
      {"dae_circle", "l.dae", Dae(solid, {"1", "Z_UP", "<instance_node url=\"#n\"/>"}),
       "<node> shows itself"},
      {"dae_without_geometry", "m.dae", replaced(dae, "<instance_geometry url=\"#g\"/>", ""), ""},
      {"dae_nan", "n.dae", replaced(dae, ".300000012", "nan"), ""},
      {"glb_cut", "o.glb", glb.substr(0, glb.size() - 20), "bytes and has"},
      {"glb_index", "p.glb", glb_past, "names vertex 1000000, and there are 4"},
      {"glb_chunk", "q.glb", glb_long, "past the end"},
      {"glb_text", "r.glb", "hello, this is no model", "does not begin as binary glTF"},
      {"flat", "s.obj", Obj(flat), "lie in one plane", ErrorCode::kModel},
      {"flat_tilted", "t.stl", BinaryStl(tilted), "lie in one plane", ErrorCode::kModel},
      {"tiny", "u.stl", BinaryStl(small), "correct its unit", ErrorCode::kModel},
  };
}

TEST(ImportMeshes, DamageIsRefusedWithASentence) {
  for (const Damage& damage : Damages()) {
    SCOPED_TRACE(damage.name);
    const auto collision = LoadArm(damage.file, damage.content);
    ASSERT_FALSE(collision);
    if (!damage.says.empty()) {
      EXPECT_EQ(collision.error().code, damage.code);
      EXPECT_CONTAINS(collision.error().message, damage.says);
    }
    EXPECT_CONTAINS(collision.error().where, "arm.urdf, line 4");
    EXPECT_CONTAINS(collision.error().message, damage.file);
    EXPECT_CONTAINS(collision.error().message, "link 'a'");
    // To look at, it is not needed.
    const auto visual = LoadArm(damage.file, damage.content, "", "visual");
    ASSERT_TRUE(visual) << visual.error().Text();
    EXPECT_TRUE(HasNote(visual->report, ImportNote::Kind::kDropped, damage.file));
    EXPECT_TRUE(visual->scene.mechanisms[0].bodies[1].geometries.empty());
  }
}

TEST(ImportMeshes, TrailingBytesAndMisleadingHeadersOfStl) {
  std::string stl = BinaryStl(CornerTetrahedron(kA, kB, kC));
  stl.replace(0, 5, "solid");  // as some programs begin binary files
  ExpectTetrahedron(LoadArm("solid.stl", stl), kA, kB, kC);
  ExpectTetrahedron(LoadArm("long.stl", BinaryStl(CornerTetrahedron(kA, kB, kC)) + "made by hand"), kA, kB,
                    kC);
}

// Every byte of every format turned, and every length cut: refused or read, never a crash.
TEST(ImportMeshes, NoByteCrashesTheReader) {
  const Solid solid = CornerTetrahedron(kA, kB, kC);
  std::mt19937 random(1);
  const std::pair<const char*, std::string> files[] = {
      {"x.stl", BinaryStl(solid)}, {"x.obj", Obj(solid)}, {"x.dae", Dae(solid)}, {"x.glb", Glb(solid)}};
  for (const auto& [name, content] : files) {
    for (int i = 0; i < 60; ++i) {
      std::string turned = content;
      for (int k = 0; k < 1 + i % 3; ++k) turned[random() % turned.size()] = static_cast<char>(random());
      if (i % 5 == 0) turned.resize(random() % turned.size());
      const auto loaded = LoadArm(name, turned);
      EXPECT_TRUE(loaded || loaded.error().message.find("link 'a'") != std::string::npos);
    }
  }
}

// A link of 2 kg in a mesh of water's density, then of a thousandth of its scale.
TEST(ImportMeshes, InAUnitThatCannotBe_AreNamed) {
  const Solid solid = CornerTetrahedron(.3, .2, .1);
  WriteFile("part.stl", BinaryStl(solid));
  const auto load = [](const std::string& scale) {
    return LoadMechanism(WriteFile("arm.urdf", Arm(kInertial + MeshPart("visual", "part.stl", scale) +
                                                   MeshPart("collision", "part.stl", scale))));
  };
  const auto metres = load("1 1 1"), millimetres = load("1000 1000 1000"), centimetres = load("100 100 100");
  ASSERT_TRUE(metres && millimetres && centimetres);
  const std::string said =
      "mesh 'part': its numbers are taken as metres, so it spans 300 m, and body 'a' of 2 kg";
  EXPECT_FALSE(HasNote(metres->report, ImportNote::Kind::kChosen, "taken as metres"));
  EXPECT_TRUE(HasNote(millimetres->report, ImportNote::Kind::kChosen, said));
  EXPECT_TRUE(HasNote(centimetres->report, ImportNote::Kind::kChosen, "it spans 30 m"));
  const auto count = [](const ImportReport& report) {
    return std::count_if(report.notes.begin(), report.notes.end(), [](const ImportNote& note) {
      return note.message.find("taken as metres") != std::string::npos;
    });
  };
  EXPECT_EQ(count(millimetres->report), 1);
}

TEST(ImportMeshes, WhoseHullHidesAnOpening_AreNamed) {
  const auto load = [](const Solid& solid, const std::string& kind) {
    const auto loaded = LoadArm("tube.stl", BinaryStl(solid), "", kind);
    return HasNote(loaded->report, ImportNote::Kind::kDropped,
                   "hollow of mesh 'tube': contact takes the convex");
  };
  EXPECT_TRUE(load(SquareTube(.06, .05, .3), "collision"));
  const auto tube = LoadArm("tube.stl", BinaryStl(SquareTube(.06, .05, .3)), "", "collision");
  EXPECT_TRUE(HasNote(tube->report, ImportNote::Kind::kDropped, "python -m fork1s.decompose"));
  EXPECT_FALSE(load(SquareTube(.06, .05, .3), "visual"));
  EXPECT_FALSE(load(SquareTube(.06, .02, .3), "collision"));  // the hole is a ninth of it
  EXPECT_FALSE(load(CornerTetrahedron(.3, .2, .1), "collision"));
  Solid open = SquareTube(.06, .05, .3);
  open.faces.pop_back();  // its volume cannot be told
  EXPECT_FALSE(load(open, "collision"));
}

}  // namespace
}  // namespace fork1s::testing_importer
