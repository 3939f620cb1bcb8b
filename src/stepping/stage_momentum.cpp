// Momenta of a mechanism in the flat space of a two-stage step.
//
// Momenta are taken about a point that moves evenly with the base, in axes that stand still: a flat space, in
// which the momentum of the whole is exact, linear and angular, and a drift of the whole changes nothing.
#include "stage_momentum.hpp"

#include "mechanism_detail.hpp"

namespace fork1s {
namespace {

const RigidTransform kIdentity;

// Centre of mass of a part in R.
Vector3 CenterOfPart(const StepContext& ctx, int part) {
  const auto at = static_cast<std::size_t>(part);
  const RigidTransform& X = part == 0 ? kIdentity : ctx.work.configuration.kinematics.P[at - 1];
  return X * ctx.model.rigid_parts.parts[at].inertia_R0.center;
}

// The point that momenta are taken about, from R's origin, in R [m], and the rotation from R to the axes at
// the start.
struct MomentumFrame {
  Vector3 point, drift;
  Matrix3 R_start_now;
};
MomentumFrame FrameOf(const StepContext& ctx, double time) {
  const auto& [model, state, ws] = ctx;
  const Matrix3 R_T = state.reduced.X_WR.rotation().transpose();
  return {R_T * (ws.start.X_WR.translation() + time * ws.start.drift_W - state.reduced.X_WR.translation()),
          R_T * ws.start.drift_W, ws.start.X_WR.rotation().transpose() * state.reduced.X_WR.rotation()};
}

// momentum_change.parts <- momenta of `base` as wrenches in R about R's origin at the pose at hand.
void ExpressMomenta(const StepContext& ctx, double time, const StageBase& base) {
  const auto& [model, state, ws] = ctx;
  ws.momentum_change.parts = base.momentum;
  if (!model.base_moves()) return;
  const MomentumFrame frame = FrameOf(ctx, time);
  const Matrix3 R_now_start = frame.R_start_now.transpose();
  for (int i = 0; i < model.rigid_parts.size(); ++i) {
    const double mass = model.rigid_parts.parts[static_cast<std::size_t>(i)].inertia_R0.mass;
    if (mass == 0) continue;
    auto p = ws.momentum_change.parts.col(i);
    const Vector3 linear = R_now_start * p.tail<3>();
    const Vector3 angular = R_now_start * p.head<3>() + frame.point.cross(linear) +
                            CenterOfPart(ctx, i).cross(mass * frame.drift);
    p << angular, linear + mass * frame.drift;
  }
}

// The inverse of FlattenWrench.
Vector6 ExpressFlatWrench(const StepContext& ctx, double time, const Vector6& flat) {
  const MomentumFrame frame = FrameOf(ctx, time);
  const Matrix3 R_now_start = frame.R_start_now.transpose();
  const Vector3 force = R_now_start * flat.tail<3>();
  Vector6 out;
  out << R_now_start * flat.head<3>() + frame.point.cross(force), force;
  return out;
}

// velocities <- of joints and of the parts, at v [num_velocities] and the pose
// at hand.
void ComputeVelocities(const StepContext& ctx, const VectorX& v) {
  const auto& [model, state, ws] = ctx;
  Vector6 V = Vector6::Zero();
  if (model.base_size > 0) V = v.head<6>();
  if (model.mechanism().base() == BaseKind::kDriven) V = state.reduced.V_R;
  ws.velocities.q_dot.setZero();
  if (model.size() > 0) {
    ws.velocities.w = v.tail(model.size());
    AddMotion(*model.reduced, ws.Q_now(), ws.velocities.w, ws.velocities.q_dot);
  }
  ComputeMaterialVelocities(model.mechanism(), model.rigid_parts, ws.configuration.kinematics,
                            ws.velocities.q_dot, V, ws.velocities.parts);
  ComputeJointVelocities(model.mechanism(), ws.configuration.kinematics, ws.velocities.q_dot,
                         ws.velocities.joint);
}

}  // namespace

// Spatial momenta of the parts at velocity x [num_velocities], in the flat space of the step.
void ComputeFlatMomenta(const StepContext& ctx, double time, StageBase& out) {
  const auto& [model, state, ws] = ctx;
  if (ws.expansion.in_use) return ComputeExpandedMomenta(ctx, out);
  ComputeVelocities(ctx, ws.x);
  out.momentum.setZero(6, model.rigid_parts.size());
  out.momentum_defect.setZero();
  AddMomentum(model.rigid_parts, ws.configuration.kinematics, ws.velocities.parts, Matrix3::Identity(), 1,
              out.momentum);
  out.joint_momentum = model.mechanism().armature().cwiseProduct(ws.velocities.joint);
  if (!model.base_moves()) return;
  const MomentumFrame frame = FrameOf(ctx, time);
  for (int i = 0; i < model.rigid_parts.size(); ++i) {
    const double mass = model.rigid_parts.parts[static_cast<std::size_t>(i)].inertia_R0.mass;
    if (mass == 0) continue;
    auto p = out.momentum.col(i);
    const Vector3 linear = p.tail<3>() - mass * frame.drift;
    const Vector3 angular =
        p.head<3>() - CenterOfPart(ctx, i).cross(mass * frame.drift) - frame.point.cross(linear);
    p << frame.R_start_now * angular, frame.R_start_now * linear;
  }
}

// A wrench in R about R's origin as a change of momentum in the flat space of the step.
Vector6 FlattenWrench(const StepContext& ctx, double time, const Vector6& wrench) {
  const MomentumFrame frame = FrameOf(ctx, time);
  const Vector3 force = wrench.tail<3>();
  Vector6 out;
  out << frame.R_start_now * (wrench.head<3>() - frame.point.cross(force)), frame.R_start_now * force;
  return out;
}

Vector6 Total(const StageBase& base) { return base.momentum.rowwise().sum() + base.momentum_defect; }

// momentum <- J(x)ᵀ (p of `base` - p(v, x)) at the pose at hand, with the impulse that dampers of joints give
// within b.
void ComputeMomentumResidual(const StepContext& ctx, double time, const StageBase& base, const VectorX& v,
                             double b) {
  const auto& [model, state, ws] = ctx;
  if (ws.expansion.in_use) return ComputeExpandedMomentumChange(ctx, base, v, b);
  ExpressMomenta(ctx, time, base);
  ComputeVelocities(ctx, v);
  AddMomentum(model.rigid_parts, ws.configuration.kinematics, ws.velocities.parts, Matrix3::Identity(), -1,
              ws.momentum_change.parts);
  ws.momentum_change.part_impulses = ws.momentum_change.parts.bottomRows<3>();
  ws.momentum_change.joint =
      base.joint_momentum -
      (model.mechanism().armature() + b * model.mechanism().damping()).cwiseProduct(ws.velocities.joint);
  ConvertToCoordinateForces(model.mechanism(), ws.configuration.kinematics, ws.momentum_change.joint);
  GatherFromParts(model.mechanism(), ws.configuration.kinematics.S, ws.momentum_change.parts,
                  ws.momentum_change.joint);
  if (b > 0) {
    AddSpringDampers(ctx, b, ws.velocities.q_dot, ws.momentum_change.joint);
    AddMuscleDampers(ctx, b, ws.velocities.q_dot, ws.momentum_change.joint);
  }
  if (model.size() > 0) {
    ReduceForce(*model.reduced, ws.Q_now(), ws.momentum_change.joint, ws.momentum_change.reduced);
    if (b > 0 && model.at_reference.closure_damping.size() > 0)
      ws.momentum_change.reduced.noalias() -=
          b * model.at_reference.closure_damping.selfadjointView<Eigen::Lower>() * ws.velocities.w;
    ws.momentum_change.all.tail(model.size()) = ws.momentum_change.reduced;
  }
  if (model.base_size > 0)
    ws.momentum_change.all.head<6>() =
        ws.momentum_change.parts.col(0) + ExpressFlatWrench(ctx, time, base.momentum_defect);
}

// Of a floating mechanism, world axes [N s].
Vector3 LinearMomentum(const StepContext& ctx, const StageBase& of) {
  const auto& [model, state, ws] = ctx;
  if (model.base_size == 0) return Vector3::Zero();
  return ws.start.X_WR.rotation() * Total(of).tail<3>() + ws.mass.M_00(5, 5) * ws.start.drift_W;
}

}  // namespace fork1s
