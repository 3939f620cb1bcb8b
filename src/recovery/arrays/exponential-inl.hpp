// Exponentials and products of poses in wide registers, for whoever is compiled for each instruction set.
//
// A pose is twelve registers: nine entries of the rotation, by rows, then three of the translation.

#if defined(FORK1S_RECOVERY_EXPONENTIAL) == defined(HWY_TARGET_TOGGLE)
#ifdef FORK1S_RECOVERY_EXPONENTIAL
#undef FORK1S_RECOVERY_EXPONENTIAL
#else
#define FORK1S_RECOVERY_EXPONENTIAL
#endif

#include <hwy/highway.h>

#include <array>
#include <cstddef>

HWY_BEFORE_NAMESPACE();
namespace fork1s::internal::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

constexpr double kHalfTurn2 = 9.869604401089358;  // π²

// Terms of the series below up to x = π², the first one left out below the last digit: 1e-8 and 3e-17.
template <class Real>
constexpr int kTermsToHalfTurn = sizeof(Real) == 4 ? 8 : 13;
// Up to x = (π/2)²: 3e-9 and 8e-18.
template <class Real>
constexpr int kTermsToQuarterTurn = sizeof(Real) == 4 ? 6 : 10;

template <class Real, int shift, int terms>
constexpr auto InverseFactorials() {
  std::array<Real, terms> out{};
  double value = 1;
  for (int n = 2; n <= shift; ++n) value /= n;
  for (int k = 0; k < terms; ++k) {
    out[static_cast<std::size_t>(k)] = static_cast<Real>(value);
    value /= (2 * k + shift + 1) * (2 * k + shift + 2);
  }
  return out;
}

// Σ (-x)^k / (2 k + shift)!: (1 - cos θ)/θ² for shift 2 and (θ - sin θ)/θ³ for shift 3, x = θ².
template <int shift, int terms, class D, class V = hn::Vec<D>, class Real = hn::TFromD<D>>
HWY_INLINE V Series(D d, V x) {
  static constexpr auto term = InverseFactorials<Real, shift, terms>();
  V sum = hn::Set(d, term.back());
  for (std::size_t k = term.size() - 1; k-- > 0;) sum = hn::NegMulAdd(sum, x, hn::Set(d, term[k]));
  return sum;
}

// sin θ and 1 - cos θ of any angle, as near as its last digit says: θ = k π + r, |r| <= π/2.
template <class D, class V = hn::Vec<D>, class Real = hn::TFromD<D>>
HWY_INLINE void SineAndVersine(D d, V angle, V& sine, V& versine) {
  constexpr bool single = sizeof(Real) == 4;
  const V one = hn::Set(d, Real(1));
  const V k = hn::Round(hn::Mul(angle, hn::Set(d, static_cast<Real>(0.3183098861837907))));
  // π in two parts, so that what is taken off is right to more digits than are left.
  V r = hn::NegMulAdd(k, hn::Set(d, single ? Real(3.14159274101257324) : Real(3.141592653589793)), angle);
  r = hn::NegMulAdd(k, hn::Set(d, single ? Real(-8.742278012618954e-8) : Real(1.2246467991473532e-16)), r);
  const V x = hn::Mul(r, r);
  const V half = hn::Mul(k, hn::Set(d, Real(0.5)));
  const V sign = hn::NegMulAdd(hn::Sub(half, hn::Floor(half)), hn::Set(d, Real(4)), one);  // (-1)^k
  const V B = Series<2, kTermsToQuarterTurn<Real>>(d, x), C = Series<3, kTermsToQuarterTurn<Real>>(d, x);
  sine = hn::Mul(sign, hn::NegMulAdd(hn::Mul(r, x), C, r));
  versine = hn::MulAdd(hn::Mul(sign, x), B, hn::Sub(one, sign));
}

// Exp of a twist of rotation ω, |ω|² = x, by the coefficients of its powers:
//   R = 1 + A [ω] + B [ω]²,    p = v + B ω × v + C ω × (ω × v)
template <class D, class V>
HWY_INLINE void Exponential(D d, const V A, const V B, const V C, const V* w, const V* v, V* R, V* p) {
  const V one = hn::Set(d, hn::TFromD<D>(1));
  const V w00 = hn::Mul(w[0], w[0]), w11 = hn::Mul(w[1], w[1]), w22 = hn::Mul(w[2], w[2]);
  const V a0 = hn::Mul(A, w[0]), a1 = hn::Mul(A, w[1]), a2 = hn::Mul(A, w[2]);
  const V b0 = hn::Mul(B, w[0]), b1 = hn::Mul(B, w[1]);
  const V b01 = hn::Mul(b0, w[1]), b02 = hn::Mul(b0, w[2]), b12 = hn::Mul(b1, w[2]);
  R[0] = hn::NegMulAdd(B, hn::Add(w11, w22), one);
  R[1] = hn::Sub(b01, a2);
  R[2] = hn::Add(b02, a1);
  R[3] = hn::Add(b01, a2);
  R[4] = hn::NegMulAdd(B, hn::Add(w00, w22), one);
  R[5] = hn::Sub(b12, a0);
  R[6] = hn::Sub(b02, a1);
  R[7] = hn::Add(b12, a0);
  R[8] = hn::NegMulAdd(B, hn::Add(w00, w11), one);
  const V c0 = hn::MulSub(w[1], v[2], hn::Mul(w[2], v[1])), c1 = hn::MulSub(w[2], v[0], hn::Mul(w[0], v[2])),
          c2 = hn::MulSub(w[0], v[1], hn::Mul(w[1], v[0]));
  p[0] = hn::MulAdd(C, hn::MulSub(w[1], c2, hn::Mul(w[2], c1)), hn::MulAdd(B, c0, v[0]));
  p[1] = hn::MulAdd(C, hn::MulSub(w[2], c0, hn::Mul(w[0], c2)), hn::MulAdd(B, c1, v[1]));
  p[2] = hn::MulAdd(C, hn::MulSub(w[0], c1, hn::Mul(w[1], c0)), hn::MulAdd(B, c2, v[2]));
}

// Pose times pose, entry by entry: left(i) and right(i) give one, put(i, entry) takes one of the product.
template <class V, class Left, class Right, class Put>
HWY_INLINE void Product(const Left& left, const Right& right, const Put& put) {
  for (int j = 0; j < 3; ++j) {
    const V r0 = right(j), r1 = right(3 + j), r2 = right(6 + j);
    for (int i = 0; i < 3; ++i)
      put(3 * i + j,
          hn::MulAdd(left(3 * i), r0, hn::MulAdd(left(3 * i + 1), r1, hn::Mul(left(3 * i + 2), r2))));
  }
  const V r0 = right(9), r1 = right(10), r2 = right(11);
  for (int i = 0; i < 3; ++i)
    put(9 + i, hn::MulAdd(left(3 * i), r0,
                          hn::MulAdd(left(3 * i + 1), r1, hn::MulAdd(left(3 * i + 2), r2, left(9 + i)))));
}

// The pose that a link's rows (link_rows.hpp) at `c` make at θ, lane by lane: rows stand `block` numbers
// apart.
template <class D, class Real = hn::TFromD<D>, class V = hn::Vec<D>>
HWY_INLINE void LinkAt(D d, const Real* HWY_RESTRICT c, std::size_t block, V turn, V sine, V versine, V* L) {
  const auto row = [&](std::size_t k) HWY_ATTR { return hn::Load(d, c + k * block); };
  V E[12];
  const V one = hn::Set(d, Real(1)), w0 = row(12), w1 = row(13), w2 = row(14), u0 = row(15), u1 = row(16),
          u2 = row(17);
  const V s0 = hn::Mul(sine, w0), s1 = hn::Mul(sine, w1), s2 = hn::Mul(sine, w2);
  const V m0 = hn::Mul(versine, w0), m1 = hn::Mul(versine, w1), m2 = hn::Mul(versine, w2);
  const V m01 = hn::Mul(m0, w1), m02 = hn::Mul(m0, w2), m12 = hn::Mul(m1, w2);
  E[0] = hn::NegMulAdd(m1, w1, hn::NegMulAdd(m2, w2, one));
  E[1] = hn::Sub(m01, s2);
  E[2] = hn::Add(m02, s1);
  E[3] = hn::Add(m01, s2);
  E[4] = hn::NegMulAdd(m0, w0, hn::NegMulAdd(m2, w2, one));
  E[5] = hn::Sub(m12, s0);
  E[6] = hn::Sub(m02, s1);
  E[7] = hn::Add(m12, s0);
  E[8] = hn::NegMulAdd(m0, w0, hn::NegMulAdd(m1, w1, one));
  // θ a + (1 - cos θ) u - sin θ ω × u,  u = ω × v
  E[9] = hn::MulAdd(turn, row(18), hn::MulAdd(versine, u0, hn::MulSub(u1, s2, hn::Mul(u2, s1))));
  E[10] = hn::MulAdd(turn, row(19), hn::MulAdd(versine, u1, hn::MulSub(u2, s0, hn::Mul(u0, s2))));
  E[11] = hn::MulAdd(turn, row(20), hn::MulAdd(versine, u2, hn::MulSub(u0, s1, hn::Mul(u1, s0))));
  Product<V>([&](int e) HWY_ATTR { return row(static_cast<std::size_t>(e)); },
             [&](int e) HWY_ATTR { return E[e]; }, [&](int e, V entry) HWY_ATTR { L[e] = entry; });
}

// x = |ω|²
template <class V>
HWY_INLINE V Square(const V* w) {
  return hn::Add(hn::Add(hn::Mul(w[0], w[0]), hn::Mul(w[1], w[1])), hn::Mul(w[2], w[2]));
}

// Exp of twists [w; v] times the poses that ref(i) gives, entry i; put(i, entry) takes the result. Returns
// those that turn by more than half a turn, which are not right.
template <class D, class V, class Ref, class Put>
HWY_INLINE hn::Mask<D> ExpTimes(D d, const V* w, const V* v, const Ref& ref, const Put& put) {
  using Real = hn::TFromD<D>;
  const V x = Square(w);
  const V B = Series<2, kTermsToHalfTurn<Real>>(d, x), C = Series<3, kTermsToHalfTurn<Real>>(d, x);
  const V A = hn::NegMulAdd(x, C, hn::Set(d, Real(1)));  // sin θ/θ
  V E[12];
  Exponential(d, A, B, C, w, v, E, E + 9);
  Product<V>([&](int i) HWY_ATTR { return E[i]; }, ref, put);
  return hn::Gt(x, hn::Set(d, static_cast<Real>(kHalfTurn2)));
}

// The same, by closed forms where it turns farther.
template <class D, class V, class Ref, class Put>
HWY_INLINE void ExpTimesAnyTurn(D d, const V* w, const V* v, const Ref& ref, const Put& put) {
  using Real = hn::TFromD<D>;
  const V one = hn::Set(d, Real(1));
  const V x = Square(w);
  V B = Series<2, kTermsToHalfTurn<Real>>(d, x), C = Series<3, kTermsToHalfTurn<Real>>(d, x);
  V A = hn::NegMulAdd(x, C, one);
  const auto far = hn::Gt(x, hn::Set(d, static_cast<Real>(kHalfTurn2)));
  if (HWY_UNLIKELY(!hn::AllFalse(d, far))) {
    const V angle = hn::Sqrt(x);
    V sine, versine;
    SineAndVersine(d, angle, sine, versine);
    A = hn::IfThenElse(far, hn::Div(sine, angle), A);
    B = hn::IfThenElse(far, hn::Div(versine, x), B);
    C = hn::IfThenElse(far, hn::Div(hn::Sub(one, A), x), C);
  }
  V E[12];
  Exponential(d, A, B, C, w, v, E, E + 9);
  Product<V>([&](int i) HWY_ATTR { return E[i]; }, ref, put);
}

}  // namespace fork1s::internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
