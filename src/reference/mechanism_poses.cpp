// Poses that satisfy every link and loop.
#include <algorithm>
#include <cmath>

#include "full_mechanism.hpp"

namespace fork1s::internal {

// A floating base turns by the mean of its twists before and after, beside the drift of the centre of mass,
// which only carries it along (docs/compare.md). Contact moves it by the twist after, which is the one that
// keeps gaps.
RigidTransform FullMechanism::NextBasePose() const {
  if (mechanism_->base() == BaseKind::kFixed) return X_[0];
  if (mechanism_->base() == BaseKind::kDriven) return driven_next;
  if (stage_) return BaseMoved(V_next_.col(0), X_next_[0].rotation(), h_);
  const Vector3 drift_W = pushed ? Drift(X_next_, V_next_) : drift_W_;
  Vector6 start = V_.col(0), end = V_next_.col(0);
  start.tail<3>() -= X_[0].rotation().transpose() * drift_W;
  end.tail<3>() -= X_next_[0].rotation().transpose() * drift_W;
  RigidTransform X = X_[0] * Exp(h_ * (pushed ? end : Vector6(0.5 * (start + end))));
  X.translation() += h_ * drift_W;
  return X;
}

double FullMechanism::AdvancePoses() {
  std::vector<RigidTransform> X(X_.size());
  X[0] = NextBasePose();
  for (std::size_t b = 1; b < X.size(); ++b)
    X[b] = X_[b] * Exp(h_ * V_next_.col(static_cast<Eigen::Index>(b)));
  VectorX q = q_ + h_ * q_dot_next_;
  gap_ = Project(X, q);
  double change = 0;
  for (std::size_t b = 0; b < X.size(); ++b) {
    X[b].Orthonormalize();
    // |R - R'| (Frobenius) is √2 times the angle for small turns.
    change = std::max({change, (X[b].translation() - X_next_[b].translation()).norm(),
                       mechanism_->length_scale() * (X[b].rotation() - X_next_[b].rotation()).norm()});
  }
  X_next_ = std::move(X);
  q_next_ = std::move(q);
  return change;
}

// Gauss-Newton on the link and loop equations themselves. Links take what they need from the poses of their
// bodies; loops bend the joints, the stiff ones least, in the metric that the reduced model uses too. The
// base stays. Returns the largest opening left [m].
double FullMechanism::Project(std::vector<RigidTransform>& X, VectorX& q) {
  const Mechanism& m = *mechanism_;
  const double L = m.length_scale();
  const VectorX& k = m.stiffness();
  const double k_max = k.size() > 0 ? k.maxCoeff() : 0;
  const VectorX metric =
      k_max > 0 ? VectorX((k / k_max).cwiseMax(1e-3)) : VectorX(VectorX::Ones(m.num_coordinates()));
  MatrixX right(num_unknowns(), 1);
  double gap = 0, before = std::numeric_limits<double>::infinity();
  for (int iteration = 0; iteration < 30; ++iteration) {
    right.setZero();
    gap = 0;
    auto meet = [&](const Vector6& error) {
      gap = std::max({gap, L * error.head<3>().norm(), error.tail<3>().norm()});
    };
    for (const Link& link : links_) {
      const Vector6 error = Log((X[static_cast<std::size_t>(link.parent)] * LinkPose(link, q)).inverse() *
                                X[static_cast<std::size_t>(link.body)]);
      meet(error);
      right.block<6, 1>(Row(link.row), 0) = -error;
    }
    int row = Row(first_loop_row_);
    for (const ClosureDef& closure : m.closures()) {
      if (!closure.rigid.any()) continue;
      const Vector6 error = closure.rigid.select(ClosureError(closure, X), Vector6::Zero());
      meet(error);
      for (int i = 0; i < 6; ++i)
        if (closure.rigid(i)) right(row++) = -error(i);
    }
    for (const Mechanism::Coupling& coupling : m.couplings()) {
      const double error = CouplingError(coupling, q);
      const bool turns = m.Turns(coupling.a);
      gap = std::max(gap, (turns ? L : 1) * std::abs(error));
      right(row++) = -error;
    }
    // Near rounding, iterations that gain nothing end it.
    if (gap < 1e-15 * L || (gap < 1e-12 * L && gap > 0.1 * before) || !std::isfinite(gap)) break;
    before = gap;

    positions_.Begin(num_unknowns());
    if (column_[0] >= 0)
      for (int i = 0; i < 6; ++i) positions_.Add(column_[0] + i, column_[0] + i, 1);
    for (int i = 0; i < m.num_coordinates(); ++i)
      positions_.Add(ColumnOfCoordinate(i), ColumnOfCoordinate(i), metric(i));
    // Loops closed more often than needed are met in the least-squares sense: far softer than any metric.
    AddConstraints(X, q, false, 1e-10 * std::min(1.0, L * L), positions_);
    if (!positions_.Factor() || !positions_.Solve(right)) return std::numeric_limits<double>::infinity();
    for (std::size_t b = 0; b < X.size(); ++b)
      if (Moves(static_cast<int>(b)) && b > 0) X[b] = X[b] * Exp(right.block<6, 1>(column_[b], 0));
    q += right.block(num_body_columns_, 0, m.num_coordinates(), 1);
  }
  return gap;
}

}  // namespace fork1s::internal
