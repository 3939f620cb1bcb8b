// What a simulation may do by its equations and no machine does: said, since a table of it looks like any
// other.
#pragma once

#include <fork1s/sim/simulation.hpp>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace fork1s {

/// Watches a run for steps that mean little: too fast or spinning too fast for the time step, deep in each
/// other, sunk into what they rest on, with joints apart, with contact forces of wedged bodies, not converged,
/// or with energy out of nowhere. Of each kind the worst moment is kept.
class PlausibleWatch {
 public:
  explicit PlausibleWatch(const Simulation& simulation);

  /// What the caller of Look has at hand.
  struct Seen {
    double energy = 0;    // J, after the step
    double kinetic = 0;   // J, of that
    double gap = 0;       // m, Simulation::JointGap()
    bool pushed = false;  // a force from outside acted in the step
    bool converged = true;
  };
  /// After every step.
  void Look(const Simulation& simulation, const Seen& seen);
  /// Another level of detail: other bodies touch, and energy is another.
  void Changed(const Simulation& simulation);
  /// A sentence for each kind that was beyond the plausible.
  std::vector<std::string> Sentences() const;

 private:
  struct Worst {
    double times = 0;  // of what would be plausible
    std::string sentence;
  };
  enum Kind { kFast, kSpins, kDeep, kSunk, kApart, kForce, kUnconverged, kEnergy, kKinds };
  using Bodies = std::pair<int, int>;  // places in Simulation::bodies(), -1: the still world
  struct PairContact {
    double force = 0;  // N
    double gap = 0;    // m, of the deepest point
  };
  template <class Sentence>
  void Note(Kind kind, double times, const Sentence& sentence);
  void LookAtSpeeds(const Simulation& simulation);
  void LookAtDepths(const Simulation& simulation);
  void LookAtPairs(const Simulation& simulation);
  void LookAtForces(const Simulation& simulation, bool converged);
  /// The pair that overlapped at the start and whose contact forces, over the depth then, can do most work:
  /// Bodies() where all of them do less than `rise` [J].
  Bodies PushedApart(double rise) const;
  void LookAtSinking(const Simulation& simulation);
  void LookAtEnergy(const Simulation& simulation, const Seen& seen);
  bool IsDriven(const Simulation& simulation, const Seen& seen);

  std::vector<double> radii_;  // m, of contactors; infinite for the still world
  std::vector<bool> is_setpoint_;
  std::map<std::pair<int, int>, double> sunk_since_;  // s, of contactors
  double size_ = 0;  // m, of the smallest mechanism
  std::map<Bodies, PairContact> pairs_;  // after the last step
  std::map<Bodies, double>
      overlaps_;            // m, depth of pairs that overlapped at the start and have not parted since
  bool has_pairs_ = false;  // of the start
  double weight_ = 0;       // N, of all that moves; without gravity on earth
  Worst worst_[kKinds];
  VectorX controls_;
  bool driven_before_ = true;  // in the step before
  double energy_ = 0, kinetic_ = 0;
};

}  // namespace fork1s
