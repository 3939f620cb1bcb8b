#include <fork1s/server/pull_spring.hpp>

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace fork1s {
namespace {

struct Softness {
  Matrix3 W = Matrix3::Zero();  // m/s per N·s
  Matrix3 C = Matrix3::Zero();  // m per N, at once
  double mass = 0;              // kg, of what is pulled
};

Softness OfFreeBody(const FreeBody& body, const Vector3& point_W) {
  Softness s;
  Eigen::Matrix<double, 3, 6> J;
  J << -Skew(point_W - body.center_W()), Matrix3::Identity();
  s.W = J * body.InverseInertia() * J.transpose();
  s.mass = body.inertia().mass;
  return s;
}

// Operators about the reference: a pull needs them only to be stable, so that they may be a refresh old.
Softness OfMechanism(const MechanismDynamics& m, BodyIndex body, const Vector3& point_W, double h) {
  const ReducedModel& model = m.model();
  const int r = model.size(), n = model.num_coordinates();
  const RigidTransform& X_WR = m.state().X_WR;
  const Vector3 point_R = X_WR.inverse() * point_W;
  Eigen::Matrix<double, 3, 6> at_point;  // twist in R about R's origin -> velocity of the point in the world
  at_point << -X_WR.rotation() * Skew(point_R), X_WR.rotation();

  const int base = m.mechanism().base() == BaseKind::kFloating ? 6 : 0;
  MatrixX J(3, base + r), J_q = MatrixX::Zero(3, n);
  if (base > 0) J.leftCols(6) = at_point;
  for (int j = m.mechanism().body(body).last_joint; j >= 0; j = m.mechanism().joint(JointIndex(j)).previous) {
    const auto& joint = m.mechanism().joint(JointIndex(j));
    J_q.middleCols(joint.offset, joint.size) = at_point * model.S_ref.middleCols(joint.offset, joint.size);
  }
  J.rightCols(r) = J_q * model.Q;

  MatrixX A = MatrixX::Zero(base + r, base + r);
  A.bottomRightCorner(r, r) = model.M + h * model.D;
  A.bottomRightCorner(r, r).diagonal() += h * h * model.K_r;
  if (base > 0) {
    A.topLeftCorner(6, 6) = model.M_00;
    A.topRightCorner(6, r) = model.M_0z;
    A.bottomLeftCorner(r, 6) = model.M_0z.transpose();
  }
  Softness s;
  s.mass = m.mechanism().total_mass();
  if (base + r > 0) s.W = J * A.ldlt().solve(J.transpose());
  if (model.has_complement) {
    VectorX response;
    for (int i = 0; i < 3; ++i) {
      ApplyComplement(model, J_q.row(i).transpose(), response);
      s.C.col(i) = J_q * response;
    }
  }
  return s;
}

}  // namespace

Vector3 PullForce(const Simulation& simulation, int body, const Vector3& point_B, const Vector3& target_W,
                  double stiffness, const Vector3& last_force_W) {
  const SceneBody& b = simulation.bodies()[static_cast<std::size_t>(body)];
  const World& world = simulation.world();
  const double h = simulation.dt();
  const RigidTransform X_WB = simulation.Pose(body);
  const Vector3 p = X_WB * point_B;
  const Vector6 V = simulation.Velocity(body);
  const Vector3 v = V.tail<3>() + V.head<3>().cross(p - X_WB.translation());
  const Softness s = b.mechanism < 0 ? OfFreeBody(world.free_bodies()[static_cast<std::size_t>(b.index)], p)
                                     : OfMechanism(world.mechanisms()[static_cast<std::size_t>(b.mechanism)],
                                                   BodyIndex(b.index), p, h);

  // Critical for what the point moves along its softest direction, never for more than the whole mass.
  const double softest = std::max({s.W(0, 0), s.W(1, 1), s.W(2, 2), 1e-12});
  const double damper = 2 * std::sqrt(stiffness * std::min(1 / softest, std::max(s.mass, 1e-9)));
  const Matrix3 A = Matrix3::Identity() + (h * h * stiffness + h * damper) * s.W + stiffness * s.C;
  const Vector3 rhs = stiffness * (target_W - p - h * v + s.C * last_force_W) - damper * v;
  const Vector3 force = A.partialPivLu().solve(rhs);
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
  for (const MechanismDynamics& m : simulation.world().mechanisms())
    for (const BodyDef& b : m.mechanism().definition().bodies) add(body++, b.geometries);
  for (const FreeBodyDef& b : simulation.scene().free_bodies) add(body++, b.geometries);
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
