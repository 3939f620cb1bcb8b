// Loops of many states: loop_kernels.hpp. A part of kernels.cpp, which takes it once for each instruction
// set.
#include "loop_kernels.hpp"

#include "link-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace fork1s::internal::HWY_NAMESPACE {
namespace {

template <class Real>
void Bend(const BendMap<Real>& map, Real* HWY_RESTRICT y, std::size_t y_stride, std::size_t states,
          Real* HWY_RESTRICT squares) {
  const hn::ScalableTag<Real> d;
  const std::size_t lanes = hn::Lanes(d);
  const auto at = [&](int entry, std::size_t i) {
    return y + static_cast<std::size_t>(entry) * y_stride + i;
  };
  for (std::size_t i = 0; i < states; i += lanes)
    for (int g = 0; g < map.count; ++g) {
      const BendGroup& group = map.groups[g];
      for (int p = 0; p < group.pairs; ++p)
        hn::Store(hn::Mul(hn::Load(d, at(map.a[group.first_pair + p], i)),
                          hn::Load(d, at(map.b[group.first_pair + p], i))),
                  d, squares + static_cast<std::size_t>(p) * lanes);
      const Real* HWY_RESTRICT N = map.N + group.at;
      for (int row = 0; row < group.rows; ++row) {
        auto sum = hn::Zero(d);
        for (int p = 0; p < group.pairs; ++p)
          sum = hn::MulAdd(hn::Set(d, *N++), hn::Load(d, squares + static_cast<std::size_t>(p) * lanes), sum);
        hn::Store(sum, d, at(group.entry + row, i));
      }
    }
}

// One register of states on its way to closed loops. Rows of `lanes` numbers each.
template <class D, class Real = hn::TFromD<D>>
class Closer {
  using V = hn::Vec<D>;
  using M = hn::Mask<D>;

 public:
  Closer(D d, const LoopMap<Real>& map, Real* y, std::size_t y_stride, Real* scratch)
      : d_(d), map_(map), y_(y), y_stride_(y_stride), m_(static_cast<std::size_t>(map.rows)) {
    X_ = scratch;
    c_ = X_ + 12 * static_cast<std::size_t>(map.slots) * lanes();
    t_ = c_ + m_ * lanes();
    steps_ = t_ + m_ * lanes();
    squares_ = steps_ + (kMostCorrections + 1) * m_ * lanes();
    closed_ = square(kMostCorrections + 1, 0);
  }

  // Returns those that are open after all corrections.
  //
  // Chords by G, with the secants of all corrections so far (Broyden's method in the form that keeps steps
  // alone: C. T. Kelley, Iterative Methods for Linear and Nonlinear Equations, SIAM 1995, section 7.3): G is
  // off by the angle that loops have turned, chords alone would take a digit or less each.
  M Close(int& corrections) {
    const V closed = hn::Set(d_, static_cast<Real>(kClosed<Real>));
    M done = hn::Lt(closed, hn::Zero(d_));
    for (int n = 0; n <= kMostCorrections; ++n) {
      Walk();
      done = hn::Or(done, hn::Lt(Residual(), closed));
      Step(n, closed);
      corrections = HWY_MAX(corrections, n);
      if (hn::AllTrue(d_, done)) break;
    }
    return hn::Not(done);
  }

 private:
  static constexpr std::size_t lanes() { return hn::MaxLanes(D()); }
  static std::size_t At(int row) { return static_cast<std::size_t>(row) * lanes(); }
  Real* nu(int row) const { return y_ + static_cast<std::size_t>(map_.entry + row) * y_stride_; }

  void Walk() {
    for (int l = 0; l < map_.links.count; ++l) {
      const Link& link = map_.links.links[l];
      V L[12];
      LinkPose(d_, map_.links, link, y_, y_stride_, L);
      Real* to = X_ + 12 * At(link.slot);
      const auto put = [&](int e, V entry) HWY_ATTR { hn::Store(entry, d_, to + At(e)); };
      if (link.parent < 0) {
        for (int e = 0; e < 12; ++e) put(e, L[e]);
        continue;
      }
      const Real* from = X_ + 12 * At(link.parent);
      Product<V>([&](int e) HWY_ATTR { return hn::Load(d_, from + At(e)); },
                 [&](int e) HWY_ATTR { return L[e]; }, put);
    }
  }

  void Frame(int slot, const Real* X_BJ, V* X) const {
    const auto own = [&](int e) HWY_ATTR { return hn::Set(d_, X_BJ[e]); };
    if (slot < 0) {
      for (int e = 0; e < 12; ++e) X[e] = own(e);
      return;
    }
    const Real* from = X_ + 12 * At(slot);
    Product<V>([&](int e) HWY_ATTR { return hn::Load(d_, from + At(e)); }, own,
               [&](int e, V entry) HWY_ATTR { X[e] = entry; });
  }

  // c in its units, and the largest of each state's. A turn's log is sin θ times its axis by θ/sin θ, which
  // has no share in where it is 0: 3/(2 + cos θ) is as good as that up to a right angle, and beyond 120
  // degrees a state counts as open.
  V Residual() {
    V worst = hn::Zero(d_);
    sound_ = worst;
    for (int k = 0; k < map_.num_closures; ++k) {
      const ClosureRows<Real>& closure = map_.closures[k];
      V a[12], b[12], error[6];
      Frame(closure.slot_a, closure.X_a, a);
      Frame(closure.slot_b, closure.X_b, b);
      const V p0 = hn::Sub(b[9], a[9]), p1 = hn::Sub(b[10], a[10]), p2 = hn::Sub(b[11], a[11]);
      const V unit = hn::Set(d_, map_.shift_unit);
      for (int i = 0; i < 3; ++i)
        error[3 + i] = hn::Mul(unit, hn::MulAdd(a[i], p0, hn::MulAdd(a[3 + i], p1, hn::Mul(a[6 + i], p2))));
      if (closure.component[0] < 3) {
        const auto entry = [&](int i, int j) HWY_ATTR {
          return hn::MulAdd(a[i], b[j], hn::MulAdd(a[3 + i], b[3 + j], hn::Mul(a[6 + i], b[6 + j])));
        };
        const V two = hn::Set(d_, Real(2)), half = hn::Set(d_, Real(0.5));
        const V cosine = hn::Mul(
            half, hn::Sub(hn::Add(hn::Add(entry(0, 0), entry(1, 1)), entry(2, 2)), hn::Set(d_, Real(1))));
        const V factor = hn::Mul(half, hn::Div(hn::Set(d_, Real(3)), hn::Add(two, cosine)));
        error[0] = hn::Mul(factor, hn::Sub(entry(2, 1), entry(1, 2)));
        error[1] = hn::Mul(factor, hn::Sub(entry(0, 2), entry(2, 0)));
        error[2] = hn::Mul(factor, hn::Sub(entry(1, 0), entry(0, 1)));
        worst = hn::IfThenElse(hn::Lt(cosine, hn::Set(d_, Real(-0.5))), two, worst);
      }
      for (int i = 0; i < closure.rows; ++i)
        worst = PutResidual(closure.row[i], error[closure.component[i]], worst);
    }
    for (int k = 0; k < map_.num_couplings; ++k) {
      const CouplingRow<Real>& coupling = map_.couplings[k];
      const V a = Form(coupling.first_a, coupling.last_a), b = Form(coupling.last_a, coupling.last_b);
      V value = hn::Set(d_, coupling.polynomial[4]);
      for (int i = 4; i-- > 0;) value = hn::MulAdd(value, b, hn::Set(d_, coupling.polynomial[i]));
      worst = PutResidual(coupling.row, hn::Mul(hn::Set(d_, coupling.unit), hn::Sub(a, value)), worst);
    }
    return hn::Add(worst, sound_);
  }
  V PutResidual(int row, V error, V worst) {
    hn::Store(error, d_, c_ + At(row));
    sound_ =
        hn::Add(sound_, hn::Sub(error, error));  // a maximum may drop what is no number; it is not closed
    return hn::Max(worst, hn::Abs(error));
  }
  V Form(int first, int last) const {
    V sum = hn::Zero(d_);
    for (int k = first; k < last; ++k)
      sum = hn::MulAdd(hn::Set(d_, map_.weights[k]),
                       hn::Load(d_, y_ + static_cast<std::size_t>(map_.inputs[k]) * y_stride_), sum);
    return sum;
  }

  Real* step(int n, int row) const { return steps_ + (static_cast<std::size_t>(n) * m_) * lanes() + At(row); }
  Real* square(int n, int g) const {
    return squares_ + static_cast<std::size_t>(n) * static_cast<std::size_t>(map_.num_groups) * lanes() +
           At(g);
  }
  V StepTimes(int n, const LoopGroup& group) const {  // s_nᵀ t
    V sum = hn::Zero(d_);
    for (int i = group.row; i < group.row + group.rows; ++i)
      sum = hn::MulAdd(hn::Load(d_, step(n, i)), hn::Load(d_, t_ + At(i)), sum);
    return sum;
  }

  // t = G c; t += s_{j+1} (s_jᵀ t)/s_j² for j < n - 1; s_n = t/(1 - s_{n-1}ᵀ t/s_{n-1}²); ν += s_n. Each
  // group of loops by itself.
  void Step(int n, V closed) {
    const V zero = hn::Zero(d_), one = hn::Set(d_, Real(1));
    const V least = hn::Set(d_, sizeof(Real) == 4 ? Real(1e-30) : Real(1e-290));
    for (int g = 0; g < map_.num_groups; ++g) {
      const LoopGroup& group = map_.groups[g];
      // What was closed before stays where it is: of steps that are rounding there are no secants.
      const M rests = n == 0 ? hn::Lt(one, zero) : hn::Gt(hn::Load(d_, closed_ + At(g)), zero);
      V worst = zero;
      for (int i = group.row; i < group.row + group.rows; ++i)
        worst = hn::Max(worst, hn::Abs(hn::Load(d_, c_ + At(i))));
      hn::Store(hn::IfThenElseZero(hn::Or(rests, hn::Lt(worst, closed)), one), d_, closed_ + At(g));
      const Real* HWY_RESTRICT G = map_.G + group.at;
      for (int i = 0; i < group.rows; ++i) {
        V sum = hn::Zero(d_);
        for (int k = 0; k < group.rows; ++k)
          sum = hn::MulAdd(hn::Set(d_, *G++), hn::Load(d_, c_ + At(group.row + k)), sum);
        hn::Store(sum, d_, t_ + At(group.row + i));
      }
      for (int j = 0; j + 1 < n; ++j) {
        const V share = hn::Div(StepTimes(j, group), hn::Load(d_, square(j, g)));
        for (int i = group.row; i < group.row + group.rows; ++i)
          hn::Store(hn::MulAdd(share, hn::Load(d_, step(j + 1, i)), hn::Load(d_, t_ + At(i))), d_,
                    t_ + At(i));
      }
      V scale = one;
      if (n > 0) {
        const V left = hn::Div(StepTimes(n - 1, group), hn::Load(d_, square(n - 1, g)));
        // Closed, by a step that gained nothing: both are rounding.
        const M still = hn::And(hn::Lt(worst, closed), hn::Gt(left, hn::Set(d_, Real(0.5))));
        scale = hn::IfThenZeroElse(still, hn::Div(one, hn::Sub(one, left)));
      }
      V sum = hn::Zero(d_);
      for (int i = group.row; i < group.row + group.rows; ++i) {
        const V s = hn::IfThenZeroElse(rests, hn::Mul(scale, hn::Load(d_, t_ + At(i))));
        hn::Store(s, d_, step(n, i));
        hn::Store(hn::Add(hn::Load(d_, nu(i)), s), d_, nu(i));
        sum = hn::MulAdd(s, s, sum);
      }
      hn::Store(hn::Max(sum, least), d_, square(n, g));
    }
  }

  D d_;
  const LoopMap<Real>& map_;
  Real* y_;
  std::size_t y_stride_, m_;
  Real *X_, *c_, *t_, *steps_, *squares_, *closed_;
  V sound_ = hn::Zero(D());  // 0, or no number
};

template <class Real>
Closing CloseStates(const LoopMap<Real>& map, Real* y, std::size_t y_stride, std::size_t states,
                    Real* scratch) {
  const hn::ScalableTag<Real> d;
  Closing out;
  for (std::size_t lane = 0; lane < states; lane += hn::Lanes(d)) {
    const auto open =
        Closer<hn::ScalableTag<Real>>(d, map, y + lane, y_stride, scratch).Close(out.corrections);
    if (hn::AllFalse(d, open)) continue;
    std::uint8_t bits[64] = {};
    hn::StoreMaskBits(d, open, bits);
    for (std::size_t k = 0; k < hn::Lanes(d); ++k)
      if (bits[k / 8] >> (k % 8) & 1) out.open |= Missed{1} << (lane + k);
  }
  return out;
}

void BendFloat(const BendMap<float>& map, float* y, std::size_t y_stride, std::size_t states,
               float* scratch) {
  Bend(map, y, y_stride, states, scratch);
}
void BendDouble(const BendMap<double>& map, double* y, std::size_t y_stride, std::size_t states,
                double* scratch) {
  Bend(map, y, y_stride, states, scratch);
}
Closing CloseFloat(const LoopMap<float>& map, float* y, std::size_t y_stride, std::size_t states,
                   float* scratch) {
  return CloseStates(map, y, y_stride, states, scratch);
}
Closing CloseDouble(const LoopMap<double>& map, double* y, std::size_t y_stride, std::size_t states,
                    double* scratch) {
  return CloseStates(map, y, y_stride, states, scratch);
}

}  // namespace
}  // namespace fork1s::internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace fork1s::internal {

HWY_EXPORT(BendFloat);
HWY_EXPORT(BendDouble);
HWY_EXPORT(CloseFloat);
HWY_EXPORT(CloseDouble);

void BendStates(const BendMap<float>& map, float* y, std::size_t y_stride, std::size_t states,
                float* scratch) {
  HWY_DYNAMIC_DISPATCH(BendFloat)(map, y, y_stride, states, scratch);
}
void BendStates(const BendMap<double>& map, double* y, std::size_t y_stride, std::size_t states,
                double* scratch) {
  HWY_DYNAMIC_DISPATCH(BendDouble)(map, y, y_stride, states, scratch);
}
Closing CloseBlock(const LoopMap<float>& map, float* y, std::size_t y_stride, std::size_t states,
                   float* scratch) {
  return HWY_DYNAMIC_DISPATCH(CloseFloat)(map, y, y_stride, states, scratch);
}
Closing CloseBlock(const LoopMap<double>& map, double* y, std::size_t y_stride, std::size_t states,
                   double* scratch) {
  return HWY_DYNAMIC_DISPATCH(CloseDouble)(map, y, y_stride, states, scratch);
}

}  // namespace fork1s::internal
#endif
