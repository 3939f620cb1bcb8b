// Springs along lengths in the matrix of a stage: K_r has them as they are at the reference. Force, energy and
// stiffness in joint coordinates: mechanism/springs.cpp.
#include "forces.hpp"

namespace fork1s {

void AddRankOneStiffness(const StepContext& ctx, const Mechanism::Length& length, double weight, bool bends) {
  const auto& [model, state, ws] = ctx;
  auto A_z = ws.matrix.A.bottomRightCorner(model.size(), model.size());
  if (bends || length.path >= 0)
    ReducedRow(length, ws.paths(), ws.Q_now(), ws.scratch.length_row);
  else
    ReducedRow(length, model.at_reference.paths, model.reduced->Q_rows, ws.scratch.length_row);
  A_z.noalias() += weight * ws.scratch.length_row * ws.scratch.length_row.transpose();
}

namespace {

// f(index, spring, stiffness at the pose) of springs of paths and of those that are not linear.
template <class F>
void ForEachNonlinearSpring(const StepContext& ctx, const F& f) {
  const auto& [model, state, ws] = ctx;
  const auto& springs = model.mechanism().springs();
  auto slack = ws.active_set.slack.begin();
  for (std::size_t k = 0; k < springs.size(); ++k) {
    const Mechanism::Spring& s = springs[k];
    if (s.length.path < 0 && s.is_linear()) continue;
    f(k, s, s.slack > 0 ? SlackStiffness(model, *slack++) : s.StiffnessAt(Length(ctx, s.length)));
  }
}

}  // namespace

// Springs of paths, and those that are not linear, stand in K_r as they are at the reference. A thread's arms
// may double before the next refresh, and a stiff spring that A knows by half would swing up: in A they turn
// with the pose.
void AddNonlinearStiffness(const StepContext& ctx, double weight) {
  const auto& [model, state, ws] = ctx;
  if (!model.at_reference.has_bent_springs) return;
  auto A_z = ws.matrix.A.bottomRightCorner(model.size(), model.size());
  ForEachNonlinearSpring(ctx, [&](std::size_t k, const Mechanism::Spring& s, double stiffness) {
    ReducedRow(s.length, model.at_reference.paths, model.reduced->Q_rows, ws.scratch.length_row);
    A_z.noalias() -= weight * model.at_reference.spring_stiffness[k] * ws.scratch.length_row *
                     ws.scratch.length_row.transpose();
    AddRankOneStiffness(ctx, s.length, weight * stiffness, true);
  });
}

}  // namespace fork1s
