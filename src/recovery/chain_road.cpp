// Products of exponentials along the tree, loops by their curvature or exactly: docs/method.md, section 2.
#include <algorithm>
#include <fork1s/parallel/parallel_for.hpp>
#include <numeric>
#include <optional>

#include "aligned_vector.hpp"
#include "chain_tables.hpp"
#include "loop_tables.hpp"
#include "one_tables.hpp"
#include "pose_road.hpp"

namespace fork1s::internal {
namespace {

template <class Real>
class ChainRoad final : public PoseRoad<Real> {
 public:
  ChainRoad(const ReducedModel& model, Recovery recovery)
      : mechanism_(model.mechanism), q_ref_(model.q_ref), r_(model.size()) {
    const LoopUnits units(model);
    const CoordinateForms forms(model, units.unit);
    y_size_ = forms.size();
    tables_ = LinkTables<Real>(*mechanism_, forms);
    const bool exact = recovery == Recovery::kExact;
    loops_ = LoopTables<Real>(model, units, forms, tables_, exact);
    if (exact && loops_.exist()) {
      model_ = model;
      model_->curvature = {};
    }
    FillOne();
  }
  int bodies() const override { return mechanism_->num_bodies(); }
  int coordinates() const override { return r_; }
  std::size_t BytesMoved() const override {
    return one_.BytesRead() + loops_.BytesRead() + 12 * sizeof(Real) * static_cast<std::size_t>(bodies());
  }
  std::size_t Operations() const override { return tables_.Operations() + loops_.Operations(); }
  void SetInterior(const VectorX& q_perp) override {
    q_perp_ = q_perp;
    const VectorX q = q_perp.size() > 0 ? VectorX(q_ref_ + q_perp) : q_ref_;
    tables_.SetConstants(*mechanism_, q);
    loops_.SetConstants(*mechanism_, q);
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
  std::vector<RigidTransform> OneByOne(const Real* z, std::size_t stride, LoopClosing& closing) const;
  std::size_t slots() const { return static_cast<std::size_t>(tables_.slots); }

  std::shared_ptr<const Mechanism> mechanism_;
  VectorX q_ref_, q_perp_;
  int r_ = 0, y_size_ = 1;
  LinkTables<Real> tables_;
  OneTables<Real> one_;
  LoopTables<Real> loops_;
  std::optional<ReducedModel>
      model_;  // where loops are closed exactly: for states that do not close side by side
};

// A state alone, as every other part of the program has it.
template <class Real>
std::vector<RigidTransform> ChainRoad<Real>::OneByOne(const Real* z, std::size_t stride,
                                                      LoopClosing& closing) const {
  ReducedState state;
  state.z.resize(r_);
  for (int k = 0; k < r_; ++k) state.z(k) = static_cast<double>(z[static_cast<std::size_t>(k) * stride]);
  state.q_perp = q_perp_;
  Configuration at(*model_);
  at.closed = std::min(at.closed, kClosed<Real>);
  Configure(*model_, state, at);
  ++closing.one_by_one;
  if (!(at.c.cwiseAbs().maxCoeff() < at.closed)) ++closing.open;
  return at.kinematics.X_RB;
}

template <class Real>
LoopClosing ChainRoad<Real>::Recover(const Real* z, PoseArrays<Real>& out) const {
  // What a call needs beside, kept from call to call.
  thread_local AlignedVector<Real> y, scratch;
  LoopClosing closing;
  out.Resize(static_cast<std::size_t>(bodies()));
  const auto size = static_cast<std::size_t>(y_size_);
  if (loops_.exist()) {  // one state of a block of them
    constexpr std::size_t block = kBlock<Real>;
    y.assign(size * block, Real(0));
    std::fill_n(y.begin(), block, Real(1));
    for (std::size_t k = 0; k < static_cast<std::size_t>(r_); ++k) y[(1 + k) * block] = z[k];
    loops_.Bend(y.data(), block, block, scratch);
    if (model_) {
      const Closing closed = loops_.Close(tables_, y.data(), block, 1, scratch);
      closing.corrections = closed.corrections;
      if (closed.open & 1) {
        const std::vector<RigidTransform> X_RB = OneByOne(z, 1, closing);
        for (std::size_t b = 0; b < X_RB.size(); ++b) PutPose(X_RB[b], b, out);
        return closing;
      }
    }
    for (std::size_t k = 0; k < size; ++k) y[k] = y[k * block];
  } else {
    y.resize(size);
    y[0] = 1;
    std::copy_n(z, r_, y.begin() + 1);
  }
  const Real* X = one_.Walk(y.data(), scratch);
  PutPoses(X, tables_.slots, 0, bodies(), out.row(0), out.stride());
  return closing;
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
  std::vector<LoopClosing> closings(static_cast<std::size_t>(tiles));
  ParallelFor(0, tiles, grain, [&](int first_tile, int last_tile) {
    const std::size_t width = std::min(kTile<Real>, Padded<Real>(states));
    AlignedVector<Real> y(static_cast<std::size_t>(y_size_) * width, Real(0)), scratch,
        between((slots() - static_cast<std::size_t>(bodies())) * 12 * width);
    std::vector<Place<Real>> places(slots());
    std::vector<std::size_t> open;  // states
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
      LoopClosing& closing = closings[static_cast<std::size_t>(tile)];
      open.clear();
      if (loops_.exist()) loops_.Bend(y.data(), width, Padded<Real>(count), scratch);
      for (std::size_t i = 0; model_ && i < count; i += kBlock<Real>) {
        const std::size_t some = std::min<std::size_t>(kBlock<Real>, count - i);
        const Closing closed = loops_.Close(tables_, y.data() + i, width, some, scratch);
        closing.corrections = std::max(closing.corrections, closed.corrections);
        for (std::size_t k = 0; k < some; ++k)
          if (closed.open >> k & 1) open.push_back(begin + i + k);
      }
      WalkStates(tables_.Map(), y.data(), width, Padded<Real>(count), places.data());
      for (const std::size_t i : open) {
        const std::vector<RigidTransform> X_RB = OneByOne(z + i, z_stride, closing);
        for (std::size_t b = 0; b < X_RB.size(); ++b) PutPose(X_RB[b], i, out[b]);
      }
    }
  });
  LoopClosing all;
  for (const LoopClosing& closing : closings) {
    all.one_by_one += closing.one_by_one;
    all.open += closing.open;
    all.corrections = std::max(all.corrections, closing.corrections);
  }
  return all;
}

}  // namespace

template <class Real>
std::unique_ptr<PoseRoad<Real>> MakeChainRoad(const ReducedModel& model, Recovery recovery) {
  return std::make_unique<ChainRoad<Real>>(model, recovery);
}

template std::unique_ptr<PoseRoad<float>> MakeChainRoad<float>(const ReducedModel&, Recovery);
template std::unique_ptr<PoseRoad<double>> MakeChainRoad<double>(const ReducedModel&, Recovery);

}  // namespace fork1s::internal
