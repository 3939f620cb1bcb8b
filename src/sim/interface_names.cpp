#include <fork1s/sim/interface_names.hpp>

namespace fork1s {

std::vector<std::vector<std::string>> InterfaceNames(const Simulation& simulation) {
  std::vector<std::vector<std::string>> names;
  for (const MechanismDynamics& m : simulation.world().mechanisms()) {
    names.emplace_back();
    for (BodyIndex b : m.model().interfaces) names.back().push_back(m.mechanism().body(b).name);
  }
  return names;
}

}  // namespace fork1s
