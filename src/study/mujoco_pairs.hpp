// Which bodies MuJoCo lets touch that the reduced simulation does not, and the other way round.
#pragma once

#include <mujoco/mujoco.h>

#include <fork1s/sim/simulation.hpp>
#include <fork1s/study/compare.hpp>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace fork1s::internal {

/// Pairs of bodies that one simulator tests for contact and the other does not. Of bodies that cannot move
/// against each other there are none; all still bodies are one, called "world".
class PairDifference {
 public:
  PairDifference(const mjModel* m, const Simulation& reduced);

  /// Remembers which of MuJoCo's own pairs press on each other at present.
  void Observe(const mjData* d);
  std::vector<ContactPair> OnlyMuJoCo() const;
  const std::vector<ContactPair>& OnlyReduced() const { return only_reduced_; }

 private:
  using Pair = std::pair<std::string, std::string>;  // sorted
  Pair PairOf(int geom_a, int geom_b) const;

  const mjModel* m_;
  std::vector<std::string> name_;     // of each of MuJoCo's bodies, as the reduced simulation calls it
  std::map<Pair, bool> only_mujoco_;  // whether it touched
  std::vector<ContactPair> only_reduced_;
};

}  // namespace fork1s::internal
