// What a Cholesky factor is before its first matrix.
#pragma once

#include <Eigen/Cholesky>

namespace fork1s {

/// The factor of the 1 x 1 unit matrix. Eigen copies the state of an empty factor as it is, uninitialised.
Eigen::LLT<Eigen::MatrixXd> UnitFactor();

}  // namespace fork1s
