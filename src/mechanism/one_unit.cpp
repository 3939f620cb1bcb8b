#include <fork1s/linalg/products.hpp>
#include <fork1s/mechanism/one_unit.hpp>

#include <algorithm>
#include <cmath>

#include "closures.hpp"

namespace fork1s {
namespace {

// Size of a screw: its turn, or its displacement along its own axis in lengths of the mechanism. A hinge and a
// ball have 1, a slide 1/length.
double ScrewSize(const Vector6& s, double length) {
  const double turn = s.head<3>().norm();
  if (turn == 0) return s.tail<3>().norm() / length;
  const double along = std::abs(s.head<3>().dot(s.tail<3>())) / turn;
  return std::max(turn, along / length);
}

bool Slides(const Vector6& s) { return s.head<3>().isZero(0); }

// ∂c/∂q of all six directions, 6 x n. Joints on both paths cancel exactly: the same numbers with either sign.
Matrix6X AllColumns(const Mechanism& mechanism, const ClosureDef& closure, const Kinematics& kinematics) {
  Matrix6X columns = Matrix6X::Zero(6, mechanism.num_coordinates());
  internal::ForEachClosureColumn(mechanism, closure, kinematics,
                                 [&](int i, const Vector6& column) { columns.col(i) += column; });
  return columns;
}

}  // namespace

OneUnit ComputeOneUnit(const Mechanism& mechanism, const Kinematics& kinematics) {
  const int n = mechanism.num_coordinates();
  const double L = mechanism.length_scale();
  OneUnit unit;
  unit.coordinate.resize(n);
  for (int i = 0; i < n; ++i) unit.coordinate(i) = 1 / ScrewSize(mechanism.screws().col(i), L);
  const auto& closures = mechanism.closures();
  unit.closure = VectorX::Constant(static_cast<Eigen::Index>(closures.size()), L);
  if (closures.empty()) return unit;

  VectorX slides = VectorX::Zero(n);  // the longest loop of each slide
  for (std::size_t c = 0; c < closures.size(); ++c) {
    const Matrix6X columns = AllColumns(mechanism, closures[c], kinematics);
    double reach = 0;
    for (int i = 0; i < n; ++i)
      if (!Slides(mechanism.screws().col(i)))
        reach = std::max(reach, columns.col(i).tail<3>().norm() * unit.coordinate(i));
    // Where all axes meet the closure's point, displacements are rounding and stay so.
    if (reach > 1e-6 * L) unit.closure(static_cast<Eigen::Index>(c)) = reach;
    for (int i = 0; i < n; ++i)
      if (Slides(mechanism.screws().col(i)) && !columns.col(i).isZero(0))
        slides(i) = std::max(slides(i), unit.closure(static_cast<Eigen::Index>(c)));
  }
  for (int i = 0; i < n; ++i)
    if (slides(i) > 0) unit.coordinate(i) = slides(i) / mechanism.screws().col(i).tail<3>().norm();
  return unit;
}

MatrixX ClosureRowsInOneUnit(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q,
                             const OneUnit& unit, VectorX* row_scale) {
  MatrixX A;
  ClosureJacobian(mechanism, kinematics, q, A);
  VectorX scale = VectorX::Ones(A.rows());
  int row = 0;
  for (std::size_t c = 0; c < mechanism.closures().size(); ++c)
    for (int i = 0; i < 6; ++i)
      if (mechanism.closures()[c].rigid(i))
        scale(row++) = i < 3 ? 1.0 : 1 / unit.closure(static_cast<Eigen::Index>(c));
  A = A * unit.coordinate.asDiagonal();
  for (; row < A.rows(); ++row) scale(row) = 1 / A.row(row).cwiseAbs().maxCoeff();  // couplings
  A = ScaledRows(scale, A);
  if (row_scale) *row_scale = scale;
  return A;
}

SpringRows SpringRowsInOneUnit(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q,
                               const OneUnit& unit) {
  const int n = mechanism.num_coordinates();
  std::vector<VectorX> rows;
  std::vector<double> weights;
  SpringRows out;
  const auto add = [&](const VectorX& row, double weight, int joint) {
    rows.push_back(row);
    weights.push_back(weight);
    out.joint.push_back(joint);
  };
  for (int i = 0; i < n; ++i)
    if (const double k = mechanism.stiffness()(i); k > 0)
      add(VectorX::Unit(n, i), std::sqrt(k) * unit.coordinate(i), i);
  for (const Mechanism::Spring& s : mechanism.springs()) {
    VectorX row = VectorX::Zero(n);
    ForEachArm(s.length, kinematics.paths, [&](int i, double c) { row(i) += c * unit.coordinate(i); });
    const double size = row.norm();
    const double stiffness = s.StiffnessAt(LengthOf(mechanism, s.length, kinematics, q));
    if (stiffness > 0 && size > 0) add(row / size, std::sqrt(stiffness) * size, -1);
  }
  for (std::size_t c = 0; c < mechanism.closures().size(); ++c) {
    const ClosureDef& closure = mechanism.closures()[c];
    if (closure.rigid.select(Vector6::Zero(), closure.stiffness).isZero(0)) continue;
    const Matrix6X columns = AllColumns(mechanism, closure, kinematics) * unit.coordinate.asDiagonal();
    for (int i = 0; i < 6; ++i) {
      if (closure.rigid(i) || !(closure.stiffness(i) > 0)) continue;
      const double length = i < 3 ? 1.0 : unit.closure(static_cast<Eigen::Index>(c));
      add(columns.row(i).transpose() / length, std::sqrt(closure.stiffness(i)) * length, -1);
    }
  }
  out.rows.resize(static_cast<Eigen::Index>(rows.size()), n);
  out.weight.resize(static_cast<Eigen::Index>(rows.size()));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    out.rows.row(static_cast<Eigen::Index>(i)) = rows[i].transpose();
    out.weight(static_cast<Eigen::Index>(i)) = weights[i];
  }
  return out;
}

}  // namespace fork1s
