// Links with parts of their inertia or size missing: said by name, with what was taken, or refused.
#include "helpers.hpp"
#include "mesh_writers.hpp"
#include "urdf_text.hpp"

namespace fork1s::testing_importer {
namespace {

using Kind = ImportNote::Kind;

constexpr const char* kOnlyMass = R"(<inertial><origin xyz=".01 0 0"/><mass value="2"/></inertial>)";
constexpr const char* kZeros = R"(<inertial><mass value="2"/>
  <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>)";

const BodyDef& BodyA(const ImportedScene& loaded) { return loaded.scene.mechanisms[0].bodies[1]; }

TEST(ImportUrdfInertia, MassAloneTakesTheInertiaOfTheShape) {
  const std::string box = Part("collision", R"(<box size=".1 .2 .3"/>)");
  for (const char* inertial : {kOnlyMass, kZeros}) {
    const ImportedScene loaded = MustLoad(Arm(inertial + box));
    EXPECT_TRUE(HasNote(loaded.report, Kind::kChosen, "link 'a': mass without rotational inertia"));
    EXPECT_TRUE(HasNote(loaded.report, Kind::kChosen, "solid box of the same mass"));
    // m (b² + c²) / 12; written with 17 digits and back, so rounding alone.
    const Vector3 moments = 2.0 / 12 * Vector3(.04 + .09, .01 + .09, .01 + .04);
    EXPECT_LT((BodyA(loaded).inertia.rotational - Matrix3(moments.asDiagonal())).norm(), 1e-12);
    EXPECT_EQ(BodyA(loaded).inertia.mass, 2);
  }
  // The shape may be one to look at, or a mesh, which counts as the box around it.
  const ImportedScene ball = MustLoad(Arm(kOnlyMass + Part("visual", R"(<sphere radius=".5"/>)")));
  EXPECT_LT((BodyA(ball).inertia.rotational - .4 * 2 * .25 * Matrix3::Identity()).norm(), 1e-12);
  WriteFile("part.dae", Dae(CornerTetrahedron(.1, .2, .3)));
  const auto mesh = LoadMechanism(WriteFile("arm.urdf", Arm(kOnlyMass + MeshPart("collision", "part.dae"))));
  ASSERT_TRUE(mesh) << mesh.error().Text();
  EXPECT_TRUE(HasNote(mesh->report, Kind::kChosen, "solid box around its mesh"));
  const Vector3 moments = 2.0 / 12 * Vector3(.04 + .09, .01 + .09, .01 + .04);
  // Vertices pass through floats.
  EXPECT_LT((BodyA(*mesh).inertia.rotational - Matrix3(moments.asDiagonal())).norm(), 1e-7);
}

TEST(ImportUrdfInertia, MassWithoutShapeIsAPoint) {
  const ImportedScene loaded = MustLoad(Arm(kZeros));
  EXPECT_TRUE(HasNote(loaded.report, Kind::kChosen, "link 'a': mass without rotational inertia"));
  EXPECT_TRUE(HasNote(loaded.report, Kind::kChosen, "the mass is a point"));
  EXPECT_EQ(BodyA(loaded).inertia.rotational, Matrix3::Zero());
}

TEST(ImportUrdfInertia, NothingAtAllIsSaid) {
  const ImportedScene shaped = MustLoad(Arm(Part("collision", R"(<box size=".1 .1 .1"/>)")));
  EXPECT_TRUE(
      HasNote(shaped.report, Kind::kChosen, "link 'a': no <inertial>: taken from the collision shapes"));
  EXPECT_NEAR(BodyA(shaped).inertia.mass, 1, 1e-12);  // a litre of water
  // What is only drawn weighs nothing.
  const ImportedScene drawn = MustLoad(
      Arm(Part("collision", R"(<box size=".1 .1 .1"/>)") + Part("visual", R"(<box size="1 1 1"/>)")));
  EXPECT_NEAR(BodyA(drawn).inertia.mass, 1, 1e-12);
  // A link without mass moves where another hangs on it.
  const auto carrier = [](const std::string& content) {
    return MustLoad(Robot(Link("base") + Link("a", content) + Link("b") +
                          Joint("j", "continuous", "base", "a") + Joint("f", "fixed", "a", "b", "")));
  };
  const ImportedScene bare = carrier("");
  EXPECT_TRUE(HasNote(bare.report, Kind::kChosen, "link 'a': no <inertial>: the link weighs nothing"));
  EXPECT_EQ(BodyA(bare).inertia.mass, 0);
  const ImportedScene weightless = carrier("<inertial/>");
  EXPECT_TRUE(HasNote(weightless.report, Kind::kDropped, "link 'a': inertia with zero mass"));
}

TEST(ImportUrdfInertia, MovingLinkWithoutMass_IsRefusedByName) {
  for (const std::string& content :
       {std::string(), std::string("<inertial/>"), Part("visual", "<box size=\".1 .1 .1\"/>")}) {
    const Error error = MustFail(Arm(content));
    EXPECT_EQ(error.code, ErrorCode::kModel);
    EXPECT_EQ(error.where, "test.xml, link 'a'");
    EXPECT_CONTAINS(error.message, "joint 'j' moves it");
    EXPECT_CONTAINS(error.message, "<inertial>");
  }
}

TEST(ImportUrdfInertia, WordsAreNoNumbers) {
  const auto mass = [](const std::string& value) {
    return Arm("<inertial><mass value=\"" + value + "\"/></inertial>");
  };
  const Error xacro = MustFail(mass("${m}"));
  EXPECT_EQ(xacro.code, ErrorCode::kModel);
  EXPECT_CONTAINS(xacro.where, "line 4");
  EXPECT_CONTAINS(xacro.message, "<mass value=\"${m}\"> is unexpanded xacro");
  EXPECT_CONTAINS(xacro.message, "run xacro");
  EXPECT_CONTAINS(MustFail(mass("2 kg")).message, "is no number");
  EXPECT_CONTAINS(MustFail(mass("")).message, "is no number");
  EXPECT_CONTAINS(MustFail(Arm(R"(<inertial><mass value="1"/><inertia ixx="x"/></inertial>)")).message,
                  "ixx");
}

std::string Diagonal(double mass, const std::string& xx, const std::string& yy, const std::string& zz) {
  return "<inertial><mass value=\"" + std::to_string(mass) + "\"/><inertia ixx=\"" + xx + "\" iyy=\"" + yy +
         "\" izz=\"" + zz + "\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>";
}

// Two moments of a plate add up to the third, those of a rod are one zero and two equal ones.
TEST(ImportUrdfInertia, PlatesAndRods_AreAcceptedToTheDigitsOfTheFile) {
  struct Case {
    const char *xx, *yy, *zz;
    double change;  // of the largest moment, at most
    bool noted;
  };
  for (const Case& one :
       {Case{"3e-4", "1e-4", "4e-4", 1e-8, false}, Case{"0.012", "0.0035", "0.0155", 1e-8, false},
        Case{"0", "0.02083333333333", "0.02083333333333", 1e-8, false},
        Case{"0.0208", "0.0208", "-1e-12", 1e-8, false}, Case{"0.00167", "0.00666", "0.00835", 3e-3, true}}) {
    SCOPED_TRACE(one.zz);
    const ImportedScene loaded = MustLoad(Arm(Diagonal(2, one.xx, one.yy, one.zz)));
    const Vector3 written(std::stod(one.xx), std::stod(one.yy), std::stod(one.zz));
    EXPECT_LT((BodyA(loaded).inertia.rotational - Matrix3(written.asDiagonal())).cwiseAbs().maxCoeff(),
              one.change * written.maxCoeff());
    EXPECT_FALSE(HasNote(loaded.report, Kind::kChanged, "mean"));
    EXPECT_EQ(HasNote(loaded.report, Kind::kChanged, "by rounding"), one.noted);
  }
  const ImportedScene wrong = MustLoad(Arm(Diagonal(2, ".01", ".01", ".03")));
  EXPECT_TRUE(HasNote(wrong.report, Kind::kChanged, "became their mean"));
  EXPECT_CONTAINS(MustFail(Arm(Diagonal(2, ".01", ".01", "-.01"))).message, "negative principal moment");
}

TEST(ImportUrdfInertia, MomentsOfRounding_AreNone) {
  const ImportedScene loaded = MustLoad(Arm(Diagonal(2, "-3e-35", "0", "1e-35")));
  EXPECT_TRUE(HasNote(loaded.report, Kind::kChosen, "the mass is a point"));
}

// At both edges: what counts as no moment, and what three digits can be off by.
TEST(ImportUrdfInertia, EdgesOfNothingAndOfWrittenDigits) {
  EXPECT_TRUE(HasNote(MustLoad(Arm(Diagonal(2, "1.9e-14", "1.9e-14", "1.9e-14"))).report, Kind::kChosen,
                      "the mass is a point"));
  EXPECT_FALSE(HasNote(MustLoad(Arm(Diagonal(2, "2.1e-14", "2.1e-14", "2.1e-14"))).report, Kind::kChosen,
                       "the mass is a point"));
  EXPECT_TRUE(
      HasNote(MustLoad(Arm(Diagonal(2, ".005", ".00491", ".01"))).report, Kind::kChanged, "by rounding"));
  EXPECT_TRUE(HasNote(MustLoad(Arm(Diagonal(2, ".005", ".00489", ".01"))).report, Kind::kChanged,
                      "became their mean"));
}

// A leg of a millimetre has 1e-12 kg m².
TEST(ImportUrdfInertia, SmallMoments_AreKept) {
  const ImportedScene loaded = MustLoad(Arm(Diagonal(3e-6, "4e-13", "4e-13", "6e-13")));
  const Vector3 written(4e-13, 4e-13, 6e-13);
  EXPECT_LT((BodyA(loaded).inertia.rotational - Matrix3(written.asDiagonal())).norm(), 1e-6 * written.norm());
}

struct Sized {
  const char* geometry;
  const char* says;
  bool refused;  // as a collision shape; one that has no extent at all is left out
};

TEST(ImportUrdfInertia, SizesOfZero) {
  const Sized cases[] = {
      {R"(<box size="0 0 0"/>)", "a box of size zero", false},
      {R"(<sphere radius="0"/>)", "a sphere of size zero", false},
      {R"(<cylinder radius="0" length="0"/>)", "a cylinder of size zero", false},
      {R"(<box size=".1 .1 0"/>)", "a box with one size zero", true},
      {R"(<cylinder radius=".1" length="0"/>)", "a cylinder with one size zero", true},
      {R"(<box size=".1 -.1 .1"/>)", "negative size", true},
      {R"(<box size=".1 .1"/>)", "without its size of three numbers", true},
      {R"(<sphere/>)", "without its radius", true},
      {R"(<cylinder radius=".1"/>)", "without its radius and length", true},
      {R"(<capsule length=".1" radius="0"/>)", "a capsule with one size zero", true},
  };
  for (const Sized& one : cases) {
    SCOPED_TRACE(one.geometry);
    const std::string collision = Arm(kInertial + Part("collision", one.geometry));
    if (one.refused) {
      const Error error = MustFail(collision);
      EXPECT_EQ(error.code, ErrorCode::kModel);
      EXPECT_CONTAINS(error.where, "line 5");
      EXPECT_CONTAINS(error.message, "link 'a'");
      EXPECT_CONTAINS(error.message, one.says);
    } else {
      const ImportedScene loaded = MustLoad(collision);
      EXPECT_TRUE(HasNote(loaded.report, Kind::kDropped, std::string("link 'a': ") + one.says));
      EXPECT_TRUE(BodyA(loaded).geometries.empty());
    }
    const ImportedScene drawn = MustLoad(Arm(kInertial + Part("visual", one.geometry)));
    EXPECT_TRUE(HasNote(drawn.report, Kind::kDropped, "link 'a'"));
    EXPECT_TRUE(BodyA(drawn).geometries.empty());
  }
}

}  // namespace
}  // namespace fork1s::testing_importer
