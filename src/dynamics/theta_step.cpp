// The step of second order: docs/method.md, section 5.
//
// ẋ are velocities of the centre and, in its own axes, of the turn of every rigid part: inertia is constant
// there, and a part left alone keeps its energy (rigid_parts.hpp). J(z) maps rates of z to ẋ; joints confine
// the mean velocity of a step to what the pose half way allows, z_m = z + (h/2) w, ẋ having turned with it:
//     u  = M_m⁻¹ J_mᵀ ẋ                        the old velocity as that pose sees it
//     M_m (w⁺ - u) = h f(z + h Th w̄) + J_cᵀλ,   w̄ = w + Th (w⁺ + u - 2 w),   z⁺ = z + h w̄
// (on a driven base w there is that beside the base's own motion of the start: w_start)
//     ẋ⁺ = J_m (w⁺ + u) - ẋ,   w at the end = M(z⁺)⁻¹ J(z⁺)ᵀ ẋ⁺
// Since ẋ⁺ + ẋ = J_m (w⁺ + u), kinetic energy changes by what forces work, ½ h (w⁺ + u)·f, and by nothing
// else, however far the pose turns; seeing ẋ⁺ from z⁺ can only lose what the joints cannot do. No velocity
// force is computed and none can feed itself. The forces' work is taken along the chord h w̄; where their
// potential bends within the step, the difference to its true change is made up for along w̄, either way.
#include "mechanism_detail.hpp"

namespace fork1s {
namespace {

// Centre of mass in R of an inertia about R's origin.
Vector3 CenterOf(const Matrix6& M_00) { return Vector3(M_00(2, 4), M_00(0, 5), M_00(1, 3)) / M_00(5, 5); }

}  // namespace

void SizeTheta(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  const int r = model.size(), n = model.reduced->num_coordinates();
  ws.theta.h = ws.at_end.h = -1;
  ws.u.setZero(model.num_velocities());
  ws.contact_shift.setZero(model.num_velocities());
  ws.w_start.setZero(r);
  ws.q_dot_start.setZero(n);
  ws.nu_start.setZero(n);
  ws.nu_mixed.setZero(n);
  ws.w_mean.setZero(r);
  ws.w_felt.setZero(r);
  ws.f_used.setZero(r);
  ws.f_turn.setZero(r);
  ws.f_wrench.setZero(r);
  ws.f_moved.setZero(r);
  ws.F_parts.resize(6, model.rigid_parts.size());
}

void SeeStart(const MechanismStep& here, double h, StepRule rule) {
  const auto& [model, state, ws] = here;
  ws.q_dot_start.setZero();
  AddMotion(*model.reduced, ws.Q_now(), state.reduced.w, ws.q_dot_start);
  if (model.base_size > 0) {
    const Vector6 p = ws.M_full.topRows<6>() * ws.x;
    ws.center_W = state.reduced.X_WR * CenterOf(ws.M_00);
    ws.linear_W = state.reduced.X_WR.rotation() * p.tail<3>();
  }
  if (rule == StepRule::kEuler) return;
  ComputeJointVelocities(model.mechanism(), ws.configuration.kinematics, ws.q_dot_start, ws.nu_start);
  Vector6 V_start = state.reduced.V_R;
  if (model.mechanism().base() == BaseKind::kFixed) V_start.setZero();
  if (model.mechanism().base() == BaseKind::kDriven && rule == StepRule::kTwoSteps && state.past.h == h)
    V_start = state.past.V_R;
  ComputeMaterialVelocities(model.mechanism(), model.rigid_parts, ws.configuration.kinematics, ws.q_dot_start,
                            V_start, ws.start_velocity);
}

void Begin(const MechanismStep& here, double h, const Vector3& gravity_W, StepRule rule) {
  const auto& [model, state, ws] = here;
  FORK1S_REQUIRE(!model.by_twists());
  ws.rule = rule;
  ws.order = 1;
  ws.touches = ws.first_order = ws.matches = false;
  ws.minimum_found = true;
  ws.sides_unknown = false;
  ws.newton_steps = 0;
  ws.gravity_W = gravity_W;
  ws.z_before = state.reduced.z;
  ws.w_before = state.reduced.w;
  ws.X_WR_before = state.reduced.X_WR;
  ws.V_R_before = state.reduced.V_R;
  SeeStart(here, h, rule);
  KeepPast(here, h);
  if (ws.rule != StepRule::kMiddle) {
    TakePast(here, h);
    return;
  }
  if (model.reduced->has_complement) {
    // At the middle a spring too stiff for the step stands where it never will, and would pass for a load.
    LoadForces(here, state.reduced.X_WR.rotation().transpose() * gravity_W);
    FollowLoads(here);
  }
  if (model.mechanism().base() == BaseKind::kDriven) state.reduced.V_R = DrivenTwist(state, h);
  KeepPotential(here, h);
  ws.nu_mixed = ws.nu_start;
  TurnFreely(model.rigid_parts, 0.5 * h, ws.start_velocity);
  MoveToMiddle(here, h);
}

void MoveToMiddle(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  std::swap(ws.configuration, ws.elsewhere);
  ws.configuration.TakeLoops(ws.elsewhere);
  state.reduced.z += 0.5 * h * state.reduced.w;
  if (model.mechanism().base() == BaseKind::kDriven)
    state.reduced.X_WR = state.reduced.X_WR * Exp(0.5 * h * state.reduced.V_R);
  if (model.base_size > 0)
    state.reduced.X_WR.rotation() =
        state.reduced.X_WR.rotation() * ExpRotation(0.5 * h * state.reduced.V_R.head<3>());
  UpdateConfiguration(here);
  if (model.base_size == 0) return;
  const Matrix3& R = state.reduced.X_WR.rotation();
  const Vector3 center = CenterOf(ws.M_00);
  state.reduced.X_WR.translation() = ws.center_W + 0.5 * h / ws.M_00(5, 5) * ws.linear_W - R * center;
  // The same angular rate and momentum in the axes that have turned meanwhile: what contacts see approach.
  const Vector3 omega = R.transpose() * (ws.X_WR_before.rotation() * ws.V_R_before.head<3>());
  Vector3 of_joints = Vector3::Zero();
  if (model.size() > 0) of_joints.noalias() = ws.M_0z.bottomRows<3>() * state.reduced.w;
  state.reduced.V_R << omega, (R.transpose() * ws.linear_W - of_joints) / ws.M_00(5, 5) - omega.cross(center);
  ws.x.head<6>() = state.reduced.V_R;
}

// momentum, of the start as the pose at hand feels it, and u.
void TakeMomenta(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  if (ws.rule == StepRule::kEuler) {  // of the pose at hand, which is that of the start
    ws.momentum.noalias() = ws.M_full * ws.x;
    if (model.mechanism().base() == BaseKind::kDriven)
      ws.momentum.noalias() += ws.M_0z.transpose() * (ws.V_R_before - ws.V_end);
    return;
  }
  const Matrix3 R_mW = state.reduced.X_WR.rotation().transpose();
  const int r = model.size();
  ws.F_parts.setZero();
  AddMomentum(model.rigid_parts, ws.configuration.kinematics, ws.start_velocity,
              R_mW * ws.X_WR_before.rotation(), 1, ws.F_parts);
  if (model.mechanism().base() == BaseKind::kDriven) {
    // Joints see what is left beside the base's own mean motion.
    ws.tau.setZero();
    ComputeMaterialVelocities(model.mechanism(), model.rigid_parts, ws.configuration.kinematics, ws.tau,
                              ws.rule == StepRule::kMiddle ? state.reduced.V_R : ws.V_end, ws.other_velocity);
    AddMomentum(model.rigid_parts, ws.configuration.kinematics, ws.other_velocity, Matrix3::Identity(), -1,
                ws.F_parts);
  }
  ws.tau = model.mechanism().armature().cwiseProduct(ws.nu_mixed);
  ConvertToCoordinateForces(model.mechanism(), ws.configuration.kinematics, ws.tau);
  GatherFromParts(model.mechanism(), ws.configuration.kinematics.S, ws.F_parts, ws.tau);
  if (r > 0) ws.momentum.tail(r).noalias() = ws.Q_now().transpose() * ws.tau;
  if (model.base_size > 0) ws.momentum.head<6>() = ws.F_parts.col(0);
  if (ws.rule != StepRule::kMiddle) return;
  ws.u = ws.momentum;
  if (model.num_velocities() > 0) SolveOrFail(ws.inertia_factor, ws.M_full, ws.u);
  if (r == 0) return;
  ws.w_start = ws.first_order ? VectorX(ws.u.tail(r)) : ws.w_before;
  if (model.mechanism().base() == BaseKind::kDriven && !ws.first_order) {
    // Half of what the change of the base's twist brings has come by the start, the other half comes by the
    // end.
    ws.f_turn.noalias() = ws.M_0z.transpose() * (ws.V_R_before - state.reduced.V_R);
    ws.inertia_factor.SolveInPlace(ws.f_turn);
    ws.w_start += 0.5 * ws.f_turn;
  }
  ws.contact_shift.setZero();
  ws.contact_shift.tail(r) = ws.u.tail(r) - ws.w_start;
}

// f_z and base_force of the pose at hand, and what of them has no potential.
void TakeForces(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  const int r = model.size();
  LoadForces(here, state.reduced.X_WR.rotation().transpose() * ws.gravity_W);
  if (model.reduced->has_complement) {
    if (ws.rule != StepRule::kMiddle) FollowLoads(here);
    ws.potential_start += ws.relaxed;
  }
  ReduceForce(*model.reduced, ws.Q_now(), ws.g, ws.f_z);
  if (state.interior.offset.size() > 0)
    state.interior.offset *= std::exp(-h / model.options.complement_relaxation);
  ws.f_wrench.setZero();
  ws.base_wrench.setZero();
  if (state.has_loads) {
    ws.F.setZero();
    AddLoadWrenches(here, ws.F);
    ws.base_wrench = ws.F.rowwise().sum();
    ws.tau.setZero();
    AccumulateGeneralizedForce(model.mechanism(), ws.configuration.kinematics.S, ws.F, ws.tau);
    if (r > 0) ws.f_wrench.noalias() = ws.Q_now().transpose() * ws.tau;
  }
  if (model.has_followers && r > 0) {
    ws.tau.setZero();
    AddFollowerForce(here, 1, ws.tau);
    ws.f_wrench.noalias() += ws.Q_now().transpose() * ws.tau;
  }
  ws.controls_moved = state.controls_move && r > 0;
  if (ws.controls_moved) {
    ws.tau.setZero();
    AddControlForce(model.mechanism(), ws.configuration.kinematics, state.controls, ws.tau);
    ws.q_ddot.setZero();
    AddControlForce(model.mechanism(), ws.configuration.kinematics, state.controls_from, ws.q_ddot);
    ws.tau -= ws.q_ddot;
    ws.f_moved.noalias() = ws.Q_now().transpose() * ws.tau;
  }
  ForgetInputs(here);
  if (HasSwitches(here)) OpenSwitches(here);
}

// What was meant for one step alone, once that knows it.
void ForgetInputs(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  state.controls_from = state.controls;
  state.controls_move = state.knows_driven_rate = false;
  ClearLoads(state);
}

// x* from the momenta and forces at hand.
void SolveFreeMiddle(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  const int r = model.size();
  ws.all_at_end = ws.touches || AnyAtBound(state);
  if (TakesBentSprings(here)) TakeStiffnessBeyond(here);
  ThetaScheme& rule = ws.all_at_end ? ws.at_end : ws.theta;
  if (rule.h != h) {
    std::vector<VelocityRange> ranges = model.parts;
    if (model.base_size > 0) ranges = {{0, r}};
    rule.Fill(*model.reduced, ranges, h, ws.all_at_end, !model.mechanism().frictions().empty());
  }
  if (HasSwitches(here)) AddSwitchedForces(here);
  if (model.num_velocities() == 0) return;
  ws.impulse.setZero(model.num_velocities());
  SolveFreeMiddleWith(here, rule, ws.w_start);
  // Dampers that are not linear by the mean of the rates that they would bring about.
  if (model.has_bent_springs && !ws.first_order)
    SolveFreeMiddleWith(here, rule, VectorX(0.5 * (ws.w_start + ws.x.tail(r))));
}

// Dampers that are not linear by the rates of `w_drag`.
void SolveFreeMiddleWith(const MechanismStep& here, const ThetaScheme& rule, const VectorX& w_drag) {
  const auto& [model, state, ws] = here;
  const int r = model.size();
  const double h = rule.h;
  ws.x = ws.momentum;
  if (model.base_size > 0) ws.x.head<6>() += h * ws.base_force;
  auto A_z = ws.A.bottomRightCorner(r, r);
  if (model.base_size > 0) {
    ws.A = ws.M_full;
    A_z += rule.end;
  } else {
    ws.A = ws.M_full + rule.end;
  }
  if (r > 0) {
    auto rhs = ws.x.tail(r);
    rhs += h * ws.f_z;
    // Of the way that controls go within the step a mode feels what its own rule asks of it: half by the
    // trapezoid, all at the end. Their force is that of f_z beside what is not there yet.
    if (ws.controls_moved && !ws.all_at_end) {
      rhs -= h * ws.f_moved;
      rhs.noalias() += h * (rule.Th.transpose() * ws.f_moved);
    }
    // f at z + h Th w̄ from f at the pose half way.
    ws.f_used = ws.z_before - state.reduced.z;
    SpringPull(here, ws.f_used, ws.f_turn);
    rhs += h * ws.f_turn;
    // What acts on w⁺ acts on what turning does to it. By first order nothing acts on w.
    ws.f_turn = ws.u.tail(r) - ws.w_start;
    rhs.noalias() -= rule.end * ws.f_turn;
    if (!ws.all_at_end) rhs.noalias() -= rule.start * ws.w_start;
    if (TakesBentSprings(here)) {
      A_z += (h * h) * ws.K_beyond;
      rhs.noalias() -= (h * h) * (ws.K_beyond * ws.f_turn);
    }
    if (DampersTurn(model) || model.has_bent_springs) {
      // Of dampers beyond those of the reference half acts on either velocity, by first order all on the last.
      ws.D_beyond.setZero(r, r);
      AddDampersBeyond(here, h, true, w_drag, ws.D_beyond);
      const double end = ws.all_at_end ? 1 : 0.5;
      if (rule.symmetric)
        A_z += end * ws.D_beyond;  // half of it, which Cholesky reads
      else
        A_z += end * MatrixX(ws.D_beyond.selfadjointView<Eigen::Lower>());
      ws.f_turn *= end;
      ws.f_turn += (1 - end) * ws.w_start;
      rhs.noalias() -= ws.D_beyond.selfadjointView<Eigen::Lower>() * ws.f_turn;
    }
    if (ws.all_at_end) {
      SubtractSaturatedStiffness(here, h);
      ws.f_turn = ws.u.tail(r) - ws.w_start;
      AddBackBoundedSprings(here, h, 1, ws.f_turn, rhs);
    }
  }
  if (rule.symmetric) {
    SolveOrFail(ws.factor, ws.A, ws.x);
  } else {
    // Nothing else asks for the factor: what touches, or stands at a bound, has all at its end.
    ws.mixed_factor.Compute(ws.A);
    ws.mixed_factor.SolveInPlace(ws.x);
  }
}

// Work of springs, weight and controls along the chord h w̄, which becomes w_mean.
double WorkOfChord(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  const int r = model.size();
  if (r == 0) return 0;
  ws.f_turn = ws.x.tail(r) + ws.u.tail(r) - 2 * ws.w_start;
  auto by_Th = [&](const VectorX& w, VectorX& out) {
    if (ws.all_at_end)
      out = w;
    else
      out.noalias() = ws.scheme().Th * w;
  };
  by_Th(ws.f_turn, ws.w_mean);
  ws.w_mean += ws.w_start;
  by_Th(ws.w_mean, ws.w_felt);
  // f(z + h Th w̄); what springs bend by within the step is what the work then misses.
  ws.f_used = ws.z_before - state.reduced.z + h * ws.w_felt;
  SpringPull(here, ws.f_used, ws.f_turn);
  double work = h * ws.w_mean.dot(ws.f_z - ws.f_wrench + ws.f_turn);
  ws.f_used = ws.w_felt - 0.5 * ws.w_mean;
  SpringPull(here, ws.f_used, ws.f_turn);
  work -= h * h * ws.w_mean.dot(ws.f_turn);
  return work - WorkOfCaught(here, h, ws.w_mean);
}

void IntegrateMiddle(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  const int r = model.size();
  const bool driven = model.mechanism().base() == BaseKind::kDriven;
  const Matrix3 R_m = state.reduced.X_WR.rotation();
  const RigidTransform X_m = state.reduced.X_WR;
  // An impact keeps gaps closed at the end velocity.
  const double end = ws.all_at_end && ws.pushed ? 1 : 0.5;
  double work = WorkOfChord(here, h);
  TakeBoundsFromPotential(here);
  if (model.base_size > 0)
    work += h * (end * ws.x.head<6>() + (1 - end) * ws.u.head<6>()).dot(ws.base_force - ws.base_wrench);
  TurnAndMove(here, h, end);
  double gain = r > 0 ? GainOfPotential(here) : 0;
  if (r > 0 && (ws.sides_unknown || BendsTooMuch(here, gain + work))) {
    state.reduced.X_WR = X_m;
    work = MinimiseAtEnd(here, h);
    if (model.base_size > 0)
      work += h * (end * ws.x.head<6>() + (1 - end) * ws.u.head<6>()).dot(ws.base_force - ws.base_wrench);
    TurnAndMove(here, h, end);
    gain = GainOfPotential(here);
  }

  // ẋ⁺ + ẋ and its rates of joints, seen from the middle.
  Vector6 V = Vector6::Zero();
  if (driven) V = 2 * state.reduced.V_R;
  if (model.base_size > 0) V = ws.x.head<6>() + ws.u.head<6>();
  ws.q_ddot.setZero();
  if (r > 0) {
    ws.f_turn = ws.x.tail(r) + ws.u.tail(r);
    AddMotion(*model.reduced, ws.elsewhere.Q_now, ws.f_turn, ws.q_ddot);
  }
  ComputeMaterialVelocities(model.mechanism(), model.rigid_parts, ws.elsewhere.kinematics, ws.q_ddot, V,
                            ws.other_velocity);
  ComputeJointVelocities(model.mechanism(), ws.elsewhere.kinematics, ws.q_ddot, ws.nu_mixed);
  ws.nu_mixed -= ws.nu_start;
  SubtractFrom(ws.other_velocity, R_m.transpose() * ws.X_WR_before.rotation(), ws.start_velocity);
  TurnFreely(model.rigid_parts, 0.5 * h, ws.start_velocity);

  UpdateInertia(here);
  const Matrix3 R_eW = state.reduced.X_WR.rotation().transpose();
  ws.F_parts.setZero();
  AddMomentum(model.rigid_parts, ws.configuration.kinematics, ws.start_velocity, R_eW * R_m, 1, ws.F_parts);
  ws.tau = model.mechanism().armature().cwiseProduct(ws.nu_mixed);
  ConvertToCoordinateForces(model.mechanism(), ws.configuration.kinematics, ws.tau);
  if (driven) {
    ws.q_ddot.setZero();
    ComputeMaterialVelocities(model.mechanism(), model.rigid_parts, ws.configuration.kinematics, ws.q_ddot,
                              state.reduced.V_R, ws.other_velocity);
    AddMomentum(model.rigid_parts, ws.configuration.kinematics, ws.other_velocity, Matrix3::Identity(), -1,
                ws.F_parts);
  }
  GatherFromParts(model.mechanism(), ws.configuration.kinematics.S, ws.F_parts, ws.tau);
  ws.q_dot = ws.q_dot_start;  // ClosureForces takes the rate of joint rates from it
  VelocityAtEnd(here);
  if (MatchesPotential(here)) GiveBack(here, -work - gain);
  TakeVelocity(here);
  if (ws.first_order) {
    state.past.h = 0;
    return;
  }
  ws.past_next.z_moved = state.reduced.z - ws.z_before;
  ws.past_next.V_R = state.reduced.V_R;
  std::swap(state.past, ws.past_next);
}

// Pose at the end of the step from w_mean and x: from the middle, to which elsewhere then belongs. The
// centre of mass goes by momentum alone, so that a drift of the whole changes nothing else.
void TurnAndMove(const MechanismStep& here, double h, double end) {
  const auto& [model, state, ws] = here;
  const Matrix3 R_m = state.reduced.X_WR.rotation();
  state.reduced.z = ws.z_before;
  if (model.size() > 0) state.reduced.z += h * ws.w_mean;
  state.reduced.X_WR = model.mechanism().base() == BaseKind::kDriven ? state.driven_next : ws.X_WR_before;
  Vector3 center_end = Vector3::Zero();  // m, world axes
  if (model.base_size > 0) {
    const Vector3 pushed = R_m * (ws.M_full.middleRows<3>(3) * ws.x - ws.momentum.segment<3>(3));
    const Vector3 turn = h * (R_m * (end * ws.x.head<3>() + (1 - end) * ws.u.head<3>()));
    center_end = ws.center_W + h / ws.M_00(5, 5) * (ws.linear_W + end * pushed);
    state.reduced.X_WR.rotation() = ExpRotation(turn) * state.reduced.X_WR.rotation();
    state.reduced.X_WR.Orthonormalize();
  }
  std::swap(ws.configuration, ws.elsewhere);
  ws.configuration.TakeLoops(ws.elsewhere);
  ws.pose_energy.valid = false;
  Configure(*model.reduced, state.reduced, ws.configuration);
  if (model.base_size > 0)
    state.reduced.X_WR.translation() =
        center_end -
        state.reduced.X_WR.rotation() * CenterOfParts(model.rigid_parts, ws.configuration.kinematics);
}

}  // namespace fork1s
