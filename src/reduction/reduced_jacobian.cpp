#include <fork1s/reduction/reduced_jacobian.hpp>

#include <algorithm>

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

void ReducedInertia(const ReducedModel& model, const RigidParts& parts, const Configuration& c,
                    const ReducedJacobian& jacobian, Eigen::Ref<MatrixX> M_zz, Matrix6X& M_0z,
                    Matrix6& M_00) {
  const Mechanism& m = *model.mechanism;
  M_zz.setZero();
  M_0z.setZero();
  M_00 = parts.parts[0].inertia_R0.Matrix();
  for (int j = 0; j < m.num_joints(); ++j) {
    const SpatialInertia& at_zero = parts.parts[static_cast<std::size_t>(j) + 1].inertia_R0;
    if (at_zero.mass == 0) continue;
    const Matrix6 I = Transform(c.kinematics.P[static_cast<std::size_t>(j)], at_zero).Matrix();
    M_00 += I;
    const auto T = jacobian.T(j);
    const int begin = jacobian.begin(j), size = jacobian.size(j);
    // Column by column: products of six rows cost less than a general product's set-up.
    for (int k = 0; k < size; ++k) {
      const Vector6 IT = I * T.col(k);
      M_0z.col(begin + k) += IT;
      for (int i = k; i < size; ++i) M_zz(begin + i, begin + k) += T.col(i).dot(IT);
    }
  }
  const int r = model.size();
  for (int i = 0; i < model.num_coordinates(); ++i) {
    const double rotor = m.armature()(i);
    if (rotor == 0) continue;
    for (int k = 0; k < r; ++k) {
      const double q = rotor * c.Q_now(i, k);
      if (q == 0) continue;
      for (int l = k; l < r; ++l) M_zz(l, k) += q * c.Q_now(i, l);
    }
  }
  for (int k = 0; k < r; ++k)
    for (int l = k + 1; l < r; ++l) M_zz(k, l) = M_zz(l, k);
}

}  // namespace fork1s
