// The step of second order: docs/method.md, section 5.
//
// ẋ are velocities of the centre and, in its own axes, of the turn of every rigid part: inertia is constant
// there, and a part left alone keeps its energy (rigid_parts.hpp). J(z) maps rates of z to ẋ; joints confine
// the mean velocity of a step to what the pose half way allows, z_m = z + (h/2) w, ẋ having turned with it:
//     u  = M_m⁻¹ J_mᵀ ẋ                        the old velocity as that pose sees it
//     M_m (w⁺ - u) = h f(z + h Th w̄) + J_cᵀλ,   w̄ = w + Th (w⁺ + u - 2 w),   z⁺ = z + h w̄
// (on a driven base w there is that beside the base's own motion of the start: w_start_)
//     ẋ⁺ = J_m (w⁺ + u) - ẋ,   w at the end = M(z⁺)⁻¹ J(z⁺)ᵀ ẋ⁺
// Since ẋ⁺ + ẋ = J_m (w⁺ + u), kinetic energy changes by what forces work, ½ h (w⁺ + u)·f, and by nothing
// else, however far the pose turns; seeing ẋ⁺ from z⁺ can only lose what the joints cannot do. No velocity
// force is computed and none can feed itself. The forces' work is taken along the chord h w̄; where their
// potential bends within the step, the difference to its true change is made up for along w̄, either way.
#include <fork1s/dynamics/mechanism_dynamics.hpp>

#include <cmath>
#include <limits>

namespace fork1s {
namespace {

// Of potential energies: sums of a hundred terms know no more digits than this.
constexpr double kRounding = 1e-13;

// Centre of mass in R of an inertia about R's origin.
Vector3 CenterOf(const Matrix6& M_00) { return Vector3(M_00(2, 4), M_00(0, 5), M_00(1, 3)) / M_00(5, 5); }

// The root of a κ² + b κ = d that is nearest to 0; where there is none the lowest point.
double SmallRoot(double a, double b, double d) {
  const double inside = b * b + 4 * a * d;
  if (inside <= 0) return a > 0 ? -b / (2 * a) : 0;
  const double sum = b + std::copysign(std::sqrt(inside), b);
  return sum != 0 ? 2 * d / sum : 0;
}

// x <- A⁻¹ x. An A that is no inertia gives no number, which World::Step finds, takes back and reports.
void SolveOrFail(Cholesky& factor, const MatrixX& A, VectorX& x) {
  if (factor.Compute(A))
    factor.SolveInPlace(x);
  else
    x.setConstant(std::numeric_limits<double>::quiet_NaN());
}

}  // namespace

void MechanismDynamics::SizeTheta() {
  const int r = model().size(), n = model().num_coordinates();
  theta_.h = at_end_.h = -1;
  u_.setZero(num_velocities());
  contact_shift_.setZero(num_velocities());
  w_start_.setZero(r);
  q_dot_start_.setZero(n);
  w_mean_.setZero(r);
  f_used_.setZero(r);
  f_turn_.setZero(r);
  f_wrench_.setZero(r);
  f_moved_.setZero(r);
  F_parts_.resize(6, rigid_parts_.size());
}

void MechanismDynamics::Begin(double h, const Vector3& gravity_W, StepRule rule) {
  FORK1S_REQUIRE(options_.recovery != Recovery::kTwist);
  rule_ = rule;
  order_ = 1;
  touches_ = first_order_ = false;
  gravity_W_ = gravity_W;
  z_before_ = state_.reduced.z;
  w_before_ = state_.reduced.w;
  X_WR_before_ = state_.reduced.X_WR;
  V_R_before_ = state_.reduced.V_R;
  q_dot_start_.setZero();
  AddMotion(model(), Q_now(), state_.reduced.w, q_dot_start_);
  if (base_size_ > 0) {
    const Vector6 p = M_full_.topRows<6>() * x_;
    center_W_ = state_.reduced.X_WR * CenterOf(M_00_);
    linear_W_ = state_.reduced.X_WR.rotation() * p.tail<3>();
    past_next_.center_W = center_W_;
  }
  Vector6 V_start = state_.reduced.V_R;
  if (mechanism().base() == BaseKind::kFixed) V_start.setZero();
  if (mechanism().base() == BaseKind::kDriven && rule_ == StepRule::kTwoSteps && state_.past.h == h)
    V_start = state_.past.V_R;
  ComputeMaterialVelocities(mechanism(), rigid_parts_, configuration_.kinematics, q_dot_start_, V_start,
                            start_velocity_);
  KeepPast(h);
  if (rule_ != StepRule::kMiddle) {
    TakePast(h);
    return;
  }
  if (model().has_complement) {
    // At the middle a spring too stiff for the step stands where it never will, and would pass for a load.
    LoadForces(state_.reduced.X_WR.rotation().transpose() * gravity_W);
    FollowLoads();
  }
  if (mechanism().base() == BaseKind::kDriven) {
    state_.reduced.V_R = DrivenTwist(h);
    weighed_on_ = state_.reduced.X_WR * Exp(0.5 * h * state_.reduced.V_R);
    potential_start_ = PotentialOfSprings(weighed_on_, gravity_W);
  } else {
    potential_start_ = PotentialOfSprings(state_.reduced.X_WR, gravity_W);
  }
  KeepBoundedLengths();
  q_dot_mixed_ = q_dot_start_;
  TurnFreely(rigid_parts_, 0.5 * h, start_velocity_);
  MoveToMiddle(h);
}

void MechanismDynamics::MoveToMiddle(double h) {
  std::swap(configuration_, elsewhere_);
  configuration_.TakeLoops(elsewhere_);
  state_.reduced.z += 0.5 * h * state_.reduced.w;
  if (mechanism().base() == BaseKind::kDriven)
    state_.reduced.X_WR = state_.reduced.X_WR * Exp(0.5 * h * state_.reduced.V_R);
  if (base_size_ > 0)
    state_.reduced.X_WR.rotation() =
        state_.reduced.X_WR.rotation() * ExpRotation(0.5 * h * state_.reduced.V_R.head<3>());
  UpdateConfiguration();
  if (base_size_ == 0) return;
  const Matrix3& R = state_.reduced.X_WR.rotation();
  const Vector3 center = CenterOf(M_00_);
  state_.reduced.X_WR.translation() = center_W_ + 0.5 * h / M_00_(5, 5) * linear_W_ - R * center;
  // The same angular rate and momentum in the axes that have turned meanwhile: what contacts see approach.
  const Vector3 omega = R.transpose() * (X_WR_before_.rotation() * V_R_before_.head<3>());
  Vector3 of_joints = Vector3::Zero();
  if (model().size() > 0) of_joints.noalias() = M_0z_.bottomRows<3>() * state_.reduced.w;
  state_.reduced.V_R << omega, (R.transpose() * linear_W_ - of_joints) / M_00_(5, 5) - omega.cross(center);
  x_.head<6>() = state_.reduced.V_R;
}

// momentum_, of the start as the pose at hand feels it, and u.
void MechanismDynamics::TakeMomenta() {
  const Matrix3 R_mW = state_.reduced.X_WR.rotation().transpose();
  const int r = model().size();
  F_parts_.setZero();
  AddMomentum(rigid_parts_, configuration_.kinematics, start_velocity_, R_mW * X_WR_before_.rotation(), 1,
              F_parts_);
  if (mechanism().base() == BaseKind::kDriven) {
    // Joints see what is left beside the base's own mean motion.
    tau_.setZero();
    ComputeMaterialVelocities(mechanism(), rigid_parts_, configuration_.kinematics, tau_,
                              rule_ == StepRule::kMiddle ? state_.reduced.V_R : V_end_, other_velocity_);
    AddMomentum(rigid_parts_, configuration_.kinematics, other_velocity_, Matrix3::Identity(), -1, F_parts_);
  }
  tau_ = mechanism().armature().cwiseProduct(q_dot_mixed_);
  GatherFromParts(mechanism(), configuration_.kinematics.S, F_parts_, tau_);
  if (r > 0) momentum_.tail(r).noalias() = Q_now().transpose() * tau_;
  if (base_size_ > 0) momentum_.head<6>() = F_parts_.col(0);
  if (rule_ != StepRule::kMiddle) return;
  u_ = momentum_;
  if (num_velocities() > 0) SolveOrFail(inertia_factor_, M_full_, u_);
  if (r == 0) return;
  w_start_ = first_order_ ? VectorX(u_.tail(r)) : w_before_;
  if (mechanism().base() == BaseKind::kDriven && !first_order_) {
    // Half of what the change of the base's twist brings has come by the start, the other half comes by the
    // end.
    f_turn_.noalias() = M_0z_.transpose() * (V_R_before_ - state_.reduced.V_R);
    inertia_factor_.SolveInPlace(f_turn_);
    w_start_ += 0.5 * f_turn_;
  }
  contact_shift_.setZero();
  contact_shift_.tail(r) = u_.tail(r) - w_start_;
}

// f_z_ and base_force_ of the pose at hand, and what of them has no potential.
void MechanismDynamics::TakeForces(double h) {
  const int r = model().size();
  LoadForces(state_.reduced.X_WR.rotation().transpose() * gravity_W_);
  if (model().has_complement) {
    if (rule_ != StepRule::kMiddle) FollowLoads();
    potential_start_ += relaxed_;
  }
  ReduceForce(model(), Q_now(), g_, f_z_);
  if (state_.q_perp_offset.size() > 0) state_.q_perp_offset *= std::exp(-h / options_.complement_relaxation);
  f_wrench_.setZero();
  base_wrench_.setZero();
  if (state_.has_wrenches) {
    for (int b = 0; b < mechanism().num_bodies(); ++b)
      F_.col(b) = AdjointTransposeApply(state_.reduced.X_WR, state_.wrenches_W.col(b));
    base_wrench_ = F_.rowwise().sum();
    tau_.setZero();
    AccumulateGeneralizedForce(mechanism(), configuration_.kinematics.S, F_, tau_);
    if (r > 0) f_wrench_.noalias() = Q_now().transpose() * tau_;
  }
  if (has_followers_ && r > 0) {
    tau_.setZero();
    AddFollowerForce(1, tau_);
    f_wrench_.noalias() += Q_now().transpose() * tau_;
  }
  controls_moved_ = state_.controls_move && r > 0;
  if (controls_moved_) {
    tau_.setZero();
    AddControlForce(mechanism(), configuration_.kinematics, state_.controls, tau_);
    q_ddot_.setZero();
    AddControlForce(mechanism(), configuration_.kinematics, state_.controls_from, q_ddot_);
    tau_ -= q_ddot_;
    f_moved_.noalias() = Q_now().transpose() * tau_;
  }
  ForgetInputs();
  if (HasSwitches()) OpenSwitches();
}

// What was meant for one step alone, once that knows it.
void MechanismDynamics::ForgetInputs() {
  state_.controls_move = false;
  if (!state_.has_wrenches) return;
  state_.wrenches_W.setZero();
  state_.has_wrenches = false;
}

// x* from the momenta and forces at hand.
void MechanismDynamics::SolveFreeMiddle(double h) {
  const int r = model().size();
  all_at_end_ = touches_ || AnyAtBound();
  if (TakesBentSprings()) TakeStiffnessBeyond();
  ThetaScheme& rule = all_at_end_ ? at_end_ : theta_;
  if (rule.h != h) {
    std::vector<VelocityRange> ranges = parts_;
    if (base_size_ > 0) ranges = {{0, r}};
    rule.Fill(model(), ranges, h, all_at_end_);
  }
  if (HasSwitches()) AddSwitchedForces();
  if (num_velocities() == 0) return;
  impulse_.setZero(num_velocities());
  SolveFreeMiddleWith(rule, w_start_);
  // Dampers that are not linear by the mean of the rates that they would bring about.
  if (has_bent_springs_ && !first_order_) SolveFreeMiddleWith(rule, VectorX(0.5 * (w_start_ + x_.tail(r))));
}

// Dampers that are not linear by the rates of `w_drag`.
void MechanismDynamics::SolveFreeMiddleWith(const ThetaScheme& rule, const VectorX& w_drag) {
  const int r = model().size();
  const double h = rule.h;
  x_ = momentum_;
  if (base_size_ > 0) x_.head<6>() += h * base_force_;
  A_ = M_full_;
  if (r > 0) {
    A_.bottomRightCorner(r, r) += h * rule.D_end + h * h * rule.K_Th2;
    if (TakesBentSprings()) A_.bottomRightCorner(r, r) += h * h * K_beyond_;
    auto rhs = x_.tail(r);
    rhs += h * f_z_;
    // Of the way that controls go within the step a mode feels what its own rule asks of it: half by the
    // trapezoid, all at the end. Their force is that of f_z_ beside what is not there yet.
    if (controls_moved_ && !all_at_end_) {
      rhs -= h * f_moved_;
      rhs.noalias() += h * (rule.Th.transpose() * f_moved_);
    }
    // f at z + h Th w̄ from f at the pose half way.
    f_used_ = z_before_ - state_.reduced.z;
    SpringPull(f_used_, f_turn_);
    rhs += h * f_turn_;
    f_turn_ = u_.tail(r) - w_start_;
    rhs.noalias() -= (h * h) * (rule.K_Th_rest * w_start_);
    rhs.noalias() -= (h * h) * (rule.K_Th2 * f_turn_);
    if (TakesBentSprings()) rhs.noalias() -= (h * h) * (K_beyond_ * f_turn_);
    rhs.noalias() -= h * (rule.D_start * w_start_);
    rhs.noalias() -= h * (rule.D_end * f_turn_);
    if (DampersTurn() || has_bent_springs_) {
      // Of dampers beyond those of the reference half acts on either velocity, by first order all on the last.
      D_beyond_.setZero(r, r);
      AddDampersBeyond(h, true, w_drag, D_beyond_);
      const double end = all_at_end_ ? 1 : 0.5;
      A_.bottomRightCorner(r, r) += end * D_beyond_;
      f_turn_ *= end;
      f_turn_ += (1 - end) * w_start_;
      rhs.noalias() -= D_beyond_.selfadjointView<Eigen::Lower>() * f_turn_;
    }
    if (all_at_end_) TakeBoundedSpringsOut(h);
  }
  SolveOrFail(factor_, A_, x_);
}

// Work of springs, weight and controls along the chord h w̄, which becomes w_mean_.
double MechanismDynamics::WorkOfChord(double h) {
  const int r = model().size();
  if (r == 0) return 0;
  f_turn_ = x_.tail(r) + u_.tail(r) - 2 * w_start_;
  w_mean_.noalias() = scheme().Th * f_turn_;
  w_mean_ += w_start_;
  // f(z + h Th w̄); what springs bend by within the step is what the work then misses.
  f_used_ = z_before_ - state_.reduced.z;
  f_used_.noalias() += h * (scheme().Th * w_mean_);
  SpringPull(f_used_, f_turn_);
  double work = h * w_mean_.dot(f_z_ - f_wrench_ + f_turn_);
  f_used_.noalias() = scheme().Th * w_mean_;
  f_used_ -= 0.5 * w_mean_;
  SpringPull(f_used_, f_turn_);
  work -= h * h * w_mean_.dot(f_turn_);
  return work;
}

void MechanismDynamics::IntegrateMiddle(double h) {
  const int r = model().size();
  const bool driven = mechanism().base() == BaseKind::kDriven;
  const Matrix3 R_m = state_.reduced.X_WR.rotation();
  const RigidTransform X_m = state_.reduced.X_WR;
  // An impact keeps gaps closed at the end velocity.
  const double end = all_at_end_ && pushed_ ? 1 : 0.5;
  minimum_found_ = true;
  newton_steps_ = 0;
  double work = WorkOfChord(h);
  potential_size_ = std::abs(potential_start_);
  potential_start_ -= BeyondBoundsAtStart();
  potential_size_ += std::abs(potential_start_);
  if (base_size_ > 0)
    work += h * (end * x_.head<6>() + (1 - end) * u_.head<6>()).dot(base_force_ - base_wrench_);
  TurnAndMove(h, end);
  if (r > 0 && BendsTooMuch(work)) {
    state_.reduced.X_WR = X_m;
    work = MinimiseAtEnd(h);
    if (base_size_ > 0)
      work += h * (end * x_.head<6>() + (1 - end) * u_.head<6>()).dot(base_force_ - base_wrench_);
    TurnAndMove(h, end);
  }

  // ẋ⁺ + ẋ and its rates of joints, seen from the middle.
  Vector6 V = Vector6::Zero();
  if (driven) V = 2 * state_.reduced.V_R;
  if (base_size_ > 0) V = x_.head<6>() + u_.head<6>();
  q_ddot_.setZero();
  if (r > 0) {
    f_turn_ = x_.tail(r) + u_.tail(r);
    AddMotion(model(), elsewhere_.Q_now, f_turn_, q_ddot_);
  }
  ComputeMaterialVelocities(mechanism(), rigid_parts_, elsewhere_.kinematics, q_ddot_, V, other_velocity_);
  q_ddot_ -= q_dot_start_;
  SubtractFrom(other_velocity_, R_m.transpose() * X_WR_before_.rotation(), start_velocity_);
  TurnFreely(rigid_parts_, 0.5 * h, start_velocity_);

  UpdateInertia();
  const Matrix3 R_eW = state_.reduced.X_WR.rotation().transpose();
  F_parts_.setZero();
  AddMomentum(rigid_parts_, configuration_.kinematics, start_velocity_, R_eW * R_m, 1, F_parts_);
  tau_ = mechanism().armature().cwiseProduct(q_ddot_);
  if (driven) {
    q_ddot_.setZero();
    ComputeMaterialVelocities(mechanism(), rigid_parts_, configuration_.kinematics, q_ddot_,
                              state_.reduced.V_R, other_velocity_);
    AddMomentum(rigid_parts_, configuration_.kinematics, other_velocity_, Matrix3::Identity(), -1, F_parts_);
  }
  GatherFromParts(mechanism(), configuration_.kinematics.S, F_parts_, tau_);
  q_dot_ = q_dot_start_;  // ClosureForces takes the rate of joint rates from it
  TakeVelocityAtEnd(work);
  if (first_order_) {
    state_.past.h = 0;
    return;
  }
  past_next_.z_moved = state_.reduced.z - z_before_;
  past_next_.V_R = state_.reduced.V_R;
  std::swap(state_.past, past_next_);
}

// Pose at the end of the step from w_mean_ and x_: from the middle, to which elsewhere_ then belongs. The
// centre of mass goes by momentum alone, so that a drift of the whole changes nothing else.
void MechanismDynamics::TurnAndMove(double h, double end) {
  const Matrix3 R_m = state_.reduced.X_WR.rotation();
  state_.reduced.z = z_before_;
  if (model().size() > 0) state_.reduced.z += h * w_mean_;
  state_.reduced.X_WR = mechanism().base() == BaseKind::kDriven ? state_.driven_next : X_WR_before_;
  Vector3 center_end = Vector3::Zero();  // m, world axes
  if (base_size_ > 0) {
    const Vector3 pushed = R_m * (M_full_.middleRows<3>(3) * x_ - momentum_.segment<3>(3));
    const Vector3 turn = h * (R_m * (end * x_.head<3>() + (1 - end) * u_.head<3>()));
    center_end = center_W_ + h / M_00_(5, 5) * (linear_W_ + end * pushed);
    state_.reduced.X_WR.rotation() = ExpRotation(turn) * state_.reduced.X_WR.rotation();
    state_.reduced.X_WR.Orthonormalize();
  }
  std::swap(configuration_, elsewhere_);
  configuration_.TakeLoops(elsewhere_);
  pose_energy_.valid = false;
  Configure(model(), state_.reduced, configuration_);
  if (base_size_ > 0)
    state_.reduced.X_WR.translation() =
        center_end - state_.reduced.X_WR.rotation() * CenterOfParts(rigid_parts_, configuration_.kinematics);
}

// Whether springs came to hold so much more than foreseen that the motion of the joints cannot pay for it: along
// w̄ it has (w̄·M x)²/2 w̄·M w̄ to give.
bool MechanismDynamics::BendsTooMuch(double work) {
  const RigidTransform& X_WR = mechanism().base() == BaseKind::kDriven ? weighed_on_ : state_.reduced.X_WR;
  const double missed = PotentialOfStep(X_WR) - potential_start_ + work;
  TakeRelativeMotion(w_mean_);
  const double along = solved_.dot(x_), inertia = solved_.dot(rhs_);
  const double has = inertia > 0 ? along * along / (2 * inertia) : 0;
  return missed > 0.5 * has + kRounding * potential_size_;
}

// rhs_ <- w without momentum of the whole, solved_ <- M times it.
void MechanismDynamics::TakeRelativeMotion(const Eigen::Ref<const VectorX>& w) {
  rhs_.tail(model().size()) = w;
  if (base_size_ > 0) rhs_.head<6>() = -SolvePositive(M_00_, M_0z_ * w);
  solved_.noalias() = M_full_ * rhs_;  // base rows 0: no momentum
}

// Adds `energy` to the kinetic energy along the relative motion of the step, and where that has less than is
// owed, as after a turn by a radian, along that of its end. The momentum of the whole stays.
void MechanismDynamics::MatchWork(double energy) {
  for (const bool at_end : {false, true}) {
    if (at_end)
      TakeRelativeMotion(x_.tail(model().size()));
    else
      TakeRelativeMotion(w_mean_);
    const double a = 0.5 * solved_.dot(rhs_), b = solved_.dot(x_), share = SmallRoot(a, b, energy);
    x_ += share * rhs_;
    energy -= (a * share + b) * share;
    if (!(energy < -kRounding * potential_size_)) return;
  }
}

// The velocity that ẋ⁺ leaves at the new pose, tau_ and F_parts_ its momentum, with the momentum of the whole
// kept to rounding and the work of the chord corrected to the potential's true change.
void MechanismDynamics::TakeVelocityAtEnd(double work) {
  const int r = model().size();
  if (num_velocities() == 0) return;
  if (r > 0) ReduceForce(model(), Q_now(), tau_, f_used_);
  if (r > 0) momentum_.tail(r) = f_used_;
  if (base_size_ > 0) momentum_.head<6>() = F_parts_.col(0);
  x_ = momentum_;
  SolveOrFail(inertia_factor_, M_full_, x_);
  // What is known of the energy: the work of springs without potential is known at the middle alone.
  if (r > 0 && rule_ == StepRule::kMiddle && !has_follower_springs_) {
    const RigidTransform& X_WR = mechanism().base() == BaseKind::kDriven ? weighed_on_ : state_.reduced.X_WR;
    const double potential = PotentialOfStep(X_WR), missed = potential_start_ - potential - work;
    // Below the digits of the two it would keep alive what comes to rest.
    if (std::abs(missed) > kRounding * potential_size_) MatchWork(missed);
  }
  state_.reduced.w = x_.tail(r);
  if (base_size_ > 0) state_.reduced.V_R = x_.head<6>();
}

}  // namespace fork1s
