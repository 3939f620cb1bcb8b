// One twist a body: docs/method.md, section 2.
#include <algorithm>

#include "aligned_vector.hpp"
#include "parallel/parallel_for.hpp"
#include "pose_backend.hpp"

namespace fork1s::internal {
namespace {

template <class Real>
class TwistBackend final : public PoseBackend<Real> {
 public:
  explicit TwistBackend(const ReducedModel& model)
      : bodies_(model.mechanism->num_bodies()), r_(model.size()), T_(model.T), X_ref_(model.X_RB_ref) {
    blocks_.Fill(model, kBlock<Real>);
    single_.Fill(model, 1);
  }
  int bodies() const override { return bodies_; }
  int coordinates() const override { return r_; }
  std::size_t BytesMoved() const override {
    return (blocks_.T.size() + 2 * blocks_.X_ref.size()) * sizeof(Real) + blocks_.inputs.size() * sizeof(int);
  }
  // Twelve a coordinate that a body depends on; the exponential and its product as counted in exponential-inl.hpp.
  std::size_t Operations() const override {
    constexpr std::size_t series = 2 * (sizeof(Real) == 4 ? 7 : 12), pose = 2 * series + 121;
    return 12 * single_.inputs.size() + pose * static_cast<std::size_t>(bodies_);
  }
  LoopClosing Recover(const Real* z, PoseArrays<Real>& out) const override;
  LoopClosing RecoverMany(const Real* z, std::size_t z_stride, std::size_t states,
                          PoseArrays<Real>* out) const override;

 private:
  // What a TwistMap points to.
  struct Layout {
    std::vector<int> first{0}, inputs;
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
          inputs.push_back(k);
          for (int row = 0; row < 6; ++row)
            for (int b = begin; b < begin + width; ++b)
              T.push_back(b < end ? static_cast<Real>(column(b, k)(row)) : Real(0));
        }
        first.push_back(static_cast<int>(inputs.size()));
        for (int i = 0; i < 12; ++i)
          for (int b = begin; b < begin + width; ++b)
            X_ref.push_back(static_cast<Real>(
                Entry(b < end ? model.X_RB_ref[static_cast<std::size_t>(b)] : RigidTransform(), i)));
      }
    }
    TwistMap<Real> Map() const { return {first.data(), inputs.data(), T.data(), X_ref.data()}; }
  };

  RigidTransform OneByOne(int body, const Real* z, std::size_t stride) const {
    Vector6 twist = Vector6::Zero();
    for (int k = 0; k < r_; ++k)
      twist += T_.col(static_cast<Eigen::Index>(body) * r_ + k) *
               static_cast<double>(z[static_cast<std::size_t>(k) * stride]);
    return Exp(twist) * X_ref_[static_cast<std::size_t>(body)];
  }

  int bodies_ = 0, r_ = 0;
  Matrix6X T_;  // of the model, for what turns too far
  std::vector<RigidTransform> X_ref_;
  Layout blocks_, single_;
};

template <class Real>
LoopClosing TwistBackend<Real>::Recover(const Real* z, PoseArrays<Real>& out) const {
  constexpr int block = kBlock<Real>;
  out.Resize(static_cast<std::size_t>(bodies_));
  const int blocks = static_cast<int>(blocks_.first.size()) - 1;
  std::vector<Missed> missed(static_cast<std::size_t>(blocks));
  constexpr int kGrain = 8192 / block;  // 20 us or so: below, waking a thread costs more
  ParallelFor(0, blocks, kGrain, [&](int begin, int end) {
    RecoverBlocks(blocks_.Map(), z, begin, end, out.row(0), out.stride(), missed.data());
  });
  for (int i = 0; i < blocks; ++i)
    for (int k = 0; missed[static_cast<std::size_t>(i)] >> k != 0 && k < block; ++k)
      if (const int b = i * block + k; missed[static_cast<std::size_t>(i)] >> k & 1 && b < bodies_)
        PutPose(OneByOne(b, z, 1), static_cast<std::size_t>(b), out);
  return {};
}

template <class Real>
LoopClosing TwistBackend<Real>::RecoverMany(const Real* z, std::size_t z_stride, std::size_t states,
                                            PoseArrays<Real>* out) const {
  constexpr int block = kBlock<Real>;
  const int whole = static_cast<int>(states) / block, left = static_cast<int>(states) % block;
  // States that do not fill a block are read from one that is filled up.
  AlignedVector<Real> rest(static_cast<std::size_t>(left > 0 ? r_ * block : 0), Real(0));
  for (int k = 0; left > 0 && k < r_; ++k)
    std::copy_n(z + static_cast<std::size_t>(k) * z_stride + static_cast<std::size_t>(whole * block), left,
                rest.begin() + k * block);
  constexpr int kWork = 16384;  // poses, as above
  const int grain = std::max(1, kWork / std::max(1, static_cast<int>(states)));
  ParallelFor(0, bodies_, grain, [&](int begin, int end) {
    std::vector<Missed> missed(static_cast<std::size_t>(whole) + 1);
    for (int b = begin; b < end; ++b) {
      PoseArrays<Real>& to = out[b];
      to.Resize(states);
      RecoverStates(single_.Map(), b, z, z_stride, 0, whole, to.row(0), to.stride(), missed.data());
      if (left > 0)
        RecoverStates(single_.Map(), b, rest.data(), block, 0, 1, to.row(0) + whole * block, to.stride(),
                      missed.data() + whole);
      for (std::size_t i = 0; i < states; ++i)
        if (missed[i / block] >> (i % block) & 1) PutPose(OneByOne(b, z + i, z_stride), i, to);
    }
  });
  return {};
}

}  // namespace

template <class Real>
std::unique_ptr<PoseBackend<Real>> MakeTwistBackend(const ReducedModel& model) {
  return std::make_unique<TwistBackend<Real>>(model);
}

template std::unique_ptr<PoseBackend<float>> MakeTwistBackend<float>(const ReducedModel&);
template std::unique_ptr<PoseBackend<double>> MakeTwistBackend<double>(const ReducedModel&);

}  // namespace fork1s::internal
