#include <fork1s/mechanism/kinematics.hpp>

#include "closures.hpp"

namespace fork1s {
namespace {

double Length(const Mechanism::LinearForm& terms, const VectorX& q) {
  double length = 0;
  for (const auto& [i, c] : terms) length += c * q(i);
  return length;
}

// Calls f(c, rows) for every closure that has springs or dampers, with the rows that are rigid or free zeroed
// by the caller's weights.
template <class F>
void ForEachSpringyClosure(const Mechanism& mechanism, const Kinematics& kinematics, F f) {
  Matrix6X rows(6, mechanism.num_coordinates());
  Vector6 c;
  for (const ClosureDef& closure : mechanism.closures()) {
    if ((closure.rigid.array() || (closure.stiffness.array() == 0 && closure.damping.array() == 0)).all()) continue;
    internal::ClosureErrorJacobian(mechanism, closure, kinematics, c, rows);
    f(closure, c, rows);
  }
}

Vector6 Soft(const ClosureDef& closure, const Vector6& weights) {
  return closure.rigid.select(Vector6::Zero(), weights);
}

}  // namespace

void SpringForce(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q, VectorX& tau) {
  tau = mechanism.stiffness().cwiseProduct(mechanism.rest() - q);
  for (const Mechanism::Spring& s : mechanism.springs()) {
    const double force = s.stiffness * (s.rest - Length(s.terms, q));
    for (const auto& [i, c] : s.terms) tau(i) += c * force;
  }
  if (!mechanism.closures().empty())
    ForEachSpringyClosure(mechanism, kinematics, [&](const ClosureDef& closure, const Vector6& c, const Matrix6X& rows) {
      tau.noalias() -= rows.transpose() * Soft(closure, closure.stiffness).cwiseProduct(c);
    });
}

MatrixX StiffnessMatrix(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX&) {
  MatrixX K = mechanism.stiffness().asDiagonal();
  for (const Mechanism::Spring& s : mechanism.springs())
    for (const auto& [i, ci] : s.terms)
      for (const auto& [j, cj] : s.terms) K(i, j) += s.stiffness * ci * cj;
  ForEachSpringyClosure(mechanism, kinematics, [&](const ClosureDef& closure, const Vector6&, const Matrix6X& rows) {
    K.noalias() += rows.transpose() * Soft(closure, closure.stiffness).asDiagonal() * rows;
  });
  return K;
}

MatrixX DampingMatrix(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX&) {
  MatrixX D = mechanism.damping().asDiagonal();
  for (const Mechanism::Spring& s : mechanism.springs())
    for (const auto& [i, ci] : s.terms)
      for (const auto& [j, cj] : s.terms) D(i, j) += s.damping * ci * cj;
  ForEachSpringyClosure(mechanism, kinematics, [&](const ClosureDef& closure, const Vector6&, const Matrix6X& rows) {
    D.noalias() += rows.transpose() * Soft(closure, closure.damping).asDiagonal() * rows;
  });
  return D;
}

double SpringEnergy(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q) {
  double energy = 0.5 * mechanism.stiffness().dot((q - mechanism.rest()).cwiseAbs2());
  for (const Mechanism::Spring& s : mechanism.springs()) {
    const double stretch = Length(s.terms, q) - s.rest;
    energy += 0.5 * s.stiffness * stretch * stretch;
  }
  for (const ClosureDef& closure : mechanism.closures()) {
    const Vector6 k = Soft(closure, closure.stiffness);
    if (k.isZero(0)) continue;
    const Vector6 c = internal::ClosureError(closure, kinematics);
    energy += 0.5 * k.dot(c.cwiseAbs2());
  }
  return energy;
}

void AddControlForce(const Mechanism& mechanism, const VectorX& u, VectorX& tau) {
  const auto& controls = mechanism.controls();
  for (std::size_t k = 0; k < controls.size(); ++k)
    for (const auto& [i, c] : controls[k].terms)
      tau(i) += controls[k].gain * c * u(static_cast<Eigen::Index>(k));
}

}  // namespace fork1s
