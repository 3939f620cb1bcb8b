#include <fork1s/stepping/mechanism_dynamics.hpp>

#include <algorithm>

#include "sim/interface_names.hpp"

namespace fork1s {

std::vector<std::vector<std::string>> InterfaceNames(const Simulation& simulation) {
  std::vector<std::vector<std::string>> names;
  for (std::size_t i = 0; i < simulation.scene().mechanisms.size(); ++i) {
    const auto number = static_cast<int>(i);
    const MechanismPlace& at = simulation.place(number);
    const Mechanism& given = simulation.given_mechanism(number);
    names.emplace_back();
    for (const BodyIndex b :
         simulation.world().mechanisms()[static_cast<std::size_t>(at.mechanism)].model().interfaces) {
      const int own = b.value() - at.first_body;
      // A base that joined is an interface there, so that it may touch; of itself it needs no name.
      if (own >= (at.first_body == 0 ? 0 : 1) && own < given.num_bodies())
        names.back().push_back(given.body(BodyIndex(own)).name);
    }
  }
  for (const FrozenGrasp& hold : simulation.frozen_grasps())
    for (const FrozenGrasp::Contact& c : hold.contacts) {
      auto& of_mechanism = names[static_cast<std::size_t>(c.mechanism)];
      if (std::find(of_mechanism.begin(), of_mechanism.end(), c.body) == of_mechanism.end())
        of_mechanism.push_back(c.body);
    }
  return names;
}

}  // namespace fork1s
