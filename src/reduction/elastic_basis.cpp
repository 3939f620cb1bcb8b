#include "elastic_basis.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/linalg/null_space.hpp>
#include <fork1s/linalg/products.hpp>
#include <fork1s/linalg/select.hpp>

#include "coordinate_groups.hpp"

namespace fork1s::internal {

ElasticBasis ElasticBasis::ElasticOf(const Part& part) const {
  ElasticBasis out;
  out.diagonal = diagonal;
  out.scale = scale;
  if (diagonal) {
    const auto begin = sprung.begin() + part.elastic;
    out.sprung.assign(begin, begin + part.num_elastic);
    out.inverse_root = inverse_root.segment(part.elastic, part.num_elastic);
  } else {
    out.V = V.middleCols(part.elastic, part.num_elastic);
  }
  return out;
}

int ElasticBasis::PartOfElastic(Eigen::Index column) const {
  int p = 0;
  while (parts[static_cast<std::size_t>(p)].elastic + parts[static_cast<std::size_t>(p)].num_elastic <=
         column)
    ++p;
  return p;
}

int ElasticBasis::PartOfFree(Eigen::Index column) const {
  int p = 0;
  while (parts[static_cast<std::size_t>(p)].free + parts[static_cast<std::size_t>(p)].num_free <= column) ++p;
  return p;
}

MatrixX ElasticBasis::DenseFree(int n) const {
  if (!diagonal) return N;
  MatrixX dense = MatrixX::Zero(n, num_free());
  for (int i = 0; i < num_free(); ++i) dense(unsprung[static_cast<std::size_t>(i)], i) = 1;
  return dense;
}

MatrixX ElasticBasis::FreeInOneUnit(int n) const {
  if (!diagonal) return ScaledRows(scale.cwiseInverse(), N);
  return DenseFree(n);
}

bool ElasticBasis::Feels(const MatrixX& J_x) const {
  if (num_elastic() == 0 || J_x.rows() == 0) return false;
  return (diagonal ? Columns(J_x, sprung) : Times(J_x, elastic_x)).cwiseAbs().maxCoeff() > kRankThreshold;
}

MatrixX ElasticBasis::DenseClosed(int n) const {
  if (!diagonal) return Z;
  return MatrixX(scale.asDiagonal()) * MatrixX::Identity(n, n);
}

VectorX ElasticBasis::ApplyV(const VectorX& y, int n) const {
  if (!diagonal) return Times(V, y);
  VectorX q = VectorX::Zero(n);
  for (int i = 0; i < num_elastic(); ++i) q(sprung[static_cast<std::size_t>(i)]) = inverse_root(i) * y(i);
  return q;
}

VectorX ElasticBasis::ApplyVTransposed(const VectorX& g) const {
  if (!diagonal) return TransposedTimes(V, g);
  VectorX y(num_elastic());
  for (int i = 0; i < num_elastic(); ++i) y(i) = inverse_root(i) * g(sprung[static_cast<std::size_t>(i)]);
  return y;
}

MatrixX ElasticBasis::TimesV(const MatrixX& B) const {
  if (!diagonal) return Times(B, V);
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

// Appends columns that live on the coordinates `of`.
void Append(const MatrixX& columns, const std::vector<int>& of, MatrixX& to) {
  MatrixX both(to.rows(), to.cols() + columns.cols());
  both.leftCols(to.cols()) = to;
  for (Eigen::Index k = 0; k < columns.cols(); ++k)
    both.col(to.cols() + k) = Spread(columns.col(k), of, static_cast<int>(to.rows()));
  to.swap(both);
}

// Rows of A that have anything in the columns `of`.
std::vector<int> RowsOn(const MatrixX& A, const std::vector<int>& of) {
  std::vector<int> rows;
  for (Eigen::Index i = 0; i < A.rows(); ++i)
    if (std::any_of(of.begin(), of.end(), [&](int k) { return A(i, k) != 0; }))
      rows.push_back(static_cast<int>(i));
  return rows;
}

void AddDiagonalPart(const Mechanism& mechanism, const std::vector<int>& group, ElasticBasis& basis) {
  ElasticBasis::Part part{basis.num_free(), 0, basis.num_elastic(), 0};
  for (const int i : group) (mechanism.stiffness()(i) > 0 ? basis.sprung : basis.unsprung).push_back(i);
  part.num_free = basis.num_free() - part.free;
  part.num_elastic = basis.num_elastic() - part.elastic;
  basis.parts.push_back(part);
}

// `A` and `springs`: rows of all loops and springs in one unit.
void AddDensePart(const Mechanism& mechanism, const std::vector<int>& group, const MatrixX& A,
                  const SpringRows& springs, ElasticBasis& basis) {
  const int n = mechanism.num_coordinates();
  const auto size = static_cast<Eigen::Index>(group.size());
  ElasticBasis::Part part{basis.num_free(), 0, basis.num_elastic(), 0};
  MatrixX Z_x = MatrixX::Identity(size, size);
  if (const std::vector<int> rows = RowsOn(A, group); !rows.empty()) {
    NullSpace closed = ComputeNullSpace(RowsAndColumns(A, rows, group));
    if (closed.doubtful.size() > 0)
      basis.doubts.push_back(Doubt(mechanism, "loops hold", closed.rank.kept, closed.rank.dropped,
                                   Spread(closed.doubtful, group, n)));
    for (const int i : closed.independent_rows)
      basis.independent_rows.push_back(rows[static_cast<std::size_t>(i)]);
    Z_x = std::move(closed.unseen);
  }
  const VectorX scale = Entries(basis.scale, group);
  Append(ScaledRows(scale, Z_x), group, basis.Z);
  const std::vector<int> rows = RowsOn(springs.rows, group);
  const MatrixX stretch = Times(RowsAndColumns(springs.rows, rows, group), Z_x);
  const NullSpace held = ComputeNullSpace(stretch);
  if (held.doubtful.size() > 0)
    basis.doubts.push_back(Doubt(mechanism, "springs hold", held.rank.kept, held.rank.dropped,
                                 Spread(Times(Z_x, held.doubtful).col(0), group, n)));
  Append(ScaledRows(scale, Times(Z_x, held.unseen)), group, basis.N);
  Append(Times(Z_x, held.seen), group, basis.elastic_x);
  const VectorX weight = Entries(springs.weight, rows);
  const MatrixX weighted = ScaledRows(weight, Times(stretch, held.seen));
  Append(ScaledRows(scale, Times(Z_x, Times(held.seen, OrthonormalisingFactor(weighted)))), group, basis.V);
  part.num_free = basis.num_free() - part.free;
  part.num_elastic = basis.num_elastic() - part.elastic;
  basis.parts.push_back(part);
}

}  // namespace

ElasticBasis ComputeElasticBasis(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q) {
  const int n = mechanism.num_coordinates();
  ElasticBasis basis;
  const OneUnit unit = ComputeOneUnit(mechanism, kinematics);
  basis.scale = unit.coordinate;
  basis.diagonal = mechanism.is_tree() && mechanism.has_diagonal_stiffness();
  const std::vector<std::vector<int>> groups = CoordinateGroups(mechanism);
  if (basis.diagonal) {
    for (const std::vector<int>& group : groups) AddDiagonalPart(mechanism, group, basis);
    basis.inverse_root.resize(basis.num_elastic());
    for (int i = 0; i < basis.num_elastic(); ++i)
      basis.inverse_root(i) = 1 / std::sqrt(mechanism.stiffness()(basis.sprung[static_cast<std::size_t>(i)]));
    return basis;
  }
  for (MatrixX* columns : {&basis.Z, &basis.N, &basis.V, &basis.elastic_x}) columns->resize(n, 0);
  const MatrixX A = ClosureRowsInOneUnit(mechanism, kinematics, q, unit);
  const SpringRows springs = SpringRowsInOneUnit(mechanism, kinematics, q, unit);
  for (const std::vector<int>& group : groups) AddDensePart(mechanism, group, A, springs, basis);
  std::sort(basis.independent_rows.begin(), basis.independent_rows.end());
  return basis;
}

MatrixX ClosedMotions(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q) {
  const OneUnit unit = ComputeOneUnit(mechanism, kinematics);
  return ScaledRows(unit.coordinate, Closed(mechanism, kinematics, q, unit).unseen);
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
