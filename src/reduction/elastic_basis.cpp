#include "elastic_basis.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/linalg/null_space.hpp>

namespace fork1s::internal {

MatrixX ElasticBasis::DenseFree(int n) const {
  if (!diagonal) return N;
  MatrixX dense = MatrixX::Zero(n, num_free());
  for (int i = 0; i < num_free(); ++i) dense(unsprung[static_cast<std::size_t>(i)], i) = 1;
  return dense;
}

MatrixX ElasticBasis::FreeInOneUnit(int n) const {
  if (!diagonal) return scale.cwiseInverse().asDiagonal() * N;
  return DenseFree(n);
}

bool ElasticBasis::Feels(const MatrixX& J_x) const {
  if (num_elastic() == 0 || J_x.rows() == 0) return false;
  return (diagonal ? MatrixX(J_x(Eigen::all, sprung)) : MatrixX(J_x * elastic_x)).cwiseAbs().maxCoeff() >
         kRankThreshold;
}

MatrixX ElasticBasis::DenseClosed(int n) const {
  if (!diagonal) return Z;
  return MatrixX(scale.asDiagonal()) * MatrixX::Identity(n, n);
}

VectorX ElasticBasis::ApplyV(const VectorX& y, int n) const {
  if (!diagonal) return V * y;
  VectorX q = VectorX::Zero(n);
  for (int i = 0; i < num_elastic(); ++i) q(sprung[static_cast<std::size_t>(i)]) = inverse_root(i) * y(i);
  return q;
}

VectorX ElasticBasis::ApplyVTransposed(const VectorX& g) const {
  if (!diagonal) return V.transpose() * g;
  VectorX y(num_elastic());
  for (int i = 0; i < num_elastic(); ++i) y(i) = inverse_root(i) * g(sprung[static_cast<std::size_t>(i)]);
  return y;
}

MatrixX ElasticBasis::TimesV(const MatrixX& B) const {
  if (!diagonal) return B * V;
  MatrixX out(B.rows(), num_elastic());
  for (int i = 0; i < num_elastic(); ++i)
    out.col(i) = inverse_root(i) * B.col(sprung[static_cast<std::size_t>(i)]);
  return out;
}

namespace {

// x-space basis of the motions that keep loops closed.
NullSpace Closed(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q,
                 const OneUnit& unit) {
  return ComputeNullSpace(ClosureRowsInOneUnit(mechanism, kinematics, q, unit));
}

}  // namespace

ElasticBasis ComputeElasticBasis(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q) {
  const int n = mechanism.num_coordinates();
  ElasticBasis basis;
  const OneUnit unit = ComputeOneUnit(mechanism, kinematics);
  basis.scale = unit.coordinate;
  if (mechanism.is_tree() && mechanism.has_diagonal_stiffness()) {
    basis.diagonal = true;
    for (int i = 0; i < n; ++i) (mechanism.stiffness()(i) > 0 ? basis.sprung : basis.unsprung).push_back(i);
    basis.inverse_root.resize(basis.num_elastic());
    for (int i = 0; i < basis.num_elastic(); ++i)
      basis.inverse_root(i) = 1 / std::sqrt(mechanism.stiffness()(basis.sprung[static_cast<std::size_t>(i)]));
    return basis;
  }

  MatrixX Z_x = MatrixX::Identity(n, n);
  if (mechanism.num_constraints() > 0) {
    NullSpace closed = Closed(mechanism, kinematics, q, unit);
    if (closed.doubtful.size() > 0)
      basis.doubts.push_back(
          Doubt(mechanism, "loops hold", closed.rank.kept, closed.rank.dropped, closed.doubtful));
    basis.independent_rows = std::move(closed.independent_rows);
    Z_x = std::move(closed.unseen);
  }
  basis.Z = basis.scale.asDiagonal() * Z_x;
  const SpringRows springs = SpringRowsInOneUnit(mechanism, kinematics, q, unit);
  const MatrixX stretch = springs.rows * Z_x;
  const NullSpace held = ComputeNullSpace(stretch);
  if (held.doubtful.size() > 0)
    basis.doubts.push_back(
        Doubt(mechanism, "springs hold", held.rank.kept, held.rank.dropped, Z_x * held.doubtful));
  basis.N = basis.Z * held.unseen;
  basis.elastic_x = Z_x * held.seen;
  const MatrixX weighted = springs.weight.asDiagonal() * (stretch * held.seen);
  basis.V = basis.Z * (held.seen * OrthonormalisingFactor(weighted));
  return basis;
}

MatrixX ClosedMotions(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q) {
  const OneUnit unit = ComputeOneUnit(mechanism, kinematics);
  return unit.coordinate.asDiagonal() * Closed(mechanism, kinematics, q, unit).unseen;
}

MatrixX ScaledInterfaceJacobian(const Mechanism& mechanism, const Kinematics& kinematics,
                                const std::vector<BodyIndex>& bodies, double length) {
  MatrixX J(6 * static_cast<Eigen::Index>(bodies.size()), mechanism.num_coordinates());
  for (std::size_t e = 0; e < bodies.size(); ++e) {
    auto rows = J.middleRows(6 * static_cast<Eigen::Index>(e), 6);
    rows = BodyJacobian(mechanism, kinematics, bodies[e]);
    rows.bottomRows(3) -= Skew(kinematics.X_RB[bodies[e].u()].translation()) * rows.topRows(3);
    rows.topRows(3) *= length;
  }
  return J;
}

RankDoubt Doubt(const Mechanism& mechanism, const char* what, double kept, double dropped,
                const VectorX& direction) {
  RankDoubt doubt{what, kept, dropped, {}};
  constexpr double kMuch = 0.1;  // of the largest
  constexpr std::size_t kNames = 4;
  std::vector<int> order;
  for (int i = 0; i < direction.size(); ++i) order.push_back(i);
  std::stable_sort(order.begin(), order.end(),
                   [&](int i, int k) { return std::abs(direction(i)) > std::abs(direction(k)); });
  for (const int i : order) {
    if (doubt.joints.size() == kNames || !(std::abs(direction(i)) > kMuch * std::abs(direction(order[0])))) break;
    const std::string& name = mechanism.joint(mechanism.CoordinateJoint(i)).name;
    if (std::find(doubt.joints.begin(), doubt.joints.end(), name) == doubt.joints.end())
      doubt.joints.push_back(name);
  }
  return doubt;
}

}  // namespace fork1s::internal
