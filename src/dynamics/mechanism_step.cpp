// The implicit step: docs/method.md, section 5.
#include <fork1s/dynamics/mechanism_dynamics.hpp>

#include <cmath>
#include <fork1s/linalg/cholesky.hpp>


namespace fork1s {
namespace {

// Base momentum p [6] in R is carried along by the midpoint rule, Ad(Exp(h (V + V⁺)/2))ᵀ p. V⁺ = solve(that)
// enters it and is found by a short iteration from V_next. Returns the momentum carried, V⁺ in V_next.
template <typename Solve>
Vector6 TransportMomentum(double h, const Vector6& p, const Vector6& V, Vector6& V_next, const Solve& solve) {
  Vector6 moved = p;
  // Every round gains about h |V|: two or three digits at walking speed, less in a fast spin.
  constexpr int kRounds = 24;
  for (int i = 0; i < kRounds; ++i) {
    moved = AdjointTransposeApply(Exp(0.5 * h * (V + V_next)), p);
    const Vector6 next = solve(moved);
    const double change = (next - V_next).cwiseAbs().maxCoeff();
    V_next = next;
    if (change < 1e-12 * (1 + V_next.cwiseAbs().maxCoeff())) break;
  }
  return moved;
}

}  // namespace

void MechanismDynamics::Factor(double h) {
  factored_h_ = h;
  if (num_velocities() == 0)
    return;  // a driven body without joints: Eigen's products may not be asked for nothing
  A_ = M_full_;
  A_.bottomRightCorner(model().size(), model().size()) += h * model().D;
  A_.diagonal().tail(model().size()) += h * h * model().K_r;
  TurnSprings(h);
  TurnDampers(h);
  TurnServos(h);
  TakeBoundedSpringsOut(h);
  factor_.Compute(A_);
}

void MechanismDynamics::Predict(double h, const Vector3& gravity_W) {
  pushed_ = false;
  if (rule_ != StepRule::kEuler) {
    PredictTheta(h);
    SolveFreeTheta(h);
    return;
  }
  V_R_before_ = state_.reduced.V_R;
  gravity_W_ = gravity_W;
  guard_ = mechanism().base() != BaseKind::kDriven && options_.recovery != Recovery::kTwist &&
           !state_.has_wrenches;
  if (guard_) energy_budget_ = energy_start_ = KineticEnergy() + PotentialEnergy(gravity_W);
  Vector6 A_R = Vector6::Zero();
  Vector6 V_next = state_.reduced.V_R;
  if (mechanism().base() == BaseKind::kDriven) {
    // Twist that takes the base to its next pose; its change pushes the interior by inertia.
    V_next = DrivenTwist(h);
    A_R = (V_next - state_.reduced.V_R) / h;
  }
  if (base_size_ > 0) {
    // The step is taken in a frame that keeps up with the centre of mass. Left in, its velocity v enters as
    // forces m ω × v on bodies and base that cancel only at the end of an implicit step, and feed rotation
    // once h v nears the size of the mechanism.
    momentum_.noalias() = M_full_ * x_;
    drift_R_ = momentum_.segment<3>(3) / M_00_(5, 5);
    state_.reduced.V_R.tail<3>() -= drift_R_;
    V_next = state_.reduced.V_R;
  }
  if (model().has_complement) q_perp_before_ = state_.reduced.q_perp;
  LoadForces(h, state_.reduced.X_WR.rotation().transpose() * gravity_W, A_R);
  if (state_.q_perp_offset.size() > 0) state_.q_perp_offset *= std::exp(-h / options_.complement_relaxation);

  if (base_size_ > 0) momentum_.noalias() -= M_full_.middleCols<3>(3) * drift_R_;
  V_free_ = V_next;
  if (HasSwitches()) OpenSwitches();
  SolveFree(h);
  state_.controls_move = false;
  if (state_.has_wrenches) {
    state_.wrenches_W.setZero();
    state_.has_wrenches = false;
  }
}

// x* from the forces and momenta at hand.
void MechanismDynamics::SolveFree(double h) {
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
  Vector6 V_next = V_free_;
  transported_ = TransportMomentum(h, momentum_.head<6>(), V_free_, V_next, [&](const Vector6& moved) {
    x_.head<6>() = moved + h * (base_force_ - momentum_rate_);
    x_.tail(r) = momentum_.tail(r) + h * f_z_;
    factor_.SolveInPlace(x_);
    return Vector6(x_.head<6>());
  });
  x_.segment<3>(3) += drift_R_;
  state_.reduced.V_R = V_R_before_;
}

void MechanismDynamics::PredictAgain(double h) {
  pushed_ = false;
  if (rule_ != StepRule::kEuler) {
    SolveFreeTheta(h);
    return;
  }
  if (guard_) energy_budget_ = energy_start_;
  SolveFree(h);
}

void MechanismDynamics::ApplyImpulse(const VectorX& p, bool from_outside) {
  if (p.isZero(0)) return;
  pushed_ = pushed_ || from_outside;
  rhs_ = p;
  factor_.SolveInPlace(rhs_);
  x_ += rhs_;
  if (rule_ != StepRule::kEuler) {
    impulse_ += p;
    return;
  }
  // Contact's work: by the mean velocity where M alone resists, by the end velocity where springs do.
  if (guard_) {
    rhs_.tail(model().size()) = state_.reduced.w;
    if (base_size_ > 0) rhs_.head<6>() = V_R_before_;
    energy_budget_ += std::max(p.dot(x_), 0.5 * (p.dot(x_) + p.dot(rhs_)));
  }
}

void MechanismDynamics::Integrate(double h) {
  if (rule_ != StepRule::kEuler) {
    IntegrateTheta(h);
    rule_ = StepRule::kEuler;
    order_ = 1;
    return;
  }
  state_.past.h = 0;
  if (guard_) {
    if (has_followers_) energy_budget_ += FollowerWork(h);
    z_before_ = state_.reduced.z;
    w_before_ = state_.reduced.w;
    X_WR_before_ = state_.reduced.X_WR;
    x_after_ = x_;
    if (model().has_complement) q_perp_after_ = state_.reduced.q_perp;
  }
  Vector6 V = V_R_before_;
  V.tail<3>() -= drift_R_;
  Advance(h, V, h * momentum_rate_);
  if (guard_ && !TakeExcessEnergy()) TakeShorterStep(h);
}

// Moves the state by x_ over h. V_start: the base twist that the midpoint rule starts from, without drift.
// `by_pose`: momentum that x_ has with the M of the new pose beyond what it has with that of the old one, as
// Predict foresaw it.
void MechanismDynamics::Advance(double h, const Vector6& V_start, const Vector6& by_pose) {
  state_.reduced.w = x_.tail(model().size());
  state_.reduced.z += h * state_.reduced.w;
  KeepJointRates();
  if (mechanism().base() == BaseKind::kDriven) state_.reduced.X_WR = state_.driven_next;
  if (base_size_ == 0) {
    UpdateConfiguration();
    return;
  }
  // As in Predict, beside the drift of the centre of mass, which only moves the base along. Contact asks that
  // gaps stay closed at the end velocity, so what was pushed turns and drifts by that one; the mean would let
  // a foot that lands sink by half of what it fell in the step.
  Vector3 drift_R = drift_R_;
  if (pushed_) {
    momentum_.noalias() = M_full_ * x_;
    drift_R = (momentum_.segment<3>(3) + by_pose.tail<3>()) / M_00_(5, 5);
  }
  x_.segment<3>(3) -= drift_R;
  const Vector3 drift_W = state_.reduced.X_WR.rotation() * drift_R;
  const Vector6 mean = pushed_ ? Vector6(x_.head<6>()) : Vector6(0.5 * (V_start + x_.head<6>()));
  state_.reduced.X_WR = state_.reduced.X_WR * Exp(h * mean);
  state_.reduced.X_WR.translation() += h * drift_W;
  state_.reduced.X_WR.Orthonormalize();
  momentum_.noalias() = M_full_ * x_;
  const Vector6 p = momentum_.head<6>() + by_pose;
  UpdateConfiguration();
  // The pose changed under the base: its momentum stays, its twist follows.
  if (options_.recovery != Recovery::kTwist)
    x_.head<6>() = SolvePositive(M_00_, p - M_0z_ * state_.reduced.w);
  x_.segment<3>(3).noalias() += state_.reduced.X_WR.rotation().transpose() * drift_W;
  state_.reduced.V_R = x_.head<6>();
}

// The relative motion of the step is shortened by s, as if it had been s times as fast from the start: at s =
// 0 the mechanism moves on as one rigid body, which keeps its energy under the midpoint rule.
void MechanismDynamics::AdvanceShortened(double h, double s) {
  state_.reduced.z = z_before_;
  state_.reduced.X_WR = X_WR_before_;
  if (model().has_complement) state_.reduced.q_perp = q_perp_before_;
  UpdateConfiguration();
  if (model().has_complement) state_.reduced.q_perp += s * (q_perp_after_ - q_perp_before_);
  const int r = model().size();
  x_ = x_after_;
  if (base_size_ == 0) {
    x_ *= s;
    Advance(h, Vector6::Zero(), Vector6::Zero());
    return;
  }
  x_.segment<3>(3) -= drift_R_;
  const auto M_0 = M_full_.topRows<6>();
  Vector6 V = V_R_before_;
  V.tail<3>() -= drift_R_;
  const Vector6 p = M_00_ * V + M_0z_ * w_before_;
  const Vector6 locked = SolvePositive(M_00_, p);
  V = locked + s * (V - locked);
  // A shortened step turns and bends less than was foreseen: its twist follows the pose afterwards.
  const Vector6 pushed = M_0 * x_ - transported_ + h * momentum_rate_;
  x_.tail(r) *= s;
  Vector6 V_next = V;
  TransportMomentum(h, p, V, V_next, [&](const Vector6& moved) {
    return SolvePositive(M_00_, moved + pushed - M_0z_ * x_.tail(r));
  });
  x_.head<6>() = V_next;
  x_.segment<3>(3) += drift_R_;
  Advance(h, V, Vector6::Zero());
}

}  // namespace fork1s
