// The last resort of the contact solver: from the answer without friction along the path of answers.
#pragma once

#include <vector>

#include "compliant_rows.hpp"
#include "piece_newton.hpp"

namespace fork1s::internal {

class FrictionPath {
 public:
  void Reserve(int num_contacts, int num_limits, int freedoms);
  /// From `d`, the answer at a share of friction of 0, with its impulses in `rows`, to that at 1. Leaves the
  /// answer in `d` and `rows` if true, friction whole in any case.
  bool Follow(CompliantRows& rows, std::vector<double>& d, double tolerance, int& iterations);

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

  bool Linearize(CompliantRows& rows, const Place& at);
  void DirectionHere(Direction& out) const;
  bool Correct(CompliantRows& rows, const Direction& along, double length, Place& place, int& iterations,
               Direction& ahead);
  bool Advance(CompliantRows& rows, double& length, double tolerance, int& iterations, bool& there);
  bool Arrive(CompliantRows& rows, Place& place, double tolerance, int& iterations);

  double scale2_ = 1;  // of d against the share
  std::vector<double> H_, a_, b_;
  std::vector<int> pivots_;
  PieceNewton pieces_;
  Place here_, predicted_, trial_, last_;
  Direction along_, ahead_, next_;
  std::vector<PointRows> points_, ahead_points_, last_points_;  // with the pieces that they are on
  std::vector<LimitRows> limits_, ahead_limits_, last_limits_;
};

}  // namespace fork1s::internal
