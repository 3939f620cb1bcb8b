// The spring between a viewer's pointer and a body, at the suggested stiffness and above it.
#include <gtest/gtest.h>

#include <fork1s/sim/simulation.hpp>
#include <mechanisms.hpp>

#include "server/pull_spring.hpp"

namespace fork1s {
namespace {

// Two links, hinged about y, that hang on soft springs.
Scene SoftArm(double stiffness) {
  Scene scene;
  scene.mechanisms.push_back(testing::TwoLinkArm(BaseKind::kFixed, {stiffness, 0.017 * stiffness},
                                                 {stiffness / 3, 0.017 * stiffness / 3}));
  std::vector<BodyDef>& bodies = scene.mechanisms[0].bodies;
  for (const auto& [body, tip] : {std::pair(1, 0.3), std::pair(2, 0.25)}) {
    GeometryDef shape;
    shape.name = bodies[static_cast<std::size_t>(body)].name;
    shape.shape = Sphere{0.02};
    shape.X_BG = RigidTransform(Vector3(tip, 0, 0));
    bodies[static_cast<std::size_t>(body)].geometries.push_back(shape);
  }
  return scene;
}

TEST(Pull, ComesToRestByTwoStages) {
  for (const double stiffness : {3.0, 30.0})
    for (const double harder : {1.0, 25.0})
      for (const double dt : {1.0 / 60, 1.0 / 240}) {
        SCOPED_TRACE(::testing::Message() << stiffness << " N m/rad, pull " << harder << ", dt " << dt);
        SimulationOptions options;
        options.dt = dt;
        options.step.integrator = Integrator::kTwoStage;
        auto made = Simulation::Create(SoftArm(stiffness), options);
        ASSERT_TRUE(made.has_value()) << made.error().Text();
        Simulation& simulation = *made;
        const double k = harder * SuggestPullStiffness(simulation);
        int body = 0;
        while (simulation.bodies()[static_cast<std::size_t>(body)].name != "lower") ++body;
        const Vector3 tip_B(0.25, 0, 0), target(0.1, 0.0, 0.35);
        Vector3 reached = simulation.Pose(body) * tip_B;  // the pointer leaves the tip within the first step
        double kinetic = 0;
        for (int i = 0; i < static_cast<int>(4 / dt); ++i) {
          simulation.SetPointSpring(body, PullSpring(simulation, body, tip_B, reached, target, k));
          ASSERT_TRUE(simulation.Step().finite) << i;
          reached = target;
          kinetic = std::max(kinetic, simulation.KineticEnergy());
        }
        // A spring of that stiffness holds k/2 0.6² at the start.
        EXPECT_LT(kinetic, 0.5 * k * 0.36 + 2);
        EXPECT_LT(simulation.KineticEnergy(), 1e-3 * kinetic + 1e-6);
      }
}

}  // namespace
}  // namespace fork1s
