// In which order the freedoms of a contact problem are eliminated.
//
// Freedoms meet where one contact moves both. A finger that touches one thing meets it and the palm that
// carries it; eliminated first, it leaves something behind on those alone. So with the next: always the block
// that meets the fewest (minimum degree), until what is left meets itself all over and is factored at once.
// A chain of bodies costs as its length so, and not as its cube.
#pragma once

#include <cstdint>
#include <vector>

namespace fork1s::internal {

/// Freedoms from begin to before end.
struct Span {
  int begin = 0, end = 0;
  int size() const { return end - begin; }
};

class EliminationOrder {
 public:
  /// Freedoms that are eliminated together, and what they leave their part on.
  struct Block {
    Span own;
    int first_hub = 0, num_hubs = 0;  // of hubs(): spans that neither overlap nor touch
    int hub_size = 0;
  };

  void Reserve(int freedoms, int cliques);
  void Begin(int freedoms);
  /// All of these meet each other. Empty spans are let be.
  void Connect(const Span* spans, int count);
  /// From what was met since Begin.
  void Find();

  const std::vector<Block>& blocks() const { return blocks_; }
  const std::vector<Span>& hubs() const { return hubs_; }
  /// Freedoms that are factored at once in the end. Those that meet nothing, not even themselves, are left
  /// out.
  const std::vector<Span>& core() const { return core_; }
  int core_size() const { return core_size_; }
  /// H, n x n by columns, becomes the diagonal where freedoms meet or will; what else it holds stays.
  void SetDiagonal(double diagonal, double* H) const;

 private:
  void FindAtoms();
  void FindNeighbours();
  void Weigh(int atom);
  void Eliminate(int atom);
  static void Append(const Span& span, std::vector<Span>& to, std::size_t first);
  std::uint64_t* Row(int atom) { return neighbours_.data() + static_cast<std::ptrdiff_t>(atom) * words_; }
  template <class Act>
  static void ForEachBit(const std::uint64_t* row, int words, const Act& act);

  template <class Act>
  void ForEachFreedom(const Act& act) const;

  int freedoms_ = 0, words_ = 0;
  std::vector<Span> cliques_;     // clique by clique
  std::vector<int> clique_ends_;  // of each clique in cliques_
  std::vector<Span> atoms_;       // freedoms that all cliques have or lack together
  std::vector<int> cover_, atom_at_;
  std::vector<char> cut_;
  std::vector<int> weight_;  // freedoms that an atom meets, itself left out; -1: it is eliminated
  std::vector<std::uint64_t> neighbours_, mask_;  // a bit an atom
  std::vector<Block> blocks_;
  std::vector<Span> hubs_;
  std::vector<Span> core_;
  int core_size_ = 0;
};

}  // namespace fork1s::internal
