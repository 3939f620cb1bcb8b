#include <fork1s/reduction/reduced_jacobian.hpp>

#include <algorithm>
#include <fork1s/base/quad.hpp>
#include <fork1s/spatial/rigid_transform.hpp>

namespace fork1s {

ReducedJacobian::ReducedJacobian(const ReducedModel& model) {
  const Mechanism& m = *model.mechanism;
  runs_.resize(static_cast<std::size_t>(m.num_joints()));
  std::vector<int> anchor(runs_.size());  // where the fours of a tree of joints begin
  for (int j = 0; j < m.num_joints(); ++j) {
    const Mechanism::Joint& joint = m.joints()[static_cast<std::size_t>(j)];
    int first = model.size(), end = 0;
    const auto join = [&](int begin, int size) {
      if (size == 0) return;
      first = std::min(first, begin);
      end = std::max(end, begin + size);
    };
    if (joint.previous >= 0) join(begin(joint.previous), size(joint.previous));
    for (int i = joint.offset; i < joint.offset + joint.size; ++i)
      join(model.runs[static_cast<std::size_t>(i)].begin, model.runs[static_cast<std::size_t>(i)].size);
    if (end <= first) continue;
    runs_[static_cast<std::size_t>(j)].begin = first;
    runs_[static_cast<std::size_t>(j)].size = end - first;
  }
  for (std::size_t j = 0; j < runs_.size(); ++j) anchor[j] = runs_[j].begin;
  for (std::size_t j = runs_.size(); j-- > 0;) {
    const int above = m.joints()[j].previous;
    if (above < 0 || runs_[j].size == 0) continue;
    int& up = anchor[static_cast<std::size_t>(above)];
    up = size(above) > 0 ? std::min(up, anchor[j]) : anchor[j];
  }
  Eigen::Index values = 0;
  for (std::size_t j = 0; j < runs_.size(); ++j) {
    const int above = m.joints()[j].previous;
    if (above >= 0 && size(above) > 0) anchor[j] = anchor[static_cast<std::size_t>(above)];
    Run& run = runs_[j];
    if (run.size == 0) continue;
    run.at = values;
    run.first = anchor[j] + (run.begin - anchor[j]) / 4 * 4;
    run.padded = (run.begin + run.size - run.first + 3) / 4 * 4;
    values += 6 * run.padded;
  }
  T_.assign(static_cast<std::size_t>(values), 0.0);
  Q_at_.resize(static_cast<std::size_t>(m.num_coordinates()));
  values = 0;
  for (int j = 0; j < m.num_joints(); ++j) {
    const Mechanism::Joint& joint = m.joints()[static_cast<std::size_t>(j)];
    for (int i = joint.offset; i < joint.offset + joint.size; ++i) {
      Q_at_[static_cast<std::size_t>(i)] = values;
      values += run(j).padded;
    }
  }
  Q_.assign(static_cast<std::size_t>(values), 0.0);
}

void ReducedJacobian::Compute(const ReducedModel& model, const Configuration& c) {
  const Mechanism& m = *model.mechanism;
  for (int j = 0; j < m.num_joints(); ++j) {
    const Mechanism::Joint& joint = m.joints()[static_cast<std::size_t>(j)];
    const Run& own = run(j);
    double* T = T_.data() + own.at;
    const bool carried = joint.previous >= 0 && size(joint.previous) > 0;
    const Run* up = carried ? &run(joint.previous) : nullptr;
    const int ahead = carried ? up->first - own.first : 0, end = carried ? ahead + up->padded : 0;
    for (int i = joint.offset; i < joint.offset + joint.size; ++i) {
      const double* row_of_Q = c.Q_now.data() + i * c.Q_now.cols() + own.begin;
      double* q = Q_.data() + Q_at_[static_cast<std::size_t>(i)];
      std::copy(row_of_Q, row_of_Q + own.size, q + (own.begin - own.first));
      const double* s = &c.kinematics.S(0, i);
      // Beyond what the joint before has, or its own freedom before.
      const auto add = [&](int k, const double* to, int padded) {
        const Quad x = QuadAt(q + k);
        double* t = T + k;
        for (int row = 0; row < 6; ++row, t += own.padded, to += padded) QuadAt(t) = QuadAt(to) + s[row] * x;
      };
      for (int k = 0; k < own.padded; k += 4)
        if (i > joint.offset) {
          add(k, T + k, own.padded);
        } else if (k >= ahead && k < end) {
          add(k, T_.data() + up->at + (k - ahead), up->padded);
        } else {
          static constexpr double kNone[4] = {};
          add(k, kNone, 0);
        }
    }
  }
}

// R I Rᵀ + m (|c|² 1 - c cᵀ), c the centre where it is now.
void ReducedInertia::Sum::Add(const RigidTransform& X, const SpatialInertia& I) {
  const double* R = X.data();
  const Quad x = QuadAt(R), y = QuadAt(R + 3), z = QuadAt(R + 6);
  const auto turned = [&](int column) {
    const double* of = &I.rotational(0, column);
    return Quad(of[0] * x + of[1] * y + of[2] * z);
  };
  const Quad first = turned(0), second = turned(1), third = turned(2);
  const Vector3 c = X * I.center, p = I.mass * c;
  const Quad moved(p[0], p[1], p[2], I.mass);
  const double square = p.dot(c);
  for (int k = 0; k < 3; ++k) {
    Quad& column = rotational[static_cast<std::size_t>(k)];
    column += R[k] * first + R[3 + k] * second + R[6 + k] * third - c[k] * moved;
    column[k] += square;
  }
  moment += moved;
}

void ReducedInertia::Sum::Add(const Sum& other) {
  for (std::size_t k = 0; k < 3; ++k) rotational[k] += other.rotational[k];
  moment += other.moment;
}

Vector6 ReducedInertia::Sum::operator*(const Vector6& V) const {
  const Vector3 omega = V.head<3>(), v = V.tail<3>(), m = moment.head<3>();
  const Quad turned = omega[0] * rotational[0] + omega[1] * rotational[1] + omega[2] * rotational[2];
  Vector6 out;
  out << turned.head<3>() + m.cross(v), mass() * v - m.cross(omega);
  return out;
}

ReducedInertia::ReducedInertia(const ReducedModel& model)
    : sums_(static_cast<std::size_t>(model.mechanism->num_joints())), padded_(model.size() + 3) {
  const auto size = static_cast<std::size_t>(padded_);
  h_.resize(size);
  M_zz_.resize(size * size);
  M_0z_.resize(6 * size);
  below_.resize(static_cast<std::size_t>(model.size()));
  for (std::size_t k = 0; k < below_.size(); ++k) below_[k] = static_cast<int>(k) + 1;
  const ReducedJacobian jacobian(model);
  for (int j = 0; j < model.mechanism->num_joints(); ++j) {
    const int end = jacobian.begin(j) + jacobian.size(j);
    for (int k = jacobian.begin(j); k < end; ++k) {
      int& below = below_[static_cast<std::size_t>(k)];
      below = std::max(below, end);
    }
  }
}

void ReducedInertia::ClearApart(Eigen::Ref<MatrixX> M_zz) const {
  for (Eigen::Index k = 0; k < M_zz.cols(); ++k)
    for (Eigen::Index l = below_[static_cast<std::size_t>(k)]; l < M_zz.rows(); ++l) M_zz(l, k) = M_zz(k, l) = 0;
}

// With Ic_j the inertia of all that joint j carries, T_j = T + s qᵀ and T that of the joint before it,
//     Σ T_jᵀ I_j T_j = Σ T_jᵀ Ic_j T_j − Tᵀ Ic_j T = Σ h qᵀ + q hᵀ,   h = Tᵀ Ic_j s + ½ (sᵀ Ic_j s) q
// one column s of a joint after the other: two products of columns for what bodies one by one need six for.
void ReducedInertia::Compute(const ReducedModel& model, const RigidParts& parts, const Configuration& c,
                             const ReducedJacobian& jacobian, Eigen::Ref<MatrixX> M_zz, Matrix6X& M_0z,
                             Matrix6& M_00) {
  const Mechanism& m = *model.mechanism;
  ClearBelow();
  std::fill(M_0z_.begin(), M_0z_.end(), 0.0);
  for (Sum& sum : sums_) sum = Sum{};
  const std::ptrdiff_t padded = padded_;
  Sum all;
  all.Add(RigidTransform(), parts.parts[0].inertia_R0);
  double* h = h_.data();
  for (int j = m.num_joints() - 1; j >= 0; --j) {
    const Mechanism::Joint& joint = m.joints()[static_cast<std::size_t>(j)];
    Sum& I = sums_[static_cast<std::size_t>(j)];
    const SpatialInertia& at_zero = parts.parts[static_cast<std::size_t>(j) + 1].inertia_R0;
    if (at_zero.mass != 0) I.Add(c.kinematics.P[static_cast<std::size_t>(j)], at_zero);
    (joint.previous >= 0 ? sums_[static_cast<std::size_t>(joint.previous)] : all).Add(I);
    const ReducedJacobian::Run& run = jacobian.run(j);
    for (int i = joint.offset; i < joint.offset + joint.size; ++i) {
      const Vector6 s = c.kinematics.S.col(i), f = I * s;
      const double* q = jacobian.Q(i);
      const double own = 0.5 * (s.dot(f) + m.armature()(i));
      int ahead = 0, carried = 0;  // where the columns of the joint before begin in these, and how many
      const double* T = nullptr;
      if (joint.previous >= 0) {
        const ReducedJacobian::Run& up = jacobian.run(joint.previous);
        T = jacobian.T_.data() + up.at;
        ahead = up.first - run.first;
        carried = up.padded;
      }
      double* M_0 = M_0z_.data() + run.first;
      for (int k = 0; k < run.padded; k += 4) {
        const Quad x = QuadAt(q + k);
        Quad y = own * x;
        if (k >= ahead && k < ahead + carried) {
          const double* t = T + (k - ahead);
          for (int row = 0; row < 6; ++row, t += carried) y += f[row] * QuadAt(t);
        }
        QuadAt(h + k) = y;
        double* M = M_0 + k;
        for (int row = 0; row < 6; ++row, M += padded) QuadAt(M) += f[row] * x;
      }
      for (int e = joint.offset; e < i; ++e) {
        const double share = c.kinematics.S.col(e).dot(f);
        const double* q_e = jacobian.Q(e);
        for (int k = 0; k < run.padded; k += 4) QuadAt(h + k) += share * QuadAt(q_e + k);
      }
      AddSymmetric(q, run.first, run.padded);
    }
  }
  for (int k = 0; k < 3; ++k) M_00.col(k).head<3>() = all.rotational[static_cast<std::size_t>(k)].head<3>();
  M_00.topRightCorner<3, 3>() = Skew(all.moment.head<3>());
  M_00.bottomLeftCorner<3, 3>() = -M_00.topRightCorner<3, 3>();
  M_00.bottomRightCorner<3, 3>() = all.mass() * Matrix3::Identity();
  const int r = model.size();
  for (int k = 0; k < r; ++k) {
    const double* column = M_zz_.data() + k * padded_;
    for (int l = k; l < below_[static_cast<std::size_t>(k)]; ++l) M_zz(l, k) = M_zz(k, l) = column[l];
    for (int row = 0; row < 6; ++row) M_0z(row, k) = M_0z_[static_cast<std::size_t>(row * padded_ + k)];
  }
}

// The diagonal and what stands below it, and the rest of the fours that AddSymmetric meets.
void ReducedInertia::ClearBelow() {
  for (int k = 0; k < padded_; ++k) {
    double* column = M_zz_.data() + static_cast<std::ptrdiff_t>(k) * padded_;
    const int first = std::max(0, k - 3);
    ByFours(padded_ - first, [&](const auto& at) { at(column + first).setZero(); });
  }
}

// M_zz += h qᵀ + q hᵀ from column `first` on, below the diagonal and in the fours that it meets.
void ReducedInertia::AddSymmetric(const double* q, int first, int padded) {
  const double* h = h_.data();
  const std::ptrdiff_t stride = padded_;
  for (int k = 0; k < padded; k += 4) {
    const double q0 = q[k], q1 = q[k + 1], q2 = q[k + 2], q3 = q[k + 3];
    const double h0 = h[k], h1 = h[k + 1], h2 = h[k + 2], h3 = h[k + 3];
    double* column = M_zz_.data() + (first + k) * stride + first;
    for (int l = k; l < padded; l += 4) {
      const Quad x = QuadAt(q + l), y = QuadAt(h + l);
      double* M = column + l;
      QuadAt(M) += q0 * y + h0 * x;
      QuadAt(M + stride) += q1 * y + h1 * x;
      QuadAt(M + 2 * stride) += q2 * y + h2 * x;
      QuadAt(M + 3 * stride) += q3 * y + h3 * x;
    }
  }
}

}  // namespace fork1s
