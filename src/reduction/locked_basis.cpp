#include "locked_basis.hpp"
#include "linalg/null_space.hpp"
#include "linalg/products.hpp"
#include "linalg/select.hpp"
#include "linalg/solve.hpp"

namespace fork1s::internal {

LockedBasis LockCoordinates(const ElasticBasis& basis, int n, const std::vector<int>& locked) {
  const MatrixX V = basis.TimesV(MatrixX::Identity(n, n)), N_x = basis.ScaledFreeDirections(n);
  if (locked.empty()) return {V, ScaledRows(basis.scale, N_x)};
  const MatrixX N_p = Rows(N_x, locked);
  const NullSpace held = ComputeNullSpace(N_p);
  const MatrixX V_p = ScaledRows(Entries(basis.scale, locked).cwiseInverse(), Rows(V, locked));
  const MatrixX taken = Times(Times(N_x, held.seen), SolveSquare(Times(N_p, held.seen), V_p));
  return {V - ScaledRows(basis.scale, taken), ScaledRows(basis.scale, Times(N_x, held.unseen))};
}

MatrixX WithLocked(const MatrixX& motions, const VectorX& scale, const std::vector<int>& locked) {
  if (locked.empty()) return motions;
  const VectorX to_one_unit = Entries(scale, locked).cwiseInverse();
  return Times(motions, ComputeNullSpace(ScaledRows(to_one_unit, Rows(motions, locked))).unseen);
}

}  // namespace fork1s::internal
