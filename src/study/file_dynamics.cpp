#include "study/file_dynamics.hpp"

#include <algorithm>

#include "linalg/rank.hpp"
#include "linalg/solve.hpp"

namespace fork1s {
namespace {

bool HasDynamics(const Mechanism& mechanism, Eigen::Index control) {
  return mechanism.definition().controls[static_cast<std::size_t>(control)].dynamics !=
         ControlDynamics::kNone;
}

KeyframeDef WithoutVelocities(KeyframeDef state) {
  for (KeyframeDef::MechanismState& m : state.mechanisms) {
    m.q_dot.setZero();
    m.V_R.setZero();
  }
  for (KeyframeDef::FreeBodyState& b : state.free_bodies) {
    b.omega_W.setZero();
    b.velocity_W.setZero();
  }
  return state;
}

}  // namespace

FileDynamics::FileDynamics(const Simulation& simulation, const std::vector<FileJoint>& joints)
    : simulation_(simulation) {
  const Scene& scene = simulation.scene();
  KeyframeDef state = WithoutVelocities(simulation.State());
  Eigen::Index size = 0, first_control = 0;
  for (std::size_t i = 0; i < scene.mechanisms.size(); ++i) {
    const Mechanism& mechanism = simulation.given_mechanism(static_cast<int>(i));
    const auto num_controls = static_cast<Eigen::Index>(mechanism.controls().size());
    Part part{&mechanism,
              Kinematics(mechanism),
              state.mechanisms[i].q,
              simulation.controls().segment(first_control, num_controls),
              state.mechanisms[i].X_WR,
              mechanism.base() == BaseKind::kFloating,
              size};
    ComputeKinematics(mechanism, part.q, part.kinematics);
    const VectorX& activation = state.mechanisms[i].activation;
    for (Eigen::Index k = 0; k < activation.size(); ++k)
      if (HasDynamics(mechanism, k)) part.controls(k) = activation(k);
    size += part.size();
    first_control += num_controls;
    parts_.push_back(std::move(part));
  }
  first_free_body_ = size;
  for (const KeyframeDef::FreeBodyState& b : state.free_bodies) X_WF_.push_back(b.X_WB);
  size += 6 * static_cast<Eigen::Index>(X_WF_.size());

  // T column by column: file velocities are linear in the natural ones.
  MatrixX T(size, size);
  const auto set_column = [&](Eigen::Index k, double& w) {
    w = 1;
    const VectorX v = ComputeFileState(joints, scene, state).velocities;
    FORK1S_REQUIRE(v.size() == size, "joints with", v.size(), "velocities for a scene with", size,
                   "; give MovingJoints of the file that it was read from");
    T.col(k) = v;
    w = 0;
  };
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    KeyframeDef::MechanismState& m = state.mechanisms[i];
    for (int k = 0; parts_[i].floats && k < 6; ++k) set_column(parts_[i].first + k, m.V_R(k));
    for (Eigen::Index k = 0; k < m.q_dot.size(); ++k) set_column(parts_[i].first_joint() + k, m.q_dot(k));
  }
  for (std::size_t i = 0; i < X_WF_.size(); ++i)
    for (int k = 0; k < 6; ++k) {
      KeyframeDef::FreeBodyState& b = state.free_bodies[i];
      set_column(first_free_body_ + 6 * static_cast<Eigen::Index>(i) + k,
                 k < 3 ? b.omega_W(k) : b.velocity_W(k - 3));
    }
  to_natural_ = SolveSquare(T, MatrixX::Identity(size, size));
}

MatrixX FileDynamics::ComputeMassMatrix() const {
  MatrixX M = MatrixX::Zero(size(), size());
  for (const Part& part : parts_) {
    const Eigen::Index n = part.q.size(), first = part.first_joint();
    MatrixX M_qq;
    MassMatrix(*part.mechanism, part.kinematics, M_qq);
    M.block(first, first, n, n) = M_qq;
    if (!part.floats) continue;
    Matrix6 M_00;
    Matrix6X M_0q;
    BaseInertia(*part.mechanism, part.kinematics, M_00, M_0q);
    M.block<6, 6>(part.first, part.first) = M_00;
    M.block(part.first, first, 6, n) = M_0q;
    M.block(first, part.first, n, 6) = M_0q.transpose();
  }
  for (std::size_t i = 0; i < X_WF_.size(); ++i) {
    const RigidTransform axes(X_WF_[i].rotation(), Vector3::Zero());
    const Eigen::Index at = first_free_body_ + 6 * static_cast<Eigen::Index>(i);
    M.block<6, 6>(at, at) = Transform(axes, simulation_.scene().free_bodies[i].inertia).Matrix();
  }
  return to_natural_.transpose() * M * to_natural_;
}

MatrixX FileDynamics::ComputeJacobian(int body, const Vector3& point_B) const {
  internal::RequireIndex("body", body, simulation_.bodies().size());
  FORK1S_REQUIRE(point_B.allFinite(), "the point", point_B.transpose(), "m; give finite lengths");
  const SceneBody& b = simulation_.bodies()[static_cast<std::size_t>(body)];
  MatrixX J = MatrixX::Zero(6, size());
  if (b.given < 0) {
    const std::size_t i = static_cast<std::size_t>(body) - (simulation_.bodies().size() - X_WF_.size());
    const Eigen::Index at = first_free_body_ + 6 * static_cast<Eigen::Index>(i);
    J.block<6, 6>(0, at).setIdentity();
    J.block<3, 3>(3, at) = -Skew(X_WF_[i].rotation() * point_B);
    return J * to_natural_;
  }
  const Part& part = parts_[static_cast<std::size_t>(b.given)];
  const BodyIndex index(b.index - simulation_.place(b.given).first_body);
  // [ω; v] of the point from a twist in R about the origin of R.
  const Vector3 p_R = part.kinematics.X_RB[index.u()] * point_B;
  Matrix6 at_point = Matrix6::Identity();
  at_point.block<3, 3>(3, 0) = -Skew(p_R);
  Matrix6 to_world = Matrix6::Zero();
  to_world.block<3, 3>(0, 0) = to_world.block<3, 3>(3, 3) = part.X_WR.rotation();
  const Matrix6 map = to_world * at_point;
  if (part.floats) J.block<6, 6>(0, part.first) = map;
  J.block(0, part.first_joint(), 6, part.q.size()) =
      map * BodyJacobian(*part.mechanism, part.kinematics, index);
  return J * to_natural_;
}

VectorX FileDynamics::ComputeGravityForce() const {
  VectorX f = VectorX::Zero(size());
  const Vector3& g_W = simulation_.step_options().gravity;
  for (const Part& part : parts_) {
    const Vector3 g_R = part.X_WR.rotation().transpose() * g_W;
    Matrix6X F = Matrix6X::Zero(6, part.mechanism->num_bodies());
    AddGravityWrenches(*part.mechanism, part.kinematics, g_R, F);
    if (part.floats) f.segment<6>(part.first) = F.rowwise().sum();
    VectorX tau = VectorX::Zero(part.q.size());
    AccumulateGeneralizedForce(*part.mechanism, part.kinematics.S, F, tau);
    f.segment(part.first_joint(), part.q.size()) = tau;
  }
  for (std::size_t i = 0; i < X_WF_.size(); ++i) {
    const FreeBodyDef& def = simulation_.scene().free_bodies[i];
    const Vector3 weight = (1 - def.gravity_compensation) * def.inertia.mass * g_W;
    f.segment<6>(first_free_body_ + 6 * static_cast<Eigen::Index>(i))
        << (X_WF_[i].rotation() * def.inertia.center).cross(weight),
        weight;
  }
  return to_natural_.transpose() * f;
}

void FileDynamics::AddSpringAndControlForce(const Part& part, const VectorX& controls, VectorX& f) const {
  const Mechanism& m = *part.mechanism;
  VectorX tau = VectorX::Zero(part.q.size());
  SpringForce(m, part.kinematics, part.q, tau);
  if (controls.size() > 0) AddControlForce(m, part.kinematics, controls, tau);
  for (const Mechanism::ForceLimit& limit : m.force_limits()) {
    double force = -limit.stiffness * (LengthOf(m, limit.length, part.kinematics, part.q) - limit.rest);
    for (const auto& [control, gain] : limit.inputs) force += gain * controls(control);
    const double beyond = std::clamp(force, limit.lower, limit.upper) - force;
    if (beyond != 0)
      ForEachArm(limit.length, part.kinematics.paths, [&](int i, double arm) { tau(i) += arm * beyond; });
  }
  f.segment(part.first_joint(), part.q.size()) += tau;
}

VectorX FileDynamics::ComputeSpringAndControlForce() const {
  VectorX f = VectorX::Zero(size());
  for (const Part& part : parts_) AddSpringAndControlForce(part, part.controls, f);
  return to_natural_.transpose() * f;
}

// min |f₀ + B u + Aᵀ λ| over controls u and loop reactions λ of each mechanism, rotations over its length scale. Controls
// beyond their limits are set to these, and the others found again.
HoldingControls FileDynamics::ComputeHoldingControls() const {
  HoldingControls out;
  const VectorX gravity = ComputeGravityForce();
  VectorX f = VectorX::Zero(size());
  std::vector<double> all;
  // In natural velocities.
  const VectorX weight = SolveSquare(to_natural_.transpose(), gravity);
  for (const Part& part : parts_) {
    const Mechanism& m = *part.mechanism;
    const auto num_controls = static_cast<Eigen::Index>(m.controls().size());
    const Eigen::Index n = part.q.size();
    VectorX rows(n);
    for (Eigen::Index k = 0; k < n; ++k) rows(k) = m.Turns(static_cast<int>(k)) ? 1 / m.length_scale() : 1;
    MatrixX A(m.num_constraints(), n);
    if (m.num_constraints() > 0) ClosureJacobian(m, part.kinematics, part.q, A);
    MatrixX B = MatrixX::Zero(n, num_controls);
    for (Eigen::Index k = 0; k < num_controls; ++k) {
      VectorX column = VectorX::Zero(n);
      AddControlForce(m, part.kinematics, VectorX::Unit(num_controls, k), column);
      B.col(k) = column;
    }
    VectorX without = VectorX::Zero(n);
    SpringForce(m, part.kinematics, part.q, without);
    without += weight.segment(part.first_joint(), n);
    VectorX u = VectorX::Zero(num_controls), reactions = VectorX::Zero(A.rows());
    std::vector<char> is_fixed(static_cast<std::size_t>(num_controls));
    for (bool changed = n > 0; changed;) {
      MatrixX columns(n, num_controls + A.rows());
      columns << B, A.transpose();
      VectorX rest = without;
      for (Eigen::Index k = 0; k < num_controls; ++k)
        if (is_fixed[static_cast<std::size_t>(k)]) {
          rest += B.col(k) * u(k);
          columns.col(k).setZero();
        }
      columns = rows.asDiagonal() * columns;
      VectorX norms = columns.colwise().norm().transpose();
      for (Eigen::Index k = 0; k < norms.size(); ++k) {
        norms(k) = norms(k) > 0 ? norms(k) : 1;
        columns.col(k) /= norms(k);
      }
      const VectorX x =
          LeastNormSolve(columns, -(rows.asDiagonal() * rest), kRankThreshold).col(0).cwiseQuotient(norms);
      reactions = x.tail(A.rows());
      changed = false;
      for (Eigen::Index k = 0; k < num_controls; ++k) {
        if (is_fixed[static_cast<std::size_t>(k)]) continue;
        const Mechanism::Control& control = m.controls()[static_cast<std::size_t>(k)];
        const ControlDef& def = m.definition().controls[static_cast<std::size_t>(k)];
        u(k) = HasDynamics(m, k) ? std::clamp(x(k), def.activation_lower, def.activation_upper)
                                 : std::clamp(x(k), control.lower, control.upper);
        if (u(k) == x(k)) continue;
        is_fixed[static_cast<std::size_t>(k)] = changed = true;
      }
    }
    AddSpringAndControlForce(part, u, f);
    f.segment(part.first_joint(), n) += A.transpose() * reactions;
    all.insert(all.end(), u.data(), u.data() + u.size());
  }
  out.controls = Eigen::Map<const VectorX>(all.data(), static_cast<Eigen::Index>(all.size()));
  out.residual = to_natural_.transpose() * f + gravity;
  return out;
}

}  // namespace fork1s
