#include <fork1s/mechanism/kinematics.hpp>

#include <cmath>

#include "closures.hpp"
#include "rotation_block.hpp"

namespace fork1s {
namespace {

Vector6 Soft(const ClosureDef& closure, const Vector6& weights) {
  return closure.rigid.select(Vector6::Zero(), weights);
}

// out += weight ∂ℓ/∂qᵀ ∂ℓ/∂q
void AddLengthMatrix(const Mechanism::Length& length, const std::vector<PathState>& paths, double weight,
                     MatrixX& out) {
  ForEachArm(length, paths, [&](int i, double ci) {
    ForEachArm(length, paths, [&](int j, double cj) { out(i, j) += weight * ci * cj; });
  });
}

// out += Σ rowsᵀ diag(weights) rows over the springy directions of all closures.
void AddClosureMatrix(const Mechanism& mechanism, const Kinematics& kinematics, Vector6 ClosureDef::*weights,
                      MatrixX& out) {
  for (const ClosureDef& closure : mechanism.closures()) {
    const Vector6 w = Soft(closure, closure.*weights);
    if (w.isZero(0)) continue;
    Matrix6X rows = Matrix6X::Zero(6, mechanism.num_coordinates());
    internal::ForEachClosureColumn(mechanism, closure, kinematics,
                                   [&](int i, const Vector6& column) { rows.col(i) += column; });
    out.noalias() += rows.transpose() * w.asDiagonal() * rows;
  }
}

}  // namespace

void SpringForce(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q, VectorX& tau) {
  tau = mechanism.stiffness().cwiseProduct(mechanism.rest() - q);
  for (const Mechanism::Spring& s : mechanism.springs()) {
    const double force = s.Force(LengthOf(mechanism, s.length, kinematics, q));
    ForEachArm(s.length, kinematics.paths, [&](int i, double c) { tau(i) += c * force; });
  }
  for (const ClosureDef& closure : mechanism.closures()) {
    const Vector6 k = Soft(closure, closure.stiffness);
    if (k.isZero(0)) continue;
    const Vector6 force = k.cwiseProduct(internal::ClosureError(closure, kinematics));
    internal::ForEachClosureColumn(mechanism, closure, kinematics,
                                   [&](int i, const Vector6& column) { tau(i) -= column.dot(force); });
  }
}

MatrixX StiffnessMatrix(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q) {
  MatrixX K = mechanism.stiffness().asDiagonal();
  for (const Mechanism::Spring& s : mechanism.springs())
    AddLengthMatrix(s.length, kinematics.paths, s.StiffnessAt(LengthOf(mechanism, s.length, kinematics, q)),
                    K);
  AddClosureMatrix(mechanism, kinematics, &ClosureDef::stiffness, K);
  return K;
}

MatrixX DampingMatrix(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX&) {
  MatrixX D = mechanism.damping().asDiagonal();
  for (const Mechanism::Rotation& rotation : mechanism.rotations())
    internal::AddRotationBlock(mechanism, kinematics, rotation, mechanism.damping(), D);
  for (const Mechanism::Spring& s : mechanism.springs())
    AddLengthMatrix(s.length, kinematics.paths, s.damping, D);
  AddClosureMatrix(mechanism, kinematics, &ClosureDef::damping, D);
  return D;
}

double SpringEnergy(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q) {
  double energy = 0.5 * mechanism.stiffness().dot((q - mechanism.rest()).cwiseAbs2());
  for (const Mechanism::Spring& s : mechanism.springs())
    if (mechanism.HasPotential(s.length)) energy += s.Energy(LengthOf(mechanism, s.length, kinematics, q));
  for (const ClosureDef& closure : mechanism.closures()) {
    const Vector6 k = Soft(closure, closure.stiffness);
    if (k.isZero(0)) continue;
    const Vector6 c = internal::ClosureError(closure, kinematics);
    energy += 0.5 * k.dot(c.cwiseAbs2());
  }
  return energy;
}

void AddControlForce(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& u,
                     VectorX& tau) {
  const auto& controls = mechanism.controls();
  for (std::size_t k = 0; k < controls.size(); ++k) {
    const double force = controls[k].gain * u(static_cast<Eigen::Index>(k));
    ForEachArm(controls[k].length, kinematics.paths, [&](int i, double c) { tau(i) += c * force; });
  }
  for (std::size_t k = 0; k < mechanism.muscles().size(); ++k) {
    const Mechanism::Muscle& muscle = mechanism.muscles()[k];
    const double force = u(muscle.control) * muscle.Force(kinematics.muscles[k], 0);
    ForEachArm(muscle.length, kinematics.paths, [&](int i, double c) { tau(i) += c * force; });
  }
}

void AddMuscleRateForce(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& activation,
                        const VectorX& q_dot, VectorX& tau) {
  for (std::size_t k = 0; k < mechanism.muscles().size(); ++k) {
    const Mechanism::Muscle& muscle = mechanism.muscles()[k];
    double rate = 0;
    ForEachArm(muscle.length, kinematics.paths, [&](int i, double c) { rate += c * q_dot(i); });
    const double at = kinematics.muscles[k],
                 force = activation(muscle.control) * (muscle.Force(at, rate) - muscle.Force(at, 0));
    ForEachArm(muscle.length, kinematics.paths, [&](int i, double c) { tau(i) += c * force; });
  }
}

}  // namespace fork1s
