// The ways from z to arrays of poses, one for each kind of recovery.
#pragma once

#include <fork1s/recovery/pose_arrays.hpp>
#include <memory>

#include "twist_kernels.hpp"

namespace fork1s::internal {

/// As PoseRecovery, which asks one of these.
template <class Real>
class PoseBackend {
 public:
  virtual ~PoseBackend() = default;
  virtual int bodies() const = 0;
  virtual int coordinates() const = 0;
  virtual std::size_t BytesMoved() const = 0;
  virtual std::size_t Operations() const = 0;
  virtual LoopClosing Recover(const Real* z, PoseArrays<Real>& out) const = 0;
  virtual LoopClosing RecoverMany(const Real* z, std::size_t z_stride, std::size_t states,
                                  PoseArrays<Real>* out) const = 0;
};

template <class Real>
std::unique_ptr<PoseBackend<Real>> MakeTwistBackend(const ReducedModel& model);
template <class Real>
std::unique_ptr<PoseBackend<Real>> MakeChainBackend(const ReducedModel& model, Recovery recovery);

extern template std::unique_ptr<PoseBackend<float>> MakeTwistBackend<float>(const ReducedModel&);
extern template std::unique_ptr<PoseBackend<double>> MakeTwistBackend<double>(const ReducedModel&);
extern template std::unique_ptr<PoseBackend<float>> MakeChainBackend<float>(const ReducedModel&, Recovery);
extern template std::unique_ptr<PoseBackend<double>> MakeChainBackend<double>(const ReducedModel&, Recovery);

/// Whole blocks that hold so many.
template <class Real>
std::size_t Padded(std::size_t n) {
  constexpr std::size_t block = kBlock<Real>;
  return (n + block - 1) / block * block;
}

/// Entry i of a pose as PoseArrays has them.
inline double Entry(const RigidTransform& X, int i) {
  return i < 9 ? X.rotation()(i / 3, i % 3) : X.translation()(i - 9);
}

template <class Real>
void PutPose(const RigidTransform& X, std::size_t k, PoseArrays<Real>& out) {
  for (int i = 0; i < 12; ++i) out.row(i)[k] = static_cast<Real>(Entry(X, i));
}

}  // namespace fork1s::internal
