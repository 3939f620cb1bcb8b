// Tangents of points that stick, as rows g = M^½ G_t in freedoms. What of Σ G_tᵀλ_t (internal_forces.cpp) they bear
// when it is least, from the rows' side:
//     µ = M^-½ λ_t,   µ' = (1 − E)² µ,   E = ε (g gᵀ + ε)⁻¹,   λ_t' = M^½ µ'
// E is what no freedom sees, to the rounding in g gᵀ over ε: 1e-16/1e-12 of it. Taken away twice, 1e-8 are left.
// Rows stand by fours, those of two points; a last one alone has two that are 0.
#pragma once

#include <vector>

#include "regularized_contact_problem.hpp"

namespace fork1s::internal {

class TangentRows {
 public:
  void Reserve(int contacts, int freedoms);
  /// Of the points that fade, those fade no longer whose tangents alone move something in two independent
  /// directions: no others could bear what they do. So with the next, once they are out of the count. Returns
  /// how many are left of `fading`.
  int DropDetermined(RegularizedContactProblem& rows, int fading);
  /// `least` of the points that fade, from the rows' side; `count` of them, fewer than half as many as there
  /// are freedoms. After DropDetermined. False where nothing moves.
  bool FindLeast(RegularizedContactProblem& rows, int count);

 private:
  // Freedoms that something moves, each in one span, in order.
  struct Moved {
    Span spans[8];
    int count = 0;
    void Add(Span span);
    int Common(const Moved& other, Span* out) const;
  };
  struct Member {
    int point, pair;
  };
  // Adds rows of a pair's points, freedoms x 4, from that column on.
  static void Gather(const RegularizedContactProblem& rows, const Member* members, int count, int column,
                     double* to);
  void Clear(const Moved& moved, double* rows_of_four) const;
  void FindMoved(const RegularizedContactProblem& rows);
  bool IsDetermined(const RegularizedContactProblem& rows, const Member& member);
  double AddProducts(int groups);

  int freedoms_ = 0;
  std::vector<Moved> moved_, of_group_;  // by pairs, by fours of rows
  std::vector<int> fading_;              // points of a pair
  std::vector<int> cover_;               // pairs that move a freedom
  std::vector<double> rows_;
  std::vector<Member> members_;
  std::vector<double> K_, x_, y_;
};

}  // namespace fork1s::internal
