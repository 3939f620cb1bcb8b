#include <fork1s/recovery/pose_arrays.hpp>

#include <algorithm>
#include <fork1s/parallel/parallel_for.hpp>
#include <new>

#include "aligned_vector.hpp"
#include "twist_kernels.hpp"

namespace fork1s {
namespace {

using internal::AlignedVector;
using internal::kBlock;
using internal::kCacheLine;
using internal::Missed;

template <class Real>
std::size_t Padded(std::size_t n) {
  constexpr std::size_t block = kBlock<Real>;
  return (n + block - 1) / block * block;
}

double Entry(const RigidTransform& X, int i) {
  return i < 9 ? X.rotation()(i / 3, i % 3) : X.translation()(i - 9);
}

template <class Real>
void Put(const RigidTransform& X, std::size_t k, PoseArrays<Real>& out) {
  for (int i = 0; i < 12; ++i) out.row(i)[k] = static_cast<Real>(Entry(X, i));
}

}  // namespace

template <class Real>
void PoseArrays<Real>::Free::operator()(Real* values) const {
  ::operator delete(values, kCacheLine);
}

template <class Real>
void PoseArrays<Real>::Resize(std::size_t poses) {
  size_ = poses;
  stride_ = Padded<Real>(poses);
  if (12 * stride_ <= capacity_) return;
  capacity_ = 12 * stride_;
  values_.reset(static_cast<Real*>(::operator new(capacity_ * sizeof(Real), kCacheLine)));
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
struct TwistRecovery<Real>::Detail {
  // What a TwistMap points to.
  struct Layout {
    std::vector<int> first{0}, heard;
    AlignedVector<Real> T, X_ref;

    void Fill(const ReducedModel& model, int width) {
      const int count = model.mechanism->num_bodies(), size = model.size();
      const auto column = [&](int body, int k) {
        return model.T.col(static_cast<Eigen::Index>(body) * size + k);
      };
      for (int begin = 0; begin < count; begin += width) {
        const int end = std::min(count, begin + width);
        for (int k = 0; k < size; ++k) {
          bool is_heard = false;
          for (int b = begin; b < end; ++b) is_heard |= !column(b, k).isZero(0);
          if (!is_heard) continue;
          heard.push_back(k);
          for (int row = 0; row < 6; ++row)
            for (int b = begin; b < begin + width; ++b)
              T.push_back(b < end ? static_cast<Real>(column(b, k)(row)) : Real(0));
        }
        first.push_back(static_cast<int>(heard.size()));
        for (int i = 0; i < 12; ++i)
          for (int b = begin; b < begin + width; ++b)
            X_ref.push_back(static_cast<Real>(
                Entry(b < end ? model.X_RB_ref[static_cast<std::size_t>(b)] : RigidTransform(), i)));
      }
    }
    internal::TwistMap<Real> Map() const { return {first.data(), heard.data(), T.data(), X_ref.data()}; }
  };

  int bodies = 0, r = 0;
  Matrix6X T;  // of the model, for what turns too far
  std::vector<RigidTransform> X_ref;
  Layout blocks, single;

  RigidTransform OneByOne(int body, const Real* z, std::size_t stride) const {
    Vector6 twist = Vector6::Zero();
    for (int k = 0; k < r; ++k)
      twist += T.col(static_cast<Eigen::Index>(body) * r + k) *
               static_cast<double>(z[static_cast<std::size_t>(k) * stride]);
    return Exp(twist) * X_ref[static_cast<std::size_t>(body)];
  }
};

template <class Real>
TwistRecovery<Real>::TwistRecovery(const ReducedModel& model) : detail_(std::make_unique<Detail>()) {
  detail_->bodies = model.mechanism->num_bodies();
  detail_->r = model.size();
  detail_->T = model.T;
  detail_->X_ref = model.X_RB_ref;
  detail_->blocks.Fill(model, kBlock<Real>);
  detail_->single.Fill(model, 1);
}

template <class Real>
TwistRecovery<Real>::~TwistRecovery() = default;
template <class Real>
TwistRecovery<Real>::TwistRecovery(TwistRecovery&&) noexcept = default;
template <class Real>
TwistRecovery<Real>& TwistRecovery<Real>::operator=(TwistRecovery&&) noexcept = default;

template <class Real>
int TwistRecovery<Real>::bodies() const {
  return detail_->bodies;
}
template <class Real>
int TwistRecovery<Real>::coordinates() const {
  return detail_->r;
}
template <class Real>
std::size_t TwistRecovery<Real>::BytesMoved() const {
  const Detail& d = *detail_;
  return (d.blocks.T.size() + 2 * d.blocks.X_ref.size()) * sizeof(Real) + d.blocks.heard.size() * sizeof(int);
}
// Twelve a coordinate that a body hears; the exponential and its product as counted in twist_kernels.cpp.
template <class Real>
std::size_t TwistRecovery<Real>::Operations() const {
  const Detail& d = *detail_;
  constexpr std::size_t series = 2 * (sizeof(Real) == 4 ? 7 : 12), pose = 2 * series + 121;
  return 12 * d.single.heard.size() + pose * static_cast<std::size_t>(d.bodies);
}

template <class Real>
void TwistRecovery<Real>::Recover(const Real* z, PoseArrays<Real>& out) const {
  const Detail& d = *detail_;
  constexpr int block = kBlock<Real>;
  out.Resize(static_cast<std::size_t>(d.bodies));
  const int blocks = static_cast<int>(d.blocks.first.size()) - 1;
  std::vector<Missed> missed(static_cast<std::size_t>(blocks));
  constexpr int kGrain = 8192 / block;  // 20 us or so: below, waking a thread costs more
  ParallelFor(0, blocks, kGrain, [&](int begin, int end) {
    internal::RecoverBlocks(d.blocks.Map(), z, begin, end, out.row(0), out.stride(), missed.data());
  });
  for (int i = 0; i < blocks; ++i)
    for (int k = 0; missed[static_cast<std::size_t>(i)] >> k != 0 && k < block; ++k)
      if (const int b = i * block + k; missed[static_cast<std::size_t>(i)] >> k & 1 && b < d.bodies)
        Put(d.OneByOne(b, z, 1), static_cast<std::size_t>(b), out);
}

template <class Real>
void TwistRecovery<Real>::RecoverMany(const Real* z, std::size_t z_stride, std::size_t states,
                                      PoseArrays<Real>* out) const {
  FORK1S_REQUIRE(z_stride >= states, z_stride, states);
  const Detail& d = *detail_;
  constexpr int block = kBlock<Real>;
  const int whole = static_cast<int>(states) / block, left = static_cast<int>(states) % block;
  // States that do not fill a block are read from one that is filled up.
  AlignedVector<Real> rest(static_cast<std::size_t>(left > 0 ? d.r * block : 0), Real(0));
  for (int k = 0; left > 0 && k < d.r; ++k)
    std::copy_n(z + static_cast<std::size_t>(k) * z_stride + static_cast<std::size_t>(whole * block), left,
                rest.begin() + k * block);
  constexpr int kWork = 16384;  // poses, as above
  const int grain = std::max(1, kWork / std::max(1, static_cast<int>(states)));
  ParallelFor(0, d.bodies, grain, [&](int begin, int end) {
    std::vector<Missed> missed(static_cast<std::size_t>(whole) + 1);
    for (int b = begin; b < end; ++b) {
      PoseArrays<Real>& to = out[b];
      to.Resize(states);
      internal::RecoverStates(d.single.Map(), b, z, z_stride, 0, whole, to.row(0), to.stride(),
                              missed.data());
      if (left > 0)
        internal::RecoverStates(d.single.Map(), b, rest.data(), block, 0, 1, to.row(0) + whole * block,
                                to.stride(), missed.data() + whole);
      for (std::size_t i = 0; i < states; ++i)
        if (missed[i / block] >> (i % block) & 1) Put(d.OneByOne(b, z + i, z_stride), i, to);
    }
  });
}

template class PoseArrays<float>;
template class PoseArrays<double>;
template class TwistRecovery<float>;
template class TwistRecovery<double>;

}  // namespace fork1s
