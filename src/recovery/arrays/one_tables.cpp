#include "one_tables.hpp"

#include <algorithm>

#include "pose_backend.hpp"

namespace fork1s::internal {
namespace {

// X <- Exp(x) X, for what turns by more than half a turn.
void TurnFar(const double* x, double* X) {
  RigidTransform C;
  for (int e = 0; e < 9; ++e) C.rotation()(e / 3, e % 3) = X[e];
  for (int e = 0; e < 3; ++e) C.translation()(e) = X[9 + e];
  const RigidTransform L = Exp(Vector6(Eigen::Map<const Vector6>(x))) * C;
  for (int e = 0; e < 12; ++e) X[e] = Entry(L, e);
}

}  // namespace

template <class Real>
void GatherWeights(const LinkTables<Real>& tables, const std::vector<int>& links, std::size_t rows,
                   int y_size, std::vector<int>& inputs, AlignedVector<Real>& weights) {
  constexpr std::size_t block = kBlock<Real>;
  std::vector<int> place(static_cast<std::size_t>(y_size), -1);
  std::vector<int> entries;
  for (const int l : links) {
    if (l < 0) continue;
    const Link& link = tables.links[static_cast<std::size_t>(l)];
    entries.insert(entries.end(), tables.inputs.begin() + link.first, tables.inputs.begin() + link.last);
  }
  std::sort(entries.begin(), entries.end());
  entries.erase(std::unique(entries.begin(), entries.end()), entries.end());
  const std::size_t begin = weights.size();
  weights.resize(begin + entries.size() * rows * block, Real(0));
  for (std::size_t k = 0; k < entries.size(); ++k) {
    place[static_cast<std::size_t>(entries[k])] = static_cast<int>(k);
    inputs.push_back(entries[k]);
  }
  for (std::size_t lane = 0; lane < links.size(); ++lane) {
    if (links[lane] < 0) continue;
    const Link& link = tables.links[static_cast<std::size_t>(links[lane])];
    const Real* weight = tables.weights.data() + link.weights;
    for (int k = link.first; k < link.last; ++k) {
      const auto at = static_cast<std::size_t>(
          place[static_cast<std::size_t>(tables.inputs[static_cast<std::size_t>(k)])]);
      for (std::size_t row = 0; row < rows; ++row)
        weights[begin + (at * rows + row) * block + lane] = *weight++;
    }
  }
}

template <class Real>
void PutConstants(const LinkTables<Real>& tables, int l, Real* to) {
  const Real* C = tables.constants.data() + tables.links[static_cast<std::size_t>(l)].constants;
  const std::array<Real, 9>& screw = tables.screws[static_cast<std::size_t>(l)];
  for (std::size_t e = 0; e < 12; ++e) to[e * kBlock<Real>] = C[e];
  for (std::size_t k = 0; k < 9; ++k) to[(12 + k) * kBlock<Real>] = screw[k];
}

template <class Real>
OneTables<Real>::OneTables(const LinkTables<Real>& tables, int first, int last, int y_size)
    : slots_(tables.slots) {
  constexpr int block = kBlock<Real>;
  std::vector<int> twists, turning;
  for (int begin = first; begin < last; begin += block) {
    turning.clear();  // by lane; -1: a twist, which depends on nothing here
    const std::size_t c = constants_.size();
    constants_.resize(c + kLinkRows * block, Real(0));
    for (int l = begin; l < std::min(last, begin + block); ++l) {
      const Link& link = tables.links[static_cast<std::size_t>(l)];
      slot_.push_back(link.slot);
      parent_.push_back(link.parent < 0 ? slots_ : link.parent);
      const bool is_twist = link.kind == LinkKind::kTwist;
      twist_.push_back(is_twist ? static_cast<int>(twists.size()) : -1);
      turning.push_back(is_twist ? -1 : l);
      if (is_twist)
        twists.push_back(l);
      else
        PutConstants(tables, l, constants_.data() + c + (l - begin));
    }
    GatherWeights(tables, turning, 1, y_size, inputs_, weights_);
    first_.push_back(static_cast<int>(inputs_.size()));
  }
  twists_ = static_cast<int>(twists.size());
  for (int begin = 0; begin < twists_; begin += block) {
    const std::vector<int> some(twists.begin() + begin, twists.begin() + std::min(twists_, begin + block));
    GatherWeights(tables, some, 6, y_size, twist_heard_, T_);
    twist_first_.push_back(static_cast<int>(twist_heard_.size()));
    const std::size_t c = C_.size();
    C_.resize(c + 12 * block, Real(0));
    for (std::size_t lane = 0; lane < some.size(); ++lane)
      for (std::size_t e = 0; e < 12; ++e)
        C_[c + e * kBlock<Real> + lane] =
            tables.constants[tables.links[static_cast<std::size_t>(some[lane])].constants + e];
  }
}

template <class Real>
void OneTables<Real>::PlaceTwists(const Real* y, Real* out, std::size_t stride) const {
  constexpr int block = kBlock<Real>;
  const int blocks = static_cast<int>(twist_first_.size()) - 1;
  std::vector<Missed> missed(static_cast<std::size_t>(blocks));
  RecoverBlocks({twist_first_.data(), twist_heard_.data(), T_.data(), C_.data()}, y, 0, blocks, out, stride,
                missed.data());
  for (int t = 0; t < twists_; ++t) {
    const int i = t / block, lane = t % block;
    if ((missed[static_cast<std::size_t>(i)] >> lane & 1) == 0) continue;
    double x[6] = {}, L[12];
    for (int k = twist_first_[static_cast<std::size_t>(i)]; k < twist_first_[static_cast<std::size_t>(i) + 1];
         ++k)
      for (int row = 0; row < 6; ++row)
        x[row] += static_cast<double>(T_[static_cast<std::size_t>((6 * k + row) * block + lane)]) *
                  static_cast<double>(y[twist_heard_[static_cast<std::size_t>(k)]]);
    for (int e = 0; e < 12; ++e)
      L[e] = static_cast<double>(C_[static_cast<std::size_t>((12 * i + e) * block + lane)]);
    TurnFar(x, L);
    for (int e = 0; e < 12; ++e)
      out[static_cast<std::size_t>(e) * stride + static_cast<std::size_t>(t)] = static_cast<Real>(L[e]);
  }
}

template <class Real>
void OneTables<Real>::Walk(const Real* y, Real* X) const {
  const std::size_t twist_stride = Padded<Real>(static_cast<std::size_t>(twists_));
  thread_local AlignedVector<Real> scratch;  // nothing in here waits and begins something else meanwhile
  if (scratch.size() < 12 * twist_stride) scratch.resize(12 * twist_stride);
  Real* twists = scratch.data();
  if (twists_ > 0) PlaceTwists(y, twists, twist_stride);
  OneMap<Real> map;
  map.count = static_cast<int>(slot_.size());
  map.slots = slots_;
  map.slot = slot_.data();
  map.parent = parent_.data();
  map.first = first_.data();
  map.inputs = inputs_.data();
  map.weights = weights_.data();
  map.constants = constants_.data();
  map.twist = twists_ > 0 ? twist_.data() : nullptr;
  map.twists = twists;
  map.twist_stride = twist_stride;
  ForwardKinematicsSingle(map, y, X);
}

template <class Real>
std::size_t OneTables<Real>::BytesRead() const {
  return (weights_.size() + constants_.size() + T_.size() + C_.size()) * sizeof(Real) +
         (slot_.size() + parent_.size() + inputs_.size() + twist_heard_.size()) * sizeof(int);
}

template void GatherWeights(const LinkTables<float>&, const std::vector<int>&, std::size_t, int,
                            std::vector<int>&, AlignedVector<float>&);
template void GatherWeights(const LinkTables<double>&, const std::vector<int>&, std::size_t, int,
                            std::vector<int>&, AlignedVector<double>&);
template void PutConstants(const LinkTables<float>&, int, float*);
template void PutConstants(const LinkTables<double>&, int, double*);
template class OneTables<float>;
template class OneTables<double>;

}  // namespace fork1s::internal
