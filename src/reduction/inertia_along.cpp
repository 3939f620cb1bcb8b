#include "inertia_along.hpp"
#include "linalg/products.hpp"

#include <algorithm>
#include <vector>

namespace fork1s::internal {
namespace {

struct Span {
  Eigen::Index begin = 0, end = 0;

  bool empty() const { return begin >= end; }
  Eigen::Index size() const { return end - begin; }
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

// y += Σ f_row x_row, rows of x r apart.
void AddRows(const Vector6& f, const double* x, Eigen::Index r, Span span, double* __restrict y) {
  const double *x0 = x, *x1 = x + r, *x2 = x1 + r, *x3 = x2 + r, *x4 = x3 + r, *x5 = x4 + r;
  const double f0 = f(0), f1 = f(1), f2 = f(2), f3 = f(3), f4 = f(4), f5 = f(5);
  for (Eigen::Index k = span.begin; k < span.end; ++k)
    y[k] += f0 * x0[k] + f1 * x1[k] + f2 * x2[k] + f3 * x3[k] + f4 * x4[k] + f5 * x5[k];
}

// Rows of y, r apart, += f_row x.
void AddToRows(const Vector6& f, const double* __restrict x, Eigen::Index r, Span span,
               double* __restrict y) {
  for (int row = 0; row < 6; ++row, y += r) {
    const double factor = f(row);
    for (Eigen::Index k = span.begin; k < span.end; ++k) y[k] += factor * x[k];
  }
}

// Hᵀ Q, rows of which are 0 outside of their spans.
MatrixX HalfOfM(const RowMatrixX& H, const std::vector<Span>& of_H, const RowMatrixX& Q,
                const std::vector<Span>& of_Q) {
  const Eigen::Index r = Q.cols();
  double filled = 0;
  for (std::size_t i = 0; i < of_H.size(); ++i)
    filled += static_cast<double>(of_H[i].size()) * static_cast<double>(of_Q[i].size());
  // Dense kernels go through twice as much in the same time. Rows one after the other are columns of the
  // transpose.
  const Eigen::Map<const MatrixX> H_columns(H.data(), r, H.rows()), Q_columns(Q.data(), r, Q.rows());
  if (2 * filled > static_cast<double>(Q.size() * r)) return TimesTransposed(H_columns, Q_columns);
  MatrixX half = MatrixX::Zero(r, r);
  for (Eigen::Index i = 0; i < Q.rows(); ++i) {
    const double* __restrict h = H.data() + i * r;
    const Span felt = of_H[static_cast<std::size_t>(i)], moved = of_Q[static_cast<std::size_t>(i)];
    for (Eigen::Index k = moved.begin; k < moved.end; ++k) {
      double* __restrict column = half.data() + k * r;
      const double factor = Q(i, k);
      for (Eigen::Index l = felt.begin; l < felt.end; ++l) column[l] += factor * h[l];
    }
  }
  return half;
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

// Entry of EᵀaE between two coordinates of a joint; a itself outside of its rotation.
double ArmatureBetween(const Mechanism& mechanism, const Kinematics& kinematics,
                       const Mechanism::Joint& joint, int i, int e) {
  const Mechanism::Rotation& rotation = mechanism.rotations()[static_cast<std::size_t>(joint.rotation)];
  const auto& at = rotation.coordinates;
  const auto row = std::find(at.begin(), at.end(), i), column = std::find(at.begin(), at.end(), e);
  if (row == at.end() || column == at.end()) return i == e ? mechanism.armature()(i) : 0;
  return WeightedRotationBlock(mechanism, kinematics, rotation, mechanism.armature())(row - at.begin(),
                                                                                      column - at.begin());
}

}  // namespace

// As ReducedInertia, one column s of a joint after the other: Σ T_jᵀ I_j T_j = Σ h qᵀ + q hᵀ with
// h = Tᵀ Ic s + ½ (sᵀ Ic s) q, Ic the inertia that the joint carries and T the twist before it.
InertiaAlong ComputeInertiaAlong(const Mechanism& mechanism, const Kinematics& kinematics,
                                 const RowMatrixX& Q) {
  const Eigen::Index n = Q.rows(), r = Q.cols();
  const std::vector<Matrix6> carried = Carried(mechanism, kinematics);
  InertiaAlong out;
  out.M_00 = carried[0];
  out.T.resize(6 * r, mechanism.num_joints());
  RowMatrixX M_0z = RowMatrixX::Zero(6, r), H = RowMatrixX::Zero(n, r);
  std::vector<Span> of_joint(static_cast<std::size_t>(mechanism.num_joints())),
      of_H(static_cast<std::size_t>(n)), of_Q(of_H.size());
  for (int j = 0; j < mechanism.num_joints(); ++j) {
    const Mechanism::Joint& joint = mechanism.joint(JointIndex(j));
    Span& own = of_joint[static_cast<std::size_t>(j)];
    double* T = out.T.col(j).data();
    if (joint.previous >= 0) {
      own = of_joint[static_cast<std::size_t>(joint.previous)];
      out.T.col(j) = out.T.col(joint.previous);
    } else {
      out.T.col(j).setZero();
    }
    // Columns of a joint one after the other, as if each were a joint of its own that carries the next.
    for (int i = joint.offset; i < joint.offset + joint.size; ++i) {
      const double* q = Q.data() + i * r;
      const Span moved = SpanOf(q, r);
      if (moved.empty()) continue;
      const Vector6 s = kinematics.S.col(i);
      const Vector6 f = carried[joint.body.u()] * s;
      double* h = H.data() + i * r;
      const double half = 0.5 * (s.dot(f) + mechanism.armature()(i));
      for (Eigen::Index k = moved.begin; k < moved.end; ++k) h[k] = half * q[k];
      if (joint.rotation >= 0) {
        // Armature of a rotation couples its coordinates: twice half of it between two of them.
        for (int e = joint.offset; e <= i; ++e) {
          const double rotor = ArmatureBetween(mechanism, kinematics, joint, i, e);
          const double share = e == i ? 0.5 * (rotor - mechanism.armature()(i)) : rotor;
          if (share == 0) continue;
          const double* q_e = Q.data() + e * r;
          const Span moved_e = SpanOf(q_e, r);
          for (Eigen::Index k = moved_e.begin; k < moved_e.end; ++k) h[k] += share * q_e[k];
        }
      }
      AddRows(f, T, r, own, h);
      AddToRows(f, q, r, moved, M_0z.data());
      AddToRows(s, q, r, moved, T);
      own.Join(moved);
      of_H[static_cast<std::size_t>(i)] = own;
      of_Q[static_cast<std::size_t>(i)] = moved;
    }
  }
  const MatrixX half = HalfOfM(H, of_H, Q, of_Q);
  out.M = half + half.transpose();
  out.M_0z = M_0z;
  return out;
}

}  // namespace fork1s::internal
