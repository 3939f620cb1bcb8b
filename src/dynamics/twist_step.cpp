// The implicit step by twists: everything is that of the reference, and z moves as a linear system does.
//
//     A x⁺ = M x + h f + Jᵀλ,   A = M + h D + h² K,   z⁺ = z + h w⁺
// A floating base carries its momentum along by the midpoint rule, and a driven one pushes by its inertia.
#include <fork1s/dynamics/mechanism_dynamics.hpp>

#include <cmath>
#include <fork1s/linalg/cholesky.hpp>

namespace fork1s {
namespace {

// Base momentum p [6] in R is carried along by the midpoint rule, Ad(Exp(h (V + V⁺)/2))ᵀ p. V⁺ = solve(that)
// enters it and is found by a short iteration from V.
template <typename Solve>
void TransportMomentum(double h, const Vector6& p, const Vector6& V, const Solve& solve) {
  Vector6 V_next = V;
  // Every round gains about h |V|: two or three digits at walking speed, less in a fast spin.
  constexpr int kRounds = 24;
  for (int i = 0; i < kRounds; ++i) {
    const Vector6 next = solve(AdjointTransposeApply(Exp(0.5 * h * (V + V_next)), p));
    const double change = (next - V_next).cwiseAbs().maxCoeff();
    V_next = next;
    if (change < 1e-12 * (1 + V_next.cwiseAbs().maxCoeff())) break;
  }
}

}  // namespace

// A of the reference, once for all steps of a length between refreshes, but for servos at their bounds.
void MechanismDynamics::Factor(double h) {
  factored_h_ = h;
  if (num_velocities() == 0)
    return;  // a driven body without joints: Eigen's products may not be asked for nothing
  A_ = M_full_;
  A_.bottomRightCorner(model().size(), model().size()) += h * model().D;
  A_.diagonal().tail(model().size()) += h * h * model().K_r;
  TakeBoundedSpringsOut(h);
  factor_.Compute(A_);
}

void MechanismDynamics::PredictTwist(double h, const Vector3& gravity_W) {
  V_R_before_ = state_.reduced.V_R;
  gravity_W_ = gravity_W;
  Vector6 A_R = Vector6::Zero();
  V_free_ = state_.reduced.V_R;
  if (mechanism().base() == BaseKind::kDriven) {
    // Twist that takes the base to its next pose; its change pushes the interior by inertia.
    V_free_ = DrivenTwist(h);
    A_R = (V_free_ - state_.reduced.V_R) / h;
  }
  if (base_size_ > 0) {
    // The step is taken in a frame that keeps up with the centre of mass. Left in, its velocity v enters as
    // forces m ω × v on bodies and base that cancel only at the end of an implicit step, and feed rotation
    // once h v nears the size of the mechanism.
    momentum_.noalias() = M_full_ * x_;
    drift_R_ = momentum_.segment<3>(3) / M_00_(5, 5);
    state_.reduced.V_R.tail<3>() -= drift_R_;
    V_free_ = state_.reduced.V_R;
  }
  LoadForcesTwist(state_.reduced.X_WR.rotation().transpose() * gravity_W, A_R);
  if (base_size_ > 0) momentum_.noalias() -= M_full_.middleCols<3>(3) * drift_R_;
  if (HasSwitches()) OpenSwitches();
  SolveFree(h);
  ForgetInputs();
}

void MechanismDynamics::SolveFreeTwist(double h) {
  impulse_.setZero(num_velocities());
  if (h != factored_h_) Factor(h);
  if (HasSwitches()) AddSwitchedForces();
  const int r = model().size();
  if (base_size_ == 0) {
    state_.reduced.V_R = V_free_;
    if (r > 0) {  // Eigen's products may not be asked for nothing
      x_.noalias() = M_full_ * state_.reduced.w;
      x_ += h * f_z_;
      factor_.SolveInPlace(x_);
    }
    return;
  }
  TransportMomentum(h, momentum_.head<6>(), V_free_, [&](const Vector6& moved) {
    x_.head<6>() = moved + h * base_force_;
    x_.tail(r) = momentum_.tail(r) + h * f_z_;
    factor_.SolveInPlace(x_);
    return Vector6(x_.head<6>());
  });
  x_.segment<3>(3) += drift_R_;
  state_.reduced.V_R = V_R_before_;
}

void MechanismDynamics::IntegrateTwist(double h) {
  state_.past.h = 0;
  state_.reduced.w = x_.tail(model().size());
  state_.reduced.z += h * state_.reduced.w;
  if (mechanism().base() == BaseKind::kDriven) state_.reduced.X_WR = state_.driven_next;
  if (base_size_ == 0) {
    UpdateConfiguration();
    return;
  }
  // As in Predict, beside the drift of the centre of mass, which only moves the base along. Contact asks that
  // gaps stay closed at the end velocity, so what was pushed turns and drifts by that one; the mean would let
  // a foot that lands sink by half of what it fell in the step.
  Vector6 V_start = V_R_before_;
  V_start.tail<3>() -= drift_R_;
  Vector3 drift_R = drift_R_;
  if (pushed_) {
    momentum_.noalias() = M_full_ * x_;
    drift_R = momentum_.segment<3>(3) / M_00_(5, 5);
  }
  x_.segment<3>(3) -= drift_R;
  const Vector3 drift_W = state_.reduced.X_WR.rotation() * drift_R;
  const Vector6 mean = pushed_ ? Vector6(x_.head<6>()) : Vector6(0.5 * (V_start + x_.head<6>()));
  state_.reduced.X_WR = state_.reduced.X_WR * Exp(h * mean);
  state_.reduced.X_WR.translation() += h * drift_W;
  state_.reduced.X_WR.Orthonormalize();
  UpdateConfiguration();
  x_.segment<3>(3).noalias() += state_.reduced.X_WR.rotation().transpose() * drift_W;
  state_.reduced.V_R = x_.head<6>();
}

}  // namespace fork1s
