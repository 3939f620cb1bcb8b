// Warnings about motion that the equations allow and no machine performs.
#pragma once

#include <fork1s/sim/simulation.hpp>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace fork1s {

/// Monitors a run for implausible steps: speed or spin too high for the time step, deep penetration, sinking into
/// a support, open joints, contact forces of wedged bodies, no convergence, energy from no source. Stores the worst
/// moment of each kind.
class SanityMonitor {
 public:
  explicit SanityMonitor(const Simulation& simulation);

  /// Arguments of Update that the caller has computed already.
  struct Seen {
    double energy = 0;    // J, after the step
    double kinetic = 0;   // J, of that
    double gap = 0;       // m, Simulation::JointGap()
    bool pushed = false;  // a force from outside acted in the step
    bool converged = true;
    double residual = 0;  // m: StepReport::stage_residual of a step whose stages did not
  };
  /// After every step.
  void Update(const Simulation& simulation, const Seen& seen);
  /// After a change of detail, which changes the bodies that may touch and the energy.
  void Changed(const Simulation& simulation);
  /// A sentence for each kind that was implausible.
  std::vector<std::string> Sentences() const;

 private:
  struct Worst {
    double times = 0;  // value over the largest plausible one
    std::string sentence;
  };
  enum Kind { kFast, kSpins, kDeep, kSunk, kApart, kForce, kUnconverged, kContactsUnsolved, kEnergy, kKinds };
  using BodyPair = std::pair<int, int>;
  /// Of two collision bodies after the last step.
  struct PairContact {
    Vector3 force_W = Vector3::Zero();  // N, on the second
    double depth = 0;                   // m, of the deepest point
    double overlap = 0;                 // m, of the start, where they have not parted since
    std::optional<double> sunk_since;   // s
    bool gives_way = false;
    int still_shape = -1;     // among those of the still world, at the deepest point; -1: of two others
    bool was_wedged = false;  // gave way in this step or before, and has not parted since
  };
  template <class Sentence>
  void Note(Kind kind, double times, const Sentence& sentence);
  void CheckSpeeds(const Simulation& simulation);
  void CheckDepths(const Simulation& simulation);
  void CheckSinking(const Simulation& simulation);
  void CheckForces(const Simulation& simulation, const Seen& seen);
  void UpdatePairs(const Simulation& simulation);
  double DiameterOf(const BodyPair& pair) const;
  /// The pair that overlapped at the start and whose contact forces, over the depth then, can do most work;
  /// none where all of them do less than `rise` [J].
  std::optional<BodyPair> PushedApart(double rise) const;
  void CheckEnergy(const Simulation& simulation, const Seen& seen);
  bool IsDriven(const Simulation& simulation, const Seen& seen);

  std::vector<double> radii_;  // m, of collision bodies; infinite for the still world
  std::vector<bool> is_setpoint_;
  double size_ = 0;  // m, of the smallest mechanism
  std::map<BodyPair, PairContact> pairs_;
  bool starts_ = true;  // the next step is the first
  double weight_ = 0;   // N, of all that moves; without gravity on earth
  Worst worst_[kKinds];
  VectorX controls_;           // activations of mechanisms and what drives bases, then all controls
  bool driven_before_ = true;  // in the step before
  std::vector<std::vector<double>> beyond_stops_;  // rad or m: of the stops of each mechanism, a step ago
  double energy_ = 0, kinetic_ = 0;
};

}  // namespace fork1s
