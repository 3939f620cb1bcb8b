// Where the full mechanism is in equilibrium under a load, and where a reduced model comes to rest under a
// dead force, in each mode of recovery.
#pragma once

#include <fork1s/reduction/statics.hpp>
#include <functional>
#include <lab/accuracy.hpp>

namespace fork1s::internal {

/// Equilibrium of all joints, and its largest joint rotation from the start.
struct FullEquilibrium {
  StaticsResult result;
  double angle_deg = 0;
};
FullEquilibrium SolveFull(const Mechanism& mechanism, const VectorX& q0, const std::vector<DeadLoad>& loads,
                          const StaticsOptions& options);

/// Raises or lowers `load`, a first guess above 0 in the unit that `solve` takes, until the largest joint
/// rotation of the equilibrium is `angle_deg`, within 1e-6 of it. False where no stable equilibrium on the
/// primary branch has it.
bool RaiseToAngle(const std::function<FullEquilibrium(double)>& solve, double angle_deg, double& load,
                  FullEquilibrium& out);

/// One model, one mode, one force; follows the equilibrium as the force grows.
class ReducedEquilibrium {
 public:
  /// The case must outlive it.
  static Expected<ReducedEquilibrium> Create(const StaticCase& c, StaticMode mode);

  /// Raises the force [N] from that of the last call. False if Newton finds no equilibrium: from then on it
  /// stays so.
  bool Raise(double force_N);
  /// Origin of the loaded body in R.
  Vector3 Position();
  /// Largest opening of a loop [m].
  double LoopGap();

 private:
  ReducedEquilibrium(const StaticCase& c, StaticMode mode, ReducedModel model);
  static Matrix6X Wrenches(const StaticCase& c, const Kinematics& kinematics, double force_N);
  static Expected<ReducedModel> ReduceAt(const StaticCase& c, StaticMode mode, const VectorX& q,
                                         double force_N);
  VectorX Residual(const VectorX& x, double force_N);
  VectorX ExactResidual(const VectorX& x, double force_N);
  bool Newton(VectorX& x, double force_N);
  void SetState(const VectorX& x);
  Vector3 PositionAt(const VectorX& x);
  bool RefreshWhereDue(double force_N);

  const StaticCase* case_;
  StaticMode mode_;
  std::shared_ptr<ReducedModel> model_;
  std::shared_ptr<Configuration> configuration_;
  VectorX g_ref_;  // n, spring forces at the reference
  VectorX x_;      // z
  ReducedState state_;
  double force_N_ = 0;
  bool lost_ = false;
};

}  // namespace fork1s::internal
