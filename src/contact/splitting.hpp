// Alternating directions (ADMM) on the assembled contact problem, for where Newton stalls.
#pragma once

#include <vector>

#include "contact_rows.hpp"

namespace fork1s::internal {

class SplittingSolver {
 public:
  /// Reserves scratch for `num_rows` = 3 contacts + limits.
  void Reserve(int num_rows);
  /// From the impulses in `rows`, solves u = A λ + b under the law. A is n x n column-major, n as for
  /// Newton's rows. Leaves impulses inside their cones, better or not, and the velocity that belongs to them.
  /// Returns the number of iterations.
  int Solve(RowSet& rows, const std::vector<double>& A, const std::vector<double>& b, double enough,
            int max_iterations);
  /// For where that failed grossly: the nearest problem that always has an answer. Penetration is not undone,
  /// contact gives a little, and sliding may lift (the associated law), which makes it convex; its impulses
  /// take energy, never bring any.
  int SolveSafely(RowSet& rows, const std::vector<double>& A, const std::vector<double>& b, double enough,
                  int max_iterations);

 private:
  int Iterate(RowSet& rows, bool associated, double enough, int max_iterations);
  void Scale(const RowSet& rows, const std::vector<double>& A, const std::vector<double>& b);
  void Project(const RowSet& rows, const double* x, double* y) const;
  void AddCorrection(const RowSet& rows, const double* z, double* out) const;

  int n_ = 0;
  std::vector<double> d_, G_, factor_, g_, x_, y_, z_, y_before_, rhs_;
};

}  // namespace fork1s::internal
