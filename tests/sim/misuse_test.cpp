// Calls that make no sense throw std::invalid_argument, which names the function, the value and the remedy.
#include <gtest/gtest.h>

#include <fork1s/sim/control_move.hpp>
#include <fork1s/sim/queries.hpp>
#include <fork1s/sim/randomisation.hpp>
#include <fork1s/sim/simulation.hpp>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "gripper.hpp"

namespace fork1s {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
const Vector3 kZero = Vector3::Zero(), kNoPoint = Vector3::Constant(kNaN);

struct Misuse {
  std::string function;  // as the message names it
  std::string says;
  std::function<void(Simulation&)> call;
};

Simulation Make(const SimulationOptions& options = {}) {
  testing::Gripper gripper;
  gripper.base = BaseKind::kDriven;
  auto simulation = Simulation::Create(gripper.Make(), options);
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  return std::move(*simulation);
}

void ExpectThrown(const std::vector<Misuse>& all) {
  for (const Misuse& misuse : all) {
    Simulation simulation = Make();
    const std::uint64_t before = simulation.HashState();
    try {
      misuse.call(simulation);
      ADD_FAILURE() << misuse.function << " takes it: " << misuse.says;
    } catch (const std::invalid_argument& e) {
      const std::string text = e.what();
      EXPECT_EQ(text.rfind(misuse.function + ": ", 0), 0u) << text;
      EXPECT_NE(text.find(misuse.says), std::string::npos) << text;
      EXPECT_EQ(text.find("--"), std::string::npos) << text;
    }
    EXPECT_EQ(simulation.HashState(), before) << misuse.function;
  }
}

Misuse CreateWith(const std::string& says, const std::function<void(SimulationOptions&)>& spoil) {
  return {"Simulation::Create", says, [=](Simulation&) {
            SimulationOptions options;
            spoil(options);
            Make(options);
          }};
}

TEST(Misuse, OfOptionsThrows) {
  ExpectThrown({
      CreateWith("a time step of -1 s", [](auto& o) { o.dt = -1; }),
      CreateWith("a time step of nan s", [](auto& o) { o.dt = kNaN; }),
      CreateWith("a time step of inf s", [](auto& o) { o.dt = kInfinity; }),
      CreateWith("refresh_angle of nan rad", [](auto& o) { o.refresh_angle = kNaN; }),
      CreateWith("refresh_angle of -1 rad", [](auto& o) { o.refresh_angle = -1; }),
      CreateWith("rank_tolerance of 1", [](auto& o) { o.reduction.rank_tolerance = 1; }),
      CreateWith("initial_keyframe 3 of a scene with 0", [](auto& o) { o.initial_keyframe = 3; }),
      CreateWith("reserved_contacts of -1", [](auto& o) { o.reserved_contacts = -1; }),
      CreateWith("margin of nan m", [](auto& o) { o.collision.margin = kNaN; }),
  });
}

TEST(Misuse, OfStepOptionsThrows) {
  const auto with = [](const std::string& says, const std::function<void(StepOptions&)>& spoil) {
    return Misuse{"Simulation::Step", says, [=](Simulation& s) {
                    spoil(s.step_options());
                    s.Step();
                  }};
  };
  ExpectThrown({
      with("gravity", [](auto& o) { o.gravity.y() = kNaN; }),
      with("h of 0.5 s beside dt() of 0.0166667 s", [](auto& o) { o.h = 0.5; }),
      with("h of nan s", [](auto& o) { o.h = kNaN; }),
      with("h of -1 s", [](auto& o) { o.h = -1; }),
      with("newton_tolerance nan", [](auto& o) { o.newton_tolerance = kNaN; }),
      with("newton_tolerance 0", [](auto& o) { o.newton_tolerance = 0; }),
  });
}

TEST(Misuse, OfControlsThrows) {
  ExpectThrown({
      {"Simulation::SetControl", "control -1 of 8", [](auto& s) { s.SetControl(-1, 0); }},
      {"Simulation::SetControl", "control 8 of 8", [](auto& s) { s.SetControl(8, 0); }},
      {"Simulation::SetControl", "control 'left' to nan", [](auto& s) { s.SetControl(0, kNaN); }},
      {"Simulation::SetControl", "control 'right' to inf", [](auto& s) { s.SetControl("right", kInfinity); }},
      {"Simulation::SetControl", "there is no control 'middle'; there are: left, right",
       [](auto& s) { s.SetControl("middle", 0); }},
      {"Simulation::SetControls", "3 values for 8 controls",
       [](auto& s) { s.SetControls(VectorX::Zero(3)); }},
      {"Simulation::SetControls", "control 'right' to nan",
       [](auto& s) {
         VectorX values = VectorX::Constant(8, 0.001);
         values(1) = kNaN;
         s.SetControls(values);
       }},
      {"Simulation::SetBaseRate", "control 'left' is no coordinate of a driven base",
       [](auto& s) { s.SetBaseRate(0, 1); }},
      {"Simulation::SetBaseRate", "control 9 of 8", [](auto& s) { s.SetBaseRate(9, 1); }},
      {"Simulation::SetBaseRate", "rate of 'frame.x' to nan", [](auto& s) { s.SetBaseRate(2, kNaN); }},
      {"Simulation::DrivesBase", "control -1 of 8", [](auto& s) { s.DrivesBase(-1); }},
      {"ControlMove::ControlMove", "over 0 steps", [](auto& s) { ControlMove(s, 0); }},
      {"ControlTrack::Apply", "2 times and 1 rows",
       [](auto& s) {
         ControlTrack{{"left"}, {0, 1}, {{0}}}.Apply(0, s);
       }},
      {"ControlTrack::Apply", "row 1 has 2 values for 1 names",
       [](auto& s) {
         ControlTrack{{"left"}, {0, 1}, {{0}, {0, 1}}}.Apply(0, s);
       }},
      {"ControlTrack::Start", "times that do not increase",
       [](auto& s) {
         ControlTrack{{"left"}, {1, 1}, {{0}, {1}}}.Start(s);
       }},
      {"ControlTrack::Apply", "at nan s",
       [](auto& s) {
         ControlTrack{{"left"}, {0, 1}, {{0}, {1}}}.Apply(kNaN, s);
       }},
  });
  Simulation begun = Make();
  begun.Step();
  try {
    begun.StartFromControls();
    ADD_FAILURE() << "it starts after a step";
  } catch (const std::invalid_argument& e) {
    EXPECT_EQ(std::string(e.what()).rfind("Simulation::StartFromControls: after 1 steps", 0), 0u) << e.what();
  }
}

TEST(Misuse, OfBodiesThrows) {
  ExpectThrown({
      {"Simulation::Pose", "body -1 of 4", [](auto& s) { s.Pose(-1); }},
      {"Simulation::Pose", "body 4 of 4", [](auto& s) { s.Pose(4); }},
      {"Simulation::Pose", "there is no body 'thumb'", [](auto& s) { s.Pose("thumb"); }},
      {"Simulation::Velocity", "body 4 of 4", [](auto& s) { s.Velocity(4); }},
      {"Simulation::BodyOf", "of mechanism 1 of 1", [](auto& s) { s.BodyOf(1, 0); }},
      {"Simulation::BodyOfCollisionBody", "collision body 9", [](auto& s) { s.BodyOfCollisionBody(9); }},
      {"Simulation::BasePose", "mechanism 1 of 1", [](auto& s) { s.BasePose(1); }},
      {"Simulation::BaseTwist", "mechanism -1 of 1", [](auto& s) { s.BaseTwist(-1); }},
      {"Simulation::JointCoordinates", "mechanism 1 of 1", [](auto& s) { s.JointCoordinates(1); }},
      {"Simulation::place", "mechanism 1 of 1", [](auto& s) { s.place(1); }},
      {"Simulation::given_mechanism", "mechanism 1 of 1", [](auto& s) { s.given_mechanism(1); }},
      {"Simulation::ApplyWrench", "body 7 of 4", [](auto& s) { s.ApplyWrench(7, kZero, kZero, kZero); }},
      {"Simulation::ApplyWrench", "on 'left'", [](auto& s) { s.ApplyWrench(1, kNoPoint, kZero, kZero); }},
      {"Simulation::ApplyWrench", "on 'left'", [](auto& s) { s.ApplyWrench(1, kZero, kZero, kNoPoint); }},
      {"Simulation::SetPointSpring", "body -1 of 4", [](auto& s) { s.SetPointSpring(-1, {}); }},
      {"Simulation::SetPointSpring", "stiffness of -1",
       [](auto& s) { s.SetPointSpring(1, {.stiffness = -1}); }},
      {"Simulation::SetPointSpring", "damping of nan",
       [](auto& s) { s.SetPointSpring(1, {.stiffness = 1, .damping = kNaN}); }},
  });
}

// Two mechanisms made by one function have the same names: an index tells them apart.
TEST(Misuse, OfANameThatTwoHaveThrows) {
  Scene scene = testing::Gripper().Make();
  scene.mechanisms.push_back(scene.mechanisms.front());
  scene.mechanisms.back().X_WR.translation().y() += 1;
  auto simulation = Simulation::Create(scene);
  ASSERT_TRUE(simulation) << simulation.error().Text();
  const auto expect = [](const std::string& says, const std::function<void()>& call) {
    try {
      call();
      ADD_FAILURE() << says;
    } catch (const std::invalid_argument& e) {
      EXPECT_NE(std::string(e.what()).find(says), std::string::npos) << e.what();
    }
  };
  expect("Simulation::Pose: 2 bodies are named 'left'", [&] { simulation->Pose("left"); });
  expect("Simulation::SetControl: 2 controls are named 'right'", [&] { simulation->SetControl("right", 0); });
  EXPECT_NE(BodyNamed(*simulation, "left").error().message.find("2 bodies are named"), std::string::npos);
  EXPECT_NE(ControlNamed(*simulation, "left").error().message.find("2 controls are named"),
            std::string::npos);
  EXPECT_NO_THROW(simulation->Pose("ball"));
}

TEST(Misuse, OfFactorsAndRangesThrows) {
  const auto vary = [](const std::string& says, SceneFactors factors) {
    return Misuse{"Vary", says, [=](Simulation& s) { Vary(s.scene(), factors); }};
  };
  const auto draw = [](const std::string& says, DrawRange mass, DrawRange start) {
    return Misuse{"Draw", says, [=](Simulation&) {
                    Randomisation randomisation;
                    randomisation.mass = mass;
                    randomisation.start = {{"left_grip", start}};
                    Draw(randomisation, 1);
                  }};
  };
  ExpectThrown({
      vary("factor 'stiffness': is -1; give a finite factor of 0 or more", {-1, 1, 1}),
      vary("factor 'friction': is nan", {1, kNaN, 1}),
      vary("factor 'mass': is 0; give a finite factor above 0", {1, 1, 0}),
      draw("range 2 to 1", {2, 1}, {}),
      draw("range 0 to 1", {0, 1}, {}),
      draw("range nan to 1", {}, {kNaN, 1}),
      {"RayWorld::Cast", "no direction", [](auto& s) { RayCaster::Create(s)->Cast(s, kZero, kZero); }},
  });
}

}  // namespace
}  // namespace fork1s
