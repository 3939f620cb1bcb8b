// New references of mechanisms at the end of a step.
#pragma once

#include "detection.hpp"
#include "rows.hpp"

namespace fork1s {

/// Of one mechanism.
struct RefreshState {
  int result = 0;               // at the end of the last step: 1 done, -1 failed, 0 not due
  LinearizationDrift drift;     // for which it was due
  bool by_expansion = false;    // the step
  bool expanded = false;        // again, at its end
  Matrix6X contact_impulses_R;  // scratch: of the last stage, 6 x bodies, about R's origin
};

/// Moves the reference of mechanism i to the pose at hand where it has left the old one, or where loads of
/// the step, of length h, lack a column.
void RefreshIfStale(std::size_t i, double h, const Detection& detection, const ConstraintRows& rows,
                    MechanismDynamics& m, RefreshState& refresh);
/// Without new references: the expansion that the next step goes by.
void ExpandIfFar(double h, MechanismDynamics& m, RefreshState& refresh);
void CountRefreshes(const std::vector<RefreshState>& refreshes, StepReport& report);

}  // namespace fork1s
