#include <cstdio>
#include <fork1s/fork1s.hpp>

int main(int argc, char** argv) {
  auto model = fork1s::LoadMechanism(argc > 1 ? argv[1] : "scenes/hand.xml");
  if (!model) return std::puts(model.error().Text().c_str()), 3;
  auto simulation = fork1s::Simulation::Create(model->scene);
  if (!simulation) return std::puts(simulation.error().Text().c_str()), 3;
  for (int i = 0; i < 120; ++i) simulation->Step();  // two seconds, 60 steps each
  for (const fork1s::SceneBody& body : simulation->bodies())
    if (body.is_interface) {
      const fork1s::Vector3 p = simulation->Pose(body.name).translation();
      std::printf("%s stands at %.4f %.4f %.4f m\n", body.name.c_str(), p.x(), p.y(), p.z());
    }
}
