#include <fork1s/dynamics/mechanism_dynamics.hpp>
#include <fork1s/sim/interface_names.hpp>

#include <algorithm>

namespace fork1s {

std::vector<std::vector<std::string>> InterfaceNames(const Simulation& simulation) {
  std::vector<std::vector<std::string>> names;
  for (const MechanismDynamics& m : simulation.world().mechanisms()) {
    names.emplace_back();
    for (BodyIndex b : m.model().interfaces) names.back().push_back(m.mechanism().body(b).name);
  }
  for (const Hold& hold : simulation.holds()) {
    auto& of_mechanism = names[static_cast<std::size_t>(hold.mechanism)];
    std::erase(of_mechanism, simulation.scene().free_bodies[static_cast<std::size_t>(hold.free_body)].name);
    for (const Hold::Contact& c : hold.contacts)
      if (std::find(of_mechanism.begin(), of_mechanism.end(), c.body) == of_mechanism.end())
        of_mechanism.push_back(c.body);
  }
  return names;
}

}  // namespace fork1s
