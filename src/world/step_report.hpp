// What the parts of a step report together.
#pragma once

#include <fork1s/world/world.hpp>

namespace fork1s {

/// whole <- with the next part of the step.
void AddReport(const StepReport& part, StepReport& whole);
/// solver <- the worst of two solves of one step.
void MergeSolverReport(const ContactSolverReport& then, ContactSolverReport& solver);

}  // namespace fork1s
