// Energies, momentum, gaps and natural frequencies in full coordinates.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "full_mechanism.hpp"
#include "linalg/null_space.hpp"
#include "linalg/products.hpp"
#include "linalg/spectrum.hpp"

namespace fork1s::internal {

double FullMechanism::KineticEnergy() const {
  double energy = 0.5 * mechanism_->armature().dot(JointVelocities(q_, q_dot_).cwiseAbs2());
  for (std::size_t b = 0; b < X_.size(); ++b) {
    const Vector6 V = V_.col(static_cast<Eigen::Index>(b));
    energy += 0.5 * V.dot(inertia_[b] * V);
  }
  return energy;
}

// As Simulation counts it: a servo's control is the set-point of the spring that holds the joint.
double FullMechanism::StoredEnergy() const {
  const Mechanism& m = *mechanism_;
  double energy = 0.5 * m.stiffness().dot((q_ - m.rest()).cwiseAbs2());
  for (const Mechanism::Spring& s : m.springs()) {
    if (!m.HasPotential(s.length)) continue;
    const double length = Length(s.length, q_),
                 stretch = length - std::clamp(length, s.rest, s.rest + s.slack);
    if (s.toe > 0) {  // a parabola of force up to the toe, then a line
      const double in_toe = std::clamp(stretch, 0.0, s.toe), beyond = std::max(0.0, stretch - s.toe);
      energy += s.stiffness * (std::pow(in_toe, 3) / (6 * s.toe) + 0.5 * beyond * (s.toe + beyond));
      continue;
    }
    energy += 0.5 * s.stiffness * stretch * stretch + s.higher_stiffness[0] * std::pow(stretch, 3) / 3 +
              s.higher_stiffness[1] * std::pow(stretch, 4) / 4;
  }
  for (const ClosureDef& closure : m.closures()) {
    const Vector6 k = closure.rigid.select(Vector6::Zero(), closure.stiffness);
    energy += 0.5 * k.dot(ClosureError(closure, X_).cwiseAbs2());
  }
  for (std::size_t k = 0; k < m.controls().size(); ++k) {
    const Mechanism::Control& control = m.controls()[k];
    const double u = controls(static_cast<Eigen::Index>(k));
    if (!m.HasPotential(control.length)) continue;
    energy += m.definition().controls[k].SetPointEnergy(u) - control.gain * u * Length(control.length, q_);
  }
  // A servo at its bound F stores F times the length it is off, and not what its spring would.
  for (const Mechanism::ForceLimit& limit : m.force_limits()) {
    if (!m.HasPotential(limit.length)) continue;
    const double f = ServoForce(limit, q_), excess = f - std::min(std::max(f, limit.lower), limit.upper);
    if (limit.stiffness > 0) energy -= excess * excess / (2 * limit.stiffness);
    if (limit.stiffness == 0) energy += excess * Length(limit.length, q_);
  }
  return energy;
}

double FullMechanism::GravityEnergy(const Vector3& gravity_W) const {
  double energy = 0;
  for (std::size_t b = 0; b < X_.size(); ++b) {
    const Mechanism::Body& body = mechanism_->bodies()[b];
    energy -= body.weighed_mass * gravity_W.dot(X_[b] * body.inertia_B.center);
  }
  return energy;
}

Vector6 FullMechanism::MomentumOf(const std::vector<RigidTransform>& X, const Matrix6X& V) const {
  Vector6 total = Vector6::Zero();
  for (std::size_t b = 0; b < X_.size(); ++b)
    total += AdjointTransposeApply(X[b].inverse(), inertia_[b] * V.col(static_cast<Eigen::Index>(b)));
  return total;
}

VectorX FullMechanism::ClosureForces() const {
  if (!(reaction_time_ > 0)) return VectorX::Zero(num_rows_ - first_loop_row_);
  return -reactions_.tail(num_rows_ - first_loop_row_) / reaction_time_;
}

std::vector<std::pair<std::string, double>> FullMechanism::Gaps() const {
  std::vector<std::pair<std::string, double>> gaps;
  const double L = mechanism_->length_scale();
  auto size = [&](const Vector6& error) {
    return std::max(L * error.head<3>().norm(), error.tail<3>().norm());
  };
  for (const Link& link : links_) {
    const auto b = static_cast<std::size_t>(link.body);
    const Vector6 error =
        Log((X_[static_cast<std::size_t>(link.parent)] * LinkPose(link, q_)).inverse() * X_[b]);
    gaps.emplace_back(link.num_joints > 0 ? mechanism_->joint(JointIndex(link.first_joint)).name
                                          : mechanism_->bodies()[b].name,
                      size(error));
  }
  for (const ClosureDef& closure : mechanism_->closures())
    gaps.emplace_back(closure.name, size(closure.rigid.select(ClosureError(closure, X_), Vector6::Zero())));
  return gaps;
}

// Constraint rows G, inertia M and springs K on all velocities.
FullMechanism::Matrices FullMechanism::LinearMatrices() const {
  const Mechanism& m = *mechanism_;
  SaddleSolver rows;
  rows.Begin(num_unknowns());
  AddConstraints(X_, q_, true, 0, rows);
  rows.Assemble();
  MatrixX identity = MatrixX::Zero(num_unknowns(), num_velocities_);
  identity.topRows(num_velocities_).setIdentity();
  const MatrixX G = rows.Multiply(identity).bottomRows(num_rows_);

  MatrixX M = MatrixX::Zero(num_velocities_, num_velocities_), K = M;
  for (std::size_t b = 0; b < X_.size(); ++b)
    if (column_[b] >= 0) M.block<6, 6>(column_[b], column_[b]) = inertia_[b];
  const int n = m.num_coordinates();
  M.block(num_body_columns_, num_body_columns_, n, n) = OnCoordinates(q_, m.armature());
  auto K_q = K.block(num_body_columns_, num_body_columns_, n, n);
  K_q.diagonal() = m.stiffness();
  for (const Mechanism::Spring& s : m.springs())
    ForEachArmAt(s.length, q_, [&](int i, double c) {
      const double k = s.StiffnessAt(Length(s.length, q_));
      ForEachArmAt(s.length, q_, [&](int j, double d) { K_q(i, j) += k * c * d; });
    });
  for (const ClosureDef& closure : m.closures()) {
    const Vector6 k = closure.rigid.select(Vector6::Zero(), closure.stiffness);
    if (k.isZero(0)) continue;
    const auto on_bodies = ClosureRows(closure, X_[closure.body_a.u()], X_[closure.body_b.u()]);
    MatrixX row = MatrixX::Zero(6, num_velocities_);
    if (Moves(closure.body_a.value()))
      row.middleCols<6>(column_[closure.body_a.u()]) += on_bodies.leftCols<6>();
    if (Moves(closure.body_b.value()))
      row.middleCols<6>(column_[closure.body_b.u()]) += on_bodies.rightCols<6>();
    K += DiagonalCongruence(k, row);
  }
  return {G, M, K};
}

// With Z a basis of the motions that G allows: ZᵀKZ v = ω² ZᵀMZ v.
std::vector<double> FullMechanism::Frequencies(int count) const {
  const Mechanism& m = *mechanism_;
  if (num_velocities_ == 0) return {};
  const auto [G, M, K] = LinearMatrices();
  MatrixX Z = MatrixX::Identity(num_velocities_, num_velocities_);
  if (num_rows_ > 0) {
    // Radians and lengths of the mechanism on both sides, so that ranks can be decided.
    const double L = m.length_scale();
    VectorX unit = VectorX::Ones(num_velocities_), row = VectorX::Ones(num_rows_);
    for (std::size_t b = 0; b < X_.size(); ++b)
      if (column_[b] >= 0) unit.segment<3>(column_[b] + 3).setConstant(L);
    for (int i = 0; i < m.num_coordinates(); ++i)
      if (!m.Turns(i)) unit(ColumnOfCoordinate(i)) = L;
    for (const Link& link : links_) row.segment<3>(link.row + 3).setConstant(1 / L);
    int next = first_loop_row_;
    for (const ClosureDef& closure : m.closures())
      for (int i = 0; i < 6; ++i)
        if (closure.rigid(i)) row(next++) = i < 3 ? 1 : 1 / L;
    MatrixX G_unit = ScaledColumns(ScaledRows(row, G), unit);
    for (; next < num_rows_; ++next) G_unit.row(next) /= G_unit.row(next).cwiseAbs().maxCoeff();
    Z = ScaledRows(unit, ComputeNullSpace(G_unit).unseen);
  }
  if (Z.cols() == 0) return {};
  const MatrixX K_z = Congruence(K, Z);
  // Where loops hold every spring, the rounding of Z is left, squared.
  if (!(K_z.cwiseAbs().maxCoeff() > 1e-22 * K.cwiseAbs().maxCoeff())) return {};
  const VectorX squares = EigenvaluesOf(K_z, Congruence(M, Z));
  std::vector<double> hertz;
  // Motions that no spring feels come out as rounding of the stiffest one.
  for (Eigen::Index i = 0; i < squares.size() && static_cast<int>(hertz.size()) < count; ++i)
    if (squares(i) > 1e-11 * squares.tail<1>()(0))
      hertz.push_back(std::sqrt(squares(i)) / (2 * std::numbers::pi));
  return hertz;
}

// [K Gᵀ; G 0][x; λ] = [Eᵀ; 0], C = E x with E the twists of the bodies in world axes: no basis of motions,
// and so no rank is decided. Lengths are in units of the mechanism's, or a millimetre would pass for rounding
// beside a radian.
MatrixX FullMechanism::Compliance(const std::vector<BodyIndex>& bodies) const {
  auto [G, M, K] = LinearMatrices();
  const double L = mechanism_->length_scale();
  VectorX unit = VectorX::Ones(num_velocities_);
  for (std::size_t b = 0; b < X_.size(); ++b)
    if (column_[b] >= 0) unit.segment<3>(column_[b] + 3).setConstant(L);
  for (int i = 0; i < mechanism_->num_coordinates(); ++i)
    if (!mechanism_->Turns(i)) unit(ColumnOfCoordinate(i)) = L;
  MatrixX E = MatrixX::Zero(6 * static_cast<Eigen::Index>(bodies.size()), num_velocities_);
  for (std::size_t i = 0; i < bodies.size(); ++i)
    if (const auto b = bodies[i].u(); column_[b] >= 0)
      for (int half = 0; half < 6; half += 3)
        E.block<3, 3>(6 * static_cast<Eigen::Index>(i) + half, column_[b] + half) = X_[b].rotation();
  E = E * unit.asDiagonal();
  K = ScaledColumns(ScaledRows(unit, K), unit);
  G = G * unit.asDiagonal();
  // A floating base is held.
  const int held = Moves(0) ? 6 : 0;
  G.conservativeResize(num_rows_ + held, num_velocities_);
  G.bottomRows(held).setZero();
  if (held > 0) G.bottomRows(6).middleCols<6>(column_[0]).setIdentity();
  for (Eigen::Index i = 0; i < G.rows(); ++i)
    if (const double norm = G.row(i).norm(); norm > 0) G.row(i) /= norm;

  const double stiffest = K.cwiseAbs().maxCoeff();
  if (!(stiffest > 0)) return {};
  SaddleSolver solver;
  solver.Begin(num_velocities_ + static_cast<int>(G.rows()));
  for (int i = 0; i < num_velocities_; ++i)
    for (int j = 0; j < num_velocities_; ++j)
      if (K(i, j) != 0) solver.Add(i, j, K(i, j));
  for (int i = 0; i < static_cast<int>(G.rows()); ++i) {
    for (int j = 0; j < num_velocities_; ++j)
      if (G(i, j) != 0) {
        solver.Add(num_velocities_ + i, j, G(i, j));
        solver.Add(j, num_velocities_ + i, G(i, j));
      }
    solver.Shift(num_velocities_ + i, 1e-8 / stiffest);
  }
  MatrixX x = MatrixX::Zero(solver.size(), E.rows());
  x.topRows(num_velocities_) = E.transpose();
  if (!solver.Factor() || !solver.Solve(x)) return {};
  const MatrixX C = E * x.topRows(num_velocities_);
  // The work of the loads is what the springs store, unless a motion without spring takes part.
  const MatrixX stored = Congruence(K, x.topRows(num_velocities_));
  if (!((C - stored).cwiseAbs().maxCoeff() < 1e-6 * std::max(C.cwiseAbs().maxCoeff(), 1 / stiffest)))
    return {};
  return C;
}

}  // namespace fork1s::internal
