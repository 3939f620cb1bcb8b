// Which shapes of an MJCF touch and at what distance, in both simulators.
#include <fork1s/importer/importer.hpp>
#include <fork1s/sim/simulation.hpp>
#include <string>

#include "support.hpp"

namespace fork1s::reference_test {
namespace {

struct EndPoses {
  RigidTransform reduced, full;
};

// Pose of a body after `seconds`, by steps of 1/240 s.
EndPoses PosesAfter(const std::string& mjcf, const std::string& body, double seconds) {
  auto imported = LoadMechanismFromString(mjcf, "test.xml");
  if (!imported) throw std::runtime_error(imported.error().Text());
  constexpr double kStep = 1.0 / 240;
  SimulationOptions options;
  options.dt = kStep;
  options.initial_keyframe = imported->initial_keyframe;
  auto reduced = Simulation::Create(imported->scene, options);
  FullSimulationOptions full_options;
  full_options.dt = kStep;
  full_options.initial_keyframe = imported->initial_keyframe;
  auto full = FullSimulation::Create(imported->scene, full_options);
  if (!reduced) throw std::runtime_error(reduced.error().Text());
  if (!full) throw std::runtime_error(full.error().Text());
  for (double t = 0; t < seconds; t += kStep) {
    reduced->Step();
    full->Step();
  }
  EndPoses ends{reduced->Pose(body), {}};
  for (std::size_t b = 0; b < full->bodies().size(); ++b)
    if (full->bodies()[b].name == body) ends.full = full->Pose(static_cast<int>(b));
  return ends;
}

TEST(ContactFilters, ExplicitPairsTouchWhateverFiltersSay) {
  const EndPoses ends =
      PosesAfter(R"(<mujoco><default><geom contype="0" conaffinity="0"/></default><worldbody>
    <geom name="floor" type="plane" size="1 1 .1"/>
    <body name="trunk" pos="0 0 .13"><freejoint/><geom type="box" size=".1 .1 .05" mass="1"/>
      <body name="foot" pos="0 0 -.1"><joint axis="0 1 0" stiffness="50" damping="1"/>
        <geom name="sole" type="box" size=".1 .1 .02" mass=".2"/></body></body></worldbody>
    <contact><pair geom1="floor" geom2="sole"/><exclude body1="foot" body2="world"/></contact></mujoco>)",
                 "foot", 0.5);
  EXPECT_NEAR(ends.reduced.translation().z(), 0.02, 1e-4);
  EXPECT_NEAR(ends.full.translation().z(), 0.02, 1e-4);
}

// A lever of 0.5 m falls on a shelf of its fixed base, whose top is 0.28 m below the pivot.
TEST(ContactFilters, ChildrenTouchAStaticParent) {
  const EndPoses ends = PosesAfter(R"(<mujoco><worldbody><body name="base">
    <geom type="box" size=".3 .1 .02" pos=".3 0 -.3"/>
    <body name="lever"><joint axis="0 1 0" damping=".2"/>
      <geom type="capsule" fromto="0 0 0 .5 0 0" size=".02" mass="1"/></body></body></worldbody></mujoco>)",
                                   "lever", 3);
  // The axis of the lever is 20 mm above the shelf at its end.
  for (const RigidTransform& X : {ends.reduced, ends.full})
    EXPECT_NEAR((X * Vector3(0.5, 0, 0)).z(), -0.26, 1e-3);
}

TEST(ContactFilters, MarginsLiftWhatRests) {
  const EndPoses ends = PosesAfter(R"(<mujoco><worldbody><geom type="plane" size="0 0 1" margin=".01"/>
    <body name="ball" pos="0 0 .1"><freejoint/><geom type="sphere" size=".05" mass="1" margin=".02"/></body>
    </worldbody></mujoco>)",
                                   "ball", 1);
  EXPECT_NEAR(ends.reduced.translation().z(), 0.08, 1e-4);
  EXPECT_NEAR(ends.full.translation().z(), 0.08, 1e-4);
}

}  // namespace
}  // namespace fork1s::reference_test
