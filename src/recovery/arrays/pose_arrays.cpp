#include <fork1s/recovery/pose_arrays.hpp>

#include <new>

#include "aligned_vector.hpp"
#include "pose_backend.hpp"

namespace fork1s {

template <class Real>
void PoseArrays<Real>::Free::operator()(Real* values) const {
  ::operator delete(values, internal::kCacheLine);
}

template <class Real>
void PoseArrays<Real>::Resize(std::size_t poses) {
  size_ = poses;
  stride_ = internal::Padded<Real>(poses);
  // Twelve rows a power of two apart share a set or two of the first cache, which holds eight or twelve lines
  // of a set.
  if (stride_ * sizeof(Real) % 1024 == 0) stride_ += internal::kBlock<Real>;
  if (12 * stride_ <= capacity_) return;
  capacity_ = 12 * stride_;
  values_.reset(static_cast<Real*>(::operator new(capacity_ * sizeof(Real), internal::kCacheLine)));
}

template <class Real>
RigidTransform PoseArrays<Real>::Pose(std::size_t k) const {
  FORK1S_REQUIRE(k < size_, k);
  RigidTransform X;
  for (int i = 0; i < 9; ++i) X.rotation()(i / 3, i % 3) = row(i)[k];
  for (int i = 0; i < 3; ++i) X.translation()(i) = row(9 + i)[k];
  return X;
}

template <class Real>
PoseRecovery<Real>::PoseRecovery(const ReducedModel& model, Recovery recovery)
    : backend_(recovery == Recovery::kTwist ? internal::MakeTwistBackend<Real>(model)
                                            : internal::MakeChainBackend<Real>(model, recovery)) {}

template <class Real>
PoseRecovery<Real>::~PoseRecovery() = default;
template <class Real>
PoseRecovery<Real>::PoseRecovery(PoseRecovery&&) noexcept = default;
template <class Real>
PoseRecovery<Real>& PoseRecovery<Real>::operator=(PoseRecovery&&) noexcept = default;

template <class Real>
int PoseRecovery<Real>::bodies() const {
  return backend_->bodies();
}
template <class Real>
int PoseRecovery<Real>::coordinates() const {
  return backend_->coordinates();
}
template <class Real>
std::size_t PoseRecovery<Real>::BytesMoved() const {
  return backend_->BytesMoved();
}
template <class Real>
std::size_t PoseRecovery<Real>::Operations() const {
  return backend_->Operations();
}
template <class Real>
LoopClosing PoseRecovery<Real>::Recover(const Real* z, PoseArrays<Real>& out) const {
  return backend_->Recover(z, out);
}
template <class Real>
LoopClosing PoseRecovery<Real>::RecoverMany(const Real* z, std::size_t z_stride, std::size_t states,
                                            PoseArrays<Real>* out) const {
  FORK1S_REQUIRE(z_stride >= states, z_stride, states);
  return backend_->RecoverMany(z, z_stride, states, out);
}

template class PoseArrays<float>;
template class PoseArrays<double>;
template class PoseRecovery<float>;
template class PoseRecovery<double>;

}  // namespace fork1s
