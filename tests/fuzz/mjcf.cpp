// Model files as MuJoCo has them, as text: read, reduced and stepped, or refused.
#include <fork1s/importer/importer.hpp>

#include "fuzz.hpp"
#include "xml_mutator.hpp"

FORK1S_FUZZ_TARGET(mjcf, 500) {
  const auto model = fork1s::LoadMechanismFromString(std::string(fork1s::fuzz::Text(input)), "fuzz.xml");
  if (!model) return fork1s::fuzz::DemandNamed(model.error());
  fork1s::SimulationOptions options;
  options.initial_keyframe = model->initial_keyframe;
  fork1s::fuzz::Run(model->scene, options, 3);
}
