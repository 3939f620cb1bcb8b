#include <fork1s/base/unit_factor.hpp>

namespace fork1s {

Eigen::LLT<Eigen::MatrixXd> UnitFactor() {
  return Eigen::LLT<Eigen::MatrixXd>(Eigen::MatrixXd::Identity(1, 1));
}

}  // namespace fork1s
