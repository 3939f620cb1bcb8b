// One twist a body: twist_kernels.hpp. A part of kernels.cpp, which takes it once for each instruction set.
#include "twist_kernels.hpp"

#include <fork1s/recovery/pose_arrays.hpp>

#include "instruction_sets.hpp"

#include "exponential-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace fork1s::internal::HWY_NAMESPACE {
namespace {

template <class D>
HWY_INLINE Missed Bits(D d, hn::Mask<D> mask, std::size_t lane) {
  if (HWY_LIKELY(hn::AllFalse(d, mask))) return 0;
  std::uint8_t bits[64] = {};
  hn::StoreMaskBits(d, mask, bits);
  Missed out = 0;
  for (std::size_t k = 0; k < hn::Lanes(d); ++k)
    if (bits[k / 8] >> (k % 8) & 1) out |= Missed{1} << (lane + k);
  return out;
}

template <class Real>
void Blocks(const TwistMap<Real>& map, const Real* HWY_RESTRICT z, int begin, int end, Real* HWY_RESTRICT out,
            std::size_t stride, Missed* missed) {
  const hn::ScalableTag<Real> d;
  const std::size_t lanes = hn::Lanes(d);
  constexpr std::size_t block = kBlock<Real>;
  for (int i = begin; i < end; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const int first = map.first[i], last = map.first[i + 1];
    missed[i] = 0;
    for (std::size_t lane = 0; lane < block; lane += lanes) {
      hn::Vec<decltype(d)> w[3] = {hn::Zero(d), hn::Zero(d), hn::Zero(d)}, v[3] = {w[0], w[0], w[0]};
      const Real* HWY_RESTRICT t = map.T + static_cast<std::size_t>(first) * 6 * block + lane;
      for (int k = first; k < last; ++k, t += 6 * block) {
        const auto value = hn::Set(d, z[map.inputs[k]]);
        w[0] = hn::MulAdd(hn::Load(d, t), value, w[0]);
        w[1] = hn::MulAdd(hn::Load(d, t + block), value, w[1]);
        w[2] = hn::MulAdd(hn::Load(d, t + 2 * block), value, w[2]);
        v[0] = hn::MulAdd(hn::Load(d, t + 3 * block), value, v[0]);
        v[1] = hn::MulAdd(hn::Load(d, t + 4 * block), value, v[1]);
        v[2] = hn::MulAdd(hn::Load(d, t + 5 * block), value, v[2]);
      }
      const Real* HWY_RESTRICT X = map.X_ref + at * 12 * block + lane;
      Real* HWY_RESTRICT to = out + at * block + lane;
      const auto mask = ExpTimes(
          d, w, v, [&](int row) HWY_ATTR { return hn::Load(d, X + static_cast<std::size_t>(row) * block); },
          [&](int row, auto entry)
              HWY_ATTR { hn::Store(entry, d, to + static_cast<std::size_t>(row) * stride); });
      missed[i] |= Bits(d, mask, lane);
    }
  }
}

template <class Real>
void States(const TwistMap<Real>& map, int body, const Real* HWY_RESTRICT z, std::size_t z_stride, int begin,
            int end, Real* HWY_RESTRICT out, std::size_t stride, Missed* missed) {
  const hn::ScalableTag<Real> d;
  const std::size_t lanes = hn::Lanes(d);
  constexpr std::size_t block = kBlock<Real>;
  const int first = map.first[body], last = map.first[body + 1];
  const Real* HWY_RESTRICT X = map.X_ref + static_cast<std::size_t>(body) * 12;
  for (int i = begin; i < end; ++i) {
    missed[i] = 0;
    for (std::size_t lane = 0; lane < block; lane += lanes) {
      const std::size_t at = static_cast<std::size_t>(i) * block + lane;
      hn::Vec<decltype(d)> w[3] = {hn::Zero(d), hn::Zero(d), hn::Zero(d)}, v[3] = {w[0], w[0], w[0]};
      const Real* HWY_RESTRICT t = map.T + static_cast<std::size_t>(first) * 6;
      for (int k = first; k < last; ++k, t += 6) {
        const auto value = hn::LoadU(d, z + static_cast<std::size_t>(map.inputs[k]) * z_stride + at);
        w[0] = hn::MulAdd(hn::Set(d, t[0]), value, w[0]);
        w[1] = hn::MulAdd(hn::Set(d, t[1]), value, w[1]);
        w[2] = hn::MulAdd(hn::Set(d, t[2]), value, w[2]);
        v[0] = hn::MulAdd(hn::Set(d, t[3]), value, v[0]);
        v[1] = hn::MulAdd(hn::Set(d, t[4]), value, v[1]);
        v[2] = hn::MulAdd(hn::Set(d, t[5]), value, v[2]);
      }
      const auto mask = ExpTimes(
          d, w, v, [&](int row) HWY_ATTR { return hn::Set(d, X[row]); },
          [&](int row, auto entry)
              HWY_ATTR { hn::Store(entry, d, out + static_cast<std::size_t>(row) * stride + at); });
      missed[i] |= Bits(d, mask, lane);
    }
  }
}

void BlocksFloat(const TwistMap<float>& map, const float* z, int begin, int end, float* out,
                 std::size_t stride, Missed* missed) {
  Blocks(map, z, begin, end, out, stride, missed);
}
void BlocksDouble(const TwistMap<double>& map, const double* z, int begin, int end, double* out,
                  std::size_t stride, Missed* missed) {
  Blocks(map, z, begin, end, out, stride, missed);
}
void StatesFloat(const TwistMap<float>& map, int body, const float* z, std::size_t z_stride, int begin,
                 int end, float* out, std::size_t stride, Missed* missed) {
  States(map, body, z, z_stride, begin, end, out, stride, missed);
}
void StatesDouble(const TwistMap<double>& map, int body, const double* z, std::size_t z_stride, int begin,
                  int end, double* out, std::size_t stride, Missed* missed) {
  States(map, body, z, z_stride, begin, end, out, stride, missed);
}
const char* Name() { return hwy::TargetName(HWY_TARGET); }

}  // namespace
}  // namespace fork1s::internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace fork1s {
namespace internal {

HWY_EXPORT(BlocksFloat);
HWY_EXPORT(BlocksDouble);
HWY_EXPORT(StatesFloat);
HWY_EXPORT(StatesDouble);
HWY_EXPORT(Name);

void RecoverBlocks(const TwistMap<float>& map, const float* z, int begin, int end, float* out,
                   std::size_t stride, Missed* missed) {
  HWY_DYNAMIC_DISPATCH(BlocksFloat)(map, z, begin, end, out, stride, missed);
}
void RecoverBlocks(const TwistMap<double>& map, const double* z, int begin, int end, double* out,
                   std::size_t stride, Missed* missed) {
  HWY_DYNAMIC_DISPATCH(BlocksDouble)(map, z, begin, end, out, stride, missed);
}
void RecoverStates(const TwistMap<float>& map, int body, const float* z, std::size_t z_stride, int begin,
                   int end, float* out, std::size_t stride, Missed* missed) {
  HWY_DYNAMIC_DISPATCH(StatesFloat)(map, body, z, z_stride, begin, end, out, stride, missed);
}
void RecoverStates(const TwistMap<double>& map, int body, const double* z, std::size_t z_stride, int begin,
                   int end, double* out, std::size_t stride, Missed* missed) {
  HWY_DYNAMIC_DISPATCH(StatesDouble)(map, body, z, z_stride, begin, end, out, stride, missed);
}

std::vector<std::int64_t> RecoveryInstructionSets() {
  hwy::SetSupportedTargetsForTest(0);
  return hwy::SupportedAndGeneratedTargets();
}
void UseInstructionSet(std::int64_t set) { hwy::SetSupportedTargetsForTest(set); }

}  // namespace internal

const char* RecoveryInstructionSet() { return HWY_DYNAMIC_DISPATCH(internal::Name)(); }

}  // namespace fork1s
#endif
