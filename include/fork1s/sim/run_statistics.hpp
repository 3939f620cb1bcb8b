// Statistics of a run, updated step by step: loads between bodies, slip, stops and servos at their limits.
#pragma once

#include <array>
#include <cstdint>
#include <fork1s/sim/simulation.hpp>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace fork1s {

/// Load of one body on another through all their contacts.
struct ContactLoad {
  Vector3 force_W = Vector3::Zero();   // N on b
  Vector3 moment_W = Vector3::Zero();  // N·m on b about its origin
  // Sums of magnitudes over the contacts and the stages of the step, each in the frame that the contact has
  // there [N].
  double normal = 0;
  double tangential = 0;      // of contacts with friction
  double friction_limit = 0;  // N, sum of µ f_n

  /// |f_t| / (µ f_n), the mean of the contacts weighted by µ f_n; 1: all of them slide. 0 without friction.
  double FrictionUse() const { return friction_limit > 0 ? tangential / friction_limit : 0; }
  /// Of one contact with a force on b along and across its normal, without a moment; `friction`: its coefficient.
  static ContactLoad OfContact(const Vector3& force_W, const Vector3& normal_W, double friction);
  ContactLoad& Add(const ContactLoad& other, double weight);
};

/// Statistics of all contacts between two bodies, frozen ones included.
struct PairLoad {
  int body_a = -1, body_b = -1;                // places in Simulation::bodies(), a < b; -1: the still world
  ContactLoad last;                            // in the last step
  ContactLoad peak;                            // in the step of the largest force
  ContactLoad mean;                            // over the steps with contact force
  double peak_s = 0;                           // s
  double touched_s = 0;                        // s with contact force
  double touched_first = 0, touched_last = 0;  // s: ends of the first and the last step with contact force
  double use_max = 0, use_max_s = 0;           // largest FrictionUse of a step, and when
  double normal_max = 0, normal_max_s = 0;     // N, the largest `normal` of a step, and when
  double tangential_max = 0, tangential_max_s = 0;  // N, the largest `tangential` of a step, and when
  double slip = 0;           // m: path of the fastest sliding contact, while friction was at its bound
  double slip_s = 0;         // s in which one slid
  double slip_first = -1;    // s; -1: never
  double slip_last = -1;     // s; -1: never
  double friction_loss = 0;  // J dissipated by sliding, torsional and rolling friction
  // m: paths of the sliding points of a and of b in the world. If a body stays and the other slides over it, one of
  // them is small compared with the other.
  double way_a = 0, way_b = 0;
};

/// Use of friction of a free body or of a floating base, over all contacts with friction that it has.
struct BodyFriction {
  int body = -1;                      // place in Simulation::bodies()
  double use_mean = 0;                // over the steps with a normal force
  double use_max = 0, use_max_s = 0;  // sum of |f_t| over sum of µ f_n, largest of all steps
  double touched_s = 0;               // s with a normal force
  struct Moment {
    double time = 0, use = 0;  // s
  };
  /// Over time, wherever it has a normal force; of a long run the larger of neighbours, 500 moments at most.
  std::vector<Moment> course;
};

/// A stop that bore load or a servo at its force limit.
struct EndReached {
  std::string name;  // "joint 'elbow'", "actuator 'grip'"
  std::int64_t steps = 0;
  double first = 0, last = 0;  // s
  bool upper = false, lower = false;
};

/// A joint or tendon that was beyond its stop by more than kShareBeyond of its range, and more than it started.
struct StopPassed {
  static constexpr double kShareBeyond =
      0.01;  // of the range; of a radian or the mechanism's length with one stop

  std::string name;    // "joint 'elbow'"
  bool turns = false;  // whether `beyond` is in rad, else m
  double beyond = 0;   // the most
  double when = 0;     // s, of the most
  double first = 0;    // s, beyond it for the first time
  bool upper = false;  // the stop of the most
};

/// Relinearizations of a run for one cause.
struct RelinearizationTotal {
  int count = 0;
  LinearizationDrift largest;  // by its share
  std::string of;              // "joint 'elbow' of 'arm'", of the largest; empty: none
};
using RelinearizationTotals = std::array<RelinearizationTotal, std::size(kDriftCauseNames)>;  // by DriftCause
void AddRelinearizations(const StepReport& report, const World& world, RelinearizationTotals& totals);

class RunStatistics {
 public:
  /// Stores the velocities before the first step, which its friction work needs; also after a change of fidelity.
  void Begin(const Simulation& simulation);
  /// After every step.
  void Update(const Simulation& simulation);
  /// Strongest first.
  std::vector<PairLoad> Pairs() const;
  /// Largest use first.
  std::vector<BodyFriction> BodyFrictions() const;
  /// Energy dissipated by contact friction so far, of all pairs [J].
  double FrictionLoss() const;
  /// Joints and tendons at a stop, longest first.
  std::vector<EndReached> Stops() const;
  /// Farthest beyond first, in shares of their range.
  std::vector<StopPassed> PassedStops() const;
  /// Servos and motors at the limit of their force, longest first.
  std::vector<EndReached> Servos() const;

 private:
  PairLoad& Pair(int a, int b);
  void UpdateContacts(const Simulation& simulation);
  void UpdateFrozenContacts(const Simulation& simulation);
  void UpdateBodyFriction(const Simulation& simulation);
  void UpdatePassedStops(const Simulation& simulation);
  std::map<std::pair<int, int>, PairLoad> pairs_;
  struct BodyCourse {
    BodyFriction friction;
    std::int64_t stride = 1, in_last = 0;  // steps that a moment of the course stands for
  };
  std::map<int, BodyCourse> bodies_;
  std::vector<Vector6> velocity_, last_velocity_;  // of all bodies that may touch: after this step, before it
  std::map<std::pair<int, std::size_t>, EndReached> stops_, servos_;  // by mechanism and place there
  std::map<std::pair<int, std::size_t>, std::pair<double, StopPassed>> passed_;  // share of the range, what
  std::map<std::pair<int, std::size_t>, double> outside_at_start_;  // shares, until they come inside
};

}  // namespace fork1s
