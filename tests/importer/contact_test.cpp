// What the file says about which shapes touch, and how.
#include "helpers.hpp"
#include "urdf_text.hpp"

namespace fork1s::testing_importer {
namespace {

const GeometryDef& Geom(const Scene& scene, const std::string& name) {
  const GeometryDef* found = nullptr;
  const auto look = [&](const std::vector<GeometryDef>& geometries) {
    for (const GeometryDef& g : geometries)
      if (g.name == name) found = &g;
  };
  look(scene.world);
  for (const MechanismDef& m : scene.mechanisms)
    for (const BodyDef& b : m.bodies) look(b.geometries);
  for (const FreeBodyDef& b : scene.free_bodies) look(b.geometries);
  if (found == nullptr) throw std::runtime_error("no geom " + name);
  return *found;
}

std::string Legged(const std::string& contact, const std::string& option = "") {
  return "<mujoco>" + option + R"(<default><geom contype="0" conaffinity="0"/></default><worldbody>
    <geom name="floor" type="plane" size="1 1 1"/>
    <body name="trunk" pos="0 0 .3"><freejoint/><geom name="trunk" type="box" size=".1 .1 .05" mass="1"/>
      <body name="leg" pos="0 0 -.1"><joint axis="0 1 0" stiffness="50"/>
        <geom name="thigh" type="sphere" size=".02" mass=".2"/>
        <body name="foot" pos="0 0 -.1"><joint axis="0 1 0" stiffness="50"/>
          <geom name="sole" type="sphere" size=".02" mass=".2"/></body></body></body>
    </worldbody><contact>)" +
         contact + "</contact></mujoco>";
}

TEST(ContactPair, CarriesItsOwnLaw) {
  const ImportedScene in = MustLoad(Legged(
      R"(<pair name="step" geom1="floor" geom2="sole" condim="4" friction=".3 .3 .02 .001 .001"
               margin=".01" solref=".02 .5"/><pair name="slip" geom1="floor" geom2="thigh" condim="1"/>)"));
  ASSERT_EQ(in.scene.contact_pairs.size(), 2u);
  const int at = in.scene.contact_pairs[0].name == "step" ? 0 : 1;  // in the order of the reader
  const ContactPairDef &step = in.scene.contact_pairs[at], &slip = in.scene.contact_pairs[1 - at];
  EXPECT_EQ(step.name, "step");
  EXPECT_EQ(step.friction, 0.3);
  EXPECT_EQ(step.torsion, 0.02);
  EXPECT_EQ(step.rolling, 0);
  EXPECT_EQ(step.margin, 0.01);
  EXPECT_GT(step.restitution, 0);
  EXPECT_EQ(slip.friction, 0);
  EXPECT_EQ(Geom(in.scene, "sole").pairs, std::vector<int>{at});
  EXPECT_EQ(Geom(in.scene, "floor").pairs, (std::vector<int>{0, 1}));
  EXPECT_TRUE(Geom(in.scene, "trunk").pairs.empty());
  EXPECT_FALSE(HasNote(in.report, ImportNote::Kind::kDropped, "pair"));
}

TEST(ContactPair, BodiesAreInterfacesAndGrounds) {
  const ImportedScene in =
      MustLoad(Legged(R"(<pair geom1="floor" geom2="sole"/><pair geom1="floor" geom2="thigh"/>)"));
  EXPECT_EQ(in.scene.mechanisms[0].interfaces, (std::vector<std::string>{"leg", "foot"}));
  for (const ImportNote& note : in.report.notes)
    EXPECT_EQ(note.message.find("nothing to fall on"), std::string::npos);
}

TEST(ContactPair, HasFrictionByDirection) {
  const ImportedScene in =
      MustLoad(Legged(R"(<pair geom1="floor" geom2="sole" friction=".05 1 .005 .0001 .0001"/>)"));
  EXPECT_EQ(in.scene.contact_pairs[0].friction, 1);
  EXPECT_EQ(in.scene.contact_pairs[0].friction_scale, Vector2(0.05, 1));
  EXPECT_FALSE(HasNote(in.report, ImportNote::Kind::kChanged, "pair"));
}

TEST(ContactPair, RollingFrictionByDirectionIsNoted) {
  const ImportedScene in =
      MustLoad(Legged(R"(<pair geom1="floor" geom2="sole" condim="6" friction="1 1 .005 .0001 .0003"/>)"));
  EXPECT_EQ(in.scene.contact_pairs[0].rolling, 0.0003);
  EXPECT_TRUE(
      HasNote(in.report, ImportNote::Kind::kChanged, "rolling friction is the same in all directions"));
}

TEST(ContactPair, OfRigidGeomsIsDropped) {
  const ImportedScene in = MustLoad(R"(<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/>
    <geom name="wall" type="box" size="1 1 1"/><body><freejoint/><geom type="sphere" size=".1"/></body></worldbody>
    <contact><pair name="p" geom1="floor" geom2="wall"/></contact></mujoco>)");
  EXPECT_TRUE(in.scene.contact_pairs.empty());
  EXPECT_TRUE(HasNote(in.report, ImportNote::Kind::kDropped, "'p'"));
}

TEST(ContactPair, IsOffWithAllContacts) {
  const ImportedScene in = MustLoad(
      Legged(R"(<pair geom1="floor" geom2="sole"/>)", R"(<option><flag contact="disable"/></option>)"));
  EXPECT_FALSE(Geom(in.scene, "sole").Collides());
}

TEST(ParentFilter, FollowsTheFormat) {
  const auto filter = [](const std::string& option) {
    return MustLoad(Legged("", option)).scene.mechanisms[0].parent_filter;
  };
  EXPECT_EQ(filter(""), ParentFilter::kMoving);
  EXPECT_EQ(filter(R"(<option><flag filterparent="disable"/></option>)"), ParentFilter::kNone);
  const auto urdf = LoadMechanism(WriteFile("arm.urdf", Arm(kInertial)));
  ASSERT_TRUE(urdf.has_value());
  EXPECT_EQ(urdf->scene.mechanisms[0].parent_filter, ParentFilter::kAll);
}

constexpr const char* kOverridden = R"(<mujoco><option o_friction=".1 .1 .02 .003 .003" o_margin=".004">
    <flag override="%"/></option><worldbody><geom name="floor" type="plane" size="0 0 1"/>
    <body><freejoint/><geom name="ball" type="sphere" size=".1" condim="6" margin=".02"/></body></worldbody>
    <contact><pair geom1="floor" geom2="ball" condim="6"/></contact></mujoco>)";

TEST(ContactOverride, ReplacesFrictionAndMargin) {
  std::string text = kOverridden;
  const Scene on = MustLoad(text.replace(text.find('%'), 1, "enable")).scene;
  EXPECT_EQ(Geom(on, "ball").friction, 0.1);
  EXPECT_EQ(Geom(on, "ball").torsion, 0.02);
  EXPECT_EQ(Geom(on, "ball").rolling, 0.003);
  EXPECT_EQ(Geom(on, "ball").margin + Geom(on, "floor").margin, 0.004);
  EXPECT_EQ(on.contact_pairs[0].friction, 0.1);
  EXPECT_EQ(on.contact_pairs[0].margin, 0.004);
  text = kOverridden;
  const Scene off = MustLoad(text.replace(text.find('%'), 1, "disable")).scene;
  EXPECT_EQ(Geom(off, "ball").friction, 1);
  EXPECT_EQ(Geom(off, "ball").margin, 0.02);
}

// The frame of a mesh is the reader's own, about its centre of volume: there the field is another.
TEST(Surface, MovesInTheFrameOfItsShape) {
  const ImportedScene in =
      MustLoad(R"(<mujoco><asset><mesh name="m" vertex="1 0 0  3 0 0  1 1 0  1 0 1"/></asset><worldbody>
    <geom name="belt" type="box" size="1 1 .1" surfacevel="1 2 3 4 5 6" adhesion="20"/>
    <geom name="wedge" type="mesh" mesh="m" surfacevel="1 2 3 4 5 6"/>
    <body pos="0 0 2"><freejoint/><geom name="ball" type="sphere" size=".1"/></body></worldbody></mujoco>)");
  EXPECT_FALSE(HasNote(in.report, ImportNote::Kind::kDropped, "geom"));
  EXPECT_EQ(Geom(in.scene, "belt").adhesion, 20);
  EXPECT_EQ(Geom(in.scene, "ball").adhesion, 0);
  const Vector3 v(1, 2, 3), omega(4, 5, 6);
  Vector6 V;
  V << omega, v;
  EXPECT_EQ(Geom(in.scene, "belt").surface_velocity, V);
  const GeometryDef& wedge = Geom(in.scene, "wedge");
  const Vector6 in_world = AdjointApply(wedge.X_BG, wedge.surface_velocity);
  EXPECT_LT((in_world - V).norm(), 1e-12) << in_world.transpose();
}

TEST(ContactNotes, NameWhatIsLeftOut) {
  const ImportedScene in = MustLoad(R"(<mujoco><worldbody>
    <geom name="floor" type="box" size="1 1 .1"/>
    <flexcomp name="pad" type="grid" count="3 3 3" spacing=".03 .03 .03" pos="0 0 1" radius=".002" dim="3"
              mass=".1"/>
    <body pos="0 0 2"><freejoint/><geom type="sphere" size=".1"/></body></worldbody></mujoco>)");
  EXPECT_TRUE(HasNote(in.report, ImportNote::Kind::kDropped, "flex 'pad'"));
}

// An angle of no more than 0 has no direction, and none is more than π.
TEST(BallLimit, OutsideOfWhatAnglesAre_IsLeftOut) {
  const auto load = [](const std::string& attributes) {
    return MustLoad("<mujoco><worldbody><body name='p'><joint name='b' type='ball' limited='true' " +
                    attributes + "/><geom size='.1'/></body></worldbody></mujoco>");
  };
  const ImportedScene thirty = load("range='0 30' margin='.1'");
  ASSERT_EQ(thirty.scene.mechanisms[0].length_limits.size(), 1u);
  EXPECT_NEAR(thirty.scene.mechanisms[0].length_limits[0].upper, M_PI / 6 - 0.1, 1e-12);
  for (const char* attributes : {"range='0 30' margin='.6'", "range='0 180'", "range='0 200'"})
    EXPECT_TRUE(load(attributes).scene.mechanisms[0].length_limits.empty()) << attributes;
  EXPECT_TRUE(
      HasNote(load("range='0 30' margin='.6'").report, ImportNote::Kind::kDropped, "less its margin"));
  const ImportedScene shared = MustLoad(
      "<mujoco><worldbody><body name='p'><joint name='h' axis='1 0 0'/><joint name='b' type='ball' range='0 30'/>"
      "<geom size='.1'/></body></worldbody></mujoco>");
  EXPECT_TRUE(HasNote(shared.report, ImportNote::Kind::kDropped, "another joint of its body"));
}

// Its vertices are no loose bodies: they stay, as a lump, with what carries them.
TEST(Flex, StandsStillInWhatCarriesIt) {
  const ImportedScene in = MustLoad(R"(<mujoco><worldbody>
    <flexcomp name="cloth" type="grid" count="3 3 1" spacing=".03 .03 .03" pos="0 0 1" radius=".002" dim="2" mass=".1"/>
    <body name="arm" pos="0 0 2"><joint name="j" axis="0 1 0" stiffness="1"/><geom type="sphere" size=".1" mass="1"/>
      <flexcomp name="pad" type="grid" count="3 3 3" spacing=".03 .03 .03" pos="0 0 -.3" radius=".002" dim="3"
                mass=".2"><pin id="0"/></flexcomp></body></worldbody>
    <keyframe><key name="k"/></keyframe></mujoco>)");
  ASSERT_EQ(in.scene.mechanisms.size(), 1u);
  EXPECT_TRUE(in.scene.free_bodies.empty());
  const MechanismDef& arm = in.scene.mechanisms[0];
  ASSERT_EQ(arm.joints.size(), 1u);
  double mass = 0;
  for (const BodyDef& b : arm.bodies) mass += b.inertia.mass;
  EXPECT_NEAR(mass, 1 + 0.2 * 26 / 27, 1e-12);  // the pinned vertex has no body
  for (const char* part : {"'cloth'", "'pad'"})
    EXPECT_TRUE(HasNote(in.report, ImportNote::Kind::kDropped, part));
}

// Contact is hard: what MuJoCo makes softer than by default is noted, what it makes harder or lively is not.
TEST(ContactNotes, SoftContactsAreNoted) {
  const ImportedScene loaded = MustLoad(R"(<mujoco><worldbody>
    <geom name="usual" size=".1"/><geom name="stiff" size=".1" solref=".004 1"/>
    <geom name="lively" size=".1" solref=".02 .3"/>
    <geom name="foam" size=".1" solref=".08 1"/><geom name="rubber" size=".1" solref="-900 -40"/>
    <geom name="yielding" size=".1" solimp=".4 .9 .01"/>
    <geom name="drawn" size=".1" solref=".08 1" contype="0" conaffinity="0"/>
    <body pos="0 0 1"><freejoint/><geom name="ball" size=".1"/></body></worldbody>
    <contact><pair name="pad" geom1="usual" geom2="ball" solref=".1 1"/></contact></mujoco>)");
  const auto noted = [&](const std::string& name) {
    return HasNote(loaded.report, ImportNote::Kind::kDropped, "softness by solref and solimp") &&
           std::any_of(loaded.report.notes.begin(), loaded.report.notes.end(), [&](const ImportNote& note) {
             return (note.where + note.message).find("'" + name + "'") != std::string::npos;
           });
  };
  for (const char* name : {"foam", "rubber", "yielding", "pad"}) EXPECT_TRUE(noted(name)) << name;
  for (const char* name : {"usual", "stiff", "lively", "drawn", "ball"}) EXPECT_FALSE(noted(name)) << name;
}

}  // namespace
}  // namespace fork1s::testing_importer
