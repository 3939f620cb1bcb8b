#include <fork1s/dynamics/point_response.hpp>

#include <algorithm>
#include <cmath>
#include <fork1s/linalg/solve.hpp>

#include "mechanism_detail.hpp"

namespace fork1s {
namespace {

// Twist in R per velocity [base; w] of a body at the present pose.
Matrix6X BodyVelocityMap(const MechanismView& here, BodyIndex body) {
  const auto& [model, state, ws] = here;
  const Mechanism& m = model.mechanism();
  const int r = model.size(), base = model.base_size;
  Matrix6X J = Matrix6X::Zero(6, base + r);
  if (base > 0) J.leftCols(6).setIdentity();
  if (model.by_twists()) {
    J.rightCols(r) = Dexp(model.reduced->T_of(body) * state.reduced.z) * model.reduced->T_of(body);
    return J;
  }
  for (int j = m.body(body).last_joint; j >= 0; j = m.joint(JointIndex(j)).previous) {
    const auto& joint = m.joint(JointIndex(j));
    J.rightCols(r).noalias() += ws.configuration.kinematics.S.middleCols(joint.offset, joint.size) *
                                ws.Q_now().middleRows(joint.offset, joint.size);
  }
  return J;
}

}  // namespace

// A copy of the state takes the step without the force; its factor of A serves for W.
PointResponse RespondAt(const MechanismView& now, BodyIndex body, const Vector3& point_B, double h,
                        const Vector3& gravity_W) {
  MechanismState state = now.state;
  MechanismWorkspace ws = now.work;
  const MechanismModel& model = now.model;
  const MechanismStep here{model, state, ws};
  const Mechanism& m = model.mechanism();
  PointResponse out;
  out.mass = m.total_mass();
  const RigidTransform& X_WR = state.reduced.X_WR;
  const Vector3 p = BodyPose(here, body) * point_B, p_R = X_WR.inverse() * p;
  Eigen::Matrix<double, 3, 6> at_point;  // twist in R about R's origin -> velocity of the point in the world
  at_point << -X_WR.rotation() * Skew(p_R), X_WR.rotation();
  if (m.base() == BaseKind::kDriven) state.driven_next = X_WR * Exp(h * state.reduced.V_R);

  if (!model.by_twists()) Begin(here, h, gravity_W, StepRule::kEuler);
  Predict(here, h, gravity_W);
  const MatrixX J = at_point * BodyVelocityMap(here, body);
  for (const VelocityRange& part : model.parts) {
    MatrixX Y = J.middleCols(part.begin, part.size).transpose();
    HalfSolve(here, part, Y);
    out.W.noalias() += Y.transpose() * Y;
  }
  if (model.reduced->has_complement && !model.by_twists()) {
    MatrixX J_q = MatrixX::Zero(3, model.reduced->num_coordinates());
    for (int j = m.body(body).last_joint; j >= 0; j = m.joint(JointIndex(j)).previous) {
      const auto& joint = m.joint(JointIndex(j));
      J_q.middleCols(joint.offset, joint.size) =
          at_point * model.reduced->S_ref.middleCols(joint.offset, joint.size);
    }
    VectorX response;
    for (int i = 0; i < 3; ++i) {
      ApplyComplement(*model.reduced, J_q.row(i).transpose(), response);
      out.C.col(i) = J_q * response;
    }
  }
  Integrate(here, h);
  out.p_free = BodyPose(here, body) * point_B;
  out.v_free = (out.p_free - p) / h;
  return out;
}

PointResponse RespondAt(FreeBody body, const Vector3& point_B, double h, const Vector3& gravity_W) {
  PointResponse out;
  const Vector3 p = body.pose() * point_B;
  Eigen::Matrix<double, 3, 6> J;
  J << -Skew(p - body.center_W()), Matrix3::Identity();
  body.Predict(h, gravity_W);
  out.v_free = J * body.PortTwist();
  out.p_free = p + h * out.v_free;
  const Eigen::Matrix<double, 6, 3> Y = body.InverseInertiaRoot() * J.transpose();
  out.W = Y.transpose() * Y;
  out.mass = body.inertia().mass;
  return out;
}

Vector3 EndForce(const PointResponse& at, const PointSpring& spring, double h) {
  const double k = spring.stiffness, c = spring.damping;
  const Matrix3 A = Matrix3::Identity() + (h * h * k + h * c) * at.W + k * at.C;
  const Vector3 force = SolveSquare(A, Vector3(k * (spring.target_W - at.p_free) - c * at.v_free));
  return force.allFinite() ? force : Vector3(Vector3::Zero());
}

double CriticalDamping(const PointResponse& at, double stiffness) {
  const double softest = std::max({at.W(0, 0), at.W(1, 1), at.W(2, 2), 1e-12});
  return 2 * std::sqrt(stiffness * std::min(1 / softest, std::max(at.mass, 1e-9)));
}

}  // namespace fork1s
