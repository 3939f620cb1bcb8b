// Two stages by reduced coordinates and by all, in code that shares nothing.
#include <draws.hpp>
#include <fork1s/sim/simulation.hpp>
#include <random_mechanism.hpp>

#include "support.hpp"

namespace fork1s::reference_test {
namespace {

// Farthest distance of any body's place between the two after `seconds`, both at steps of h.
double MethodsApart(const Scene& scene, double seconds, double h) {
  SimulationOptions options;
  options.dt = h;
  options.initial_keyframe = scene.keyframes.empty() ? -1 : 0;
  options.step.integrator = Integrator::kTwoStage;
  options.reduction.promote_hidden = true;
  options.reduction.modes = 100;  // nothing left out: the time step alone errs
  auto reduced = Simulation::Create(scene, options);
  if (!reduced) throw std::runtime_error(reduced.error().Text());
  FullSimulation full = Start(scene, h, FullIntegrator::kTwoStages);
  for (int i = 0; i * h < seconds - 1e-9; ++i) {
    EXPECT_TRUE(reduced->Step().finite);
    EXPECT_TRUE(full.Step().converged) << i;
  }
  double most = 0;
  for (std::size_t b = 0; b < full.bodies().size(); ++b)
    most = std::max(most, (full.Pose(static_cast<int>(b)).translation() -
                           reduced->Pose(full.bodies()[b].name).translation())
                              .norm());
  return most;
}

// By the same rule: what is left are the tolerances of the stages, and with loops what the rows of either
// allow, some micrometres of ways of decimetres. Where there are loops, joints start at rest, since rates
// that a loop forbids are not put right by the same rule, and have no dampers.
TEST(TwoStagesMethods, RandomMechanismsGoTheWayOfTheReducedOnes) {
  for (const BaseKind base : {BaseKind::kFixed, BaseKind::kFloating})
    for (const int loops : {0, 1})
      for (unsigned seed = 1; seed <= testing::Seeds(1, 2); ++seed) {
        SCOPED_TRACE("base " + std::to_string(static_cast<int>(base)) + ", loops " + std::to_string(loops) +
                     ", seed " + std::to_string(seed));
        testing::RandomMechanismOptions options;
        options.base = base;
        options.rigid_closures = options.springs = loops;
        MechanismDef def = testing::RandomMechanismDef(seed, options);
        if (loops > 0)
          for (JointDef& joint : def.joints)
            for (auto& freedom : joint.freedoms) freedom.damping = 0;
        def.X_WR = RigidTransform(ExpRotation(Vector3(0.4, -1.1, 0.7)), Vector3(3, -2, 5)) * def.X_WR;
        Scene scene = Of(def, Vector3(1, -2, -9));
        testing::RandomSource random(seed + 1000);
        const int n = testing::Share(def)->num_coordinates();
        const VectorX q_dot = random.Vector(n, loops > 0 ? 0 : 1);
        StartAt(scene, VectorX::Zero(n), q_dot,
                base == BaseKind::kFloating ? random.Six(1) : Vector6(Vector6::Zero()));
        const double coarse = MethodsApart(scene, 0.25, 1.0 / 480),
                     fine = MethodsApart(scene, 0.25, 1.0 / 960);
        EXPECT_LT(fine, 1e-5);
        EXPECT_LT(coarse, 4e-5);
      }
}

// Loops of which half of the joints have no spring and the others weak ones fall far under their weight, dampers and
// all: what a loop leaves free is weighed by inertia alone there, and every reference on the way turns it.
TEST(TwoStagesMethods, LooseLoopsFallTheSameWay) {
  for (unsigned seed = 1; seed < 5; ++seed) {
    SCOPED_TRACE(seed);
    testing::RandomMechanismOptions options;
    options.bodies = 5;
    options.hinges_only = true;
    options.rigid_closures = 1;
    options.unsprung = 0.5;
    options.stiffness_low = 0.02;
    options.stiffness_high = 1;
    options.armature = false;
    const MechanismDef def = testing::RandomMechanismDef(seed, options);
    Scene scene = Of(def, Vector3(1, -2, -9));
    const int n = testing::Share(def)->num_coordinates();
    StartAt(scene, VectorX::Zero(n), VectorX::Zero(n), Vector6::Zero());
    ASSERT_EQ(def.closures.size(), 1u);
    const double fine = MethodsApart(scene, 0.5, 1.0 / 960);
    EXPECT_LT(fine, 2e-3);  // m; one of them swings through something sharp, the rest come to 1e-5
  }
}

// What stands and swings, box and spring and ground: contact too meets with the square of the step.
TEST(TwoStagesMethods, WhatStandsSwingsTheSameWay) {
  MechanismBuilder builder("hopper", BaseKind::kFloating, testing::Brick(0.5, Vector3(0.1, 0.06, 0.02)));
  BodyDef mass;
  mass.name = "mass";
  mass.parent = builder.base();
  mass.X_PB = RigidTransform(Vector3(0, 0, 0.2));
  mass.inertia = testing::Ball(1, 0.05);
  const BodyIndex b = builder.AddBody(mass);
  builder.AddJoint(JointDef::Slide("leg", b, Vector3::UnitZ()).WithSpring(300, 1));
  builder.AddJoint(JointDef::Hinge("sway", b, Vector3::UnitY()).WithSpring(3));
  builder.SetInterfaces({"mass"});
  MechanismDef hopper = builder.definition();
  hopper.bodies[0].name = "foot";
  hopper.bodies[0].geometries.push_back(Touching(Box{Vector3(0.1, 0.06, 0.02)}, 0.8));
  hopper.X_WR = RigidTransform(ExpRotation(Vector3(0, 0, 0.3)), Vector3(2, -1, 0.02));
  Scene scene = Of(hopper, Vector3(0, 0, -kGravity));
  scene.world.push_back(Touching(Plane{}, 0.8));
  const double coarse = MethodsApart(scene, 0.5, 1.0 / 480), fine = MethodsApart(scene, 0.5, 1.0 / 960);
  EXPECT_LT(fine, 3e-5);  // of a swing of 6 cm
  EXPECT_GT(coarse / fine, 3);
}

}  // namespace
}  // namespace fork1s::reference_test
