// Motions of joints without spring that no interface body sees.
#pragma once

#include <fork1s/base/error.hpp>
#include <vector>

#include "elastic_basis.hpp"

namespace fork1s::internal {

struct Hidden {
  BodyIndex body;  // that would show them as an interface
  JointIndex joint;
  Vector6 screw = Vector6::Zero();  // of that joint in the motion, in R
  int count = 0;
};

/// The joint with the largest share in the spring-free motions that the interface cannot see. Motions are in
/// one unit and J in lengths of the mechanism, so that a motion which is seen is seen near 1.
Hidden FindHidden(const Mechanism& mechanism, const Matrix6X& S, const ElasticBasis& basis, const MatrixX& J,
                  std::vector<RankDoubt>& doubts);

/// A body shows six of them at most, and each that becomes an interface costs a null space of all: a chain of
/// a thousand links without a spring took minutes, and was not reduced by then.
constexpr int kMostHidden = 6 * 32;

Error HiddenError(const Mechanism& mechanism, const Hidden& hidden);
Error TooManyHidden(const Mechanism& mechanism, const Hidden& hidden);

}  // namespace fork1s::internal
