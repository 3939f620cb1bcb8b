// The reduced model beside the full one and beside MuJoCo.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fork1s/study/compare.hpp>
#include <fstream>
#include <stdexcept>

namespace fork1s {
namespace {

ImportedScene LoadScene(const std::string& name) {
  auto imported = LoadMechanism(std::string(FORK1S_SOURCE_DIR "/scenes/") + name + ".xml");
  if (!imported) throw std::runtime_error(imported.error().Text());
  return std::move(*imported);
}

/// A chain of ten sprung rods that hangs out to the side and falls, its last one the interface.
ImportedScene LoadChain(int modes) {
  std::string body, end;
  for (int i = 1; i <= 10; ++i) {
    const std::string n = std::to_string(i);
    body +=
        "<body name='link" + n + "' pos='" + (i == 1 ? "0 0 1" : "0.1 0 0") + "'><joint name='j" + n +
        "' axis='0 1 0' stiffness='200' damping='0.5'/>"
        "<geom type='capsule' fromto='0 0 0 0.1 0 0' size='0.005' mass='0.05' contype='0' conaffinity='0'/>";
    end += "</body>";
  }
  ImportOptions options;
  options.interfaces = {"link10"};
  options.modes = modes;
  auto imported = LoadMechanismFromString(
      "<mujoco model='chain'><worldbody>" + body + end + "</worldbody></mujoco>", "chain", options);
  if (!imported) throw std::runtime_error(imported.error().Text());
  return std::move(*imported);
}

Comparison CompareOrThrow(const ImportedScene& scene, const CompareOptions& options) {
  auto comparison = Compare(scene, options);
  if (!comparison) throw std::runtime_error(comparison.error().Text());
  return std::move(*comparison);
}

TEST(CompareFull, SmoothMotionOfTheHandIsWithinATenthOfAMillimetre) {
  CompareOptions options;
  options.time = 1.5;
  options.refinements = 1;
  options.controls.names = {"index_knuckle_flex", "middle_knuckle_flex", "ring_knuckle_flex", "palm.z",
                            "palm.rz"};
  options.controls.times = {0, 1, 1.5};
  options.controls.rows = {{0, 0, 0, 0, 0}, {0.5, 0.6, 0.7, 0.05, 0.3}, {0.5, 0.6, 0.7, 0.05, 0.3}};
  const Comparison c = CompareOrThrow(LoadScene("hand"), options);
  ASSERT_EQ(c.interface.size(), 5u);
  for (const BodyDifference& b : c.interface) {
    EXPECT_LT(b.max_mm, 0.1) << b.body;  // what the project promises; 0.004 was seen
    EXPECT_LE(b.rms_mm, b.max_mm) << b.body;
  }
  // They did move: fingertips by centimetres.
  double moved = 0;
  for (const ComparedTrace& t : c.traces)
    moved = std::max(moved, (t.reduced_m.back() - t.reduced_m.front()).norm());
  EXPECT_GT(moved, 0.03);
  EXPECT_EQ(c.unconverged_reduced + c.unconverged_other, 0);
  // Exact recovery leaves rounding.
  EXPECT_LT(c.gap_max_mm, 1e-9);
  EXPECT_LT(c.gap_max_other_mm, 1e-9);
  // The box only lies there: both solve the same contact, the reduced one to 1e-4 of its force.
  EXPECT_LT(c.force_rms_percent, 0.1);
  EXPECT_GT(c.wall_ratio, 1);
  EXPECT_EQ(c.times_s.size(), 91u);
}

TEST(CompareFull, FrequenciesAreThoseOfTheOtherRooms) {
  CompareOptions options;
  options.time = 0.1;
  options.refinements = 0;
  const Comparison c = CompareOrThrow(LoadScene("two_link_arm"), options);
  ASSERT_EQ(c.frequencies_full_hz.size(), 2u);
  ASSERT_EQ(c.frequencies_reduced_hz.size(), 2u);
  // docs/validation.md, to half a unit of their last digit.
  EXPECT_NEAR(2 * M_PI * c.frequencies_full_hz[0], 7.5693, 5e-5);
  EXPECT_NEAR(2 * M_PI * c.frequencies_full_hz[1], 19.8168, 5e-5);
  EXPECT_NEAR(2 * M_PI * c.frequencies_reduced_hz[0], 7.5693, 5e-5);
}

// The scene that the method was made for: one body of fourteen coordinates stands for two men and a
// trampoline.
TEST(CompareFull, BunnyOnTheTrampolineIsWithinHalfAMillimetre) {
  CompareOptions options;
  options.time = 2;
  options.refinements = 0;
  options.integrator = Integrator::kEuler;  // the same rule on both sides: what differs is the reduction's
  const Comparison c = CompareOrThrow(LoadScene("firemen"), options);
  ASSERT_EQ(c.interface.size(), 1u);
  EXPECT_LT(c.interface[0].rms_mm, 0.5);  // what the project promises; 0.15 was seen
  // The bunny tumbles: what differs at its first landing grows with every further one.
  EXPECT_LT(c.free_bodies[0].rms_mm, 2);
  EXPECT_EQ(c.unconverged_reduced, 0);
}

TEST(CompareFull, ModesBringTheReducedModelNearer) {
  CompareOptions options;
  options.time = 1;
  options.dt = 1.0 / 120;
  options.refinements = 0;
  options.integrator = Integrator::kEuler;
  const double none = CompareOrThrow(LoadChain(0), options).interface.front().rms_mm;
  const double four = CompareOrThrow(LoadChain(4), options).interface.front().rms_mm;
  // A stiff chain sags little, so that what differs is the interior's motion, and modes carry that.
  EXPECT_LT(four, 0.5 * none) << none;
}

TEST(CompareFull, ErrorAgainstTheFinestStepFallsWithTheStep) {
  CompareOptions options;
  options.time = 0.5;
  options.refinements = 3;
  options.integrator = Integrator::kEuler;
  const Comparison c = CompareOrThrow(LoadChain(10), options);
  ASSERT_EQ(c.equal_steps.size(), 4u);
  ASSERT_EQ(c.costs.size(), 7u);  // four reduced, and the full ones but for the finest, which is the truth
  double before = 1e9;
  for (const CostPoint& p : c.costs) {
    if (p.simulator != "full") continue;
    // First order against 1/8 of the first step: 7 to 3 to 1 in theory.
    EXPECT_LT(p.rms_mm, 0.7 * before) << p.dt_s;
    before = p.rms_mm;
  }
}

// With every mode the two are one mechanism: what is left is the time step's.
TEST(CompareFull, WithAllModesTheDifferenceVanishesWithTheStep) {
  CompareOptions options;
  options.time = 0.2;  // nearly all the time goes into the full model at an eighth of the step
  options.refinements = 3;
  ImportOptions all;
  all.modes = 1000;
  all.stiffness_scale = 0.1;  // so that they sink far
  auto scene = LoadMechanism(FORK1S_SOURCE_DIR "/scenes/firemen.xml", all);
  ASSERT_TRUE(scene) << scene.error().Text();
  scene->scene.free_bodies.clear();  // nothing falls on the sheet; the men sink under their own weight
  options.integrator = Integrator::kEuler;
  const Comparison euler = CompareOrThrow(*scene, options);
  ASSERT_EQ(euler.equal_steps.size(), 4u);
  // First order, both: an eighth of the step leaves an eighth of each. The truth is the full run at that
  // step, whose own eighth stays. 2.80 to 0.019 mm was seen.
  const auto error = [](const Comparison& c, std::size_t i) { return c.costs[i].rms_mm; };
  ASSERT_EQ(euler.costs[0].simulator, "reduced");
  EXPECT_LT(error(euler, 3), 0.25 * error(euler, 0));
  // Second order, both: a quarter of the step leaves a sixteenth, dampers of joints in loops or none.
  options.integrator = Integrator::kTwoStage;
  options.refinements = 2;
  const Comparison two_stage = CompareOrThrow(*scene, options);
  EXPECT_EQ(two_stage.full_integrator, FullIntegrator::kTwoStages);
  EXPECT_LT(error(two_stage, 0), 0.1 * error(euler, 0));
  EXPECT_LT(error(two_stage, 2), 0.1 * error(two_stage, 0));
  for (JointDef& joint : scene->scene.mechanisms[0].joints)
    for (auto& freedom : joint.freedoms) freedom.damping = 0;
  const Comparison undamped = CompareOrThrow(*scene, options);
  EXPECT_LT(error(undamped, 2), 0.1 * error(undamped, 0));
}

TEST(CompareMuJoCo, AgreesOnASlowlyFallingChain) {
  CompareOptions options;
  options.against = Against::kMuJoCo;
  options.time = 0.5;
  options.dt = 1e-3;
  options.refinements = 0;
  options.model_path = FORK1S_SOURCE_DIR "/scenes/hexapod.xml";
  const Comparison c = CompareOrThrow(LoadScene("hexapod"), options);
  ASSERT_EQ(c.interface.size(), 7u);  // six feet and the trunk
  // MuJoCo's soft contacts let the feet in by about a millimetre.
  for (const BodyDifference& b : c.interface) EXPECT_LT(b.max_mm, 2) << b.body;
  EXPECT_EQ(c.other, "mujoco");
  EXPECT_NEAR(c.other_dt_s, 0.002, 1e-12);  // MuJoCo's default
}

// Stiff closed loops: MuJoCo does not survive the step of the file.
TEST(CompareMuJoCo, FindsAStepThatMuJoCoSurvives) {
  CompareOptions options;
  options.against = Against::kMuJoCo;
  options.time = 1.7;
  options.refinements = 0;
  options.model_path = FORK1S_SOURCE_DIR "/scenes/firemen.xml";
  const Comparison c = CompareOrThrow(LoadScene("firemen"), options);
  EXPECT_LT(c.other_dt_s, 1.0 / 100);
  ASSERT_FALSE(c.warnings.empty());
  EXPECT_NE(c.warnings.front().find("that it survives"), std::string::npos) << c.warnings.front();
  // Its loops are soft constraints, ours are solved to 1e-9 of the men's length.
  EXPECT_GT(c.gap_max_other_mm, 1e-3);
  EXPECT_LT(c.gap_max_mm, 1e-5);
}

std::vector<std::string> Names(const std::vector<ContactPair>& pairs) {
  std::vector<std::string> names;
  for (const ContactPair& p : pairs) names.push_back(p.body_a + "+" + p.body_b + (p.touched ? "!" : ""));
  return names;
}

// A finger of three bodies of which only the tip is an interface, and a ball that falls on the first.
Comparison CompareFinger(const std::string& contact) {
  const std::string rod =
      "<geom type='capsule' fromto='0 0 0 0.1 0 0' size='0.01'/><joint axis='0 1 0' stiffness='10' "
      "damping='1'/>";
  const std::string text =
      "<mujoco model='finger'><custom><text name='fork1s_interface' data='tip'/></custom><worldbody>"
      "<geom type='plane' size='1 1 0.1'/><body name='forearm' pos='0 0 0.5'>" +
      rod + "<body name='hand' pos='0.1 0 0'>" + rod + "<body name='tip' pos='0.1 0 0'>" + rod +
      "</body></body></body><body name='ball' pos='0.05 0 0.54'><freejoint/><geom "
      "size='0.02'/></body></worldbody>" +
      contact + "</mujoco>";
  CompareOptions options;
  options.model_path = (std::filesystem::path(::testing::TempDir()) / "finger_pairs.xml").string();
  std::ofstream(options.model_path) << text;
  options.against = Against::kMuJoCo;
  options.time = 0.2;  // the ball falls 10 mm in 0.05 s
  options.refinements = 0;
  auto imported = LoadMechanism(options.model_path);
  if (!imported) throw std::runtime_error(imported.error().Text());
  return CompareOrThrow(*imported, options);
}

TEST(CompareMuJoCo, NamesThePairsThatTouchThereAlone) {
  const Comparison c = CompareFinger("");
  // Parent and child never touch in MuJoCo, but for children of the world; here no inner body does.
  EXPECT_EQ(Names(c.pairs_only_other), (std::vector<std::string>{"ball+forearm!", "ball+hand", "forearm+tip",
                                                                 "forearm+world", "hand+world"}));
  EXPECT_TRUE(c.pairs_only_reduced.empty());
  const auto lines = PairLines(c);
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_NE(lines[0].find("'ball' and 'forearm' (they did), 'ball' and 'hand'"), std::string::npos)
      << lines[0];
}

TEST(CompareMuJoCo, ExcludedAndNamedPairsCount) {
  const Comparison c = CompareFinger(
      "<contact><exclude body1='ball' body2='forearm'/><exclude body1='tip' body2='world'/></contact>");
  EXPECT_EQ(Names(c.pairs_only_other),
            (std::vector<std::string>{"ball+hand", "forearm+tip", "forearm+world", "hand+world"}));
  EXPECT_TRUE(c.pairs_only_reduced.empty());
}

TEST(CompareMuJoCo, SaysNothingOfPairsWhereAllAreTheSame) {
  CompareOptions options;
  options.against = Against::kMuJoCo;
  options.time = 0.05;
  options.refinements = 0;
  for (const char* scene : {"hexapod", "firemen", "vehicle", "hand"}) {
    options.model_path = FORK1S_SOURCE_DIR "/scenes/" + std::string(scene) + ".xml";
    EXPECT_TRUE(PairLines(CompareOrThrow(LoadScene(scene), options)).empty()) << scene;
  }
}

// A crate of 3 kg under the tip of a mast, which a weld may hold.
std::string Crane(const std::string& equality) {
  return "<mujoco model='crane'><option timestep='2e-4' integrator='implicitfast'/><worldbody>"
         "<body name='mast' pos='0 0 2'><joint name='swing' axis='0 1 0' stiffness='4000' damping='200'/>"
         "<geom type='capsule' fromto='0 0 0 1 0 0' size='.03' mass='5' contype='0' conaffinity='0'/></body>"
         "<body name='crate' pos='1 0 1.5'><freejoint/><geom type='box' size='.1 .1 .1' mass='3'/></body>"
         "</worldbody><equality>" +
         equality + "</equality></mujoco>";
}
const char* const kHook =
    "<weld name='hook' body1='mast' body2='crate' active='false' solref='.002 1' solimp='.999 .999 .001'/>";

TEST(CompareFull, SwitchedEqualityThatStaysOff_IsNotThere) {
  CompareOptions options;
  options.time = 0.5;
  options.refinements = 0;
  const auto load = [](const std::string& equality) {
    auto imported = LoadMechanismFromString(Crane(equality), "crane");
    if (!imported) throw std::runtime_error(imported.error().Text());
    return std::move(*imported);
  };
  const ImportedScene with = load(kHook);
  const Comparison off = CompareOrThrow(with, options), none = CompareOrThrow(load(""), options);
  for (const auto* c : {&off, &none}) {
    ASSERT_EQ(c->free_bodies.size(), 1u);
    EXPECT_LT(c->free_bodies[0].max_mm, 1e-6);  // both rules are exact for a constant acceleration
  }
  EXPECT_EQ(off.interface.at(0).max_mm, none.interface.at(0).max_mm);
  EXPECT_EQ(off.frequencies_full_hz, none.frequencies_full_hz);
  options.controls = {{"hook"}, {0, 0.2}, {{0}, {1}}};
  const auto refused = Compare(with, options);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().Text().find("equality 'hook'"), std::string::npos) << refused.error().Text();
  options.controls.rows = {{0}, {0.4}};
  EXPECT_TRUE(Compare(with, options));
}

// MuJoCo's rule of first order falls g t h/2 = 0.3 mm too far in 0.3 s; its springs for a weld give way by less.
TEST(CompareMuJoCo, SwitchesEqualitiesByTheTable) {
  CompareOptions options;
  options.against = Against::kMuJoCo;
  options.time = 0.6;
  options.dt = 1.0 / 240;
  options.refinements = 0;
  options.model_path = (std::filesystem::path(testing::TempDir()) / "fork1s_compare_crane.xml").string();
  std::ofstream(options.model_path) << Crane(kHook);
  const auto imported = LoadMechanism(options.model_path);
  ASSERT_TRUE(imported) << imported.error().Text();
  options.controls = {{"hook"}, {0, 0.3, 0.3001}, {{1}, {1}, {0}}};
  const Comparison c = CompareOrThrow(*imported, options);
  ASSERT_EQ(c.free_bodies.size(), 1u);
  EXPECT_LT(c.free_bodies[0].max_mm, 0.5);
  const auto& crate = *std::find_if(c.traces.begin(), c.traces.end(),
                                    [](const auto& trace) { return trace.body == "crate"; });
  // Held, then fallen by g t²/2 of 0.3 s.
  for (const auto* way : {&crate.reduced_m, &crate.other_m}) {
    EXPECT_GT((*way)[72].z(), 1.45);
    EXPECT_NEAR((*way)[72].z() - way->back().z(), 0.5 * 9.81 * 0.3 * 0.3, 1e-3);
  }
  std::filesystem::remove(options.model_path);
}

TEST(Compare, RefusesWhatItCannotRun) {
  CompareOptions options;
  options.controls.names = {"no such control"};
  options.controls.times = {0};
  options.controls.rows = {{0}};
  const auto unknown = Compare(LoadScene("two_link_arm"), options);
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().code, ErrorCode::kModel);
  EXPECT_NE(unknown.error().message.find("no such control"), std::string::npos);

  options = {};
  options.against = Against::kMuJoCo;
  ImportedScene urdf = LoadScene("two_link_arm");
  urdf.report.format = "URDF";
  const auto refused = Compare(urdf, options);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kUsage);
}

}  // namespace
}  // namespace fork1s
