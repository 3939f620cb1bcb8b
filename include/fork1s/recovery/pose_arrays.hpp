// The poses of all bodies of one reference by one twist each, as arrays for wide registers, in f32 or f64.
//
// docs/method.md, section 2. RecoverPosesTwist gives one object a body, for who asks for some; this gives
// numbers that stand side by side, for who draws, senses or learns from all of them, of one mechanism or of
// many that share a reference. SSE4, AVX2 and AVX-512 are chosen when the program runs.
#pragma once

#include <cstddef>
#include <fork1s/reduction/reduced_model.hpp>
#include <memory>

namespace fork1s {

/// Poses as rows: nine entries of the rotation, by rows, then three of the translation [m]. Entry i of pose k
/// is row(i)[k]. Rows begin on a cache line and are padded to whole ones; what stands there means nothing.
template <class Real>
class PoseArrays {
 public:
  PoseArrays() = default;
  /// Room for so many poses; contents are lost where it has to grow.
  void Resize(std::size_t poses);
  std::size_t size() const { return size_; }
  std::size_t stride() const { return stride_; }
  Real* row(int i) { return values_.get() + static_cast<std::size_t>(i) * stride_; }
  const Real* row(int i) const { return values_.get() + static_cast<std::size_t>(i) * stride_; }
  RigidTransform Pose(std::size_t k) const;

 private:
  struct Free {
    void operator()(Real* values) const;
  };
  std::size_t size_ = 0, stride_ = 0, capacity_ = 0;
  std::unique_ptr<Real[], Free> values_;
};

/// The map from reduced coordinates to poses about one reference, X_RB = Exp(T_B z) X_RB(q_ref), laid out for
/// wide registers. To be made anew after a refresh. Bodies hear few coordinates, and only those are read.
///
/// In f64 it is RecoverPosesTwist to 1e-14 of the mechanism's size; in f32 rotations are off by less than
/// 5e-7 and translations by that times the distance from the root. A body that has turned by more than half a
/// turn from the reference is recovered one by one, at full precision.
template <class Real>
class TwistRecovery {
 public:
  explicit TwistRecovery(const ReducedModel& model);
  ~TwistRecovery();
  TwistRecovery(TwistRecovery&&) noexcept;
  TwistRecovery& operator=(TwistRecovery&&) noexcept;

  int bodies() const;
  int coordinates() const;
  /// Bytes that one call of Recover reads and writes.
  std::size_t BytesMoved() const;
  /// Multiplications and additions of one call of Recover, or of RecoverMany for one instance.
  std::size_t Operations() const;

  /// Poses of all bodies in the root frame from z [r]; `out` gets one a body. In parallel from some ten
  /// thousand.
  void Recover(const Real* z, PoseArrays<Real>& out) const;
  /// The same for many states: coordinate k of state i is z[k * z_stride + i]. Pose i of body b is number i
  /// of out[b], and `out` has bodies() entries.
  void RecoverMany(const Real* z, std::size_t z_stride, std::size_t states, PoseArrays<Real>* out) const;

 private:
  struct Detail;
  std::unique_ptr<Detail> detail_;
};

extern template class PoseArrays<float>;
extern template class PoseArrays<double>;
extern template class TwistRecovery<float>;
extern template class TwistRecovery<double>;

/// What the kernels were compiled for that this processor runs: "AVX2", "AVX3", ...
const char* RecoveryInstructionSet();

}  // namespace fork1s
