#include <fork1s/reduction/loop_curvature.hpp>

#include <algorithm>
#include <fork1s/base/quad.hpp>
#include <fork1s/reduction/reduced_model.hpp>

namespace fork1s {
namespace {

// ∂A/∂z_j Q, before (A_ref B)⁻¹, in the first columns of `out`.
void TurnOfRows(const ReducedModel& model, int j, const VectorX& A_ref, Kinematics& kinematics,
                RowMatrixX& out) {
  // The largest joint by a microradian: the difference is off by as much, and rounding by 1e-10. Of a turn of
  // 15 degrees that is 3e-8 rad, where its third order is 1e-3.
  constexpr double kStep = 1e-6;
  const VectorX direction = model.Q.col(j);
  const double reach = (direction.array().abs() / model.h_inverse.array().sqrt()).maxCoeff();
  const double step = kStep / reach;
  VectorX A;
  const VectorX q = model.q_ref + step * direction;
  ComputeKinematics(*model.mechanism, q, kinematics);
  model.loops.Fill(*model.mechanism, kinematics, q, A);
  A = (A - A_ref) / step;
  model.loops.Apply(A, model.Q_rows, out);
}

}  // namespace

LoopCurvature::LoopCurvature(const ReducedModel& model) {
  const int m = model.loop_rank(), r = model.size();
  if (m == 0 || r == 0) return;
  const std::vector<std::vector<int>> coordinates = model.loops.GroupCoordinates();
  const std::vector<int> sizes = model.loops.GroupSizes();
  std::vector<char> moves(static_cast<std::size_t>(r), 0);  // columns that move any loop
  int row = 0;
  for (std::size_t g = 0; g < sizes.size(); ++g) {
    const ReducedModel::Run run = model.runs[static_cast<std::size_t>(coordinates[g].front())];
    groups_.push_back({row, sizes[g], run.begin, run.size, {}});
    std::fill_n(moves.begin() + run.begin, run.size, 1);
    row += sizes[g];
  }

  Kinematics kinematics(*model.mechanism);
  ComputeKinematics(*model.mechanism, model.q_ref, kinematics);
  VectorX A;
  model.loops.Fill(*model.mechanism, kinematics, model.q_ref, A);
  LoopFactor factor(model.loops);
  factor.Compute(model.loops, A, model.B);

  std::vector<RowMatrixX> turns(static_cast<std::size_t>(r));
  for (int j = 0; j < r; ++j) {
    if (!moves[static_cast<std::size_t>(j)]) continue;
    RowMatrixX& turn = turns[static_cast<std::size_t>(j)];
    turn.resize(m, (r + 3) / 4 * 4);
    TurnOfRows(model, j, A, kinematics, turn);
    factor.SolveInPlace(turn);
  }
  for (Group& group : groups_) {
    const int fours = (group.columns + 3) / 4;
    group.N.assign(static_cast<std::size_t>(4 * group.rows * fours * group.columns), 0.0);
    for (int i = 0; i < group.rows; ++i)
      for (int k = 0; k < group.columns; ++k)
        for (int l = 0; l < group.columns; ++l)
          group.N[static_cast<std::size_t>(4 * ((i * fours + k / 4) * group.columns + l) + k % 4)] =
              0.5 * (turns[static_cast<std::size_t>(group.column + l)](group.row + i, group.column + k) +
                     turns[static_cast<std::size_t>(group.column + k)](group.row + i, group.column + l));
  }
}

void LoopCurvature::Apply(const VectorX& z, RowMatrixX& W) const {
  W.setZero();
  for (const Group& group : groups_) {
    const double* rates = z.data() + group.column;
    const double* N = group.N.data();
    for (int i = 0; i < group.rows; ++i)
      for (int k = 0; k < group.columns; k += 4) {
        Quad sum = Quad::Zero();
        for (int l = 0; l < group.columns; ++l, N += 4) sum += rates[l] * QuadAt(N);
        double* out = &W(group.row + i, group.column + k);
        if (k + 4 <= group.columns)
          QuadAt(out) = sum;
        else
          for (int c = 0; c < group.columns - k; ++c) out[c] = sum(c);
      }
  }
}

}  // namespace fork1s
