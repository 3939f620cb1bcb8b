// The spring between a viewer's pointer and a body, at the suggested stiffness and above it.
#include <gtest/gtest.h>

#include <fork1s/mechanism/builder.hpp>
#include <fork1s/server/pull_spring.hpp>
#include <fork1s/sim/simulation.hpp>

namespace fork1s {
namespace {

// Two links, hinged about y, that hang on soft springs.
Scene SoftArm(double stiffness) {
  MechanismBuilder builder("arm");
  BodyIndex parent = builder.base();
  for (const double length : {0.3, 0.25}) {
    BodyDef link;
    link.name = length == 0.3 ? "upper" : "lower";
    link.parent = parent;
    link.X_PB = RigidTransform(Vector3(length == 0.3 ? 0 : 0.3, 0, 0));
    link.inertia.mass = length == 0.3 ? 0.5 : 0.1;
    link.inertia.center = Vector3(length / 2, 0, 0);
    const double i = link.inertia.mass * length * length / 12;
    link.inertia.rotational = Vector3(0.01 * i, i, i).asDiagonal();
    GeometryDef shape;
    shape.name = link.name;
    shape.shape = Sphere{0.02};
    shape.X_BG = RigidTransform(Vector3(length, 0, 0));
    link.geometries.push_back(shape);
    const double k = length == 0.3 ? stiffness : stiffness / 3;
    parent = builder.AddBody(link);
    builder.AddJoint(JointDef::Hinge("joint_" + link.name, parent, Vector3::UnitY()).WithSpring(k, 0.017 * k));
  }
  builder.SetInterfaces({"lower"});
  Scene scene;
  scene.mechanisms.push_back(builder.definition());
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
