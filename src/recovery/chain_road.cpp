// Products of exponentials along the tree, loops by their curvature or exactly: docs/method.md, section 2.
#include <algorithm>
#include <fork1s/parallel/parallel_for.hpp>
#include <numeric>

#include "aligned_vector.hpp"
#include "chain_tables.hpp"
#include "one_tables.hpp"
#include "pose_road.hpp"

namespace fork1s::internal {
namespace {

template <class Real>
class ChainRoad final : public PoseRoad<Real> {
 public:
  ChainRoad(const ReducedModel& model, Recovery)
      : mechanism_(model.mechanism), q_ref_(model.q_ref), r_(model.size()) {
    const CoordinateForms forms(model, VectorX::Ones(model.loop_rank()));
    y_size_ = forms.size();
    tables_ = LinkTables<Real>(*mechanism_, forms);
    FillOne();
  }
  int bodies() const override { return mechanism_->num_bodies(); }
  int coordinates() const override { return r_; }
  std::size_t BytesMoved() const override {
    return one_.BytesRead() + 12 * sizeof(Real) * static_cast<std::size_t>(bodies());
  }
  std::size_t Operations() const override { return tables_.Operations(); }
  void SetInterior(const VectorX& q_perp) override {
    tables_.SetConstants(*mechanism_, q_perp.size() > 0 ? VectorX(q_ref_ + q_perp) : q_ref_);
    FillOne();
  }
  LoopClosing Recover(const Real* z, PoseArrays<Real>& out) const override;
  LoopClosing RecoverMany(const Real* z, std::size_t z_stride, std::size_t states,
                          PoseArrays<Real>* out) const override;

 private:
  void FillOne() {
    std::vector<int> order(tables_.links.size());
    std::iota(order.begin(), order.end(), 0);
    one_ = OneTables<Real>(tables_, order, y_size_);
  }
  std::size_t slots() const { return static_cast<std::size_t>(tables_.slots); }

  std::shared_ptr<const Mechanism> mechanism_;
  VectorX q_ref_;
  int r_ = 0, y_size_ = 1;
  LinkTables<Real> tables_;
  OneTables<Real> one_;
};

template <class Real>
LoopClosing ChainRoad<Real>::Recover(const Real* z, PoseArrays<Real>& out) const {
  thread_local AlignedVector<Real> y, scratch;
  y.assign(static_cast<std::size_t>(y_size_), Real(0));
  y[0] = 1;
  std::copy_n(z, r_, y.begin() + 1);
  out.Resize(static_cast<std::size_t>(bodies()));
  const Real* X = one_.Walk(y.data(), scratch);
  PutPoses(X, tables_.slots, 0, bodies(), out.row(0), out.stride());
  return {};
}

// By tiles of so many states, whose rows of poses are some hundred bytes long each: a link after the other
// through all of a tile, so that what it reads of its parent lies in a cache still.
template <class Real>
constexpr std::size_t kTile = 16 * kBlock<Real>;

template <class Real>
LoopClosing ChainRoad<Real>::RecoverMany(const Real* z, std::size_t z_stride, std::size_t states,
                                         PoseArrays<Real>* out) const {
  for (int b = 0; b < bodies(); ++b) out[b].Resize(states);
  const int tiles = static_cast<int>((states + kTile<Real> - 1) / kTile<Real>);
  constexpr std::size_t kWork = 16384;  // poses: some 50 us
  const int grain = std::max(1, static_cast<int>(kWork / (kTile<Real> * slots())));
  ParallelFor(0, tiles, grain, [&](int first_tile, int last_tile) {
    const std::size_t width = std::min(kTile<Real>, Padded<Real>(states));
    AlignedVector<Real> y(static_cast<std::size_t>(y_size_) * width, Real(0)),
        between((slots() - static_cast<std::size_t>(bodies())) * 12 * width);
    std::vector<Place<Real>> places(slots());
    for (int tile = first_tile; tile < last_tile; ++tile) {
      const std::size_t begin = static_cast<std::size_t>(tile) * kTile<Real>,
                        count = std::min(kTile<Real>, states - begin);
      std::fill_n(y.begin(), width, Real(1));
      for (std::size_t k = 0; k < static_cast<std::size_t>(r_); ++k) {
        Real* row = y.data() + (1 + k) * width;
        std::copy_n(z + k * z_stride + begin, count, row);
        std::fill(row + count, row + width, Real(0));
      }
      for (std::size_t s = 0; s < slots(); ++s)
        if (s < static_cast<std::size_t>(bodies()))
          places[s] = {out[s].row(0) + begin, out[s].stride()};
        else
          places[s] = {between.data() + (s - static_cast<std::size_t>(bodies())) * 12 * width, width};
      WalkStates(tables_.Map(), y.data(), width, Padded<Real>(count), places.data());
    }
  });
  return {};
}

}  // namespace

template <class Real>
std::unique_ptr<PoseRoad<Real>> MakeChainRoad(const ReducedModel& model, Recovery recovery) {
  return std::make_unique<ChainRoad<Real>>(model, recovery);
}

template std::unique_ptr<PoseRoad<float>> MakeChainRoad<float>(const ReducedModel&, Recovery);
template std::unique_ptr<PoseRoad<double>> MakeChainRoad<double>(const ReducedModel&, Recovery);

}  // namespace fork1s::internal
