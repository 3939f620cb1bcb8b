// What of a file becomes switchable, what does not and says so, and recordings.
#include <unistd.h>
#include <filesystem>

#include <fork1s/record/recording.hpp>
#include <fork1s/reference/full_simulation.hpp>

#include "support.hpp"

namespace fork1s::switched_equalities_test {
namespace {

bool HasNote(const ImportReport& report, ImportNote::Kind kind, const std::string& part) {
  for (const ImportNote& note : report.notes)
    if (note.kind == kind && (note.where + ": " + note.message).find(part) != std::string::npos) return true;
  return false;
}

TEST(SwitchedEquality, OfAFile_IsAControlThatIsOff) {
  const ImportedScene loaded = MustLoad(Arm().Text());
  const MechanismDef& arm = loaded.scene.mechanisms.at(0);
  ASSERT_EQ(arm.switched_closures.size(), 1u);
  EXPECT_EQ(arm.switched_closures[0].control, "grab");
  ASSERT_EQ(arm.controls.size(), 2u);
  EXPECT_EQ(arm.controls[1].name, "grab");
  EXPECT_EQ(arm.controls[1].initial, 0);
  EXPECT_EQ(arm.controls[1].lower, 0);
  EXPECT_EQ(arm.controls[1].upper, 1);
  EXPECT_EQ(loaded.scene.free_bodies.size(), 1u);
  EXPECT_TRUE(arm.closures.empty());
  EXPECT_FALSE(HasNote(loaded.report, ImportNote::Kind::kDropped, "grab"));
}

TEST(SwitchedEquality, NamedThoughItStartsOn_IsAControlThatIsOn) {
  for (const bool by_option : {false, true}) {
    SCOPED_TRACE(by_option);
    Arm arm = ArmThatHolds();
    arm.equality = "<weld name='grab' {0}/><weld name='spare' {0} active='false'/>";
    ImportOptions options;
    if (by_option) {
      // What the file says is replaced.
      arm.custom = "<text name='fork1s_switched' data='spare'/>";
      options.switched = {"grab"};
    }
    std::string text = arm.Text();
    text.insert(text.find("</mujoco>"), "<keyframe><key name='up' qpos='.1 1 0 -.3 1 0 0 0'/></keyframe>");
    for (const char* keyframe : {"", "up"}) {
      options.keyframe = keyframe;
      const auto loaded = LoadMechanismFromString(text, "test.xml", options);
      ASSERT_TRUE(loaded) << loaded.error().Text();
      const MechanismDef& def = loaded->scene.mechanisms.at(0);
      EXPECT_TRUE(def.closures.empty());
      EXPECT_EQ(loaded->scene.free_bodies.size(), 1u);
      ASSERT_EQ(def.controls.size(), 3u);
      EXPECT_EQ(def.controls[1].name, "grab");
      EXPECT_EQ(def.controls[1].initial, 1);
      EXPECT_EQ(def.controls[1].lower, 0);
      EXPECT_EQ(def.controls[1].upper, 1);
      EXPECT_EQ(def.controls[2].initial, 0);  // spare, off whether named or not
      EXPECT_EQ(loaded->scene.keyframes.at(0).mechanisms.at(0).controls, Vector3(0, 1, 0));
    }
  }
}

// The file's word is the control's value at the start and nothing else.
TEST(SwitchedEquality, ThatStartsOn_MovesAsOneThatIsSwitchedOnAtTheStart) {
  Simulation named = MustStart(ArmThatHolds().Text(), 1. / 240), off = MustStart(Arm().Text(), 1. / 240);
  off.SetControl("grab", 1);
  off.StartFromControls();
  for (Simulation* s : {&named, &off}) RunUntil(*s, 0.1);
  EXPECT_EQ(named.HashState(), off.HashState());
}

TEST(SwitchedEquality, NotNamedAndOn_IsAClosureOfTheReduction) {
  Arm arm = ArmThatHolds();
  arm.equality += "<weld name='spare' body1='arm' body2='other'/>";
  arm.more = "<body name='other' pos='3 0 0'><freejoint/><geom size='.1'/></body>";
  const MechanismDef def = MustLoad(arm.Text()).scene.mechanisms.at(0);
  ASSERT_EQ(def.closures.size(), 1u);
  EXPECT_EQ(def.closures[0].name, "spare");
  EXPECT_EQ(def.switched_closures.size(), 1u);
}

TEST(SwitchedEquality, NamedAndNotThere_IsRefusedWithARemedy) {
  struct Bad {
    std::string data, part;
  };
  for (const Bad& bad : {Bad{"grabs", "called 'grabs'; near names are 'grab'"},
                         Bad{"brake", "no weld and no connect is called 'brake'"},
                         Bad{" ", "names no equality"}, Bad{"grab, nothing", "'nothing'"}}) {
    SCOPED_TRACE(bad.data);
    Arm arm = ArmThatHolds();
    arm.equality += "<joint name='brake' joint1='shoulder'/>";
    arm.custom = "<text name='fork1s_switched' data='" + bad.data + "'/>";
    const auto loaded = LoadMechanismFromString(arm.Text(), "test.xml", {});
    ASSERT_FALSE(loaded);
    EXPECT_EQ(loaded.error().code, ErrorCode::kModel);
    EXPECT_NE(loaded.error().Text().find(bad.part), std::string::npos) << loaded.error().Text();
    EXPECT_NE(loaded.error().where.find("text 'fork1s_switched'"), std::string::npos);
  }
  ImportOptions options;
  options.switched = {"hook"};
  const auto loaded = LoadMechanismFromString(Arm().Text(), "test.xml", options);
  ASSERT_FALSE(loaded);
  EXPECT_EQ(loaded.error().code, ErrorCode::kUsage);
  EXPECT_NE(loaded.error().where.find("option switched"), std::string::npos);
}

TEST(SwitchedEquality, WithoutANameOrOfJoints_IsLeftOutWithANote) {
  Arm arm;
  arm.equality = "<weld {} active='false'/><joint name='brake' joint1='shoulder' active='false'/>";
  const ImportedScene loaded = MustLoad(arm.Text());
  EXPECT_TRUE(loaded.scene.mechanisms.at(0).switched_closures.empty());
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped, "'equality0' and 'brake'"));
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped, "that have a name"));
}

TEST(SwitchedEquality, WithTheNameOfAnActuator_HasAControlOfItsOwn) {
  Arm arm;
  arm.equality = "<weld name='servo' {} active='false'/>";
  const ImportedScene loaded = MustLoad(arm.Text());
  EXPECT_EQ(loaded.scene.mechanisms.at(0).controls.at(1).name, "servo_equality");
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kChanged, "'servo_equality'"));
}

TEST(SwitchedEquality, OfBodiesThatAreOne_IsLeftOutWithANote) {
  Arm arm;
  arm.equality = "<weld name='same' body1='arm' body2='hand' active='false'/>";
  std::string text = arm.Text();
  const std::string after = "contype='0' conaffinity='0'/>";
  text.insert(text.find(after) + after.size(), "<body name='hand'><geom size='.01'/></body>");
  const ImportedScene loaded = MustLoad(text);
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kDropped, "equality 'same'"));
}

TEST(SwitchedEquality, OfABodyThatIsNoInterface_MakesItOne) {
  Arm arm;
  std::string text = arm.Text();
  const std::string after = "contype='0' conaffinity='0'/>";
  text.insert(
      text.find(after) + after.size(),
      "<body name='hand' pos='1 0 0'><joint axis='0 0 1' stiffness='9' damping='1'/><geom size='.01'/></body>");
  text.insert(text.find("<worldbody>"), "<custom><text name='fork1s_interface' data='hand'/></custom>");
  const ImportedScene loaded = MustLoad(text);
  EXPECT_EQ(loaded.scene.mechanisms.at(0).interfaces, (std::vector<std::string>{"hand", "arm"}));
  EXPECT_TRUE(HasNote(loaded.report, ImportNote::Kind::kChosen, "equality 'grab' may hold it"));
}

TEST(SwitchedEquality, OfABodyThatIsNotThere_IsRefusedWithARemedy) {
  ImportedScene loaded = MustLoad(Arm().Text());
  loaded.scene.mechanisms.at(0).switched_closures.at(0).body_b = "crate";
  const auto simulation = Simulation::Create(loaded.scene);
  ASSERT_FALSE(simulation);
  EXPECT_NE(simulation.error().Text().find("holds 'crate'"), std::string::npos) << simulation.error().Text();
}

TEST(SwitchedEquality, InTheFullModel_IsRefused) {
  const auto full = FullSimulation::Create(MustLoad(Arm().Text()).scene, {});
  ASSERT_FALSE(full);
  EXPECT_NE(full.error().Text().find("equality 'grab'"), std::string::npos) << full.error().Text();
}

void ExpectReplay(const std::string& path, int steps, std::uint64_t final_hash) {
  auto recording = Recording::Open(path);
  ASSERT_TRUE(recording) << recording.error().Text();
  const auto replay = Replay(*recording);
  ASSERT_TRUE(replay) << replay.error().Text();
  EXPECT_EQ(replay->steps, steps);
  EXPECT_TRUE(replay->identical) << replay->first_difference_step;
  EXPECT_EQ(replay->final_hash, final_hash);
}

TEST(SwitchedEquality, SwitchedWithinARecording_IsReplayedBitByBit) {
  const auto path =
      std::filesystem::path(::testing::TempDir()) / fmt::format("fork1s_switched_{}.h5", getpid());
  Arm arm;
  Simulation s = MustStart(arm.Text(), 1. / 240);
  {
    auto recorder = Recorder::Create(path.string(), s);
    ASSERT_TRUE(recorder) << recorder.error().Text();
    for (int k = 0; k < 120; ++k) {
      s.SetControl("grab", k >= 10 && k < 80 ? 1 : 0);
      s.SetControl("servo", k >= 40 ? 0.3 : 0);
      ASSERT_TRUE(recorder->Append(s, s.Step()));
    }
    ASSERT_TRUE(recorder->Finish());
  }
  ExpectReplay(path.string(), 120, s.HashState());
  std::filesystem::remove(path);
}

TEST(SwitchedEquality, ThatStartsOnAndIsReleasedWithinARecording_IsReplayedBitByBit) {
  const auto path =
      std::filesystem::path(::testing::TempDir()) / fmt::format("fork1s_released_{}.h5", getpid());
  Simulation s = MustStart(ArmThatHolds().Text(), 1. / 240);
  const double start = Place(s, "box").z();
  {
    auto recorder = Recorder::Create(path.string(), s);
    ASSERT_TRUE(recorder) << recorder.error().Text();
    const ControlTrack track = ReleaseAt(0.25);
    track.Start(s);
    for (int k = 0; k < 120; ++k) {
      track.Apply(s.time() + s.dt(), s);
      ASSERT_TRUE(recorder->Append(s, s.Step(true)));
    }
    ASSERT_TRUE(recorder->Finish());
  }
  EXPECT_LT(Place(s, "box").z(), start - 0.25);
  ExpectReplay(path.string(), 120, s.HashState());
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace fork1s::switched_equalities_test
