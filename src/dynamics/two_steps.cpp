// The step of second order in lasting contact: docs/method.md, section 5.
//
// Implicit Euler that knows the past step: the backward differentiation formula of two steps. With a = 3/2
//     w⁺ = a x,   z⁺ = z + h (x + s),   s = (z - z⁻)/3h                      z⁻: before the past step
//     M (w⁺ - u) = (h/a) f(z⁺) + Jᵀλ/a,   u = M⁻¹ Jᵀ (4 ẋ - ẋ⁻)/3
// so that the unknown x, which with s is how far the step goes, obeys
//     (a² M + a h D + h² K) x = a M u + h f(z) - h² K s + Jᵀλ
// and contacts are rows of x + s as they are rows of the end velocity of implicit Euler, found where that
// finds them. With nothing known of the past, a = 1 and s = 0, that is implicit Euler, which what may touch, is
// pulled, or is held by springs and free (euler_free.cpp) takes by kEuler. ẋ, ẋ⁻ are
// as in theta_step.cpp, ẋ⁻ turned freely to here.
#include "mechanism_detail.hpp"

namespace fork1s {

namespace {

// All but how far the step goes. start_velocity is that of the start.
void FillPast(const MechanismStep& here, double h, bool anew, MechanismPast& past) {
  const auto& [model, state, ws] = here;
  past.h = h;
  past.anew = anew;
  past.nu = ws.nu_start;
  past.c_dot_W.noalias() = state.reduced.X_WR.rotation() * ws.start_velocity.c_dot;
  past.omega = ws.start_velocity.omega;
  past.R_WR = state.reduced.X_WR.rotation();
  if (model.base_size > 0) past.center_W = ws.center_W;
}

// ẋ⁻ of the past step, turned freely to here, in other_velocity.
void BringPastHere(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  ws.other_velocity.c_dot.noalias() = state.reduced.X_WR.rotation().transpose() * state.past.c_dot_W;
  ws.other_velocity.omega = state.past.omega;
  TurnFreely(model.rigid_parts, h, ws.other_velocity);
}

}  // namespace

void KeepPast(const MechanismStep& here, double h) {
  if (here.work.rule != StepRule::kEuler) FillPast(here, h, false, here.work.past_next);
}

bool BeginsAnew(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  const MechanismPast& past = state.past;
  if (past.h != h) return true;
  if (!past.anew) return false;
  SeeStart(here, h, StepRule::kTwoSteps);
  BringPastHere(here, h);
  const VectorX& armature = model.mechanism().armature();
  const RigidParts& parts = model.rigid_parts;
  const auto product = [&](const MaterialVelocities& v, const VectorX& v_joints, const MaterialVelocities& y,
                           const VectorX& y_joints) {
    return KineticProduct(parts, v, y) + v_joints.dot(armature.cwiseProduct(y_joints));
  };
  return ParabolaComesBack(product(ws.start_velocity, ws.nu_start, ws.start_velocity, ws.nu_start),
                           product(ws.other_velocity, past.nu, ws.other_velocity, past.nu),
                           product(ws.start_velocity, ws.nu_start, ws.other_velocity, past.nu));
}

void BeginStepInParts(const MechanismStep& here, double h, MechanismPast& past) {
  SeeStart(here, h, StepRule::kTwoSteps);
  FillPast(here, h, true, past);
}

void EndStepInParts(const MechanismStep& here, const MechanismState& start, MechanismPast& past) {
  const auto& [model, state, ws] = here;
  past.z_moved = state.reduced.z - start.reduced.z;
  past.V_R = state.reduced.V_R;
  std::swap(state.past, past);
}

// s, and (4 ẋ - ẋ⁻)/3 in start_velocity.
void TakePast(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  const int r = model.size();
  const MechanismPast& past = state.past;
  const bool known = ws.rule == StepRule::kTwoSteps && past.h == h;
  ws.order = known ? 1.5 : 1;
  ws.contact_shift.setZero();
  ws.nu_mixed = ws.nu_start;
  if (model.mechanism().base() == BaseKind::kDriven) {
    const Vector6 V_last = state.reduced.V_R;
    state.reduced.V_R = DrivenTwist(state, h);
    ws.V_end = known ? Vector6(1.5 * state.reduced.V_R - 0.5 * V_last) : state.reduced.V_R;
  }
  if (!known) return;
  BringPastHere(here, h);
  const Matrix3 R_RW = state.reduced.X_WR.rotation().transpose();
  if (r > 0) ws.contact_shift.tail(r) = past.z_moved / (3 * h);
  if (model.base_size > 0) {
    // Of the base's frame by the turn and the way of the whole's centre of mass, whose momentum it is.
    const Vector3 turn = LogRotation(past.R_WR.transpose() * state.reduced.X_WR.rotation()) / (3 * h);
    Vector3 momentum = ws.M_00(5, 5) / (3 * h) * (R_RW * (ws.center_W - past.center_W));
    momentum -= ws.M_00.block<3, 3>(3, 0) * turn;
    for (int i = 0; i < r; ++i) momentum -= ws.contact_shift(6 + i) * ws.M_0z.col(i).tail<3>();
    ws.contact_shift.head<6>() << turn, momentum / ws.M_00(5, 5);
  }
  ws.start_velocity.c_dot = (4 * ws.start_velocity.c_dot - ws.other_velocity.c_dot) / 3;
  ws.start_velocity.omega = (4 * ws.start_velocity.omega - ws.other_velocity.omega) / 3;
  ws.nu_mixed = (4 * ws.nu_start - past.nu) / 3;
}

// x before contact, from u and the forces at hand.
void SolveFreeTwoSteps(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  const int r = model.size();
  ws.all_at_end = true;
  if (HasSwitches(here)) AddSwitchedForces(here);
  if (model.num_velocities() == 0) return;
  ws.impulse.setZero(model.num_velocities());
  ws.A = ws.order * ws.order * ws.M_full;
  ws.x = ws.order * ws.momentum;
  if (model.base_size > 0) ws.x.head<6>() += h * ws.base_force;
  if (r > 0) {
    // Springs work along x + s, all else in A on x alone.
    auto A_z = ws.A.bottomRightCorner(r, r);
    const auto s = ws.contact_shift.tail(r);
    ws.x.tail(r) += h * ws.f_z;
    A_z += ws.order * h * model.reduced->D;
    TurnDampers(here, h);
    if (ws.order > 1) ws.x.tail(r).noalias() += A_z.selfadjointView<Eigen::Lower>() * s;
    A_z.diagonal() += h * h * model.reduced->K_r;
    TurnSprings(here, h);
    TurnServos(here, h);
    if (ws.order > 1) ws.x.tail(r).noalias() -= A_z.selfadjointView<Eigen::Lower>() * s;
    if (ws.order > 1) AddBackBoundedSprings(here, h, 0, s, ws.x.tail(r));
    SubtractSaturatedStiffness(here, h);
  }
  SolveOrFail(ws.factor, ws.A, ws.x);
}

Vector6 GroupTwistFromStart(const MechanismView& here, int g, const Eigen::Ref<const MatrixX>& J_T) {
  const auto& [model, state, ws] = here;
  Vector6 V = GroupTwist(here, g, J_T);
  if (model.base_size == 0) return V;
  const Vector6& V_R = state.reduced.V_R;
  const Matrix3 turn = ws.X_WR_before.rotation().transpose() * state.reduced.X_WR.rotation();
  V.head<3>() += turn * V_R.head<3>() - V_R.head<3>();
  V.tail<3>() += turn * V_R.tail<3>() - V_R.tail<3>();
  return V;
}

void IntegrateTwoSteps(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  const int r = model.size();
  const bool driven = model.mechanism().base() == BaseKind::kDriven;
  const Matrix3 R_start = state.reduced.X_WR.rotation();
  double work = 0, kinetic = 0;  // J, of a step that matches its energy
  if (ws.matches) {
    TakeBoundsFromPotential(here);
    work = WorkToEnd(here, h);
    if (!driven) kinetic = 0.5 * ws.x.dot(ws.M_full * ws.x);
  }
  ws.w_mean = ws.x.tail(r) + ws.contact_shift.tail(r);
  state.reduced.z += h * ws.w_mean;
  // What was not pushed, by implicit Euler, follows its parabola by the mean velocity.
  const bool falls = ws.rule == StepRule::kEuler && !ws.pushed;
  Vector3 center = Vector3::Zero();
  if (driven) state.reduced.X_WR = state.driven_next;
  if (model.base_size > 0) {
    ws.rhs = ws.x + ws.contact_shift;
    Vector3 momentum = ws.M_full.middleRows<3>(3) * ws.rhs;
    if (falls) {
      ws.rhs.head<6>() = 0.5 * (ws.rhs.head<6>() + ws.V_R_before);
      momentum = 0.5 * (momentum + R_start.transpose() * ws.linear_W);
    }
    center = ws.center_W + h / ws.M_00(5, 5) * (R_start * momentum);
    state.reduced.X_WR.rotation() = R_start * ExpRotation(h * ws.rhs.head<3>());
    state.reduced.X_WR.Orthonormalize();
  }
  // The momenta that the step ends with, part by part.
  Vector6 V = Vector6::Zero();
  if (driven) V = ws.V_end;
  if (model.base_size > 0) V = ws.order * ws.x.head<6>();
  ws.q_ddot.setZero();
  if (r > 0) {
    ws.f_turn = ws.order * ws.x.tail(r);
    AddMotion(*model.reduced, ws.Q_now(), ws.f_turn, ws.q_ddot);
  }
  ComputeMaterialVelocities(model.mechanism(), model.rigid_parts, ws.configuration.kinematics, ws.q_ddot, V,
                            ws.start_velocity);
  OwnMomentum(model.rigid_parts, ws.configuration.kinematics, ws.start_velocity, ws.F_parts);
  ComputeJointVelocities(model.mechanism(), ws.configuration.kinematics, ws.q_ddot, ws.nu_mixed);
  ws.tau = model.mechanism().armature().cwiseProduct(ws.nu_mixed);

  ws.pose_energy.valid = false;
  Configure(*model.reduced, state.reduced, ws.configuration);
  ConvertToCoordinateForces(model.mechanism(), ws.configuration.kinematics, ws.tau);
  UpdateInertia(here);
  if (model.base_size > 0)
    state.reduced.X_WR.translation() =
        center -
        state.reduced.X_WR.rotation() * CenterOfParts(model.rigid_parts, ws.configuration.kinematics);
  CarryMomentum(model.rigid_parts, ws.configuration.kinematics,
                state.reduced.X_WR.rotation().transpose() * R_start, ws.F_parts);
  if (driven) {
    ws.q_ddot.setZero();
    ComputeMaterialVelocities(model.mechanism(), model.rigid_parts, ws.configuration.kinematics, ws.q_ddot,
                              ws.V_end, ws.other_velocity);
    AddMomentum(model.rigid_parts, ws.configuration.kinematics, ws.other_velocity, Matrix3::Identity(), -1,
                ws.F_parts);
  }
  GatherFromParts(model.mechanism(), ws.configuration.kinematics.S, ws.F_parts, ws.tau);
  ws.q_dot = ws.q_dot_start;  // ClosureForces takes the rate of joint rates from it
  VelocityAtEnd(here);
  if (ws.matches) {
    // On a base that moves by itself what turns does not lose all that is not seen.
    const double lost = driven ? 0 : kinetic - 0.5 * ws.x.dot(ws.M_full * ws.x);
    if (!PayForPotential(here, work, lost)) {
      StepAgainHalfWay(here, h);
      return;
    }
  }
  TakeVelocity(here);
  if (ws.rule == StepRule::kEuler) {
    state.past.h = 0;
    return;
  }
  ws.past_next.z_moved = h * ws.w_mean;
  ws.past_next.V_R = ws.V_end;
  std::swap(state.past, ws.past_next);
}

}  // namespace fork1s
