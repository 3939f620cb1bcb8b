// Shapes of one mechanism that overlap where the file starts.
#include "helpers.hpp"

namespace fork1s::testing_importer {
namespace {

using Pairs = std::vector<std::pair<std::string, std::string>>;

// Two plates on a base, `a` at -y and `b` at +y, that overlap by 20 mm along y.
std::string Plates(const std::string& joint_a, const std::string& joint_b, const std::string& more = "",
                   double overlap = 0.02) {
  const std::string y = std::to_string(0.06 - overlap / 2);
  return "<mujoco><compiler angle='radian'/><worldbody><body name='base' pos='0 0 1'><geom type='box' "
         "size='.02 .02 .02' pos='0 0 .1'/>"
         "<body name='a' pos='0 -" +
         y + " 0'><joint name='ja' " + joint_a +
         "/><geom name='ga' type='box' size='.03 .06 .03' mass='.2'/></body>"
         "<body name='b' pos='0 " +
         y + " 0'><joint name='jb' " + joint_b +
         "/><geom name='gb' type='box' size='.03 .06 .03' mass='.2'/></body></body></worldbody>" + more +
         "</mujoco>";
}

const char* const kAcross = "type='hinge' axis='0 1 0'";
const char* const kAlong = "type='slide' axis='0 1 0'";

TEST(Overlap, IsExcludedWhereNoJointMovesAlongTheNormal) {
  const ImportedScene in = MustLoad(Plates(kAcross, kAcross));
  EXPECT_EQ(in.scene.excluded_pairs, (Pairs{{"a", "b"}}));
  EXPECT_TRUE(HasNote(in.report, ImportNote::Kind::kChanged, "1 pair of bodies: 'a' and 'b' by 20 mm"));
}

TEST(Overlap, IsPushedApartWhereOneJointMovesAlongTheNormal) {
  const ImportedScene in = MustLoad(Plates(kAlong, kAcross));
  EXPECT_TRUE(in.scene.excluded_pairs.empty());
  EXPECT_TRUE(HasNote(in.report, ImportNote::Kind::kChanged, "'a' and 'b' by 20 mm"));
}

TEST(Overlap, IsExcludedWhereTheLimitsAreTooNear) {
  const std::string near = "type='slide' axis='0 1 0' range='-.005 .05'",
                    far = "type='slide' axis='0 1 0' range='-.025 .05'";
  EXPECT_EQ(MustLoad(Plates(near, kAcross)).scene.excluded_pairs.size(), 1u);
  EXPECT_EQ(MustLoad(Plates(far, kAcross)).scene.excluded_pairs.size(), 0u);
}

// What is left of a depth of 20 mm is compared with a hundredth of it.
TEST(Overlap, PartsWhereLessThanAHundredthOfItIsLeft) {
  const auto to = [](const std::string& lower) {
    return "type='slide' axis='0 1 0' range='" + lower + " .05'";
  };
  EXPECT_EQ(MustLoad(Plates(to("-.0199"), kAcross)).scene.excluded_pairs.size(), 0u);
  EXPECT_EQ(MustLoad(Plates(to("-.0197"), kAcross)).scene.excluded_pairs.size(), 1u);
}

TEST(Overlap, IsExcludedWhereCouplingsMoveBothAlike) {
  const auto coupled = [](const std::string& slope) {
    return "<equality><joint joint1='jb' joint2='ja' polycoef='0 " + slope + " 0 0 0'/></equality>";
  };
  EXPECT_EQ(MustLoad(Plates(kAlong, kAlong, coupled("1"))).scene.excluded_pairs.size(), 1u);
  EXPECT_EQ(MustLoad(Plates(kAlong, kAlong, coupled("-1"))).scene.excluded_pairs.size(), 0u);
}

TEST(Overlap, OfFlushSurfacesIsNone) {
  const ImportedScene in = MustLoad(Plates(kAcross, kAcross, "", 0));
  EXPECT_TRUE(in.scene.excluded_pairs.empty());
  EXPECT_FALSE(HasNote(in.report, ImportNote::Kind::kChanged, "overlap"));
}

TEST(Overlap, OfExplicitPairsStays) {
  const ImportedScene in =
      MustLoad(Plates(kAcross, kAcross, "<contact><pair geom1='ga' geom2='gb'/></contact>"));
  EXPECT_EQ(in.scene.contact_pairs.size(), 1u);
}

TEST(Overlap, OfExcludedPairsIsNotNoted) {
  const ImportedScene in =
      MustLoad(Plates(kAcross, kAcross, "<contact><exclude body1='a' body2='b'/></contact>"));
  EXPECT_EQ(in.scene.excluded_pairs.size(), 1u);
  EXPECT_FALSE(HasNote(in.report, ImportNote::Kind::kChanged, "overlap"));
}

TEST(Overlap, IsThatOfTheStartingPose) {
  const std::string slide = "type='slide' axis='0 0 1'";
  ImportOptions lowered;
  lowered.joint_coordinates["ja"] = -0.1;
  EXPECT_EQ(MustLoad(Plates(slide, kAcross)).scene.excluded_pairs.size(), 1u);
  EXPECT_EQ(MustLoad(Plates(slide, kAcross), lowered).scene.excluded_pairs.size(), 0u);
}

// A ring of spheres on hinges through their centres, as in a wheel of rollers.
TEST(Overlap, OfManyIsOneNote) {
  std::string rollers;
  for (int i = 0; i < 12; ++i)
    rollers += "<body name='r" + std::to_string(i) + "' pos='" + std::to_string(0.01 * i) +
               " 0 0'><joint axis='0 1 0'/><geom type='sphere' size='.007' mass='.1'/></body>";
  const ImportedScene in = MustLoad(
      "<mujoco><worldbody><body name='hub'><freejoint/><geom type='sphere' size='.001' mass='1' pos='0 0 "
      "1'/>" +
      rollers + "</body></worldbody></mujoco>");
  EXPECT_EQ(in.scene.excluded_pairs.size(), 11u);
  EXPECT_TRUE(HasNote(in.report, ImportNote::Kind::kChanged, "11 pairs of bodies"));
  EXPECT_TRUE(HasNote(in.report, ImportNote::Kind::kChanged, "and 3 more"));
}

}  // namespace
}  // namespace fork1s::testing_importer
