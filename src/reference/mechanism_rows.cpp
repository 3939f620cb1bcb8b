// Constraint rows between bodies in full coordinates.
#include <cmath>

#include "full_mechanism.hpp"

namespace fork1s::internal {
namespace {

Matrix6X Screws(const JointDef& joint) {
  Matrix6X S(6, static_cast<Eigen::Index>(joint.freedoms.size()));
  for (Eigen::Index i = 0; i < S.cols(); ++i) S.col(i) = joint.freedoms[static_cast<std::size_t>(i)].screw_B;
  return S;
}

}  // namespace

RigidTransform FullMechanism::LinkPose(const Link& link, const VectorX& q) const {
  const MechanismDef& def = mechanism_->definition();
  RigidTransform X = def.bodies[static_cast<std::size_t>(link.body)].X_PB;
  for (int j = link.first_joint; j < link.first_joint + link.num_joints; ++j) {
    const Mechanism::Joint& joint = mechanism_->joint(JointIndex(j));
    X = X * Exp(Screws(def.joints[static_cast<std::size_t>(j)]) * q.segment(joint.offset, joint.size));
  }
  return X;
}

// With E = X_pb(q)⁻¹ X_p⁻¹ X_b near 1 and twists in body axes, E⁻¹Ė = V_b - Ad(X_b⁻¹ X_p) V_p - Σ J_j q̇_j,
// J_j = Ad((Exp_{j+1} ... Exp_k)⁻¹) dexp(-S_j q_j) S_j.
LinkRows FullMechanism::RowsOf(const Link& link, const std::vector<RigidTransform>& X,
                               const VectorX& q) const {
  const MechanismDef& def = mechanism_->definition();
  LinkRows rows;
  rows.on_parent =
      -Adjoint(X[static_cast<std::size_t>(link.body)].inverse() * X[static_cast<std::size_t>(link.parent)]);
  rows.on_rates.resize(6, link.size);
  RigidTransform after;
  for (int j = link.first_joint + link.num_joints - 1; j >= link.first_joint; --j) {
    const Mechanism::Joint& joint = mechanism_->joint(JointIndex(j));
    const Matrix6X S = Screws(def.joints[static_cast<std::size_t>(j)]);
    const Vector6 x = S * q.segment(joint.offset, joint.size);
    rows.on_rates.middleCols(joint.offset - link.offset, joint.size) =
        -Adjoint(after.inverse()) * (Dexp(-x) * S);
    after = Exp(x) * after;
  }
  return rows;
}

// With the axes W of the joint in the body and x = W θ, Exp(x) turns by J_r(x) ẋ in the body's axes, J_r(x) = J_l(-x).
std::vector<RotationMap> FullMechanism::RotationMaps(const VectorX& q) const {
  std::vector<RotationMap> maps;
  for (const Mechanism::Rotation& rotation : mechanism_->rotations()) {
    const Mechanism::Joint& joint = mechanism_->joint(rotation.joint);
    const Matrix6X S = Screws(mechanism_->definition().joints[rotation.joint.u()]);
    RotationMap map{rotation.coordinates, Matrix3::Zero()};
    Matrix3 W;
    for (int k = 0; k < 3; ++k)
      W.col(k) = S.col(rotation.coordinates[static_cast<std::size_t>(k)] - joint.offset).head<3>();
    const Vector3 x = W * q(rotation.coordinates);
    map.E = W.inverse() * DexpRotation(-x) * W;
    maps.push_back(map);
  }
  return maps;
}

VectorX FullMechanism::JointVelocities(const VectorX& q, const VectorX& q_dot) const {
  VectorX velocities = q_dot;
  for (const RotationMap& rotation : RotationMaps(q))
    velocities(rotation.at) = rotation.E * q_dot(rotation.at);
  return velocities;
}

VectorX FullMechanism::CoordinateForces(const VectorX& q, VectorX force) const {
  for (const RotationMap& rotation : RotationMaps(q)) {
    const Vector3 on_theta = rotation.E.transpose() * force(rotation.at);
    force(rotation.at) = on_theta;
  }
  return force;
}

MatrixX FullMechanism::OnCoordinates(const VectorX& q, const VectorX& weights) const {
  MatrixX A = weights.asDiagonal();
  for (const RotationMap& rotation : RotationMaps(q))
    A(rotation.at, rotation.at) =
        (rotation.E.transpose() * Vector3(weights(rotation.at)).asDiagonal() * rotation.E).eval();
  return A;
}

void FullMechanism::AddLinkStiffening(const Link& link, const LinkRows& rows, const Vector6& nu, double h) {
  // The reaction on the parent, -Ad(X_b⁻¹X_p)ᵀ ν, turns with both bodies; its change with the child is
  // Ad(X_b⁻¹X_p)ᵀ C(ν), C(ν) = [τ f; f 0] of cross-product matrices. Half of it on either side of the
  // diagonal keeps the tangent symmetric; the rest only turns with the whole.
  Matrix6 C = Matrix6::Zero();
  C.topLeftCorner<3, 3>() = Skew(nu.head<3>());
  C.topRightCorner<3, 3>() = C.bottomLeftCorner<3, 3>() = Skew(nu.tail<3>());
  if (Moves(link.parent))
    dynamics_.AddPair(column_[static_cast<std::size_t>(link.parent)],
                      column_[static_cast<std::size_t>(link.body)],
                      -0.5 * h * rows.on_parent.transpose() * C);
  // Joints stacked on one body: ∂J_i/∂q_k = -[J_k, J_i] for k after i.
  for (int j = link.first_joint; j < link.first_joint + link.num_joints; ++j) {
    const Mechanism::Joint& first = mechanism_->joint(JointIndex(j));
    for (int i = first.offset; i < first.offset + first.size; ++i)
      for (int k = first.offset + first.size; k < link.offset + link.size; ++k) {
        const Vector6 J_i = rows.on_rates.col(i - link.offset), J_k = rows.on_rates.col(k - link.offset);
        const double value = 0.5 * h * nu.dot(Bracket(J_k, J_i));
        dynamics_.Add(ColumnOfCoordinate(i), ColumnOfCoordinate(k), value);
        dynamics_.Add(ColumnOfCoordinate(k), ColumnOfCoordinate(i), value);
      }
  }
}

Vector6 FullMechanism::ClosureError(const ClosureDef& closure, const std::vector<RigidTransform>& X) const {
  const RigidTransform E =
      (X[closure.body_a.u()] * closure.X_AJ).inverse() * (X[closure.body_b.u()] * closure.X_BJ);
  Vector6 c;
  c << LogRotation(E.rotation()), E.translation();
  return c;
}

// With V the motion of b relative to a in the frame J of a: d/dt log R_E = dexp⁻¹ ω, d/dt p_E = v + ω x p_E.
Eigen::Matrix<double, 6, 12> FullMechanism::ClosureRows(const ClosureDef& closure, const RigidTransform& X_a,
                                                        const RigidTransform& X_b) const {
  const RigidTransform X_Jb = (X_a * closure.X_AJ).inverse() * X_b;
  const RigidTransform E = X_Jb * closure.X_BJ;
  Matrix6 rate = Matrix6::Zero();
  rate.topLeftCorner<3, 3>() = DexpInverseRotation(LogRotation(E.rotation()));
  rate.bottomLeftCorner<3, 3>() = -Skew(E.translation());
  rate.bottomRightCorner<3, 3>().setIdentity();
  Eigen::Matrix<double, 6, 12> rows;
  rows << -rate * Adjoint(closure.X_AJ.inverse()), rate * Adjoint(X_Jb);
  return rows;
}

double FullMechanism::CouplingError(const Mechanism::Coupling& k, const VectorX& q) const {
  const double x = k.b >= 0 ? q(k.b) : 0;
  double value = 0;
  for (int i = 4; i >= 0; --i) value = value * x + k.polynomial[i];
  for (const auto& [i, coefficient] : k.terms) value += coefficient * q(i);
  return q(k.a) - value;
}

double FullMechanism::CouplingSlope(const Mechanism::Coupling& k, const VectorX& q) const {
  double value = 0;
  for (int i = 4; i >= 1; --i) value = value * q(k.b) + i * k.polynomial[i];
  return value;
}

void FullMechanism::AddConstraints(const std::vector<RigidTransform>& X, const VectorX& q, bool base_moves,
                                   double epsilon, SaddleSolver& solver) const {
  auto column = [&](int body) {
    return body == 0 && !base_moves ? -1 : column_[static_cast<std::size_t>(body)];
  };
  for (const Link& link : links_) {
    const LinkRows rows = RowsOf(link, X, q);
    for (int i = 0; i < 6; ++i) {
      solver.Add(Row(link.row) + i, column(link.body) + i, 1);
      solver.Add(column(link.body) + i, Row(link.row) + i, 1);
    }
    if (column(link.parent) >= 0) solver.AddPair(Row(link.row), column(link.parent), rows.on_parent);
    if (link.size > 0) solver.AddPair(Row(link.row), ColumnOfCoordinate(link.offset), rows.on_rates);
  }
  int row = Row(first_loop_row_);
  for (const ClosureDef& closure : mechanism_->closures()) {
    if (!closure.rigid.any()) continue;
    const auto rows = ClosureRows(closure, X[closure.body_a.u()], X[closure.body_b.u()]);
    for (int i = 0; i < 6; ++i) {
      if (!closure.rigid(i)) continue;
      if (const int c = column(closure.body_a.value()); c >= 0)
        solver.AddPair(row, c, rows.block<1, 6>(i, 0));
      if (const int c = column(closure.body_b.value()); c >= 0)
        solver.AddPair(row, c, rows.block<1, 6>(i, 6));
      solver.Shift(row++, epsilon);
    }
  }
  for (const Mechanism::Coupling& k : mechanism_->couplings()) {
    const auto add = [&](int i, double value) {
      solver.Add(row, ColumnOfCoordinate(i), value);
      solver.Add(ColumnOfCoordinate(i), row, value);
    };
    add(k.a, 1);
    if (k.b >= 0) add(k.b, -CouplingSlope(k, q));
    for (const auto& [i, coefficient] : k.terms) add(i, -coefficient);
    solver.Shift(row++, epsilon);
  }
}

VectorX FullMechanism::GivenVelocities(const std::vector<RigidTransform>& X, const VectorX& q,
                                       const Matrix6X& V) const {
  VectorX given = VectorX::Zero(num_rows_);
  for (const Link& link : links_)
    if (!Moves(link.parent)) given.segment<6>(link.row) = RowsOf(link, X, q).on_parent * V.col(link.parent);
  int row = first_loop_row_;
  for (const ClosureDef& closure : mechanism_->closures()) {
    if (!closure.rigid.any()) continue;
    const auto rows = ClosureRows(closure, X[closure.body_a.u()], X[closure.body_b.u()]);
    for (int i = 0; i < 6; ++i) {
      if (!closure.rigid(i)) continue;
      if (!Moves(closure.body_a.value()))
        given(row) += rows.block<1, 6>(i, 0).dot(V.col(closure.body_a.value()));
      if (!Moves(closure.body_b.value()))
        given(row) += rows.block<1, 6>(i, 6).dot(V.col(closure.body_b.value()));
      ++row;
    }
  }
  return given;
}

}  // namespace fork1s::internal
