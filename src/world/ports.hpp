// What of the bodies takes part in the contact solve, and how impulses move it.
#pragma once

#include "bodies.hpp"
#include "detection.hpp"
#include "rows.hpp"
#include "switched_closures.hpp"

namespace fork1s {

/// Which stops become rows and which velocities are asked for.
struct PortOptions {
  double h = 0;                        // s, of the step or stage: stops within reach of it are rows
  bool all_stops = false;              // all are
  bool with_start_velocities = false;  // ConstraintRows::start_velocities too
};
/// The ports that contact points touch, the stops within reach and all dry friction get their places; Jᵀ of
/// every part, and the velocities at hand.
void AssignPorts(const Bodies& bodies, const Detection& detection,
                 const std::vector<SwitchedClosure>& closures, const PortOptions& options,
                 std::vector<StopHistory>& stops, ConstraintRows& rows);
/// By the factors at hand: Y of every part, the velocities before contact, and the blocks of the solve.
void AssembleOperators(const Bodies& bodies, const Detection& detection, ConstraintRows& rows);
/// Frames of the ports that take part.
void FindPortFrames(const Bodies& bodies, const Detection& detection, ConstraintRows& rows);
/// Rows of a contact frame on the twist of a port.
Matrix36 PortRows(const Detection& detection, const ConstraintRows& rows, int collision_body,
                  const Vector3& point, const Matrix3& frame);
/// Impulses of the solve on mechanisms and free bodies; stops and dry friction keep theirs.
/// `of_bounded_forces`: those too.
void ApplyImpulses(const Detection& detection, const std::vector<SwitchedClosure>& closures,
                   bool of_bounded_forces, Bodies& bodies, std::vector<StopHistory>& stops,
                   ConstraintRows& rows);

/// act(i) for every contact, side by side where they are many.
template <class Act>
void ForContacts(const Detection& detection, const Act& act) {
  constexpr int kWorthAThread = 64;  // some 30 us
  ForAll(detection.points.size(), kWorthAThread, act);
}

}  // namespace fork1s
