// Products of exponentials along the tree, loops by their curvature or exactly: docs/method.md, section 2.
#include <algorithm>
#include <atomic>
#include <memory>

#include "aligned_vector.hpp"
#include "chain_tables.hpp"
#include "loop_tables.hpp"
#include "one_by_one.hpp"
#include "one_tables.hpp"
#include "parallel/parallel_for.hpp"
#include "pose_backend.hpp"
#include "scan_tables.hpp"

namespace fork1s::internal {
namespace {

// Links of a run at most, so that the nearest cache holds the poses of its first pass.
constexpr int kLongestRun = 512;
// Links of a run at least: in f32 that makes of each segment as many steps as there are segments. In f64 what
// is read and written weighs more, and up to here there is no difference.
template <class Real>
constexpr int kShortestRun = sizeof(Real) == 4 ? 256 : 768;
constexpr int kWorthThreads = 8192;  // fewer bodies are one thread's work

// What a call of Recover needs beside.
template <class Real>
struct Workspace {
  AlignedVector<Real> y, X, scratch, turns, poses, stands;
};

// Keeps one from call to call; of calls at the same time the others make their own. One for each thread would
// not do: a thread that waits in a loop of one call may begin another.
template <class T>
class Spare {
 public:
  ~Spare() { delete kept_.load(); }
  std::unique_ptr<T> Acquire() {
    std::unique_ptr<T> out(kept_.exchange(nullptr));
    return out ? std::move(out) : std::make_unique<T>();
  }
  void Return(std::unique_ptr<T> used) { delete kept_.exchange(used.release()); }

 private:
  std::atomic<T*> kept_{nullptr};
};

template <class Real>
class ChainBackend final : public PoseBackend<Real> {
 public:
  ChainBackend(const ReducedModel& model, const LoopUnits& units, const LinkTables<double>& links,
               CoordinateForms forms, bool exact)
      : mechanism_(model.mechanism),
        q_ref_(model.q_ref),
        forms_(std::move(forms)),
        r_(model.size()),
        y_size_(forms_.size()),
        tables_(links),
        loops_(LoopTables<double>(model, units, forms_, links, exact)) {
    if (exact && loops_.exist()) one_by_one_ = OneByOne(model, kClosed<Real>);
    FillOne();
  }
  int bodies() const override { return mechanism_->num_bodies(); }
  int coordinates() const override { return r_; }
  std::size_t BytesMoved() const override {
    std::size_t read = 0;
    for (const OneTables<Real>& one : plain_) read += one.BytesRead();
    for (const RunTables<Real>& run : runs_) read += run.BytesRead();
    return read + loops_.BytesRead() + 12 * sizeof(Real) * static_cast<std::size_t>(bodies());
  }
  std::size_t Operations() const override {
    return LinkOperations(tables_.links, tables_.weights.size(), sizeof(Real)) + loops_.Operations();
  }
  LoopClosing Recover(const Real* z, PoseArrays<Real>& out) const override;
  LoopClosing RecoverMany(const Real* z, std::size_t z_stride, std::size_t states,
                          PoseArrays<Real>* out) const override;

 private:
  void FillOne();
  void ForwardKinematicsOfOneState(Workspace<Real>& at, PoseArrays<Real>& out) const;
  std::vector<RigidTransform> Alone(const Real* z, std::size_t stride, LoopClosing& closing) const;
  std::size_t slots() const { return static_cast<std::size_t>(tables_.slots); }

  std::shared_ptr<const Mechanism> mechanism_;
  VectorX q_ref_;
  CoordinateForms forms_;
  int r_ = 0, y_size_ = 1;
  LinkTables<Real> tables_;
  // For one state: what is walked link by link and what is scanned, in the order of links.
  std::vector<LinkRange> ranges_;
  std::vector<OneTables<Real>> plain_;
  std::vector<RunTables<Real>> runs_;
  std::size_t most_turns_ = 0, most_poses_ = 0;    // numbers of a run
  std::vector<std::pair<int, int>> plain_bodies_;  // whole blocks that have some that are not scanned
  LoopTables<Real> loops_;
  mutable Spare<Workspace<Real>> spare_;
  OneByOne one_by_one_;  // where loops are closed exactly
};

template <class Real>
std::vector<RigidTransform> ChainBackend<Real>::Alone(const Real* z, std::size_t stride,
                                                      LoopClosing& closing) const {
  VectorX own(r_);
  for (int k = 0; k < r_; ++k) own(k) = static_cast<double>(z[static_cast<std::size_t>(k) * stride]);
  return one_by_one_.Recover(own, closing);
}

template <class Real>
LoopClosing ChainBackend<Real>::Recover(const Real* z, PoseArrays<Real>& out) const {
  std::unique_ptr<Workspace<Real>> at = spare_.Acquire();
  AlignedVector<Real>& y = at->y;
  LoopClosing closing;
  out.Resize(static_cast<std::size_t>(bodies()));
  const auto size = static_cast<std::size_t>(y_size_);
  if (loops_.exist()) {  // one state of a block of them
    constexpr std::size_t block = kBlock<Real>;
    y.assign(size * block, Real(0));
    std::fill_n(y.begin(), block, Real(1));
    for (std::size_t k = 0; k < static_cast<std::size_t>(r_); ++k) y[(1 + k) * block] = z[k];
    loops_.Bend(y.data(), block, block, at->scratch);
    if (one_by_one_.exists()) {
      const Closing closed = loops_.Close(tables_, y.data(), block, 1, at->scratch);
      closing.corrections = closed.corrections;
      if (closed.open & 1) {
        const std::vector<RigidTransform> X_RB = Alone(z, 1, closing);
        for (std::size_t b = 0; b < X_RB.size(); ++b) PutPose(X_RB[b], b, out);
        spare_.Return(std::move(at));
        return closing;
      }
    }
    for (std::size_t k = 0; k < size; ++k) y[k] = y[k * block];
  } else {
    y.resize(size);
    y[0] = 1;
    std::copy_n(z, r_, y.begin() + 1);
  }
  ForwardKinematicsOfOneState(*at, out);
  spare_.Return(std::move(at));
  return closing;
}

// In the order of links: what is walked link by link, and runs, of which each has two passes. A run's first
// pass waits for nobody, since it begins at the identity, and the second one for what it stands on: where
// there are many runs, all first ones go at the same time, and then all second ones. Else each has both at
// once, while the first one's poses are in the nearest cache.
template <class Real>
void ChainBackend<Real>::ForwardKinematicsOfOneState(Workspace<Real>& at, PoseArrays<Real>& out) const {
  const std::size_t column = 4 * (slots() + 1);
  at.X.resize(4 * column + 4 * kBlock<Real>);  // whole blocks are read behind the last body
  Real* X = at.X.data();
  const int runs = static_cast<int>(runs_.size());
  const bool side_by_side = bodies() >= kWorthThreads;
  const auto copies = static_cast<std::size_t>(side_by_side ? runs : std::min(runs, 1));
  at.turns.resize(copies * most_turns_);
  at.poses.resize(copies * most_poses_);
  at.stands.resize(copies * 12 * kBlock<Real>);
  const auto own = [&](int i) { return static_cast<std::size_t>(side_by_side ? i : 0); };
  const auto poses = [&](int i) { return at.poses.data() + own(i) * most_poses_; };
  const auto stands = [&](int i) { return at.stands.data() + own(i) * 12 * kBlock<Real>; };
  const auto first = [&](int begin, int end) {
    for (int i = begin; i < end; ++i)
      runs_[static_cast<std::size_t>(i)].First(at.y.data(), at.turns.data() + own(i) * most_turns_, poses(i));
  };
  const auto last = [&](int begin, int end) {
    for (int i = begin; i < end; ++i)
      runs_[static_cast<std::size_t>(i)].Last(poses(i), stands(i), out.row(0), out.stride());
  };
  const int grain = std::max(1, kWorthThreads / 4 / kLongestRun);
  if (side_by_side) ParallelFor(0, runs, grain, first);
  for (std::size_t k = 0; k < 4; ++k)
    for (std::size_t i = 0; i < 4; ++i) X[k * column + 4 * slots() + i] = Real(i == k && k < 3);
  int run = 0, walked = 0;
  for (const LinkRange& range : ranges_) {
    if (!range.is_run) {
      plain_[static_cast<std::size_t>(walked++)].Walk(at.y.data(), X);
      continue;
    }
    if (!side_by_side) first(run, run + 1);
    runs_[static_cast<std::size_t>(run)].Stand(poses(run), X, column, stands(run));
    if (!side_by_side) last(run, run + 1);
    ++run;
  }
  if (side_by_side) ParallelFor(0, runs, grain, last);
  for (const auto& [begin, end] : plain_bodies_)
    PutPoses(X, tables_.slots, begin, end, out.row(0), out.stride());
}

template <class Real>
void ChainBackend<Real>::FillOne() {
  plain_.clear();
  runs_.clear();
  plain_bodies_.clear();
  constexpr int block = kBlock<Real>;
  // Scanned, a run takes two products a link where it took one, in registers of several links, and no
  // waiting: a gain in registers of eight numbers or more, and in all where threads share the work.
  const bool is_wide = RegisterLanes(sizeof(Real)) >= 8;
  ranges_ = LinkRanges(tables_.links, bodies(), is_wide ? kShortestRun<Real> : kWorthThreads, kLongestRun);
  std::vector<bool> is_plain(static_cast<std::size_t>(bodies()), true);
  for (const LinkRange& range : ranges_) {
    if (!range.is_run) {
      plain_.emplace_back(tables_, range.begin, range.end, y_size_);
      continue;
    }
    runs_.emplace_back(tables_, range.begin, range.end, y_size_);
    most_turns_ = std::max(most_turns_, runs_.back().turns());
    most_poses_ = std::max(most_poses_, runs_.back().poses());
    std::fill_n(is_plain.begin() + runs_.back().first_slot(), runs_.back().size(), false);
  }
  for (int b = 0; b < bodies(); b += block) {
    const int end = std::min(bodies(), b + block);
    if (std::find(is_plain.begin() + b, is_plain.begin() + end, true) == is_plain.begin() + end) continue;
    if (!plain_bodies_.empty() && plain_bodies_.back().second == b)
      plain_bodies_.back().second = end;
    else
      plain_bodies_.emplace_back(b, end);
  }
  for (RunTables<Real>& run : runs_)  // a block that both have is put last, from X
    for (const auto& [begin, end] : plain_bodies_) run.Ask(begin, end);
}

// By tiles of so many states, whose rows of poses are some hundred bytes long each: a link after the other
// through all of a tile, so that what it reads of its parent lies in a cache still.
template <class Real>
constexpr std::size_t kTile = 16 * kBlock<Real>;

template <class Real>
LoopClosing ChainBackend<Real>::RecoverMany(const Real* z, std::size_t z_stride, std::size_t states,
                                            PoseArrays<Real>* out) const {
  for (int b = 0; b < bodies(); ++b) out[b].Resize(states);
  const int tiles = static_cast<int>((states + kTile<Real> - 1) / kTile<Real>);
  constexpr std::size_t kWork = 16384;  // poses: some 50 us
  const int grain = std::max(1, static_cast<int>(kWork / (kTile<Real> * slots())));
  std::vector<LoopClosing> tile_results(static_cast<std::size_t>(tiles));
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
      LoopClosing& closing = tile_results[static_cast<std::size_t>(tile)];
      open.clear();
      if (loops_.exist()) loops_.Bend(y.data(), width, Padded<Real>(count), scratch);
      for (std::size_t i = 0; one_by_one_.exists() && i < count; i += kBlock<Real>) {
        const std::size_t some = std::min<std::size_t>(kBlock<Real>, count - i);
        const Closing closed = loops_.Close(tables_, y.data() + i, width, some, scratch);
        closing.corrections = std::max(closing.corrections, closed.corrections);
        for (std::size_t k = 0; k < some; ++k)
          if (closed.open >> k & 1) open.push_back(begin + i + k);
      }
      ForwardKinematicsBatch(tables_.Map(), y.data(), width, Padded<Real>(count), places.data());
      for (const std::size_t i : open) {
        const std::vector<RigidTransform> X_RB = Alone(z + i, z_stride, closing);
        for (std::size_t b = 0; b < X_RB.size(); ++b) PutPose(X_RB[b], i, out[b]);
      }
    }
  });
  LoopClosing all;
  for (const LoopClosing& closing : tile_results) {
    all.one_by_one += closing.one_by_one;
    all.open += closing.open;
    all.corrections = std::max(all.corrections, closing.corrections);
  }
  return all;
}

}  // namespace

template <class Real>
std::unique_ptr<PoseBackend<Real>> MakeChainBackend(const ReducedModel& model, Recovery recovery) {
  const LoopUnits units(model);
  CoordinateForms forms(model, units.unit);
  const LinkTables<double> links = MakeLinks(*model.mechanism, forms);
  return std::make_unique<ChainBackend<Real>>(model, units, links, std::move(forms),
                                              recovery != Recovery::kCurved);
}

template std::unique_ptr<PoseBackend<float>> MakeChainBackend<float>(const ReducedModel&, Recovery);
template std::unique_ptr<PoseBackend<double>> MakeChainBackend<double>(const ReducedModel&, Recovery);

}  // namespace fork1s::internal
