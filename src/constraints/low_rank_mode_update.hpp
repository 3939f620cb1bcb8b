// The few points and rows that a factor of all has on another mode than they are on, solved by themselves.
//
// With H = 1 + Σ GᵀDG factored for modes D, points C of which are not on theirs, what these bear beside
// their modes, r = λ + D w, moves all by d += X r, X = H⁻¹G_Cᵀ, and themselves by Q = G_C X:
//     w_C = w + Q r,   λ_C = λ + r − D Q r
// The law at C alone is a small dense problem in r, whatever stands around it: where a finger begins to slide
// and three others hold, its direction is found without another factor of the whole.
#pragma once

#include <vector>

#include "derivative_lu.hpp"
#include "regularized_contact_problem.hpp"

namespace fork1s::internal {

class LowRankModeUpdate {
 public:
  void Reserve(int freedoms);
  void Begin() { members_.clear(); }
  /// Takes in what is off the law by what was measured last, all together more than `enough`. False where
  /// there is nothing new, or more than pays.
  bool Gather(const RegularizedContactProblem& rows, double enough);
  /// The law at what was taken in, to `enough`; modes of `rows` are those that `lu` is of. On success d and
  /// the impulses have moved there, and the others' on their modes. Else nothing has.
  bool Solve(RegularizedContactProblem& rows, DerivativeLu& lu, std::vector<double>& d, double enough);

 private:
  // Of a point its three rows and one an axis about which it bears a moment; or one row of a limit.
  struct Member {
    int index = 0, pair = -1;            // of a point; of a limit where pair is -1
    int begin = 0, size = 0;             // rows
    int axes[3] = {0, 0, 0};             // of rows from the fourth on
    Matrix6 factored = Matrix6::Zero();  // D
    Matrix6 more = Matrix6::Zero();      // D of the mode at hand less that
    bool is_open = false;
    // Its rows on the twists of its two ports, four of them side by side, twice: six by four, row by row.
    int port_a = -1, port_b = -1;  // in ports_
    double J_a[2][24] = {}, J_b[2][24] = {};
    int groups() const { return size > 4 ? 2 : 1; }
  };
  int PlaceOf(int port);
  bool Has(int index, bool is_limit) const;
  bool Add(const RegularizedContactProblem& rows, int index, int pair);
  double UpdatePoint(const PointRows& point, Member& m);
  double UpdateLimit(const LimitRows& limit, Member& m);
  double RespondPoint(const PointRows& point, Member& m);
  void AddColumns(const RegularizedContactProblem& rows, DerivativeLu& lu);
  double UpdateModes(const RegularizedContactProblem& rows);
  double Respond(const RegularizedContactProblem& rows);
  const double* ColumnOf(int row) const { return Q_.data() + static_cast<std::size_t>(row) * stride_; }
  void Read(const RegularizedContactProblem& rows);
  bool FindStep();
  void Move(double length);
  bool SolveInModes(const RegularizedContactProblem& rows, double enough);
  bool SolveByLineSearch(const RegularizedContactProblem& rows, double enough);

  std::vector<Member> members_;
  int count_ = 0;                 // rows of members
  std::size_t with_columns_ = 0;  // members whose columns X_ has
  std::vector<int> ports_;        // of members
  std::size_t stride_ = 0;        // count, up to a multiple of four
  // Of a group four columns, freedoms x 4 row by row; stride x count, 0 past count. Like w_step_, M_ and right_ by four
  // numbers longer, since rows go by fours.
  std::vector<double> X_, Q_;
  std::vector<double> changes_;     // of ports_, by four columns: six by four
  std::vector<double> w_, lambda_;  // now
  std::vector<double> r_, w_start_, lambda_start_;
  std::vector<double> off_, step_, w_step_;
  std::vector<double> M_, right_, s_;
  std::vector<const Member*> changed_;  // on another mode than that of the factor
  std::vector<int> pivots_, active_;    // rows of these
};

}  // namespace fork1s::internal
