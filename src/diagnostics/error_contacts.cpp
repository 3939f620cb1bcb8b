#include "error_contacts.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/constraints/material.hpp>

namespace fork1s {
namespace {

// Rows that say the same twice share a load; by so much of the softness of each.
constexpr double kShare = 1e-9;

// Share of a bound, to which the solve is exact to rounding.
constexpr double kSpare = 1e-6;

// Lever of a contact that nothing can move: rounding of a metre.
constexpr double kNothing = 1e-12;

// X (J X + R)⁻¹, X = A⁻¹G: by it what rows J see is taken back along G.
MatrixX TakeBack(const MatrixX& J, const MatrixX& X, const VectorX& R) {
  MatrixX S = J * X;
  VectorX scale(S.rows());
  for (Eigen::Index i = 0; i < S.rows(); ++i) scale(i) = 1 / std::sqrt(S(i, i));
  S.diagonal() += R;
  S = scale.asDiagonal() * S * scale.asDiagonal();
  S.diagonal().array() += kShare;
  LuFactor factor;
  factor.Compute(S.transpose());
  MatrixX back = scale.asDiagonal() * X.transpose();
  factor.SolveInPlace(back);
  return back.transpose() * scale.asDiagonal();
}

}  // namespace

void ErrorContacts::ComputeRows(const World& world, const std::vector<ContactRecord>& contacts,
                                const std::vector<ErrorCompanion>& mechanisms,
                                const std::vector<FreeBodyPath>& free_bodies, double h) {
  contacts_.clear();
  std::vector<int> at(1, 0);
  for (const ErrorCompanion& m : mechanisms) at.push_back(at.back() + m.full_size());
  const int size = at.back() + 6 * static_cast<int>(free_bodies.size());
  for (const ContactRecord& c : contacts) {
    if (c.impulse(0) <= 0) continue;
    const double depth = std::max(0.0, -c.point.gap);
    Contact kept{MatrixX::Zero(6, size),       c.impulse, Vector3::Zero(), depth, h,
                 c.friction > 0 && c.use <= 1, {}};
    const double most = (1 - kSpare) * c.impulse(0);
    kept.turns[0] = std::abs(c.moment(0)) < most * c.point.torsion;
    kept.turns[1] = kept.turns[2] = c.moment.tail<2>().norm() < most * c.point.rolling;
    for (int direction = 0; direction < 6; ++direction) {
      const bool moment = direction >= 3;
      if (moment && !kept.turns[direction - 3]) continue;
      const Vector3 f = c.point.frame.row(direction % 3).transpose();
      VectorX row = VectorX::Zero(size);
      for (const auto& [body, sign] : {std::pair(c.point.body_a, -1.0), std::pair(c.point.body_b, 1.0)}) {
        const Contactor& side = world.contactors()[static_cast<std::size_t>(body)];
        const auto index = static_cast<std::size_t>(side.index);
        Vector6 F;
        if (moment)
          F << f, Vector3::Zero();
        else
          F << c.point.point.cross(f), f;
        if (side.kind == Contactor::Kind::kGroup) {
          const MechanismDynamics& m = world.mechanisms()[index];
          const int last_joint = m.groups()[static_cast<std::size_t>(side.group)].last_joint;
          const VectorX part = sign * mechanisms[index].WrenchRow(m, last_joint, F);
          row.segment(at[index], part.size()) += part;
          if (!moment) kept.speed(direction) += sign * mechanisms[index].SpeedAlong(m, last_joint, F);
        } else if (side.kind == Contactor::Kind::kFreeBody) {
          if (!moment) F.head<3>() -= free_bodies[index].X[1].translation().cross(f);
          row.segment<6>(at.back() + 6 * side.index) += sign * F;
          if (!moment) kept.speed(direction) += sign * F.dot(free_bodies[index].v[2]);
        }
      }
      kept.rows.row(direction) = row.transpose();
    }
    contacts_.push_back(std::move(kept));
  }
}

// What sticks goes nowhere. What slides is held back along its normal, and what that bears more or less
// brings friction along; across its way the direction of friction turns with that of the way, F v/|v|, which
// is a damper F/|v|.
void ErrorContacts::Prepare(const std::vector<ErrorCompanion>& mechanisms, const std::vector<int>& offset,
                            const LuFactor& A, double s) {
  const int size = offset.back(), most = 6 * static_cast<int>(contacts_.size());
  J_.resize(most, size);
  MatrixX X(size, most);
  VectorX R = VectorX::Zero(most), depth = R, pull = R;
  const ContactMaterial material;
  const double back = s + material.relaxation_steps * s;  // s
  int rows = 0;
  for (const Contact& c : contacts_) {
    MatrixX y = MatrixX::Zero(size, 6);
    int from = 0;
    for (std::size_t i = 0; i < mechanisms.size(); ++i) {
      const int n = mechanisms[i].full_size();
      for (int k = 0; k < 6; ++k) {
        const VectorX full = c.rows.row(k).segment(from, n).transpose();
        if (!full.isZero(0)) mechanisms[i].ToBasis(full, y.col(k).segment(offset[i], mechanisms[i].size()));
      }
      from += n;
    }
    const int free = static_cast<int>(c.rows.cols()) - from;
    y.bottomRows(free) = c.rows.rightCols(free).transpose();
    const double load = c.impulse.tail<2>().norm();
    // As stiff as the simulation has it: there no contact gives more than this share of what it feels.
    const double softest =
        ContactSolverOptions{}.most_give * c.h * (c.h + material.relaxation_steps * c.h) / (s * back);
    auto add = [&](const VectorX& row, const VectorX& along, double softness, bool normal) {
      if (row.norm() < kNothing) return;
      // A contact that its own friction would draw in has no answer by it.
      for (const VectorX& way : {along, row}) {
        VectorX moved = way;
        A.SolveInPlace(moved);
        if (!(row.dot(moved) > 0)) continue;
        J_.row(rows) = row.transpose();
        X.col(rows) = moved;
        R(rows) = softness;
        if (normal) {
          R(rows) = std::min(softness, softest * row.dot(moved));
          depth(rows) = c.depth;
          pull(rows) = 1 / back;
        }
        ++rows;
        return;
      }
    };
    const Vector3 direction = c.impulse / c.impulse(0);
    const double stiffness = std::max(material.stiffness, c.impulse(0) / (c.h * material.depth));
    add(y.col(0), c.sticks ? VectorX(y.col(0)) : VectorX(y.leftCols<3>() * direction),
        1 / (s * back * stiffness), true);
    for (int k = 0; k < 3; ++k)
      if (c.turns[k]) add(y.col(3 + k), y.col(3 + k), 0, false);
    if (c.sticks) {
      for (int k = 1; k < 3; ++k) add(y.col(k), y.col(k), 0, false);
    } else if (load > 0) {
      const VectorX across = (-c.impulse(2) * y.col(1) + c.impulse(1) * y.col(2)) / load;
      add(across, across, c.speed.tail<2>().norm() * c.h / (s * load), false);
    }
  }
  J_.conservativeResize(rows, size);
  X.conservativeResize(size, rows);
  depth_ = depth.head(rows);
  pull_ = pull.head(rows);
  if (rows > 0) hold_ = TakeBack(J_, X, R.head(rows));
}

void ErrorContacts::Hold(const MatrixX& e, int column, MatrixX& rate) const {
  if (J_.rows() == 0) return;
  MatrixX off = J_ * e;
  off.col(column) -= depth_;
  rate -= hold_ * (J_ * rate + pull_.asDiagonal() * off);
}

}  // namespace fork1s
