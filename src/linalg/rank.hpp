// The one policy by which the program decides what is zero.
//
// docs/method.md, section 4. A matrix is decided on only after its rows and columns are brought to one unit:
// turns in radians, displacements in lengths of the mechanism (or of the loop that they close), springs by
// what stretches them and not by how stiff they are. Effects that count are then near 1 and rounding is near
// ν = 1e-15. Decisions stand on one another: a null space of a matrix with smallest kept singular value τ is
// off by ν/τ, and the next decision is made on it. With a thousand between what is kept and what is noise,
//     1000 ν/τ <= τ   =>   τ = sqrt(1000 ν) = 1e-6.
// Loops typed with seven digits that only nearly repeat each other fall below it as well, as they should.
#pragma once

#include <fork1s/base/types.hpp>

namespace fork1s {

/// Singular values of matrices in one unit count from here on.
inline constexpr double kRankThreshold = 1e-6;
/// Ratio between what is kept and what is dropped below which a decision is doubtful.
inline constexpr double kClearGap = 1000;

/// How many singular values count, and how clearly.
struct Rank {
  int value = 0;
  double kept = 0;     ///< smallest singular value that counts; 0 where none does
  double dropped = 0;  ///< largest that does not; 0 where all do

  /// A singular value lies within sqrt(1000) of the threshold, on either side.
  bool doubtful() const;
  /// Smallest kept over largest dropped, infinite where either is missing.
  double gap() const;
};

/// The decision for singular values in descending order of a matrix in one unit.
Rank DecideRank(const VectorX& singular_values);

}  // namespace fork1s
