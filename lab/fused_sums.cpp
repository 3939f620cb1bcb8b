// Compiled for every instruction set that recovery is (recovery/arrays/kernels.cpp), so that what it reaches
// is held against what could be reached with the same.
#include "fused_sums.hpp"

#include <cstddef>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lab/fused_sums.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace fork1s::internal::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// Ten sums at a time hide how long one takes.
template <class Real>
double Sums(int rounds, double& sum) {
  const hn::ScalableTag<Real> d;
  const auto factor = hn::Set(d, Real(0.999)), term = hn::Set(d, Real(0.25));
  auto s0 = hn::Set(d, Real(0)), s1 = hn::Set(d, Real(1)), s2 = hn::Set(d, Real(2)), s3 = hn::Set(d, Real(3)),
       s4 = hn::Set(d, Real(4)), s5 = hn::Set(d, Real(5)), s6 = hn::Set(d, Real(6)), s7 = hn::Set(d, Real(7)),
       s8 = hn::Set(d, Real(8)), s9 = hn::Set(d, Real(9));
  for (int i = 0; i < rounds; ++i) {
    s0 = hn::MulAdd(s0, factor, term), s1 = hn::MulAdd(s1, factor, term);
    s2 = hn::MulAdd(s2, factor, term), s3 = hn::MulAdd(s3, factor, term);
    s4 = hn::MulAdd(s4, factor, term), s5 = hn::MulAdd(s5, factor, term);
    s6 = hn::MulAdd(s6, factor, term), s7 = hn::MulAdd(s7, factor, term);
    s8 = hn::MulAdd(s8, factor, term), s9 = hn::MulAdd(s9, factor, term);
  }
  const auto all = hn::Add(hn::Add(hn::Add(s0, s1), hn::Add(s2, s3)),
                           hn::Add(hn::Add(hn::Add(s4, s5), hn::Add(s6, s7)), hn::Add(s8, s9)));
  sum += static_cast<double>(hn::GetLane(all));
  return 2.0 * 10 * rounds * static_cast<double>(hn::Lanes(d));
}

double SumOfNumbers(const double* HWY_RESTRICT at, std::size_t count) {
  const hn::ScalableTag<double> d;
  const std::size_t lanes = hn::Lanes(d);
  auto s0 = hn::Zero(d), s1 = s0, s2 = s0, s3 = s0, s4 = s0, s5 = s0, s6 = s0, s7 = s0;
  std::size_t i = 0;
  for (; i + 8 * lanes <= count; i += 8 * lanes) {
    s0 = hn::Add(s0, hn::LoadU(d, at + i)), s1 = hn::Add(s1, hn::LoadU(d, at + i + lanes));
    s2 = hn::Add(s2, hn::LoadU(d, at + i + 2 * lanes)), s3 = hn::Add(s3, hn::LoadU(d, at + i + 3 * lanes));
    s4 = hn::Add(s4, hn::LoadU(d, at + i + 4 * lanes)), s5 = hn::Add(s5, hn::LoadU(d, at + i + 5 * lanes));
    s6 = hn::Add(s6, hn::LoadU(d, at + i + 6 * lanes)), s7 = hn::Add(s7, hn::LoadU(d, at + i + 7 * lanes));
  }
  double sum = hn::GetLane(hn::SumOfLanes(
      d, hn::Add(hn::Add(hn::Add(s0, s1), hn::Add(s2, s3)), hn::Add(hn::Add(s4, s5), hn::Add(s6, s7)))));
  for (; i < count; ++i) sum += at[i];
  return sum;
}

double SumsOfFloats(int rounds, double& sum) { return Sums<float>(rounds, sum); }
double SumsOfDoubles(int rounds, double& sum) { return Sums<double>(rounds, sum); }

}  // namespace
}  // namespace fork1s::internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace fork1s::internal {

HWY_EXPORT(SumOfNumbers);
HWY_EXPORT(SumsOfFloats);
HWY_EXPORT(SumsOfDoubles);

double FusedSums(bool single_precision, int rounds, double& sum) {
  return single_precision ? HWY_DYNAMIC_DISPATCH(SumsOfFloats)(rounds, sum)
                          : HWY_DYNAMIC_DISPATCH(SumsOfDoubles)(rounds, sum);
}

double SumOfAll(const double* at, std::size_t count) { return HWY_DYNAMIC_DISPATCH(SumOfNumbers)(at, count); }

}  // namespace fork1s::internal
#endif
