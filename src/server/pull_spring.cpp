#include <fork1s/dynamics/mechanism_dynamics.hpp>
#include <fork1s/server/pull_spring.hpp>

#include <algorithm>
#include <cmath>
#include <fork1s/linalg/solve.hpp>

namespace fork1s {
namespace {

// Where the next step would carry the point, and how it gives way.
struct Response {
  Vector3 p_free = Vector3::Zero();  // m
  Vector3 v_free = Vector3::Zero();  // m/s
  Matrix3 W = Matrix3::Zero();       // m/s per N·s
  Matrix3 C = Matrix3::Zero();       // m per N, at once
  double mass = 0;                   // kg, of all that hangs on it
};

Response OfFreeBody(FreeBody body, const Vector3& point_B, double h, const Vector3& gravity) {
  Response out;
  const Vector3 p = body.pose() * point_B;
  Eigen::Matrix<double, 3, 6> J;
  J << -Skew(p - body.center_W()), Matrix3::Identity();
  body.Predict(h, gravity);
  out.v_free = J * body.PortTwist();
  out.p_free = p + h * out.v_free;
  const Eigen::Matrix<double, 6, 3> Y = body.InverseInertiaRoot() * J.transpose();
  out.W = Y.transpose() * Y;
  out.mass = body.inertia().mass;
  return out;
}

// Twist in R per velocity [base; w] of a body at the present pose.
Matrix6X BodyVelocityMap(const MechanismDynamics& m, BodyIndex body) {
  const ReducedModel& model = m.model();
  const int r = model.size(), base = m.num_velocities() - r;
  Matrix6X J = Matrix6X::Zero(6, base + r);
  if (base > 0) J.leftCols(6).setIdentity();
  if (m.recovery() == Recovery::kTwist) {
    J.rightCols(r) = Dexp(model.T_of(body) * m.state().z) * model.T_of(body);
    return J;
  }
  const Configuration& now = m.configuration();
  for (int j = m.mechanism().body(body).last_joint; j >= 0; j = m.mechanism().joint(JointIndex(j)).previous) {
    const auto& joint = m.mechanism().joint(JointIndex(j));
    J.rightCols(r).noalias() += now.kinematics.S.middleCols(joint.offset, joint.size) *
                                now.Q_now.middleRows(joint.offset, joint.size);
  }
  return J;
}

// A copy of the mechanism takes the step without the pull; its factor of A serves for W.
Response OfMechanism(MechanismDynamics m, BodyIndex body, const Vector3& point_B, double h,
                     const Vector3& gravity) {
  Response out;
  out.mass = m.mechanism().total_mass();
  const ReducedModel& model = m.model();
  const RigidTransform& X_WR = m.state().X_WR;
  const Vector3 p = m.BodyPose(body) * point_B, p_R = X_WR.inverse() * p;
  Eigen::Matrix<double, 3, 6> at_point;  // twist in R about R's origin -> velocity of the point in the world
  at_point << -X_WR.rotation() * Skew(p_R), X_WR.rotation();
  if (m.mechanism().base() == BaseKind::kDriven) m.DriveBase(X_WR * Exp(h * m.state().V_R));

  if (m.recovery() != Recovery::kTwist) m.Begin(h, gravity, StepRule::kEuler);
  m.Predict(h, gravity);
  const MatrixX J = at_point * BodyVelocityMap(m, body);
  for (const MechanismDynamics::Part& part : m.parts()) {
    MatrixX Y = J.middleCols(part.begin, part.size).transpose();
    m.HalfSolve(part, Y);
    out.W.noalias() += Y.transpose() * Y;
  }
  if (model.has_complement && m.recovery() != Recovery::kTwist) {
    MatrixX J_q = MatrixX::Zero(3, model.num_coordinates());
    for (int j = m.mechanism().body(body).last_joint; j >= 0;
         j = m.mechanism().joint(JointIndex(j)).previous) {
      const auto& joint = m.mechanism().joint(JointIndex(j));
      J_q.middleCols(joint.offset, joint.size) = at_point * model.S_ref.middleCols(joint.offset, joint.size);
    }
    VectorX response;
    for (int i = 0; i < 3; ++i) {
      ApplyComplement(model, J_q.row(i).transpose(), response);
      out.C.col(i) = J_q * response;
    }
  }
  m.Integrate(h);
  out.p_free = m.BodyPose(body) * point_B;
  out.v_free = (out.p_free - p) / h;
  return out;
}

}  // namespace

Vector3 PullForce(const Simulation& simulation, int body, const Vector3& point_B, const Vector3& target_W,
                  double stiffness) {
  const SceneBody& b = simulation.bodies()[static_cast<std::size_t>(body)];
  const World& world = simulation.world();
  const double h = simulation.dt();
  const Vector3& gravity = simulation.step_options().gravity;
  const auto index = static_cast<std::size_t>(b.mechanism < 0 ? b.index : b.mechanism);
  const Response s = b.mechanism < 0
                         ? OfFreeBody(world.free_bodies()[index], point_B, h, gravity)
                         : OfMechanism(world.mechanisms()[index], BodyIndex(b.index), point_B, h, gravity);

  // Critical for what the point moves along its softest direction, never for more than the whole mass.
  const double softest = std::max({s.W(0, 0), s.W(1, 1), s.W(2, 2), 1e-12});
  const double damper = 2 * std::sqrt(stiffness * std::min(1 / softest, std::max(s.mass, 1e-9)));
  const Matrix3 A = Matrix3::Identity() + (h * h * stiffness + h * damper) * s.W + stiffness * s.C;
  const Vector3 force =
      SolveSquare(A, Vector3(stiffness * (target_W - s.p_free) - damper * s.v_free));
  return force.allFinite() ? force : Vector3(Vector3::Zero());
}

double SceneRadius(const Simulation& simulation) {
  Vector3 low = Vector3::Constant(1e300), high = -low;
  auto add = [&](int body, const std::vector<GeometryDef>& geometries) {
    const RigidTransform X_WB = simulation.Pose(body);
    low = low.cwiseMin(X_WB.translation());
    high = high.cwiseMax(X_WB.translation());
    for (const GeometryDef& g : geometries) {
      const double radius = BoundingRadius(g.shape);
      if (!std::isfinite(radius)) continue;
      const Vector3 at = X_WB * g.X_BG.translation();
      low = low.cwiseMin(at.array().matrix() - Vector3::Constant(radius));
      high = high.cwiseMax(at.array().matrix() + Vector3::Constant(radius));
    }
  };
  int body = 0;
  for (const SceneBody& b : simulation.bodies()) {
    const auto index = static_cast<std::size_t>(b.index);
    if (b.mechanism < 0) {
      add(body++, simulation.present_scene().free_bodies[index].geometries);
      continue;
    }
    const Mechanism& m = simulation.world().mechanisms()[static_cast<std::size_t>(b.mechanism)].mechanism();
    add(body++, m.definition().bodies[index].geometries);
  }
  return body == 0 ? 1 : std::max(1e-3, 0.5 * (high - low).norm());
}

double SuggestPullStiffness(const Simulation& simulation) {
  double mass = 0;
  for (const MechanismDynamics& m : simulation.world().mechanisms()) mass += m.mechanism().total_mass();
  for (const FreeBody& b : simulation.world().free_bodies()) mass += b.inertia().mass;
  const double wanted = 2 * std::max(mass, 1e-3) * 9.81 / (0.2 * SceneRadius(simulation));
  // Two figures: it is shown on a slider.
  const double step = std::pow(10, std::floor(std::log10(wanted)) - 1);
  return std::round(wanted / step) * step;
}

}  // namespace fork1s
