// Model files as ROS has them, as text: the same as mjcf.cpp, on a floating base with gains for what nothing
// holds.
#include <fork1s/importer/importer.hpp>

#include "fuzz.hpp"
#include "xml_mutator.hpp"

FORK1S_FUZZ_TARGET(urdf, 500) {
  fork1s::ImportOptions options;
  options.base = fork1s::BaseKind::kFloating;
  options.pd = fork1s::PdGains{100, 2};
  options.ground = true;
  const auto model =
      fork1s::LoadMechanismFromString(std::string(fork1s::fuzz::Text(input)), "fuzz.urdf", options);
  if (!model) return fork1s::fuzz::DemandNamed(model.error());
  fork1s::SimulationOptions run;
  run.initial_keyframe = model->initial_keyframe;
  fork1s::fuzz::Run(model->scene, run, 3);
}
