// The order in which freedoms are eliminated, and what it leads to.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "constraints/block_lu.hpp"

namespace fork1s {
namespace {
using internal::BlockLu;
using internal::EliminationOrder;
using internal::Span;

// Freedoms that meet each other through one contact.
using Clique = std::vector<Span>;

EliminationOrder OrderOf(int freedoms, const std::vector<Clique>& cliques) {
  EliminationOrder order;
  order.Begin(freedoms);
  for (const Clique& clique : cliques) order.Connect(clique.data(), static_cast<int>(clique.size()));
  order.Find();
  return order;
}

bool Within(const Clique& clique, int freedom) {
  return std::any_of(clique.begin(), clique.end(),
                     [&](const Span& s) { return s.begin <= freedom && freedom < s.end; });
}

// Diagonally heavy where freedoms meet, not symmetric, as contacts that slide make it; 1 where nothing is
// met.
MatrixX MatrixOf(int freedoms, const std::vector<Clique>& cliques, std::mt19937& rng) {
  std::uniform_real_distribution<double> draw(-1, 1);
  MatrixX H = MatrixX::Identity(freedoms, freedoms);
  for (const Clique& clique : cliques)
    for (int c = 0; c < freedoms; ++c)
      for (int r = 0; r < freedoms; ++r)
        if (Within(clique, c) && Within(clique, r)) H(r, c) += draw(rng) + (r == c ? freedoms : 0);
  return H;
}

// |H x − b| where x is found by blocks in a matrix whose other entries are rubbish.
double Off(const EliminationOrder& order, const MatrixX& H, std::mt19937& rng) {
  const auto n = static_cast<int>(H.rows());
  MatrixX work = MatrixX::Constant(n, n, 1e30);
  order.SetDiagonal(0, work.data());
  for (int c = 0; c < n; ++c)
    for (int r = 0; r < n; ++r)
      if (work(r, c) == 0) work(r, c) = H(r, c);
  BlockLu lu;
  EXPECT_TRUE(lu.Factor(order, work.data(), n));
  std::uniform_real_distribution<double> draw(-1, 1);
  VectorX b(n);
  for (double& x : b) x = draw(rng);
  VectorX x = b;
  lu.Solve(order, x.data());
  return (H * x - b).norm() / b.norm();
}

TEST(Elimination, SolvesRandomGraphs) {
  std::mt19937 rng(5);
  for (int trial = 0; trial < 300; ++trial) {
    const int n = std::uniform_int_distribution<int>(1, 70)(rng);
    std::vector<Clique> cliques(std::uniform_int_distribution<std::size_t>(1, 20)(rng));
    for (Clique& clique : cliques)
      for (int s = std::uniform_int_distribution<int>(1, 4)(rng); s > 0; --s) {
        const int begin = std::uniform_int_distribution<int>(0, n - 1)(rng);
        clique.push_back({begin, std::min(n, begin + std::uniform_int_distribution<int>(0, 9)(rng))});
      }
    const EliminationOrder order = OrderOf(n, cliques);
    // Rounding of some hundred sums, on matrices that are no worse than their diagonals.
    EXPECT_LT(Off(order, MatrixOf(n, cliques, rng), rng), 1e-13) << "trial " << trial;
  }
}

// A row of bodies, each on the next: whatever their number, each leaves its part on no more than two.
TEST(Elimination, AChainCostsAsItsLength) {
  std::mt19937 rng(6);
  for (const int bodies : {3, 20, 100}) {
    std::vector<Clique> cliques;
    for (int i = 0; i + 1 < bodies; ++i) cliques.push_back({{6 * i, 6 * i + 12}});
    const EliminationOrder order = OrderOf(6 * bodies, cliques);
    EXPECT_LE(order.core_size(), 18);
    for (const EliminationOrder::Block& block : order.blocks()) EXPECT_LE(block.hub_size, 12);
    EXPECT_LT(Off(order, MatrixOf(6 * bodies, cliques, rng), rng), 1e-13);
  }
}

// Five fingers of a palm on one thing: fingers go first, each on palm and thing alone. The last one meets all
// that is left, and goes with it.
TEST(Elimination, FingersGoBeforeWhatTheyShare) {
  std::vector<Clique> cliques;
  const Span palm{20, 26}, thing{26, 32};
  for (int f = 0; f < 5; ++f) cliques.push_back({{4 * f, 4 * f + 4}, palm, thing});
  const EliminationOrder order = OrderOf(32, cliques);
  ASSERT_EQ(order.blocks().size(), 4u);
  for (const EliminationOrder::Block& block : order.blocks()) {
    EXPECT_LT(block.own.begin, 20);
    EXPECT_EQ(block.hub_size, 12);
    EXPECT_EQ(block.num_hubs, 1);  // they stand side by side
  }
  EXPECT_EQ(order.core_size(), 16);
}

TEST(Elimination, SaysWhereABlockIsSingular) {
  const std::vector<Clique> cliques = {{{0, 2}, {2, 8}}, {{2, 8}, {8, 12}}};
  const EliminationOrder order = OrderOf(12, cliques);
  ASSERT_FALSE(order.blocks().empty());
  const Span own = order.blocks().front().own;
  std::mt19937 rng(7);
  MatrixX H = MatrixOf(12, cliques, rng);
  H.block(own.begin, own.begin, own.size(), own.size()).setZero();
  BlockLu lu;
  EXPECT_FALSE(lu.Factor(order, H.data(), 12));
}

}  // namespace
}  // namespace fork1s
