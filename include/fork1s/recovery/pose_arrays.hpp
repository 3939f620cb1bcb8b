// The poses of all bodies of one reference as arrays for wide registers, in f32 or f64, by any recovery.
//
// docs/method.md, section 2. RecoverPosesExact and RecoverPosesTwist give one object a body, for who asks for
// some; this gives numbers that stand side by side, for who draws, senses or learns from all of them, of one
// mechanism or of many that share a reference. SSE4, AVX2 and AVX-512 are chosen when the program runs.
#pragma once

#include <cstddef>
#include <fork1s/recovery/recovery.hpp>
#include <fork1s/reduction/reduced_model.hpp>
#include <memory>

namespace fork1s {

namespace internal {
template <class Real>
class PoseBackend;
}

/// Poses as rows: nine entries of the rotation, by rows, then three of the translation [m]. Entry i of pose k
/// is row(i)[k]. Rows begin on a cache line and are padded to whole ones, or one more, so that a pose's
/// entries do not all fall on the same few lines of a cache; what stands there means nothing.
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

/// How RecoverMany closed the loops of many states side by side.
struct LoopClosing {
  std::size_t one_by_one = 0;  // states that did not close so, and were handed to Configure
  std::size_t open = 0;        // of these, states that it left open as well
  int corrections = 0;         // most that any state took side by side
};

/// The map from reduced coordinates to poses about one reference, laid out for wide registers. To be made
/// again after a refresh.
///
/// - kTwist: X_RB = Exp(T_B z) X_RB(q_ref). In f64 it is RecoverPosesTwist to 1e-14 of the mechanism's
///   size; in f32 rotations are off by less than 5e-7 and translations by that times the distance from the
///   root. A body that has turned by more than half a turn from the reference is recovered one by one, at
///   full precision.
/// - kExact: joints by any angle, loops closed, as RecoverPosesExact of a model without curvature. On trees
///   rounding is 4e-16 (f64) or 1e-7 (f32) of the mechanism's size for each joint on a body's path. Loops are
///   closed to 1e-12 or 1e-5, as angles and in shares of the mechanism's extent, before the last correction;
///   states that take more than a dozen go to Configure. Where a loop has several closed poses far away from
///   the reference, the two may come to different ones.
/// - kExpanded: as kExact.
/// - kCurved: Configure of a model with curvature, to the same rounding; the model need not have it.
///
/// States of one RecoverMany are walked side by side and one state of Recover otherwise, so that both are
/// the same to rounding and not to the bit, other than by kTwist.
template <class Real>
class PoseRecovery {
 public:
  PoseRecovery(const ReducedModel& model, Recovery recovery);
  ~PoseRecovery();
  PoseRecovery(PoseRecovery&&) noexcept;
  PoseRecovery& operator=(PoseRecovery&&) noexcept;

  int bodies() const;
  int coordinates() const;
  /// Bytes that one call of Recover reads and writes.
  std::size_t BytesMoved() const;
  /// Multiplications and additions of one call of Recover, or of RecoverMany for one instance; where loops
  /// are closed exactly, without the corrections.
  std::size_t Operations() const;

  /// Poses of all bodies in the root frame from z [r]; `out` gets one a body. In parallel from some ten
  /// thousand.
  LoopClosing Recover(const Real* z, PoseArrays<Real>& out) const;
  /// The same for many states: coordinate k of state i is z[k * z_stride + i]. Pose i of body b is number i
  /// of out[b], and `out` has bodies() entries.
  LoopClosing RecoverMany(const Real* z, std::size_t z_stride, std::size_t states,
                          PoseArrays<Real>* out) const;

 private:
  std::unique_ptr<internal::PoseBackend<Real>> backend_;
};

extern template class PoseArrays<float>;
extern template class PoseArrays<double>;
extern template class PoseRecovery<float>;
extern template class PoseRecovery<double>;

/// What the kernels were compiled for that this processor runs: "AVX2", "AVX3", ...
const char* RecoveryInstructionSet();

}  // namespace fork1s
