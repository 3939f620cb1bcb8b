// The contact solver of the full-coordinate simulator.
//
// It shares the physical law with the solver of the reduced simulator (docs/method.md, section 6) and no
// code: a dense problem in contact space (contact_problem.hpp), Newton's method on the natural map, and block
// Gauss-Seidel where that does not converge.
#pragma once

#include <fork1s/reference/full_contact.hpp>
#include <vector>

#include "contact_constraints.hpp"

namespace fork1s::reference {

/// Solves for the impulses of points and bounds. In: `velocities` = v*; out: v* + W p. Input that is not
/// finite: zero impulses, velocities unchanged, converged = false.
FullContactReport SolveContacts(const std::vector<ResponseBlock>& blocks,
                                std::vector<PointConstraint>& points, std::vector<BoundConstraint>& bounds,
                                VectorX& velocities, const FullContactOptions& options);

}  // namespace fork1s::reference
