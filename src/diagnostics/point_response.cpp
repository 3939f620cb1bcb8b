#include "point_response.hpp"

#include <algorithm>
#include <cmath>

#include "stepping/mechanism_detail.hpp"

namespace fork1s {
namespace {

// Twist in R per velocity [base; w] of a body at the present pose.
Matrix6X BodyVelocityMap(const ConstStepContext& here, BodyIndex body) {
  const auto& [model, state, ws] = here;
  const Mechanism& m = model.mechanism();
  const int r = model.size(), base = model.base_size;
  Matrix6X J = Matrix6X::Zero(6, base + r);
  if (base > 0) J.leftCols(6).setIdentity();
  for (int j = m.body(body).last_joint; j >= 0; j = m.joint(JointIndex(j)).previous) {
    const auto& joint = m.joint(JointIndex(j));
    J.rightCols(r).noalias() += ws.configuration.kinematics.S.middleCols(joint.offset, joint.size) *
                                ws.Q_now().middleRows(joint.offset, joint.size);
  }
  return J;
}

}  // namespace

// In a workspace of its own.
PointResponse RespondAt(const ConstStepContext& now, BodyIndex body, const Vector3& point_B, double h) {
  MechanismState state = now.state;
  MechanismWorkspace ws = now.work;
  const MechanismModel& model = now.model;
  const StepContext here{model, state, ws};
  UseExactPose(here);
  PointResponse out;
  out.mass = model.mechanism().total_mass();
  const RigidTransform& X_WR = state.reduced.X_WR;
  const Vector3 p_R = X_WR.inverse() * (BodyPose(here, body) * point_B);
  Eigen::Matrix<double, 3, 6> at_point;  // twist in R about R's origin -> velocity of the point in the world
  at_point << -X_WR.rotation() * Skew(p_R), X_WR.rotation();
  StartStageMatrix(here, h);
  const MatrixX J = at_point * BodyVelocityMap(here, body);
  for (const VelocityRange& part : model.parts) {
    MatrixX Y = J.middleCols(part.begin, part.size).transpose();
    HalfSolve(here, part, Y);
    out.W.noalias() += Y.transpose() * Y;
  }
  return out;
}

PointResponse RespondAt(const FreeBody& body, const Vector3& point_B) {
  Eigen::Matrix<double, 3, 6> J;
  J << -Skew(body.pose() * point_B - body.center_W()), Matrix3::Identity();
  const Eigen::Matrix<double, 6, 3> Y = body.InverseInertiaRoot() * J.transpose();
  return {Y.transpose() * Y, body.inertia().mass};
}

double CriticalDamping(const PointResponse& at, double stiffness) {
  const double softest = std::max({at.W(0, 0), at.W(1, 1), at.W(2, 2), 1e-12});
  return 2 * std::sqrt(stiffness * std::min(1 / softest, std::max(at.mass, 1e-9)));
}

}  // namespace fork1s
