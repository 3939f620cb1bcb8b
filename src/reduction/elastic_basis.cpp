#include "elastic_basis.hpp"

#include <algorithm>
#include <cmath>

#include "coordinate_groups.hpp"
#include "linalg/elimination.hpp"
#include "linalg/null_space.hpp"
#include "linalg/products.hpp"
#include "linalg/select.hpp"

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

MatrixX ElasticBasis::ScaledFreeDirections(int n) const {
  if (!diagonal) return ScaledRows(scale.cwiseInverse(), N);
  return DenseFree(n);
}

bool ElasticBasis::HasElasticMotion(const MatrixX& J_x) const {
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

VectorX ElasticBasis::ApplyAbsVTransposed(const VectorX& g) const {
  return diagonal ? ApplyVTransposed(g) : VectorX(V.cwiseAbs().transpose() * g);
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
                 const CoordinateScaling& unit) {
  return ComputeNullSpace(ScaledClosureRows(mechanism, kinematics, q, unit));
}

// Columns of one group, on its coordinates.
struct Piece {
  MatrixX Z, N, V, elastic_x;
};

void AddDiagonalPart(const Mechanism& mechanism, const std::vector<int>& group, ElasticBasis& basis) {
  ElasticBasis::Part part{basis.num_free(), 0, basis.num_elastic(), 0};
  for (const int i : group) (mechanism.stiffness()(i) > 0 ? basis.sprung : basis.unsprung).push_back(i);
  part.num_free = basis.num_free() - part.free;
  part.num_elastic = basis.num_elastic() - part.elastic;
  basis.parts.push_back(part);
}

// Rows of loops or springs in one unit.
struct ScaledRowBlock {
  MatrixX rows;
  VectorX weight;          // of springs
  std::vector<int> joint;  // of springs: a row that is 1 at one coordinate, else -1

  // By group those that have anything on its coordinates: all that a row has is on one group.
  std::vector<std::vector<int>> ByGroup(const std::vector<std::size_t>& group_of, std::size_t groups) const {
    std::vector<std::vector<int>> out(groups);
    std::vector<std::size_t> of_row(static_cast<std::size_t>(rows.rows()), groups);
    for (std::size_t i = 0; i < joint.size(); ++i)
      if (joint[i] >= 0) of_row[i] = group_of[static_cast<std::size_t>(joint[i])];
    const auto first = static_cast<Eigen::Index>(std::find(joint.begin(), joint.end(), -1) -
                                                 joint.begin());  // joints' own springs come first
    for (Eigen::Index k = 0; k < rows.cols() && first < rows.rows(); ++k)
      for (Eigen::Index i = first; i < rows.rows(); ++i)
        if (rows(i, k) != 0) of_row[static_cast<std::size_t>(i)] = group_of[static_cast<std::size_t>(k)];
    for (std::size_t i = 0; i < of_row.size(); ++i)
      if (of_row[i] < groups) out[of_row[i]].push_back(static_cast<int>(i));
    return out;
  }
};

Piece CarefulPiece(const Mechanism& mechanism, const std::vector<int>& group, const std::vector<int>& closing,
                   const std::vector<int>& held_by, const ScaledRowBlock& loops,
                   const ScaledRowBlock& springs, ElasticBasis& basis) {
  const int n = mechanism.num_coordinates();
  const auto size = static_cast<Eigen::Index>(group.size());
  MatrixX Z_x = MatrixX::Identity(size, size);
  if (!closing.empty()) {
    NullSpace closed = ComputeNullSpace(RowsAndColumns(loops.rows, closing, group));
    if (closed.doubtful.size() > 0)
      basis.doubts.push_back(Doubt(mechanism, "loops hold", closed.rank.kept, closed.rank.dropped,
                                   Spread(closed.doubtful, group, n)));
    for (const int i : closed.independent_rows)
      basis.independent_rows.push_back(closing[static_cast<std::size_t>(i)]);
    Z_x = std::move(closed.unseen);
  }
  const VectorX scale = Entries(basis.scale, group);
  const MatrixX stretch = Times(RowsAndColumns(springs.rows, held_by, group), Z_x);
  const NullSpace held = ComputeNullSpace(stretch);
  if (held.doubtful.size() > 0)
    basis.doubts.push_back(Doubt(mechanism, "springs hold", held.rank.kept, held.rank.dropped,
                                 Spread(Times(Z_x, held.doubtful).col(0), group, n)));
  Piece piece{ScaledRows(scale, Z_x), ScaledRows(scale, Times(Z_x, held.unseen)), {}, Times(Z_x, held.seen)};
  const MatrixX weighted = ScaledRows(Entries(springs.weight, held_by), Times(stretch, held.seen));
  piece.V = ScaledRows(scale, Times(piece.elastic_x, OrthonormalisingFactor(weighted)));
  return piece;
}

// diag(weight) rows X for x on the coordinates `group`.
MatrixX WeightedStretch(const ScaledRowBlock& springs, const std::vector<int>& held_by,
                        const std::vector<int>& group, const MatrixX& X) {
  MatrixX out(static_cast<Eigen::Index>(held_by.size()), X.cols());
  for (std::size_t s = 0; s < held_by.size(); ++s) {
    const auto row = static_cast<Eigen::Index>(s);
    const auto spring = static_cast<std::size_t>(held_by[s]);
    const double weight = springs.weight(held_by[s]);
    if (springs.joint[spring] >= 0) {
      const auto at = std::lower_bound(group.begin(), group.end(), springs.joint[spring]) - group.begin();
      out.row(row) = weight * X.row(at);
    } else {
      out.row(row).setZero();
      for (std::size_t i = 0; i < group.size(); ++i)
        if (const double arm = springs.rows(held_by[s], group[i]); arm != 0)
          out.row(row) += weight * arm * X.row(static_cast<Eigen::Index>(i));
    }
  }
  return out;
}

// Where loops are clearly independent and springs clearly hold whatever they leave: V of the eliminated
// solutions of the loops, made orthonormal in the springs. False where one of them is not clear.
bool QuickPiece(const std::vector<int>& group, const std::vector<int>& closing,
                const std::vector<int>& held_by, const ScaledRowBlock& loops, const ScaledRowBlock& springs,
                const VectorX& scale, Piece& piece) {
  MatrixX V_x;
  if (!EliminatedNullSpace(RowsAndColumns(loops.rows, closing, group), V_x)) return false;
  if (static_cast<Eigen::Index>(held_by.size()) < V_x.cols()) return false;
  constexpr double kNear = 1e-3;  // of 1 after the first pass, or the second does not reach rounding
  if (!std::isfinite(DivideByRoot(WeightedStretch(springs, held_by, group, V_x), V_x))) return false;
  if (!(DivideByRoot(WeightedStretch(springs, held_by, group, V_x), V_x) < kNear)) return false;
  // With W = diag(weight) and |W rows V_x y| = |y|, every closed x = V_x y stretches springs by
  //     |rows x| >= |y| / max W >= |x| / (max W |V_x|):
  // the singular values that ranks are decided on are larger than that.
  constexpr double kClear = 1e4;
  double weight = 0;
  for (const int s : held_by) weight = std::max(weight, springs.weight(s));
  if (!(weight * V_x.norm() < kClear)) return false;
  piece = {{}, MatrixX(V_x.rows(), 0), ScaledRows(Entries(scale, group), V_x), std::move(V_x)};
  piece.elastic_x.colwise().normalize();
  return true;
}

// Columns that live on few coordinates, beside each other.
class Gathered {
 public:
  void Add(const std::vector<int>& of, MatrixX X) {
    count_ += X.cols();
    if (X.cols() > 0) some_.push_back({&of, std::move(X), 0, 0});
  }
  void AddUnit(int i, double value) {
    ++count_;
    some_.push_back({nullptr, {}, i, value});
  }
  int count() const { return static_cast<int>(count_); }
  MatrixX Columns(int n) const {
    MatrixX out = MatrixX::Zero(n, count_);
    Eigen::Index next = 0;
    for (const Some& some : some_) {
      if (!some.of) out(some.unit, next++) = some.value;
      for (Eigen::Index k = 0; k < some.X.cols(); ++k, ++next)
        for (std::size_t i = 0; i < some.of->size(); ++i)
          out((*some.of)[i], next) = some.X(static_cast<Eigen::Index>(i), k);
    }
    return out;
  }

 private:
  struct Some {
    const std::vector<int>* of;  // null: one column, of one entry
    MatrixX X;
    int unit;
    double value;
  };
  std::vector<Some> some_;
  Eigen::Index count_ = 0;
};

void FillDense(const Mechanism& mechanism, const ScaledRowBlock& loops, const ScaledRowBlock& springs,
               BasisBy by, ElasticBasis& basis) {
  const int n = mechanism.num_coordinates();
  const std::vector<std::vector<int>> fine = StaticGroups(mechanism);
  std::vector<std::size_t> group_of(static_cast<std::size_t>(n));
  for (std::size_t g = 0; g < fine.size(); ++g)
    for (const int i : fine[g]) group_of[static_cast<std::size_t>(i)] = g;
  const auto closing = loops.ByGroup(group_of, fine.size()), held_by = springs.ByGroup(group_of, fine.size());
  Gathered Z, N, V, elastic_x;
  for (const std::vector<int>& group : CoordinateGroups(mechanism)) {
    ElasticBasis::Part part{N.count(), 0, V.count(), 0};
    for (const int i : group) {
      const std::size_t g = group_of[static_cast<std::size_t>(i)];
      if (fine[g].front() != i) continue;
      const double k = mechanism.stiffness()(i);
      if (fine[g].size() == 1 && closing[g].empty() && held_by[g].size() == (k > 0 ? 1 : 0)) {
        // No loop and no spring but its own depends on it.
        if (by == BasisBy::kCareful) Z.AddUnit(i, basis.scale(i));
        if (k > 0) {
          V.AddUnit(i, 1 / std::sqrt(k));
          elastic_x.AddUnit(i, 1);
        } else {
          N.AddUnit(i, basis.scale(i));
        }
        continue;
      }
      Piece piece;
      if (by == BasisBy::kQuick &&
          QuickPiece(fine[g], closing[g], held_by[g], loops, springs, basis.scale, piece))
        basis.independent_rows.insert(basis.independent_rows.end(), closing[g].begin(), closing[g].end());
      else
        piece = CarefulPiece(mechanism, fine[g], closing[g], held_by[g], loops, springs, basis);
      if (by == BasisBy::kCareful) Z.Add(fine[g], std::move(piece.Z));
      N.Add(fine[g], std::move(piece.N));
      V.Add(fine[g], std::move(piece.V));
      elastic_x.Add(fine[g], std::move(piece.elastic_x));
    }
    part.num_free = N.count() - part.free;
    part.num_elastic = V.count() - part.elastic;
    basis.parts.push_back(part);
  }
  if (by == BasisBy::kCareful) basis.Z = Z.Columns(n);
  basis.N = N.Columns(n);
  basis.V = V.Columns(n);
  basis.elastic_x = elastic_x.Columns(n);
  std::sort(basis.independent_rows.begin(), basis.independent_rows.end());
}

}  // namespace

ElasticBasis ComputeElasticBasis(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q,
                                 BasisBy by) {
  ElasticBasis basis;
  const CoordinateScaling unit = ComputeCoordinateScaling(mechanism, kinematics);
  basis.scale = unit.coordinate;
  basis.diagonal = mechanism.is_tree() && mechanism.has_diagonal_stiffness();
  if (basis.diagonal) {
    for (const std::vector<int>& group : CoordinateGroups(mechanism))
      AddDiagonalPart(mechanism, group, basis);
    basis.inverse_root.resize(basis.num_elastic());
    for (int i = 0; i < basis.num_elastic(); ++i)
      basis.inverse_root(i) = 1 / std::sqrt(mechanism.stiffness()(basis.sprung[static_cast<std::size_t>(i)]));
    return basis;
  }
  const ScaledRowBlock loops{ScaledClosureRows(mechanism, kinematics, q, unit), {}, {}};
  SpringRows rows = ScaledSpringRows(mechanism, kinematics, q, unit);
  FillDense(mechanism, loops, {std::move(rows.rows), std::move(rows.weight), std::move(rows.joint)}, by,
            basis);
  return basis;
}

MatrixX ClosedMotions(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q) {
  const CoordinateScaling unit = ComputeCoordinateScaling(mechanism, kinematics);
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
    if (doubt.joints.size() == kNames || !(std::abs(direction(i)) > kMuch * std::abs(direction(order[0]))))
      break;
    const std::string& name = mechanism.joint(mechanism.CoordinateJoint(i)).name;
    if (std::find(doubt.joints.begin(), doubt.joints.end(), name) == doubt.joints.end())
      doubt.joints.push_back(name);
  }
  return doubt;
}

}  // namespace fork1s::internal
