#include "linalg/rank.hpp"

#include <cmath>
#include <limits>

namespace fork1s {

bool Rank::doubtful() const {
  const double half = std::sqrt(kClearGap);
  return (value > 0 && kept < kRankThreshold * half) || dropped * half > kRankThreshold;
}

double Rank::gap() const {
  return value > 0 && dropped > 0 ? kept / dropped : std::numeric_limits<double>::infinity();
}

Rank DecideRank(const VectorX& singular_values) {
  Rank rank;
  while (rank.value < singular_values.size() && singular_values(rank.value) > kRankThreshold) ++rank.value;
  if (rank.value > 0) rank.kept = singular_values(rank.value - 1);
  if (rank.value < singular_values.size()) rank.dropped = singular_values(rank.value);
  return rank;
}

}  // namespace fork1s
