// Four doubles at a time, wherever they stand.
//
// Eigen's own loops begin their packets where the address is aligned, and sums in another order differ in the
// last bit. What must give the same bits in any place goes by fours from its first number on.
#pragma once

#include <fork1s/base/types.hpp>

namespace fork1s {

using Quad = Eigen::Matrix<double, 4, 1>;

inline Eigen::Map<Quad> QuadAt(double* p) { return Eigen::Map<Quad>(p); }
inline Eigen::Map<const Quad> QuadAt(const double* p) { return Eigen::Map<const Quad>(p); }

}  // namespace fork1s
