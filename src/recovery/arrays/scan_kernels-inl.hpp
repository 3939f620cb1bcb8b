// Long paths: scan_kernels.hpp. A part of kernels.cpp, which takes it once for each instruction set.
#include "scan_kernels.hpp"

#include "exponential-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace fork1s::internal::HWY_NAMESPACE {
namespace {

// θ of each link; then, in the order of the scan, θ, its sine and 1 - cos. By themselves, since a series is
// one long chain of sums, of which a processor overlaps those of many links only where nothing else comes
// between.
template <class Real>
void Turns(const RunMap<Real>& map, const Real* HWY_RESTRICT y, Real* HWY_RESTRICT turns) {
  const hn::ScalableTag<Real> d;
  const hn::RebindToSigned<decltype(d)> di;
  using Index = hn::TFromD<decltype(di)>;
  constexpr std::size_t block = kBlock<Real>;
  const auto steps = static_cast<std::size_t>(map.steps);
  Real* HWY_RESTRICT in_order = turns + 3 * steps * block;
  const int blocks = (map.count + static_cast<int>(block) - 1) / static_cast<int>(block);
  for (int i = 0; i < blocks; ++i)
    for (std::size_t lane = 0; lane < block; lane += hn::Lanes(d)) {
      auto turn = hn::Zero(d);
      const Real* HWY_RESTRICT weight = map.weights + static_cast<std::size_t>(map.first[i]) * block + lane;
      for (int k = map.first[i]; k < map.first[i + 1]; ++k, weight += block)
        turn = hn::MulAdd(hn::Load(d, weight), hn::Set(d, y[map.inputs[k]]), turn);
      hn::Store(turn, d, in_order + static_cast<std::size_t>(i) * block + lane);
    }
  // Segments end together, whatever the last of them has.
  for (auto l = static_cast<std::size_t>(blocks) * block; l < steps * block; ++l) in_order[l] = 0;
  for (std::size_t lane = 0; lane < block; lane += hn::Lanes(d)) {
    const auto at =
        hn::Mul(hn::Iota(di, static_cast<Index>(lane)), hn::Set(di, static_cast<Index>(map.steps)));
    for (std::size_t i = 0; i < steps; ++i) {
      const auto turn = hn::GatherIndex(d, in_order + i, at);
      hn::Vec<decltype(d)> sine, versine;
      SineAndVersine(d, turn, sine, versine);
      hn::Store(turn, d, turns + 3 * i * block + lane);
      hn::Store(sine, d, turns + (3 * i + 1) * block + lane);
      hn::Store(versine, d, turns + (3 * i + 2) * block + lane);
    }
  }
}

template <class Real>
void First(const RunMap<Real>& map, const Real* y, Real* HWY_RESTRICT turns, Real* HWY_RESTRICT poses) {
  Turns(map, y, turns);
  const hn::ScalableTag<Real> d;
  using V = hn::Vec<decltype(d)>;
  constexpr std::size_t block = kBlock<Real>;
  for (std::size_t lane = 0; lane < block; lane += hn::Lanes(d)) {
    V X[12];
    const Real *HWY_RESTRICT c = map.constants + lane, *HWY_RESTRICT turn = turns + lane;
    Real* HWY_RESTRICT to = poses + lane;
    for (int i = 0; i < map.steps; ++i, c += kLinkRows * block, turn += 3 * block, to += 12 * block) {
      V L[12];
      LinkAt(d, c, block, hn::Load(d, turn), hn::Load(d, turn + block), hn::Load(d, turn + 2 * block), L);
      if (i > 0) {
        V before[12];
        for (int e = 0; e < 12; ++e) before[e] = X[e];
        Product<V>([&](int e) HWY_ATTR { return before[e]; }, [&](int e) HWY_ATTR { return L[e]; },
                   [&](int e, V entry) HWY_ATTR { X[e] = entry; });
      } else {
        for (int e = 0; e < 12; ++e) X[e] = L[e];
      }
      for (std::size_t e = 0; e < 12; ++e) hn::Store(X[e], d, to + e * block);
    }
  }
}

// Rows to columns of a square of as many numbers as a register has lanes, a bit of the place at a time.
template <class D, class V>
HWY_INLINE void Transpose(D, V (&)[1]) {
}  // a processor without vectors, which has none of the operations below
#if HWY_TARGET != HWY_SCALAR
template <class D, class V, std::size_t n>
HWY_INLINE void Transpose(D d, V (&v)[n]) {
  for (std::size_t size = 1; size < n; size *= 2) {
    V w[n];
    for (std::size_t i = 0; i < n / 2; ++i) {
      w[i] = hn::ConcatEven(d, v[2 * i + 1], v[2 * i]);
      w[n / 2 + i] = hn::ConcatOdd(d, v[2 * i + 1], v[2 * i]);
    }
    for (std::size_t i = 0; i < n; ++i) v[i] = w[i];
  }
}
#endif

template <class Real>
void Last(const RunMap<Real>& map, const Real* HWY_RESTRICT poses, const Real* HWY_RESTRICT stands,
          Real* HWY_RESTRICT out, std::size_t stride) {
  const hn::ScalableTag<Real> d;
  using V = hn::Vec<decltype(d)>;
  constexpr std::size_t block = kBlock<Real>, n = hn::MaxLanes(hn::ScalableTag<Real>());
  const auto count = static_cast<std::size_t>(map.count), steps = static_cast<std::size_t>(map.steps);
  HWY_ALIGN Real tile[12 * n * n], end[n];
  for (std::size_t lane = 0; lane < block; lane += n) {
    V S[12];
    for (std::size_t e = 0; e < 12; ++e) S[e] = hn::Load(d, stands + e * block + lane);
    for (std::size_t next = 0; next < steps; next += n) {
      const std::size_t step = HWY_MIN(next, steps - n);  // some twice rather than some one by one
      for (std::size_t i = 0; i < n; ++i) {
        const Real* HWY_RESTRICT X = poses + 12 * (step + i) * block + lane;
        Product<V>([&](int e) HWY_ATTR { return S[e]; },
                   [&](int e) HWY_ATTR { return hn::Load(d, X + static_cast<std::size_t>(e) * block); },
                   [&](int e, V entry)
                       HWY_ATTR { hn::Store(entry, d, tile + (static_cast<std::size_t>(e) * n + i) * n); });
      }
      for (std::size_t e = 0; e < 12; ++e) {
        V v[n];
        for (std::size_t i = 0; i < n; ++i) v[i] = hn::Load(d, tile + (e * n + i) * n);
        Transpose(d, v);
        for (std::size_t i = 0; i < n; ++i) {
          const std::size_t at = (lane + i) * steps + step;
          if (at >= count) break;
          Real* to = out + e * stride + at;
          const std::size_t most = HWY_MIN(n, count - at);
          if (most == n) {
            hn::StoreU(v[i], d, to);
            continue;
          }
          hn::Store(v[i], d, end);
          for (std::size_t k = 0; k < most; ++k) to[k] = end[k];
        }
      }
    }
  }
}

void FirstFloat(const RunMap<float>& map, const float* y, float* turns, float* poses) {
  First(map, y, turns, poses);
}
void FirstDouble(const RunMap<double>& map, const double* y, double* turns, double* poses) {
  First(map, y, turns, poses);
}
void LastFloat(const RunMap<float>& map, const float* poses, const float* stands, float* out,
               std::size_t stride) {
  Last(map, poses, stands, out, stride);
}
void LastDouble(const RunMap<double>& map, const double* poses, const double* stands, double* out,
                std::size_t stride) {
  Last(map, poses, stands, out, stride);
}
int VectorBytes() { return static_cast<int>(hn::Lanes(hn::ScalableTag<float>()) * sizeof(float)); }

}  // namespace
}  // namespace fork1s::internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace fork1s::internal {

HWY_EXPORT(FirstFloat);
HWY_EXPORT(FirstDouble);
HWY_EXPORT(LastFloat);
HWY_EXPORT(LastDouble);
HWY_EXPORT(VectorBytes);

void ScanFirst(const RunMap<float>& map, const float* y, float* turns, float* poses) {
  HWY_DYNAMIC_DISPATCH(FirstFloat)(map, y, turns, poses);
}
void ScanFirst(const RunMap<double>& map, const double* y, double* turns, double* poses) {
  HWY_DYNAMIC_DISPATCH(FirstDouble)(map, y, turns, poses);
}
void ScanLast(const RunMap<float>& map, const float* poses, const float* stands, float* out,
              std::size_t stride) {
  HWY_DYNAMIC_DISPATCH(LastFloat)(map, poses, stands, out, stride);
}
void ScanLast(const RunMap<double>& map, const double* poses, const double* stands, double* out,
              std::size_t stride) {
  HWY_DYNAMIC_DISPATCH(LastDouble)(map, poses, stands, out, stride);
}
int RegisterLanes(std::size_t bytes) { return HWY_DYNAMIC_DISPATCH(VectorBytes)() / static_cast<int>(bytes); }

}  // namespace fork1s::internal
#endif
