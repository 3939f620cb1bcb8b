// Compiled once for every instruction set that Highway knows here, from this one source; which of them runs
// is decided by the processor.
#include "twist_kernels.hpp"

#include <array>
#include <fork1s/recovery/pose_arrays.hpp>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "recovery/twist_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace fork1s::internal::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr double kHalfTurn2 = 9.869604401089358;  // π²

// Terms of the series below at π², the first one left out below the last digit: 1e-8 and 3e-17.
template <class Real>
constexpr int kTerms = sizeof(Real) == 4 ? 8 : 13;

template <class Real, int shift>
constexpr auto InverseFactorials() {
  std::array<Real, kTerms<Real>> out{};
  double value = 1;
  for (int n = 2; n <= shift; ++n) value /= n;
  for (int k = 0; k < kTerms<Real>; ++k) {
    out[static_cast<std::size_t>(k)] = static_cast<Real>(value);
    value /= (2 * k + shift + 1) * (2 * k + shift + 2);
  }
  return out;
}

// Σ (-x)^k / (2 k + shift)!: (1 - cos θ)/θ² for shift 2 and (θ - sin θ)/θ³ for shift 3, x = θ².
template <int shift, class D, class V = hn::Vec<D>, class Real = hn::TFromD<D>>
HWY_INLINE V Series(D d, V x) {
  static constexpr auto term = InverseFactorials<Real, shift>();
  V sum = hn::Set(d, term.back());
  for (std::size_t k = term.size() - 1; k-- > 0;) sum = hn::NegMulAdd(sum, x, hn::Set(d, term[k]));
  return sum;
}

// Exp of twists [w; v] times the poses that ref(i) gives, row i; put(i, entry) takes the result. Returns
// those that turn too far.
template <class D, class V, class Ref, class Put>
HWY_INLINE hn::Mask<D> ExpTimes(D d, V w0, V w1, V w2, V v0, V v1, V v2, const Ref& ref, const Put& put) {
  using Real = hn::TFromD<D>;
  const V one = hn::Set(d, Real(1));
  const V w00 = hn::Mul(w0, w0), w11 = hn::Mul(w1, w1), w22 = hn::Mul(w2, w2);
  const V x = hn::Add(hn::Add(w00, w11), w22);
  const V B = Series<2>(d, x), C = Series<3>(d, x);
  const V A = hn::NegMulAdd(x, C, one);  // sin θ/θ
  const V a0 = hn::Mul(A, w0), a1 = hn::Mul(A, w1), a2 = hn::Mul(A, w2);
  const V b0 = hn::Mul(B, w0), b1 = hn::Mul(B, w1);
  const V b01 = hn::Mul(b0, w1), b02 = hn::Mul(b0, w2), b12 = hn::Mul(b1, w2);
  const V R[9] = {
      hn::NegMulAdd(B, hn::Add(w11, w22), one), hn::Sub(b01, a2), hn::Add(b02, a1), hn::Add(b01, a2),
      hn::NegMulAdd(B, hn::Add(w00, w22), one), hn::Sub(b12, a0), hn::Sub(b02, a1), hn::Add(b12, a0),
      hn::NegMulAdd(B, hn::Add(w00, w11), one)};
  // p = v + B ω × v + C ω × (ω × v)
  const V c0 = hn::MulSub(w1, v2, hn::Mul(w2, v1)), c1 = hn::MulSub(w2, v0, hn::Mul(w0, v2)),
          c2 = hn::MulSub(w0, v1, hn::Mul(w1, v0));
  const V p[3] = {hn::MulAdd(C, hn::MulSub(w1, c2, hn::Mul(w2, c1)), hn::MulAdd(B, c0, v0)),
                  hn::MulAdd(C, hn::MulSub(w2, c0, hn::Mul(w0, c2)), hn::MulAdd(B, c1, v1)),
                  hn::MulAdd(C, hn::MulSub(w0, c1, hn::Mul(w1, c0)), hn::MulAdd(B, c2, v2))};
  for (int j = 0; j < 3; ++j) {
    const V r0 = ref(j), r1 = ref(3 + j), r2 = ref(6 + j);
    for (int i = 0; i < 3; ++i)
      put(3 * i + j, hn::MulAdd(R[3 * i], r0, hn::MulAdd(R[3 * i + 1], r1, hn::Mul(R[3 * i + 2], r2))));
  }
  const V r0 = ref(9), r1 = ref(10), r2 = ref(11);
  for (int i = 0; i < 3; ++i)
    put(9 + i, hn::MulAdd(R[3 * i], r0, hn::MulAdd(R[3 * i + 1], r1, hn::MulAdd(R[3 * i + 2], r2, p[i]))));
  return hn::Gt(x, hn::Set(d, static_cast<Real>(kHalfTurn2)));
}

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
      auto w0 = hn::Zero(d), w1 = w0, w2 = w0, v0 = w0, v1 = w0, v2 = w0;
      const Real* HWY_RESTRICT t = map.T + static_cast<std::size_t>(first) * 6 * block + lane;
      for (int k = first; k < last; ++k, t += 6 * block) {
        const auto value = hn::Set(d, z[map.heard[k]]);
        w0 = hn::MulAdd(hn::Load(d, t), value, w0);
        w1 = hn::MulAdd(hn::Load(d, t + block), value, w1);
        w2 = hn::MulAdd(hn::Load(d, t + 2 * block), value, w2);
        v0 = hn::MulAdd(hn::Load(d, t + 3 * block), value, v0);
        v1 = hn::MulAdd(hn::Load(d, t + 4 * block), value, v1);
        v2 = hn::MulAdd(hn::Load(d, t + 5 * block), value, v2);
      }
      const Real* HWY_RESTRICT X = map.X_ref + at * 12 * block + lane;
      Real* HWY_RESTRICT to = out + at * block + lane;
      const auto mask = ExpTimes(
          d, w0, w1, w2, v0, v1, v2,
          [&](int row) HWY_ATTR { return hn::Load(d, X + static_cast<std::size_t>(row) * block); },
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
      auto w0 = hn::Zero(d), w1 = w0, w2 = w0, v0 = w0, v1 = w0, v2 = w0;
      const Real* HWY_RESTRICT t = map.T + static_cast<std::size_t>(first) * 6;
      for (int k = first; k < last; ++k, t += 6) {
        const auto value = hn::LoadU(d, z + static_cast<std::size_t>(map.heard[k]) * z_stride + at);
        w0 = hn::MulAdd(hn::Set(d, t[0]), value, w0);
        w1 = hn::MulAdd(hn::Set(d, t[1]), value, w1);
        w2 = hn::MulAdd(hn::Set(d, t[2]), value, w2);
        v0 = hn::MulAdd(hn::Set(d, t[3]), value, v0);
        v1 = hn::MulAdd(hn::Set(d, t[4]), value, v1);
        v2 = hn::MulAdd(hn::Set(d, t[5]), value, v2);
      }
      const auto mask = ExpTimes(
          d, w0, w1, w2, v0, v1, v2, [&](int row) HWY_ATTR { return hn::Set(d, X[row]); },
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

}  // namespace internal

const char* RecoveryInstructionSet() { return HWY_DYNAMIC_DISPATCH(internal::Name)(); }

}  // namespace fork1s
#endif
