#include <fork1s/reduction/reduced_jacobian.hpp>

#include <algorithm>
#include <fork1s/spatial/rigid_transform.hpp>

namespace fork1s {

ReducedJacobian::ReducedJacobian(const ReducedModel& model) {
  const Mechanism& m = *model.mechanism;
  const int r = model.size();
  runs_.resize(static_cast<std::size_t>(m.num_joints()));
  Eigen::Index next = 0;
  for (int j = 0; j < m.num_joints(); ++j) {
    const Mechanism::Joint& joint = m.joints()[static_cast<std::size_t>(j)];
    int first = r, last = -1;
    if (model.loop_rank() > 0) {  // loops let every coordinate turn into every joint
      first = 0;
      last = r - 1;
    }
    if (joint.previous >= 0 && size(joint.previous) > 0) {
      first = std::min(first, begin(joint.previous));
      last = std::max(last, begin(joint.previous) + size(joint.previous) - 1);
    }
    for (int i = joint.offset; i < joint.offset + joint.size; ++i)
      for (int k = 0; k < r; ++k)
        if (model.Q(i, k) != 0) {
          first = std::min(first, k);
          last = std::max(last, k);
        }
    Run& run = runs_[static_cast<std::size_t>(j)];
    run.begin = last < 0 ? 0 : first;
    run.size = last < 0 ? 0 : last + 1 - first;
    run.at = next;
    next += run.size;
  }
  T_.setZero(6, next);
}

void ReducedJacobian::Compute(const ReducedModel& model, const Configuration& c) {
  const Mechanism& m = *model.mechanism;
  for (int j = 0; j < m.num_joints(); ++j) {
    const Mechanism::Joint& joint = m.joints()[static_cast<std::size_t>(j)];
    const Run& run = runs_[static_cast<std::size_t>(j)];
    auto T = T_.middleCols(run.at, run.size);
    T.setZero();
    if (joint.previous >= 0) {
      const Run& up = runs_[static_cast<std::size_t>(joint.previous)];
      T.middleCols(up.begin - run.begin, up.size) = T_.middleCols(up.at, up.size);
    }
    for (int i = joint.offset; i < joint.offset + joint.size; ++i)
      for (int k = 0; k < run.size; ++k)
        if (const double q = c.Q_now(i, run.begin + k); q != 0) T.col(k) += q * c.kinematics.S.col(i);
  }
}

void ReducedInertia::Sum::Add(const SpatialInertia& I) {
  mass += I.mass;
  moment += I.mass * I.center;
  rotational += I.rotational;
  rotational.diagonal().array() += I.mass * I.center.squaredNorm();
  rotational -= (I.mass * I.center) * I.center.transpose();
}

void ReducedInertia::Sum::Add(const Sum& other) {
  mass += other.mass;
  moment += other.moment;
  rotational += other.rotational;
}

Vector6 ReducedInertia::Sum::operator*(const Vector6& V) const {
  const Vector3 omega = V.head<3>(), v = V.tail<3>();
  Vector6 out;
  out << rotational * omega + moment.cross(v), mass * v - moment.cross(omega);
  return out;
}

ReducedInertia::ReducedInertia(const ReducedModel& model)
    : sums_(static_cast<std::size_t>(model.mechanism->num_joints())),
      q_(VectorX::Zero(model.size())),
      h_(VectorX::Zero(model.size())) {}

// With Ic_j the inertia of all that joint j carries, T_j = T + s qᵀ and T that of the joint before it,
//     Σ T_jᵀ I_j T_j = Σ T_jᵀ Ic_j T_j − Tᵀ Ic_j T = Σ h qᵀ + q hᵀ,   h = Tᵀ Ic_j s + ½ (sᵀ Ic_j s) q
// one column s of a joint after the other: two products of columns for what bodies one by one need six for.
void ReducedInertia::Compute(const ReducedModel& model, const RigidParts& parts, const Configuration& c,
                             const ReducedJacobian& jacobian, Eigen::Ref<MatrixX> M_zz, Matrix6X& M_0z,
                             Matrix6& M_00) {
  const Mechanism& m = *model.mechanism;
  M_zz.setZero();
  M_0z.setZero();
  for (Sum& sum : sums_) sum = Sum{};
  Sum all;
  all.Add(parts.parts[0].inertia_R0);
  for (int j = m.num_joints() - 1; j >= 0; --j) {
    const Mechanism::Joint& joint = m.joints()[static_cast<std::size_t>(j)];
    Sum& I = sums_[static_cast<std::size_t>(j)];
    const SpatialInertia& at_zero = parts.parts[static_cast<std::size_t>(j) + 1].inertia_R0;
    if (at_zero.mass != 0) I.Add(Transform(c.kinematics.P[static_cast<std::size_t>(j)], at_zero));
    (joint.previous >= 0 ? sums_[static_cast<std::size_t>(joint.previous)] : all).Add(I);
    const int begin = jacobian.begin(j), size = jacobian.size(j);
    double *q = q_.data(), *h = h_.data();
    for (int i = joint.offset; i < joint.offset + joint.size; ++i) {
      const Vector6 s = c.kinematics.S.col(i), f = I * s;
      const double own = 0.5 * (s.dot(f) + m.armature()(i));
      for (int k = 0; k < size; ++k) {
        q[k] = c.Q_now(i, begin + k);
        h[k] = own * q[k];
      }
      if (joint.previous >= 0) {
        const auto T = jacobian.T(joint.previous);
        const int ahead = jacobian.begin(joint.previous) - begin;
        for (int k = 0; k < jacobian.size(joint.previous); ++k) h[ahead + k] += T.col(k).dot(f);
      }
      for (int e = joint.offset; e < i; ++e) {
        const double share = c.kinematics.S.col(e).dot(f);
        for (int k = 0; k < size; ++k) h[k] += share * c.Q_now(e, begin + k);
      }
      for (int k = 0; k < size; ++k) {
        const double q_k = q[k], h_k = h[k];
        if (q_k != 0) M_0z.col(begin + k) += q_k * f;
        if (q_k == 0 && h_k == 0) continue;
        double* column = &M_zz(begin, begin + k);
        for (int l = k; l < size; ++l) column[l] += q_k * h[l] + h_k * q[l];
      }
    }
  }
  M_00.topLeftCorner<3, 3>() = all.rotational;
  M_00.topRightCorner<3, 3>() = Skew(all.moment);
  M_00.bottomLeftCorner<3, 3>() = -M_00.topRightCorner<3, 3>();
  M_00.bottomRightCorner<3, 3>() = all.mass * Matrix3::Identity();
  const int r = model.size();
  for (int k = 0; k < r; ++k)
    for (int l = k + 1; l < r; ++l) M_zz(k, l) = M_zz(l, k);
}

}  // namespace fork1s
