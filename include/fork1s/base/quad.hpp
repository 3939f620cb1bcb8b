// Four doubles at a time, wherever they stand.
//
// Eigen's own loops begin their packets where the address is aligned, and sums in another order differ in the
// last bit. What must give the same bits in any place goes by fours from its first number on.
#pragma once

#include <fork1s/base/types.hpp>
#include <type_traits>

namespace fork1s {

using Quad = Eigen::Matrix<double, 4, 1>;

inline Eigen::Map<Quad> QuadAt(double* p) { return Eigen::Map<Quad>(p); }
inline Eigen::Map<const Quad> QuadAt(const double* p) { return Eigen::Map<const Quad>(p); }

/// f(at): by fours from the first of n numbers on, then two, then one, `at(p)` the next of them in the
/// array p. A plain loop over the last three costs more than all before: compilers ask what overlaps what.
template <typename F>
void ByFours(int n, F&& f) {
  int i = 0;
  for (; i + 4 <= n; i += 4) f([i](auto* p) { return QuadAt(p + i); });
  if (n & 2) {
    using Two = Eigen::Matrix<double, 2, 1>;
    f([i](auto* p) {
      using Map = std::conditional_t<std::is_const_v<std::remove_reference_t<decltype(*p)>>,
                                     Eigen::Map<const Two>, Eigen::Map<Two>>;
      return Map(p + i);
    });
    i += 2;
  }
  if (n & 1) {
    using One = Eigen::Matrix<double, 1, 1>;
    f([i](auto* p) {
      using Map = std::conditional_t<std::is_const_v<std::remove_reference_t<decltype(*p)>>,
                                     Eigen::Map<const One>, Eigen::Map<One>>;
      return Map(p + i);
    });
  }
}

}  // namespace fork1s
