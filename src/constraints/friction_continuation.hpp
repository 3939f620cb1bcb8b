// The last resort of the contact solver: from the answer without friction along the path of answers.
#pragma once

#include <vector>

#include "regularized_contact_problem.hpp"
#include "semismooth_newton.hpp"

namespace fork1s::internal {

class FrictionContinuation {
 public:
  void Reserve(int num_contacts, int num_limits, int freedoms);
  /// From `d`, the answer at a share of friction of 0, with its impulses in `rows`, to that at 1. Leaves the
  /// answer in `d` and `rows` if true, friction whole in any case. Gives up where `iterations` has become the most.
  bool Follow(RegularizedContactProblem& rows, std::vector<double>& d, double tolerance, int most_iterations,
              int& iterations);

 private:
  // Tangent of the path, normalised: of d and of the share.
  struct Direction {
    std::vector<double> d;
    double share = 0;
  };
  struct Place {
    std::vector<double> d;
    double share = 0;
  };

  bool Linearize(RegularizedContactProblem& rows, const Place& at);
  void DirectionHere(Direction& out) const;
  bool Correct(RegularizedContactProblem& rows, const Direction& along, double length, Place& place,
               int& iterations, Direction& ahead);
  bool Advance(RegularizedContactProblem& rows, double& length, double tolerance, int& iterations,
               bool& there);
  bool Arrive(RegularizedContactProblem& rows, Place& place, double tolerance, int& iterations);

  double scale2_ = 1;  // of d against the share
  std::vector<double> H_, a_, b_;
  std::vector<int> pivots_;
  SemismoothNewton newton_;
  Place here_, predicted_, trial_, last_;
  Direction along_, ahead_, next_;
  std::vector<PointRows> points_, ahead_points_, last_points_;  // with the modes that they are on
  std::vector<LimitRows> limits_, ahead_limits_, last_limits_;
};

}  // namespace fork1s::internal
