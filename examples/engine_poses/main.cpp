// A simulation whose bodies are posed on the graphics processor: only base poses and z go there in a frame.
//
//     engine_poses [MODEL] [SHADERS]
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fork1s/importer/importer.hpp>
#include <fork1s/record/recovery_buffers.hpp>

#include "pose_shaders.hpp"

int main(int argc, char** argv) {
  auto model = fork1s::LoadMechanism(argc > 1 ? argv[1] : "scenes/hand.xml");
  if (!model) return std::puts(model.error().Text().c_str()), 3;
  auto simulation = fork1s::Simulation::Create(model->scene);
  if (!simulation) return std::puts(simulation.error().Text().c_str()), 3;
  try {
    const engine_poses::Context context;
    engine_poses::PoseShaders shaders(argc > 2 ? argv[2] : "shaders");
    std::printf("on %s\n", context.Renderer().c_str());

    fork1s::RecoveryBuffers buffers(*simulation);
    shaders.SetModel(buffers.tables(), buffers.numbers());
    std::vector<float> frame;
    int uploads = 1;
    for (int i = 0; i < 120; ++i) {
      simulation->Step();
      if (!buffers.IsOf(*simulation)) {  // bent far: the reference has moved to the present pose
        buffers = fork1s::RecoveryBuffers(*simulation);
        shaders.SetModel(buffers.tables(), buffers.numbers());
        ++uploads;
      }
      buffers.WriteFrame(*simulation, frame);
      shaders.SetFrame(frame);
      shaders.RunExact(0);  // and draw with shaders.poses()
    }

    const engine_poses::Poses poses = shaders.Read();
    double off = 0;
    for (int b = 0; b < buffers.bodies(); ++b)
      for (int k = 0; k < 3; ++k)
        off = std::max(off, std::abs(static_cast<double>(poses[static_cast<std::size_t>(8 * b + 4 + k)]) -
                                     simulation->Pose(b).translation()(k)));
    std::printf("%d bodies from %zu numbers a frame, model uploaded %d times, off by at most %.1e m\n",
                buffers.bodies(), frame.size(), uploads, off);
  } catch (const engine_poses::GraphicsError& error) {
    return std::puts(error.what()), 3;
  }
}
