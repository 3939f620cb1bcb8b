#include "reduction/reduced_jacobian.hpp"

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
  reach_.assign(static_cast<std::size_t>(model.size()), 0);
  values = 0;
  for (int j = 0; j < m.num_joints(); ++j) {
    const Mechanism::Joint& joint = m.joints()[static_cast<std::size_t>(j)];
    Run& own = runs_[static_cast<std::size_t>(j)];
    own.coordinate = joint.offset;
    own.freedoms = joint.size;
    own.previous = joint.previous;
    if (joint.previous >= 0 && size(joint.previous) > 0) {
      const Run& up = run(joint.previous);
      own.up_begin = up.first - own.first;
      own.up_end = own.up_begin + up.padded;
      own.up_at = up.at;
    }
    own.Q_at = values;
    if (bands_.empty() || bands_.back().first != own.first || bands_.back().padded != own.padded)
      bands_.push_back({joint.offset, 0, own.first, own.padded, values});
    bands_.back().rows += joint.size;
    values += static_cast<Eigen::Index>(joint.size) * own.padded;
    for (int k = own.begin; k < own.begin + own.size; ++k) {
      int& reach = reach_[static_cast<std::size_t>(k)];
      reach = std::max(reach, own.begin + own.size);
    }
  }
  Q_.assign(static_cast<std::size_t>(values), 0.0);
  LoadRows(model.Q_rows);
}

namespace {

// f<quads>(k) over columns [begin, end), three fours at a time and then what is left.
template <class F>
void ByThreeFours(int begin, int end, F&& f) {
  int k = begin;
  for (; k + 12 <= end; k += 12) f.template operator()<3>(k);
  if (k + 8 == end) f.template operator()<2>(k);
  if (k + 4 == end) f.template operator()<1>(k);
}

// Columns of T = T_up + s qᵀ; rows stand `stride` and `up_stride` apart.
template <int kQuads>
void AddScrew(const double* T_up, std::ptrdiff_t up_stride, const double* s, const double* q, double* T,
              std::ptrdiff_t stride) {
  Quad x[kQuads];
  for (int k = 0; k < kQuads; ++k) x[k] = QuadAt(q + 4 * k);
  for (int row = 0; row < 6; ++row, T += stride, T_up += up_stride)
    for (int k = 0; k < kQuads; ++k) QuadAt(T + 4 * k) = QuadAt(T_up + 4 * k) + s[row] * x[k];
}

// What stands before a joint that nothing moves.
constexpr double kNoColumns[12] = {};

}  // namespace

// Outside of a coordinate's run a row is 0, so that those of a band go alike.
void ReducedJacobian::LoadRows(const RowMatrixX& Q) {
  const auto columns = static_cast<int>(Q.cols());
  for (const Band& band : bands_) {
    const int width = std::min(band.padded, columns - band.first);
    const double* from = Q.data() + band.coordinate * Q.cols() + band.first;
    double* to = Q_.data() + band.at;
    for (int row = 0; row < band.rows; ++row, from += columns, to += band.padded)
      ByFours(width, [&](const auto& at) { at(to) = at(from); });
  }
}

void ReducedJacobian::Compute(const ReducedModel& model, const Configuration& c) {
  if (model.loop_rank() > 0) LoadRows(c.Q_now);  // on trees it is Q at any pose
  for (const Run& own : runs_) {
    double* const T = T_.data() + own.at;
    const double *q = Q_.data() + own.Q_at, *s = c.kinematics.S.data() + 6 * own.coordinate;
    const auto alone = [&]<int kQuads>(int k) {
      AddScrew<kQuads>(kNoColumns, 0, s, q + k, T + k, own.padded);
    };
    const double* const T_up = T_.data() + own.up_at;
    const int up_stride = own.up_end - own.up_begin;
    ByThreeFours(own.up_begin, own.up_end, [&]<int kQuads>(int k) {
      AddScrew<kQuads>(T_up + (k - own.up_begin), up_stride, s, q + k, T + k, own.padded);
    });
    ByThreeFours(0, own.up_begin, alone);
    ByThreeFours(own.up_end, own.padded, alone);
    for (int i = 1; i < own.freedoms; ++i) {
      q += own.padded;
      s += 6;
      ByThreeFours(0, own.padded, [&]<int kQuads>(int k) {
        AddScrew<kQuads>(T + k, own.padded, s, q + k, T + k, own.padded);
      });
    }
  }
}

inline void ReducedInertia::Sum::Clear() {
  for (Quad& column : rotational) column.setZero();
  moment.setZero();
  mass = 0;
}

inline void ReducedInertia::Sum::Add(const RigidTransform& X, const SpatialInertia& I) {
  const double *R = X.rotation().data(), *p = X.translation().data(), *J = I.rotational.data();
  const Quad x = QuadAt(R), y = QuadAt(R + 3), z(R[6], R[7], R[8], 0);
  const Quad c = I.center[0] * x + I.center[1] * y + I.center[2] * z + Quad(p[0], p[1], p[2], 0);
  const Quad turned[3] = {J[0] * x + J[1] * y + J[2] * z, J[3] * x + J[4] * y + J[5] * z,
                          J[6] * x + J[7] * y + J[8] * z};  // columns of R J
  const Quad mc = I.mass * c;
  moment += mc;
  const double around = mc[0] * c[0] + mc[1] * c[1] + mc[2] * c[2];
  for (int k = 0; k < 3; ++k) {
    rotational[k] += R[k] * turned[0] + R[3 + k] * turned[1] + R[6 + k] * turned[2] - c[k] * mc;
    rotational[k][k] += around;
  }
  mass += I.mass;
}

inline void ReducedInertia::Sum::Add(const Sum& other) {
  for (int k = 0; k < 3; ++k) rotational[k] += other.rotational[k];
  moment += other.moment;
  mass += other.mass;
}

inline void ReducedInertia::Sum::Apply(const double* twist, double* momentum) const {
  const double *w = twist, *v = twist + 3;
  const double* m = moment.data();
  const Quad spin = w[0] * rotational[0] + w[1] * rotational[1] + w[2] * rotational[2];
  momentum[0] = spin[0] + (m[1] * v[2] - m[2] * v[1]);
  momentum[1] = spin[1] + (m[2] * v[0] - m[0] * v[2]);
  momentum[2] = spin[2] + (m[0] * v[1] - m[1] * v[0]);
  momentum[3] = mass * v[0] - (m[1] * w[2] - m[2] * w[1]);
  momentum[4] = mass * v[1] - (m[2] * w[0] - m[0] * w[2]);
  momentum[5] = mass * v[2] - (m[0] * w[1] - m[1] * w[0]);
}

ReducedInertia::ReducedInertia(const ReducedModel& model)
    : sums_(static_cast<std::size_t>(model.mechanism->num_joints())),
      padded_(model.size() + 3),
      base_moves_(model.mechanism->base() != BaseKind::kFixed) {
  const auto size = static_cast<std::size_t>(padded_);
  const auto coordinates = static_cast<std::size_t>(model.num_coordinates());
  f_.resize(6 * coordinates);
  h_.resize(size * coordinates);
  half_.resize(size * size);
  M_0z_.resize(6 * size);
}

namespace {

// X += Hᵀ Q, 4 kQuads rows by four columns, over `rows` rows of H and Q, `padded` apart; columns of X `stride`
// apart. X stays in registers meanwhile.
template <int kQuads>
void AddOuterProducts(const double* h, const double* q, int rows, std::ptrdiff_t padded, double* X,
                      std::ptrdiff_t stride) {
  Quad sum[4][kQuads];
  for (int column = 0; column < 4; ++column)
    for (int k = 0; k < kQuads; ++k) sum[column][k] = QuadAt(X + column * stride + 4 * k);
  for (; rows > 0; --rows, h += padded, q += padded) {
    Quad own[kQuads];
    for (int k = 0; k < kQuads; ++k) own[k] = QuadAt(h + 4 * k);
    for (int column = 0; column < 4; ++column)
      for (int k = 0; k < kQuads; ++k) sum[column][k] += q[column] * own[k];
  }
  for (int column = 0; column < 4; ++column)
    for (int k = 0; k < kQuads; ++k) QuadAt(X + column * stride + 4 * k) = sum[column][k];
}

// h = own q + T_upᵀ f
template <int kQuads>
void AccumulateHalf(double own, const double* q, const double* f, const double* T_up,
                    std::ptrdiff_t up_stride, double* h) {
  Quad sum[kQuads];
  for (int k = 0; k < kQuads; ++k) sum[k] = own * QuadAt(q + 4 * k);
  for (int row = 0; row < 6; ++row, T_up += up_stride)
    for (int k = 0; k < kQuads; ++k) sum[k] += f[row] * QuadAt(T_up + 4 * k);
  for (int k = 0; k < kQuads; ++k) QuadAt(h + 4 * k) = sum[k];
}

// M_0 += F Q, four columns; `f` six numbers a row of Q, rows of M_0 `stride` apart.
void AddMoments(const double* f, const double* q, int rows, std::ptrdiff_t padded, double* M_0,
                std::ptrdiff_t stride) {
  Quad sum[6];
  for (int row = 0; row < 6; ++row) sum[row] = QuadAt(M_0 + row * stride);
  for (; rows > 0; --rows, f += 6, q += padded) {
    const Quad x = QuadAt(q);
    for (int row = 0; row < 6; ++row) sum[row] += f[row] * x;
  }
  for (int row = 0; row < 6; ++row) QuadAt(M_0 + row * stride) = sum[row];
}

}  // namespace

// With Ic_j the inertia of all that joint j carries, T_j = T + s qᵀ and T that of the joint before it,
//     Σ T_jᵀ I_j T_j = Σ T_jᵀ Ic_j T_j − Tᵀ Ic_j T = Σ h qᵀ + q hᵀ,   h = Tᵀ Ic_j s + ½ (sᵀ Ic_j s) q
// one column s of a joint after the other. Rows h and q of all joints stand one below the other, so that Σ h qᵀ is a
// product of two matrices, half of M_zz as its transpose is the other.
void ReducedInertia::Compute(const ReducedModel& model, const RigidParts& parts, const Configuration& c,
                             const ReducedJacobian& jacobian, Eigen::Ref<MatrixX> M_zz, Matrix6X& M_0z,
                             Matrix6& M_00) {
  ComputeMomenta(model, parts, c, jacobian, M_00);
  AddBands(jacobian);
  const int r = model.size();
  for (int k = 0; k < r; ++k) {
    const double *column = half_.data() + k * padded_, *row = half_.data() + k;
    const int end = jacobian.reach_[static_cast<std::size_t>(k)];
    for (int l = k; l < end; ++l) M_zz(l, k) = M_zz(k, l) = column[l] + row[l * padded_];
  }
  if (!base_moves_) return;
  for (int k = 0; k < r; ++k)
    for (int i = 0; i < 6; ++i) M_0z(i, k) = M_0z_[static_cast<std::size_t>(i * padded_ + k)];
}

void ReducedInertia::ClearApart(const ReducedJacobian& jacobian, Eigen::Ref<MatrixX> M_zz) {
  for (Eigen::Index k = 0; k < M_zz.cols(); ++k)
    for (Eigen::Index l = std::max<Eigen::Index>(k, jacobian.reach_[static_cast<std::size_t>(k)]);
         l < M_zz.rows(); ++l)
      M_zz(l, k) = M_zz(k, l) = 0;
}

// Armature of a joint with a rotation, between its freedoms; false where it has none and the diagonal is all.
bool ReducedInertia::FillArmature(const Mechanism& mechanism, const Kinematics& kinematics, int joint_index) {
  const Mechanism::Joint& joint = mechanism.joints()[static_cast<std::size_t>(joint_index)];
  if (joint.rotation < 0 || mechanism.armature().segment(joint.offset, joint.size).isZero(0)) return false;
  armature_.setZero();
  armature_.diagonal().head(joint.size) = mechanism.armature().segment(joint.offset, joint.size);
  const Mechanism::Rotation& rotation = mechanism.rotations()[static_cast<std::size_t>(joint.rotation)];
  const Matrix3 block = WeightedRotationBlock(mechanism, kinematics, rotation, mechanism.armature());
  for (int i = 0; i < 3; ++i)
    for (int e = 0; e < 3; ++e)
      armature_(rotation.coordinates[static_cast<std::size_t>(i)] - joint.offset,
                rotation.coordinates[static_cast<std::size_t>(e)] - joint.offset) = block(i, e);
  return true;
}

// f = Ic s and h of every coordinate, and M_00.
void ReducedInertia::ComputeMomenta(const ReducedModel& model, const RigidParts& parts,
                                    const Configuration& c, const ReducedJacobian& jacobian, Matrix6& M_00) {
  const VectorX& armature = model.mechanism->armature();
  for (Sum& sum : sums_) sum.Clear();
  Sum all;
  all.Clear();
  all.Add(RigidTransform(), parts.parts[0].inertia_R0);
  for (std::size_t j = sums_.size(); j-- > 0;) {
    const ReducedJacobian::Run& run = jacobian.runs_[j];
    Sum& I = sums_[j];
    const SpatialInertia& at_zero = parts.parts[j + 1].inertia_R0;
    if (at_zero.mass != 0) I.Add(c.kinematics.P[j], at_zero);
    (run.previous >= 0 ? sums_[static_cast<std::size_t>(run.previous)] : all).Add(I);
    const double* const T_up = jacobian.T_.data() + run.up_at;
    const int up_stride = run.up_end - run.up_begin;
    const double* const S = c.kinematics.S.data() + 6 * run.coordinate;
    const bool rotates = FillArmature(*model.mechanism, c.kinematics, static_cast<int>(j));
    for (int i = 0; i < run.freedoms; ++i) {
      double* const f = f_.data() + 6 * (run.coordinate + i);
      I.Apply(S + 6 * i, f);
      const auto along = [f](const double* t) {
        return (t[0] * f[0] + t[1] * f[1] + t[2] * f[2]) + (t[3] * f[3] + t[4] * f[4] + t[5] * f[5]);
      };
      const double rotor = rotates ? armature_(i, i) : armature(run.coordinate + i);
      const double own = 0.5 * (along(S + 6 * i) + rotor);
      const Eigen::Index at = run.Q_at + i * run.padded;
      const double* const q = jacobian.Q_.data() + at;
      double* const h = h_.data() + at;
      for (int k = 0; k < run.up_begin; k += 4) QuadAt(h + k) = own * QuadAt(q + k);
      for (int k = run.up_end; k < run.padded; k += 4) QuadAt(h + k) = own * QuadAt(q + k);
      ByThreeFours(run.up_begin, run.up_end, [&]<int kQuads>(int k) {
        AccumulateHalf<kQuads>(own, q + k, f, T_up + (k - run.up_begin), up_stride, h + k);
      });
      for (int e = 0; e < i; ++e) {
        const double share = along(S + 6 * e) + (rotates ? armature_(i, e) : 0);
        const double* q_e = jacobian.Q_.data() + run.Q_at + e * run.padded;
        for (int k = 0; k < run.padded; k += 4) QuadAt(h + k) += share * QuadAt(q_e + k);
      }
    }
  }
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) M_00(row, column) = all.rotational[column][row];
  M_00.topRightCorner<3, 3>() = Skew(all.moment.head<3>());
  M_00.bottomLeftCorner<3, 3>() = -M_00.topRightCorner<3, 3>();
  M_00.bottomRightCorner<3, 3>() = all.mass * Matrix3::Identity();
}

// Half of M_zz and M_0z, band by band of the rows of Q.
void ReducedInertia::AddBands(const ReducedJacobian& jacobian) {
  const std::ptrdiff_t stride = padded_;
  for (std::size_t k = 0; k < jacobian.reach_.size(); ++k)  // columns of the padding are never read
    std::fill_n(half_.data() + static_cast<std::ptrdiff_t>(k) * stride, padded_, 0.0);
  for (const ReducedJacobian::Band& band : jacobian.bands_) {
    const double *h = h_.data() + band.at, *q = jacobian.Q_.data() + band.at;
    for (int k = 0; k < band.padded; k += 4) {
      double* X = half_.data() + (band.first + k) * stride + band.first;
      ByThreeFours(0, band.padded, [&]<int kQuads>(int l) {
        AddOuterProducts<kQuads>(h + l, q + k, band.rows, band.padded, X + l, stride);
      });
    }
  }
  if (!base_moves_) return;
  std::fill(M_0z_.begin(), M_0z_.end(), 0.0);
  for (const ReducedJacobian::Band& band : jacobian.bands_)
    for (int k = 0; k < band.padded; k += 4)
      AddMoments(f_.data() + 6 * band.coordinate, jacobian.Q_.data() + band.at + k, band.rows, band.padded,
                 M_0z_.data() + band.first + k, stride);
}

}  // namespace fork1s
