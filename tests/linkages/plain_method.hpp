// The compliance of a linkage and every rank behind it, straight from the definition.
//
// In extended precision, with kinematics and decompositions of its own: poses as products of exponentials in
// body frames, constraint rows by differences of the closures' residuals, null spaces by Jacobi rotations,
// and every rank from geometry alone, so that no stiffness has a say in it.
#pragma once

#include <fork1s/mechanism/mechanism.hpp>
#include <vector>

namespace fork1s::linkages {

struct PlainAnswer {
  int loop_rank = 0;       // independent rigid rows
  int free = 0;            // motions that no spring resists
  int elastic = 0;         // motions that springs resist, loops closed
  int interface_free = 0;  // of the free ones, those that the interface bodies show
  int interface_rank = 0;  // elastic motions that they show beside the free ones
  int hidden() const { return free - interface_free; }

  MatrixX C;                   // 6e x 6e in world axes, free directions projected off both sides
  MatrixX free_d;              // 6e x interface_free, orthonormal with turns times `length`
  MatrixX hidden_q;            // n x hidden, in coordinates (slides times 1 / length: all in radians)
  double open_compliance = 0;  // largest compliance of a spring, rad/N·m or its like in lengths: what cancels

  /// Over all rank decisions: the smallest singular value kept and the largest dropped, relative to the
  /// largest.
  double smallest_kept = 1, largest_dropped = 0;
  /// What double precision can be expected to leave of C, relative: see plain_road.cpp.
  double expected_error = 0;
  bool well_posed = false;
};

/// At q = 0. `length` makes turns and slides comparable.
PlainAnswer PlainMethod(const Mechanism& mechanism, const std::vector<BodyIndex>& bodies, double length);

/// P with P free = 0 and P² = P, orthogonal where turns are measured in `length` (6e x 6e): P C Pᵀ.
MatrixX ProjectOff(const MatrixX& free, double length);
/// |A - B| / |B| with turns measured in `length`.
double RelativeDifference(const MatrixX& A, const MatrixX& B, double length, double floor);
/// Largest sine of the angles between the spans of A and B, columns measured in `length`; 2 for other ranks.
double SpanDistance(const MatrixX& A, const MatrixX& B, double length);

}  // namespace fork1s::linkages
