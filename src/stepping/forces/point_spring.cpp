// A point spring in a stage of a mechanism.
//
// With x and J v position and velocity of its point, t the target, F = k (t - x) its force without the
// damper,
//     f = Jᵀ (F - c J v),   -∂f/∂x = k Jᵀ J + K_g,   -∂f/∂v = c Jᵀ J
// K_g, the geometric stiffness of the force F - c J v, is that of a constant force (applied_forces.cpp). The
// change of J v with the pose is left out, by which the iteration contracts by the turn of a stage.
#include "forces.hpp"

namespace fork1s {

void SetPointSpring(const StepContext& ctx, BodyIndex body, const PointSpring& spring) {
  FORK1S_REQUIRE(body.valid() && body.value() < ctx.model.mechanism().num_bodies(), body.value());
  ctx.state.point_spring = spring;
  ctx.state.point_spring_body = body;
}

void EvaluatePointSpring(const StepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  const PointSpring& spring = state.point_spring;
  const RigidTransform& X_WR = state.reduced.X_WR;
  const Vector3 p = ws.configuration.kinematics.X_RB[state.point_spring_body.u()] * spring.point_B;
  ws.point_spring.point_R = p;
  ws.point_spring.force_R = X_WR.rotation().transpose() * spring.SpringForce(X_WR * p);
  ws.point_spring.base_velocity_R.setZero();
  if (model.mechanism().base() == BaseKind::kDriven)
    ws.point_spring.base_velocity_R = state.reduced.V_R.tail<3>() + state.reduced.V_R.head<3>().cross(p);
  const int base = model.base_size;
  ws.point_spring.J.setZero();
  if (base > 0) ws.point_spring.J.leftCols<6>() << -Skew(p), Matrix3::Identity();
  if (const int joint = model.mechanism().body(state.point_spring_body).last_joint; joint >= 0) {
    const auto T = ws.jacobian.T(joint);
    auto J = ws.point_spring.J.middleCols(base + ws.jacobian.begin(joint), T.cols());
    J = T.bottomRows<3>();
    J.noalias() -= Skew(p).lazyProduct(T.topRows<3>());
  }
  const Vector3 force = PointSpringForce(ctx);
  if (model.size() > 0)
    ws.forces.f_z.noalias() += ws.point_spring.J.rightCols(model.size()).transpose() * force;
  if (base > 0) ws.forces.base.noalias() += ws.point_spring.J.leftCols<6>().transpose() * force;
}

Vector3 PointSpringForce(const ConstStepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  const Vector3 velocity = ws.point_spring.base_velocity_R + ws.point_spring.J * ws.stage.v_k;
  return ws.point_spring.force_R - state.point_spring.damping * velocity;
}

void AddPointSpringOperator(const StepContext& ctx, double b) {
  const auto& [model, state, ws] = ctx;
  const PointSpring& spring = state.point_spring;
  const Matrix3X& J = ws.point_spring.J;
  ws.matrix.A.triangularView<Eigen::Lower>() += spring.ImplicitMass(b) * J.transpose().lazyProduct(J);
}

}  // namespace fork1s
