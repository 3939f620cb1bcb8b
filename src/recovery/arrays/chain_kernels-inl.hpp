// Products along the tree: chain_kernels.hpp. A part of kernels.cpp, which takes it once for each instruction
// set.
#include "chain_kernels.hpp"

#include "link-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace fork1s::internal::HWY_NAMESPACE {
namespace {

template <class Real>
void Walk(const LinkMap<Real>& map, const Real* y, std::size_t y_stride, std::size_t states,
          const Place<Real>* places) {
  const hn::ScalableTag<Real> d;
  using V = hn::Vec<decltype(d)>;
  for (int l = 0; l < map.count; ++l) {
    const Link& link = map.links[l];
    const Place<Real> to = places[link.slot];
    const Place<Real> from = link.parent < 0 ? Place<Real>{} : places[link.parent];
    for (std::size_t i = 0; i < states; i += hn::Lanes(d)) {
      V L[12];
      LinkPose(d, map, link, y + i, y_stride, L);
      const auto put = [&](int e, V entry) HWY_ATTR {
        hn::Store(entry, d, to.first + static_cast<std::size_t>(e) * to.stride + i);
      };
      if (link.parent < 0) {
        for (int e = 0; e < 12; ++e) put(e, L[e]);
        continue;
      }
      Product<V>(
          [&](int e)
              HWY_ATTR { return hn::Load(d, from.first + static_cast<std::size_t>(e) * from.stride + i); },
          [&](int e) HWY_ATTR { return L[e]; }, put);
    }
  }
}

// The four numbers of a column, in as many registers as they take.
template <class Real>
struct Column {
  static constexpr hn::CappedTag<Real, 4> d{};
  static constexpr std::size_t lanes = hn::MaxLanes(d), parts = 4 / lanes;
  hn::Vec<hn::CappedTag<Real, 4>> part[parts];
  HWY_INLINE void Load(const Real* from) {
    for (std::size_t i = 0; i < parts; ++i) part[i] = hn::Load(d, from + i * lanes);
  }
  HWY_INLINE void Store(Real* to) const {
    for (std::size_t i = 0; i < parts; ++i) hn::Store(part[i], d, to + i * lanes);
  }
};

// The columns of a pose times L, entries from `stride` to `stride`. Along a chain each column waits for three
// fused products of the one before; the entries of L wait for nobody.
template <class Real>
HWY_INLINE void TimesLink(Column<Real>* X, const Real* HWY_RESTRICT L, std::size_t stride) {
  using C = Column<Real>;
  for (std::size_t i = 0; i < C::parts; ++i) {
    const auto x0 = X[0].part[i], x1 = X[1].part[i], x2 = X[2].part[i];
    const auto entry = [&](std::size_t e) HWY_ATTR { return hn::Set(C::d, L[e * stride]); };
    for (std::size_t j = 0; j < 3; ++j)
      X[j].part[i] = hn::MulAdd(x2, entry(6 + j), hn::MulAdd(x1, entry(3 + j), hn::Mul(x0, entry(j))));
    X[3].part[i] =
        hn::Add(X[3].part[i], hn::MulAdd(x2, entry(11), hn::MulAdd(x1, entry(10), hn::Mul(x0, entry(9)))));
  }
}

// Poses in their parents of the block's links, entry e of link k at L[e * kBlock + k].
template <class Real>
HWY_INLINE void LinkBlock(const OneMap<Real>& map, int i, const Real* HWY_RESTRICT y, Real* HWY_RESTRICT L) {
  const hn::ScalableTag<Real> d;
  constexpr std::size_t block = kBlock<Real>;
  const int first = map.first[i], last = map.first[i + 1];
  for (std::size_t lane = 0; lane < block; lane += hn::Lanes(d)) {
    auto turn = hn::Zero(d);
    const Real* HWY_RESTRICT weight = map.weights + static_cast<std::size_t>(first) * block + lane;
    for (int k = first; k < last; ++k, weight += block)
      turn = hn::MulAdd(hn::Load(d, weight), hn::Set(d, y[map.inputs[k]]), turn);
    hn::Vec<decltype(d)> entries[12], sine, versine;
    SineAndVersine(d, turn, sine, versine);
    LinkAt(d, map.constants + static_cast<std::size_t>(i) * kLinkRows * block + lane, block, turn, sine,
           versine, entries);
    for (std::size_t e = 0; e < 12; ++e) hn::Store(entries[e], d, L + e * block + lane);
  }
}

template <class Real>
void One(const OneMap<Real>& map, const Real* HWY_RESTRICT y, Real* HWY_RESTRICT X) {
  constexpr int block = kBlock<Real>;
  const std::size_t column = 4 * (static_cast<std::size_t>(map.slots) + 1);
  // Some blocks at a time: series are long chains of sums, of which the next blocks' go on meanwhile.
  constexpr int some = 4;
  HWY_ALIGN Real L[some * 12 * block];
  Column<Real> pose[4];
  int at = map.slots;  // whose pose it is
  for (std::size_t k = 0; k < 4; ++k)
    for (std::size_t i = 0; i < 4; ++i)
      X[k * column + 4 * static_cast<std::size_t>(at) + i] = i == k && k < 3;
  for (std::size_t k = 0; k < 4; ++k) pose[k].Load(X + k * column + 4 * static_cast<std::size_t>(at));
  for (int begin = 0; begin < map.count; begin += some * block) {
    const int end = HWY_MIN(map.count, begin + some * block);
    for (int i = 0; begin + i * block < end; ++i) LinkBlock(map, begin / block + i, y, L + i * 12 * block);
    for (int l = begin; l < end; ++l) {
      if (map.parent[l] != at)
        for (std::size_t k = 0; k < 4; ++k)
          pose[k].Load(X + k * column + 4 * static_cast<std::size_t>(map.parent[l]));
      if (map.twist != nullptr && map.twist[l] >= 0)
        TimesLink(pose, map.twists + map.twist[l], map.twist_stride);
      else
        TimesLink(pose, L + (l - begin) / block * 12 * block + (l - begin) % block,
                  static_cast<std::size_t>(block));
      at = map.slot[l];
      for (std::size_t k = 0; k < 4; ++k) pose[k].Store(X + k * column + 4 * static_cast<std::size_t>(at));
    }
  }
}

template <class Real>
void Put(const Real* HWY_RESTRICT X, int slots, int begin, int end, Real* HWY_RESTRICT out,
         std::size_t stride) {
  const hn::ScalableTag<Real> d;
  const std::size_t column = 4 * (static_cast<std::size_t>(slots) + 1);
  for (auto b = static_cast<std::size_t>(begin); b < static_cast<std::size_t>(end); b += hn::Lanes(d))
    for (std::size_t k = 0; k < 4; ++k) {
      hn::Vec<decltype(d)> x, y, z, none;
      hn::LoadInterleaved4(d, X + k * column + 4 * b, x, y, z, none);
      Real* to = out + b;
      const std::size_t row = k < 3 ? k : 9, next = k < 3 ? 3 : 1;  // rotations stand by rows
      hn::Store(x, d, to + row * stride);
      hn::Store(y, d, to + (row + next) * stride);
      hn::Store(z, d, to + (row + 2 * next) * stride);
    }
}

void OneFloat(const OneMap<float>& map, const float* y, float* X) { One(map, y, X); }
void OneDouble(const OneMap<double>& map, const double* y, double* X) { One(map, y, X); }
void PutFloat(const float* X, int slots, int begin, int end, float* out, std::size_t stride) {
  Put(X, slots, begin, end, out, stride);
}
void PutDouble(const double* X, int slots, int begin, int end, double* out, std::size_t stride) {
  Put(X, slots, begin, end, out, stride);
}
void WalkFloat(const LinkMap<float>& map, const float* y, std::size_t y_stride, std::size_t states,
               const Place<float>* places) {
  Walk(map, y, y_stride, states, places);
}
void WalkDouble(const LinkMap<double>& map, const double* y, std::size_t y_stride, std::size_t states,
                const Place<double>* places) {
  Walk(map, y, y_stride, states, places);
}

}  // namespace
}  // namespace fork1s::internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace fork1s::internal {

HWY_EXPORT(WalkFloat);
HWY_EXPORT(WalkDouble);
HWY_EXPORT(OneFloat);
HWY_EXPORT(OneDouble);
HWY_EXPORT(PutFloat);
HWY_EXPORT(PutDouble);

void ForwardKinematicsBatch(const LinkMap<float>& map, const float* y, std::size_t y_stride,
                            std::size_t states, const Place<float>* places) {
  HWY_DYNAMIC_DISPATCH(WalkFloat)(map, y, y_stride, states, places);
}
void ForwardKinematicsBatch(const LinkMap<double>& map, const double* y, std::size_t y_stride,
                            std::size_t states, const Place<double>* places) {
  HWY_DYNAMIC_DISPATCH(WalkDouble)(map, y, y_stride, states, places);
}
void ForwardKinematicsSingle(const OneMap<float>& map, const float* y, float* X) {
  HWY_DYNAMIC_DISPATCH(OneFloat)(map, y, X);
}
void ForwardKinematicsSingle(const OneMap<double>& map, const double* y, double* X) {
  HWY_DYNAMIC_DISPATCH(OneDouble)(map, y, X);
}
void PutPoses(const float* X, int slots, int begin, int end, float* out, std::size_t stride) {
  HWY_DYNAMIC_DISPATCH(PutFloat)(X, slots, begin, end, out, stride);
}
void PutPoses(const double* X, int slots, int begin, int end, double* out, std::size_t stride) {
  HWY_DYNAMIC_DISPATCH(PutDouble)(X, slots, begin, end, out, stride);
}

}  // namespace fork1s::internal
#endif
