// Sentences about runs that mean little.
#include <gtest/gtest.h>
#include <fork1s/sim/sanity_monitor.hpp>
#include <mechanisms.hpp>

namespace fork1s {
namespace {

GeometryDef Cube(const std::string& name, double half, const Vector3& place = Vector3::Zero()) {
  GeometryDef g;
  g.name = name;
  g.shape = Box{Vector3(half, half, half)};
  g.X_BG = RigidTransform(place);
  g.friction = 0;
  return g;
}

FreeBodyDef FreeCube(const std::string& name, const Vector3& place) {
  FreeBodyDef body;
  body.name = name;
  body.X_WB = RigidTransform(place);
  body.inertia = testing::Ball(1, 0.05);
  body.geometries.push_back(Cube(name, 0.05));
  return body;
}

// `residual`: m, of steps that are said not to have converged, by their contacts where it is 0.
std::string Watched(const Scene& scene, int steps, bool converged = true, double residual = 0) {
  auto simulation = Simulation::Create(scene, {});
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  SanityMonitor watch(*simulation);
  for (int i = 0; i < steps; ++i) {
    simulation->Step();
    SanityMonitor::Seen seen;
    seen.energy = simulation->Energy();
    seen.kinetic = simulation->KineticEnergy();
    seen.converged = converged;
    seen.residual = residual;
    watch.Update(*simulation, seen);
  }
  std::string all;
  for (const std::string& sentence : watch.Sentences()) all += sentence + "\n";
  return all;
}

// Cubes on joints of a fixed base, at these places along y.
Scene Cubes(const std::vector<std::pair<double, JointDef>>& cubes) {
  Scene scene;
  MechanismDef m;
  m.name = "hand";
  BodyDef palm;
  palm.name = "palm";
  m.bodies.push_back(palm);
  for (const auto& [y, joint] : cubes) {
    BodyDef body;
    body.name = joint.name;
    body.parent = BodyIndex(0);
    body.X_PB = RigidTransform(Vector3(0, y, 0));
    body.inertia = testing::Ball(0.1, 0.05);
    body.geometries.push_back(Cube(joint.name, 0.05));
    m.bodies.push_back(body);
    m.joints.push_back(joint);
    m.interfaces.push_back(joint.name);
  }
  scene.mechanisms.push_back(m);
  return scene;
}

// Nothing moves it along the normal.
TEST(Plausible, NamesWhatIsWedged) {
  Scene scene = Cubes({{0, JointDef::Hinge("flap", BodyIndex(1), Vector3::UnitY())}});
  scene.world.push_back(Cube("wall", 0.05, Vector3(0, 0.09, 0)));
  const std::string sentences = Watched(scene, 3);
  EXPECT_NE(sentences.find("the world (shape 'wall') and 'flap' are wedged"), std::string::npos) << sentences;
}

// No mass and no load put it there: the remedy is another start.
TEST(Plausible, WhatStartsInAnotherIsToldToStartApart) {
  Scene scene = Cubes({{0, JointDef::Hinge("flap", BodyIndex(1), Vector3::UnitY())}});
  scene.world.push_back(Cube("wall", 0.05, Vector3(0, 0.09, 0)));
  const std::string sentences = Watched(scene, 12);
  EXPECT_EQ(sentences.find("bring their masses"), std::string::npos) << sentences;
  const auto sunk = sentences.find("'flap' is 10 mm into the world (shape 'wall')");
  ASSERT_NE(sunk, std::string::npos) << sentences;
  EXPECT_NE(
      sentences.find("they overlap by 10 mm at the start; place them apart at the start, or exclude the pair",
                     sunk),
      std::string::npos)
      << sentences;
}

// A spring that could part them and does not: 1e7 N on 0.1 kg.
TEST(Plausible, NamesWhatBearsAMillionTimesItsWeight) {
  Scene scene = Cubes({{0, JointDef::Slide("press", BodyIndex(1), Vector3::UnitY()).WithSpring(1e9, 1e6)}});
  scene.world.push_back(Cube("wall", 0.05, Vector3(0, 0.09, 0)));
  const std::string sentences = Watched(scene, 10);
  EXPECT_NE(sentences.find("the contact of the world (shape 'wall') and 'press' bears"), std::string::npos)
      << sentences;
}

TEST(Plausible, NamesWhatOverlapsWhereThatGivesEnergy) {
  const auto finger = [](const char* name, int body) {
    return JointDef::Slide(name, BodyIndex(body), Vector3::UnitY()).WithSpring(1000, 60);
  };
  const std::string sentences =
      Watched(Cubes({{-0.0495, finger("left", 1)}, {0.0495, finger("right", 2)}}), 10);
  EXPECT_NE(sentences.find("'left' and 'right' overlap by 1 mm at the start"), std::string::npos)
      << sentences;
  EXPECT_EQ(sentences.find("no input did work"), std::string::npos) << sentences;
}

TEST(Plausible, NamesThePairOfAStepThatDidNotConverge) {
  Scene scene;
  scene.free_bodies.push_back(FreeCube("block", Vector3(0, 0, 0.1)));
  scene.world.push_back(Cube("table", 0.05));
  const std::string sentences = Watched(scene, 3, false);
  EXPECT_NE(sentences.find("did not converge, with"), std::string::npos) << sentences;
  EXPECT_NE(sentences.find("the world (shape 'table') and 'block'"), std::string::npos) << sentences;
  EXPECT_NE(Watched(scene, 3, false, 2.5e-4).find("did not converge to better than 0.25 mm, with"),
            std::string::npos);
  // 1e-5 of the radius of the block, 87 mm, is 8.7e-7 m.
  EXPECT_NE(Watched(scene, 3, false, 8.6e-7)
                .find("did not converge to better than 0.00086 mm: poses are off by no more"),
            std::string::npos);
  EXPECT_NE(Watched(scene, 3, false, 8.8e-7).find("0.00088 mm, with"), std::string::npos);
  EXPECT_EQ(Watched(scene, 3), "");
}

}  // namespace
}  // namespace fork1s
