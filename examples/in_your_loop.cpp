// A gripper takes a cube: what it presses with, what a ray meets, a moment to come back to, stiffer joints
// while it holds, and a second cube that comes and goes.
#include <cstdio>
#include <fork1s/fork1s.hpp>
#include <string>

namespace {

int Refuse(const fork1s::Error& error) { return std::puts(error.Text().c_str()), 3; }

void Run(fork1s::Simulation& simulation, int steps) {
  for (int i = 0; i < steps; ++i)
    if (!simulation.Step().finite) std::puts("a step was undone");
}

// Newtons, by which the jaws press on the cube from both sides.
double Pressed(const fork1s::Simulation& simulation) {
  double sum = 0;
  for (const fork1s::BodyContact& c : fork1s::Contacts(simulation))
    if (c.name_a.ends_with("_jaw") || c.name_b.ends_with("_jaw")) sum += c.force_W.cwiseAbs().x();
  return sum / 2;
}

}  // namespace

int main(int argc, char** argv) {
  auto model = fork1s::LoadMechanism(argc > 1 ? argv[1] : "scenes/fourbar_gripper.xml");
  if (!model) return Refuse(model.error());
  fork1s::SimulationOptions options;
  options.dt = 1.0 / 60;
  auto simulation = fork1s::Simulation::Create(model->scene, options);
  if (!simulation) return Refuse(simulation.error());

  // Names that do not exist are errors that list those that do.
  if (auto set = fork1s::TrySetControl(*simulation, "thumb", 0.4); !set)
    std::puts(set.error().Text().c_str());
  for (const char* grip : {"left_grip", "right_grip"})
    if (auto set = fork1s::TrySetControl(*simulation, grip, 0.4); !set) return Refuse(set.error());
  Run(*simulation, 60);
  std::printf("after %.2f s the jaws press with %.2f N\n", simulation->time(), Pressed(*simulation));

  auto rays = fork1s::RayCaster::Create(*simulation);
  if (!rays) return Refuse(rays.error());
  if (const auto hit = rays->Cast(*simulation, {0, 0, 0.1}, {0, 0, -1}))
    std::printf("below the mount is '%s', %.1f mm away\n", hit->name.c_str(), 1000 * hit->distance);

  // Pull at the cube, and come back to the moment before: the same bits.
  const auto cube = fork1s::BodyNamed(*simulation, "cube");
  if (!cube) return Refuse(cube.error());
  const fork1s::Simulation::Snapshot moment = simulation->Save();
  const auto hash = simulation->HashState();
  for (int i = 0; i < 30; ++i) {
    simulation->ApplyWrench(*cube, {0, 0, 12}, fork1s::Vector3::Zero(),
                            simulation->Pose(*cube).translation());
    simulation->Step();
  }
  std::printf("pulled with 12 N the cube has its middle at %.2f mm",
              1000 * simulation->Pose(*cube).translation().z());
  if (auto back = simulation->Restore(moment); !back) return Refuse(back.error());
  std::printf(", and back it is %s\n", simulation->HashState() == hash ? "as it was" : "not as it was");

  // Stiffer cranks and a second cube: the same motion goes on in another scene.
  fork1s::Scene scene = simulation->scene();
  for (const char* crank : {"left_crank", "right_crank"}) {
    auto stiffer = fork1s::WithStiffness(std::move(scene), crank, 4);
    if (!stiffer) return Refuse(stiffer.error());
    scene = std::move(*stiffer);
  }
  fork1s::FreeBodyDef second = scene.free_bodies[0];
  second.name = "second";
  second.X_WB = fork1s::RigidTransform(fork1s::Vector3(0.2, 0, 0.1));
  scene.free_bodies.push_back(second);
  auto next = fork1s::Continue(*simulation, scene);
  if (!next) return Refuse(next.error());
  Run(*next, 60);
  std::printf("at %.2f s, stiffer, they press with %.2f N; the second cube lies at %.1f mm\n", next->time(),
              Pressed(*next), 1000 * next->Pose("second").translation().z());

  scene.free_bodies.pop_back();
  auto last = fork1s::Continue(*next, scene);
  if (!last) return Refuse(last.error());
  Run(*last, 60);
  std::printf("at %.2f s there are %zu bodies, and the jaws press with %.2f N\n", last->time(),
              last->bodies().size(), Pressed(*last));
}
