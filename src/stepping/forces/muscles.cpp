// Muscles in a stage. Their passive part is a spring and what they give at rest stands with the controls
// (mechanism/springs.cpp); here is what the rate of their length changes, and their slopes for the matrix.
#include <algorithm>

#include "forces.hpp"

namespace fork1s {

void AddMuscleDampers(const StepContext& ctx, double b, const VectorX& q_dot, VectorX& tau) {
  const auto& [model, state, ws] = ctx;
  const auto& muscles = model.mechanism().muscles();
  for (std::size_t k = 0; k < muscles.size(); ++k) {
    const Mechanism::Muscle& muscle = muscles[k];
    double rate = 0;
    ForEachArm(muscle.length, ws.paths(), [&](int i, double c) { rate += c * q_dot(i); });
    const double at = ws.configuration.kinematics.muscles[k];
    AddLengthForce(ctx, muscle.length,
                   b * ActivationOf(state, muscle.control) * (muscle.Force(at, rate) - muscle.Force(at, 0)),
                   tau);
  }
}

// Shortened below its optimum a muscle pulls less: a stiffness. Beyond, it pulls less the longer it is; there the matrix
// has as much of that as the passive part makes up for, and Newton's iteration finds the rest.
void AddMuscleOperator(const StepContext& ctx, double b) {
  const auto& [model, state, ws] = ctx;
  const auto& muscles = model.mechanism().muscles();
  if (muscles.empty()) return;
  for (std::size_t k = 0; k < muscles.size(); ++k) {
    const Mechanism::Muscle& muscle = muscles[k];
    const double a = ActivationOf(state, muscle.control), at = ws.configuration.kinematics.muscles[k],
                 rate = LengthRateBy(ctx, muscle.length, ws.stage.v_k);
    const double stiffness = std::max(-a * muscle.ForceByLength(at, rate),
                                      -model.mechanism().PassivePart(k).StiffnessAt(at)),
                 damping = std::max(0.0, -a * muscle.ForceByRate(at, rate));
    AddRankOneStiffness(ctx, muscle.length, b * (damping + b * stiffness), true);
  }
}

}  // namespace fork1s
