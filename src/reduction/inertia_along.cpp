#include "inertia_along.hpp"

#include <algorithm>

namespace fork1s::internal {
namespace {

struct Span {
  Eigen::Index begin = 0, end = 0;

  bool empty() const { return begin >= end; }
  void Join(const Span& other) {
    if (other.empty()) return;
    *this = empty() ? other : Span{std::min(begin, other.begin), std::max(end, other.end)};
  }
};

Span SpanOf(const double* row, Eigen::Index size) {
  Span span{0, size};
  while (!span.empty() && row[span.begin] == 0) ++span.begin;
  while (!span.empty() && row[span.end - 1] == 0) --span.end;
  return span;
}

void Add(double factor, const double* __restrict x, Span span, double* __restrict y) {
  for (Eigen::Index k = span.begin; k < span.end; ++k) y[k] += factor * x[k];
}

// Of each body with all that it carries, in R about R's origin.
std::vector<Matrix6> Carried(const Mechanism& mechanism, const Kinematics& kinematics) {
  const auto& bodies = mechanism.bodies();
  std::vector<Matrix6> carried(bodies.size());
  for (std::size_t b = 0; b < bodies.size(); ++b)
    carried[b] = Transform(kinematics.X_RB[b], bodies[b].inertia_B).Matrix();
  for (std::size_t b = bodies.size(); b-- > 1;) carried[bodies[b].parent.u()] += carried[b];
  return carried;
}

}  // namespace

// As ReducedInertia, one column s of a joint after the other: Σ T_jᵀ I_j T_j = Σ h qᵀ + q hᵀ with
// h = Tᵀ Ic s + ½ (sᵀ Ic s) q, Ic the inertia that the joint carries and T the twist before it.
InertiaAlong ComputeInertiaAlong(const Mechanism& mechanism, const Kinematics& kinematics,
                                 const RowMatrixX& Q) {
  const Eigen::Index r = Q.cols();
  const std::vector<Matrix6> carried = Carried(mechanism, kinematics);
  InertiaAlong out;
  out.M_00 = carried[0];
  out.M_0z.setZero(6, r);
  out.T.assign(static_cast<std::size_t>(6 * r * mechanism.num_joints()), 0.0);
  RowMatrixX M_0z = RowMatrixX::Zero(6, r);
  MatrixX half = MatrixX::Zero(r, r);
  std::vector<double> h(static_cast<std::size_t>(r));
  std::vector<Span> reach(static_cast<std::size_t>(mechanism.num_joints()));
  for (int j = 0; j < mechanism.num_joints(); ++j) {
    const Mechanism::Joint& joint = mechanism.joint(JointIndex(j));
    Span& own = reach[static_cast<std::size_t>(j)];
    double* T = out.T.data() + 6 * r * j;
    if (joint.previous >= 0) {
      own = reach[static_cast<std::size_t>(joint.previous)];
      const double* T_before = out.T_of(joint.previous);
      for (int row = 0; row < 6 && !own.empty(); ++row)
        std::copy(T_before + row * r + own.begin, T_before + row * r + own.end, T + row * r + own.begin);
    }
    // Columns of a joint one after the other, as if each were a joint of its own that carries the next.
    for (int i = joint.offset; i < joint.offset + joint.size; ++i) {
      const double* q = Q.data() + i * r;
      const Span moved = SpanOf(q, r);
      if (moved.empty()) continue;
      const Vector6 s = kinematics.S.col(i);
      const Vector6 f = carried[joint.body.u()] * s;
      Span felt = own;
      felt.Join(moved);
      std::fill(h.begin() + felt.begin, h.begin() + felt.end, 0.0);
      for (int row = 0; row < 6; ++row) Add(f(row), T + row * r, own, h.data());
      Add(0.5 * (s.dot(f) + mechanism.armature()(i)), q, moved, h.data());
      for (Eigen::Index k = moved.begin; k < moved.end; ++k) Add(q[k], h.data(), felt, half.data() + k * r);
      for (int row = 0; row < 6; ++row) {
        Add(f(row), q, moved, M_0z.data() + row * r);
        Add(s(row), q, moved, T + row * r);
      }
      own = felt;
    }
  }
  out.M = half + half.transpose();
  out.M_0z = M_0z;
  return out;
}

}  // namespace fork1s::internal
