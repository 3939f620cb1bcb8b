
#include <algorithm>
#include <cmath>
#include <vector>

#include "closures.hpp"
#include "linalg/products.hpp"
#include "mechanism/coordinate_scaling.hpp"

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

// ∂c/∂q of all six directions of one closure, for the coordinates between its bodies: others do not move it.
struct LoopColumn {
  int coordinate;
  Vector6 column;
};

void ColumnsOf(const Mechanism& mechanism, const ClosureDef& closure, const Kinematics& kinematics,
               std::vector<LoopColumn>& out) {
  out.clear();
  internal::ForEachClosureColumn(mechanism, closure, kinematics, [&](int i, const Vector6& column) {
    out.push_back({i, column});
  });
}

}  // namespace

CoordinateScaling ComputeCoordinateScaling(const Mechanism& mechanism, const Kinematics& kinematics) {
  const int n = mechanism.num_coordinates();
  const double L = mechanism.length_scale();
  CoordinateScaling unit;
  unit.coordinate.resize(n);
  for (int i = 0; i < n; ++i) unit.coordinate(i) = 1 / ScrewSize(mechanism.screws().col(i), L);
  const auto& closures = mechanism.closures();
  unit.closure = VectorX::Constant(static_cast<Eigen::Index>(closures.size()), L);
  if (closures.empty()) return unit;

  VectorX slides = VectorX::Zero(n);  // the longest loop of each slide
  std::vector<LoopColumn> columns;
  for (std::size_t c = 0; c < closures.size(); ++c) {
    ColumnsOf(mechanism, closures[c], kinematics, columns);
    double reach = 0;
    for (const auto& [i, column] : columns)
      if (!Slides(mechanism.screws().col(i)))
        reach = std::max(reach, column.tail<3>().norm() * unit.coordinate(i));
    // Where all axes meet the closure's point, displacements are rounding and stay so.
    if (reach > 1e-6 * L) unit.closure(static_cast<Eigen::Index>(c)) = reach;
    for (const auto& [i, column] : columns)
      if (Slides(mechanism.screws().col(i)) && !column.isZero(0))
        slides(i) = std::max(slides(i), unit.closure(static_cast<Eigen::Index>(c)));
  }
  for (int i = 0; i < n; ++i)
    if (slides(i) > 0) unit.coordinate(i) = slides(i) / mechanism.screws().col(i).tail<3>().norm();
  return unit;
}

MatrixX ScaledClosureRows(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q,
                          const CoordinateScaling& unit, VectorX* row_scale) {
  MatrixX A = MatrixX::Zero(mechanism.num_constraints(), mechanism.num_coordinates());
  VectorX scale = VectorX::Ones(A.rows());
  int row = 0;
  for (std::size_t c = 0; c < mechanism.closures().size(); ++c) {
    const ClosureDef& closure = mechanism.closures()[c];
    if (!closure.rigid.any()) continue;
    const double length = 1 / unit.closure(static_cast<Eigen::Index>(c));
    internal::ForEachClosureColumn(mechanism, closure, kinematics, [&](int i, const Vector6& column) {
      int r = row;
      for (int k = 0; k < 6; ++k)
        if (closure.rigid(k)) A(r++, i) = (k < 3 ? 1.0 : length) * (column(k) * unit.coordinate(i));
    });
    for (int k = 0; k < 6; ++k)
      if (closure.rigid(k)) scale(row++) = k < 3 ? 1.0 : length;
  }
  for (const Mechanism::Coupling& k : mechanism.couplings()) {
    k.ForEachSlope(q, [&](int i, double slope) { A(row, i) = slope * unit.coordinate(i); });
    scale(row) = 1 / A.row(row).cwiseAbs().maxCoeff();
    A.row(row) *= scale(row);
    ++row;
  }
  if (row_scale) *row_scale = scale;
  return A;
}

SpringRows ScaledSpringRows(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q,
                            const CoordinateScaling& unit) {
  const int n = mechanism.num_coordinates();
  SpringRows out;
  Eigen::Index most = (mechanism.stiffness().array() > 0).count();
  most += static_cast<Eigen::Index>(mechanism.springs().size() + 6 * mechanism.closures().size());
  out.rows.setZero(most, n);
  out.weight.resize(most);
  Eigen::Index count = 0;
  const auto keep = [&](double weight, int joint) {  // the row that was filled
    out.weight(count++) = weight;
    out.joint.push_back(joint);
  };
  for (int i = 0; i < n; ++i)
    if (const double k = mechanism.stiffness()(i); k > 0) {
      out.rows(count, i) = 1;
      keep(std::sqrt(k) * unit.coordinate(i), i);
    }
  for (const Mechanism::Spring& s : mechanism.springs()) {
    auto row = out.rows.row(count);
    ForEachArm(s.length, kinematics.paths, [&](int i, double c) { row(i) += c * unit.coordinate(i); });
    const double size = row.norm();
    const double stiffness = s.StiffnessAt(LengthOf(mechanism, s.length, kinematics, q));
    if (stiffness > 0 && size > 0) {
      row /= size;
      keep(std::sqrt(stiffness) * size, -1);
    } else {
      row.setZero();
    }
  }
  std::vector<LoopColumn> columns;
  for (std::size_t c = 0; c < mechanism.closures().size(); ++c) {
    const ClosureDef& closure = mechanism.closures()[c];
    if (closure.rigid.select(Vector6::Zero(), closure.stiffness).isZero(0)) continue;
    ColumnsOf(mechanism, closure, kinematics, columns);
    for (int k = 0; k < 6; ++k) {
      if (closure.rigid(k) || !(closure.stiffness(k) > 0)) continue;
      const double length = k < 3 ? 1.0 : unit.closure(static_cast<Eigen::Index>(c));
      for (const auto& [i, column] : columns) out.rows(count, i) = column(k) * unit.coordinate(i) / length;
      keep(std::sqrt(closure.stiffness(k)) * length, -1);
    }
  }
  out.rows.conservativeResize(count, Eigen::NoChange);
  out.weight.conservativeResize(count);
  return out;
}

}  // namespace fork1s
