#include "elimination_order.hpp"

#include <bit>
#include <cstddef>
#include <fork1s/base/quad.hpp>

namespace fork1s::internal {
template <class Act>
void EliminationOrder::ForEachBit(const std::uint64_t* row, int words, const Act& act) {
  for (int w = 0; w < words; ++w)
    for (std::uint64_t bits = row[w]; bits != 0; bits &= bits - 1) act(64 * w + std::countr_zero(bits));
}

void EliminationOrder::Reserve(int freedoms, int cliques) {
  const auto n = static_cast<std::size_t>(freedoms), meetings = static_cast<std::size_t>(cliques);
  cliques_.reserve(4 * meetings);
  for (std::vector<Span>* v : {&atoms_, &hubs_, &core_}) v->reserve(4 * n);
  clique_ends_.reserve(meetings);
  for (std::vector<int>* v : {&cover_, &atom_at_, &weight_}) v->reserve(n + 1);
  cut_.reserve(n + 1);
  blocks_.reserve(n);
  mask_.reserve(n / 64 + 1);
  neighbours_.reserve(n * (n / 64 + 1));
}

void EliminationOrder::Begin(int freedoms) {
  freedoms_ = freedoms;
  cliques_.clear();
  clique_ends_.clear();
}

void EliminationOrder::Connect(const Span* spans, int count) {
  for (int i = 0; i < count; ++i)
    if (spans[i].size() > 0) cliques_.push_back(spans[i]);
  clique_ends_.push_back(static_cast<int>(cliques_.size()));
}

void EliminationOrder::FindAtoms() {
  const auto n = static_cast<std::size_t>(freedoms_);
  cut_.assign(n + 1, 0);
  cover_.assign(n + 1, 0);
  atom_at_.assign(n, -1);
  atoms_.clear();
  for (const Span& span : cliques_) {
    cut_[static_cast<std::size_t>(span.begin)] = cut_[static_cast<std::size_t>(span.end)] = 1;
    ++cover_[static_cast<std::size_t>(span.begin)];
    --cover_[static_cast<std::size_t>(span.end)];
  }
  int covered = 0;
  for (int i = 0; i < freedoms_; ++i) {
    const auto at = static_cast<std::size_t>(i);
    covered += cover_[at];
    if (covered == 0) continue;
    if (cut_[at]) atoms_.push_back({i, i});
    atoms_.back().end = i + 1;
    atom_at_[at] = static_cast<int>(atoms_.size()) - 1;
  }
}

void EliminationOrder::FindNeighbours() {
  words_ = static_cast<int>(atoms_.size() + 63) / 64;
  neighbours_.assign(atoms_.size() * static_cast<std::size_t>(words_), 0);
  int begin = 0;
  for (const int end : clique_ends_) {
    mask_.assign(static_cast<std::size_t>(words_), 0);
    for (; begin < end; ++begin) {
      const Span& span = cliques_[static_cast<std::size_t>(begin)];
      for (int i = span.begin; i < span.end;) {
        const int atom = atom_at_[static_cast<std::size_t>(i)];
        mask_[static_cast<std::size_t>(atom / 64)] |= std::uint64_t{1} << (atom % 64);
        i = atoms_[static_cast<std::size_t>(atom)].end;
      }
    }
    ForEachBit(mask_.data(), words_, [&](int atom) {
      for (int w = 0; w < words_; ++w) Row(atom)[w] |= mask_[static_cast<std::size_t>(w)];
    });
  }
}

void EliminationOrder::Weigh(int atom) {
  int weight = 0;
  ForEachBit(Row(atom), words_, [&](int other) {
    if (other != atom) weight += atoms_[static_cast<std::size_t>(other)].size();
  });
  weight_[static_cast<std::size_t>(atom)] = weight;
}

// Spans from `first` on neither overlap nor touch.
void EliminationOrder::Append(const Span& span, std::vector<Span>& to, std::size_t first) {
  if (to.size() > first && to.back().end == span.begin)
    to.back().end = span.end;
  else
    to.push_back(span);
}

// What it met meets each other from now on.
void EliminationOrder::Eliminate(int atom) {
  const Span own = atoms_[static_cast<std::size_t>(atom)];
  Block block{own, static_cast<int>(hubs_.size()), 0, weight_[static_cast<std::size_t>(atom)]};
  std::uint64_t* row = Row(atom);
  row[atom / 64] &= ~(std::uint64_t{1} << (atom % 64));
  ForEachBit(row, words_, [&](int other) {
    Append(atoms_[static_cast<std::size_t>(other)], hubs_, static_cast<std::size_t>(block.first_hub));
    std::uint64_t* others = Row(other);
    for (int w = 0; w < words_; ++w) others[w] |= row[w];
    others[atom / 64] &= ~(std::uint64_t{1} << (atom % 64));
  });
  block.num_hubs = static_cast<int>(hubs_.size()) - block.first_hub;
  ForEachBit(row, words_, [&](int other) { Weigh(other); });
  weight_[static_cast<std::size_t>(atom)] = -1;
  blocks_.push_back(block);
}

void EliminationOrder::Find() {
  FindAtoms();
  FindNeighbours();
  blocks_.clear();
  hubs_.clear();
  core_.clear();
  const int atoms = static_cast<int>(atoms_.size());
  weight_.resize(atoms_.size());
  int left = 0;
  for (int a = 0; a < atoms; ++a) {
    Weigh(a);
    left += atoms_[static_cast<std::size_t>(a)].size();
  }
  for (;;) {
    int fewest = -1;
    for (int a = 0; a < atoms; ++a)
      if (const int weight = weight_[static_cast<std::size_t>(a)];
          weight >= 0 && (fewest < 0 || weight < weight_[static_cast<std::size_t>(fewest)]))
        fewest = a;
    if (fewest < 0) break;
    const int size = atoms_[static_cast<std::size_t>(fewest)].size();
    if (weight_[static_cast<std::size_t>(fewest)] + size == left) break;
    Eliminate(fewest);
    left -= size;
  }
  for (int a = 0; a < atoms; ++a)
    if (weight_[static_cast<std::size_t>(a)] >= 0) Append(atoms_[static_cast<std::size_t>(a)], core_, 0);
  core_size_ = left;
}

// act(i): H[i] stands on the diagonal.
template <class Act>
void EliminationOrder::ForEachFreedom(const Act& act) const {
  const auto all = [&](const Span& span) {
    for (std::ptrdiff_t i = span.begin; i < span.end; ++i) act(i * (freedoms_ + 1));
  };
  for (const Block& block : blocks_) all(block.own);
  for (const Span& span : core_) all(span);
}

void EliminationOrder::SetDiagonal(double diagonal, double* H) const {
  const auto clear = [&](const Span& columns, const Span* rows, const Span* rows_end) {
    for (int c = columns.begin; c < columns.end; ++c) {
      double* column = H + static_cast<std::ptrdiff_t>(c) * freedoms_;
      for (const Span* span = rows; span != rows_end; ++span)
        ByFours(span->size(), [&](const auto& at) { at(column + span->begin).setZero(); });
    }
  };
  for (const Block& block : blocks_) {
    const Span *hubs = hubs_.data() + block.first_hub, *hubs_end = hubs + block.num_hubs;
    clear(block.own, &block.own, &block.own + 1);
    clear(block.own, hubs, hubs_end);
    for (const Span* hub = hubs; hub != hubs_end; ++hub) clear(*hub, &block.own, &block.own + 1);
  }
  for (const Span& span : core_) clear(span, core_.data(), core_.data() + core_.size());
  ForEachFreedom([&](std::ptrdiff_t at) { H[at] = diagonal; });
}

}  // namespace fork1s::internal
