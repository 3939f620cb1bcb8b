// The pose of a link in its parent for a register of states, for whoever is compiled for each instruction
// set; its equations stand in chain_kernels.hpp.

#if defined(FORK1S_RECOVERY_LINK) == defined(HWY_TARGET_TOGGLE)
#ifdef FORK1S_RECOVERY_LINK
#undef FORK1S_RECOVERY_LINK
#else
#define FORK1S_RECOVERY_LINK
#endif

#include "chain_kernels.hpp"
#include "exponential-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace fork1s::internal::HWY_NAMESPACE {

// θ of a link of one freedom.
template <class D, class Real = hn::TFromD<D>, class V = hn::Vec<D>>
HWY_INLINE V LinkTurn(D d, const LinkMap<Real>& map, const Link& link, const Real* HWY_RESTRICT y,
                      std::size_t y_stride) {
  const Real* HWY_RESTRICT weight = map.weights + link.weights;
  V turn = hn::Set(d, *weight++);
  for (int k = link.first + 1; k < link.last; ++k)
    turn = hn::MulAdd(hn::Set(d, *weight++),
                      hn::Load(d, y + static_cast<std::size_t>(map.inputs[k]) * y_stride), turn);
  return turn;
}

template <class D, class Real = hn::TFromD<D>, class V = hn::Vec<D>>
HWY_INLINE void LinkPose(D d, const LinkMap<Real>& map, const Link& link, const Real* HWY_RESTRICT y,
                         std::size_t y_stride, V* L) {
  const Real* HWY_RESTRICT c = map.constants + link.constants;
  if (link.kind == LinkKind::kTwist) {
    const Real* HWY_RESTRICT weight = map.weights + link.weights;
    V w[3], v[3];
    for (int i = 0; i < 3; ++i) {
      w[i] = hn::Set(d, weight[i]);
      v[i] = hn::Set(d, weight[3 + i]);
    }
    for (int k = link.first + 1; k < link.last; ++k) {
      weight += 6;
      const V value = hn::Load(d, y + static_cast<std::size_t>(map.inputs[k]) * y_stride);
      for (int i = 0; i < 3; ++i) {
        w[i] = hn::MulAdd(hn::Set(d, weight[i]), value, w[i]);
        v[i] = hn::MulAdd(hn::Set(d, weight[3 + i]), value, v[i]);
      }
    }
    ExpTimesAnyTurn(
        d, w, v, [&](int e) HWY_ATTR { return hn::Set(d, c[e]); },
        [&](int e, V entry) HWY_ATTR { L[e] = entry; });
    return;
  }
  for (int e = 0; e < 12; ++e) L[e] = hn::Set(d, c[e]);
  if (link.kind == LinkKind::kFixed) return;
  const V turn = LinkTurn(d, map, link, y, y_stride);
  if (link.kind != LinkKind::kSlide) {
    V sine, versine;
    SineAndVersine(d, turn, sine, versine);
    for (int e = 0; e < 12; ++e)
      L[e] = hn::MulAdd(versine, hn::Set(d, c[24 + e]), hn::MulAdd(sine, hn::Set(d, c[12 + e]), L[e]));
    if (link.kind == LinkKind::kTurn) return;
  }
  const Real* HWY_RESTRICT slide = c + NumConstants(link.kind) - 3;
  for (int i = 0; i < 3; ++i) L[9 + i] = hn::MulAdd(turn, hn::Set(d, slide[i]), L[9 + i]);
}

}  // namespace fork1s::internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
