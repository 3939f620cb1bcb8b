// Which blocks touch one other at most.
#include <utility>

#include "compliant_rows.hpp"

namespace fork1s::internal {

// A small block that touches nothing else, or one other that is no leaf itself: of two that touch only each
// other the smaller is the leaf.
void CompliantRows::FindLeaves() {
  constexpr int kNone = -1, kSeveral = -2;
  touched_.assign(blocks_.size(), kNone);
  const auto block_of = [&](int port) {
    return block_of_[static_cast<std::size_t>(ports[static_cast<std::size_t>(port)].row)];
  };
  for (const PairRows& pair : pairs) {
    if (pair.port_a < 0 || pair.port_b < 0) continue;
    const int a = block_of(pair.port_a), b = block_of(pair.port_b);
    if (a == b) continue;
    for (const auto& [own, other] : {std::pair(a, b), std::pair(b, a)}) {
      int& touched = touched_[static_cast<std::size_t>(own)];
      touched = touched == kNone || touched == other ? other : kSeveral;
    }
  }
  // Larger ones are factored at less cost among the rest (leaf_lu.cpp finds their inverse).
  constexpr int kSmall = 8;
  const auto may_be_leaf = [&](int block) {
    return touched_[static_cast<std::size_t>(block)] != kSeveral &&
           blocks_[static_cast<std::size_t>(block)].count <= kSmall;
  };
  leaves_.clear();
  core_.clear();
  for (int b = 0; b < static_cast<int>(blocks_.size()); ++b) {
    const Freedoms& own = blocks_[static_cast<std::size_t>(b)];
    const int other = touched_[static_cast<std::size_t>(b)];
    bool is_leaf = may_be_leaf(b);
    if (is_leaf && other >= 0 && touched_[static_cast<std::size_t>(other)] == b && may_be_leaf(other)) {
      const int size = blocks_[static_cast<std::size_t>(other)].count;
      is_leaf = own.count < size || (own.count == size && b < other);
    }
    if (own.count == 0) continue;
    if (!is_leaf) {
      for (int i = 0; i < own.count; ++i) core_.push_back(own.begin + i);
    } else if (other >= 0) {
      const Freedoms& hub = blocks_[static_cast<std::size_t>(other)];
      leaves_.push_back({own.begin, own.count, hub.begin, hub.count});
    } else {
      leaves_.push_back({own.begin, own.count, own.begin, 0});
    }
  }
  // Three quarters take 0.42 of the work of all; with more in the core, taking it apart costs what it saves.
  if (4 * core_.size() > 3 * static_cast<std::size_t>(freedoms_)) leaves_.clear();
}

}  // namespace fork1s::internal
