// Random mechanisms in random motion by the two-stage step, and measures of each.
#pragma once

#include <fork1s/world/world.hpp>
#include <string>
#include <vector>

namespace fork1s::random_motion {

/// What the generator may draw. Every feature has a stream of random numbers of its own, so that a mechanism
/// without one feature is otherwise the same.
struct GeneratorOptions {
  int max_bodies = 8;          // moving bodies, each with one or two joints
  double max_stiffness = 1e8;  // N/m or N·m/rad
  bool closures = true, couplings = true, tendons = true, nonlinear_tendons = true;
  bool dampers = true, armatures = true, limits = true, frictions = true, servos = true, bounds = true;
  bool gravity = true, spin = true, floor = true, free_bodies = true, pushes = true;
  bool set_point_jumps = true, base_jumps = true;
  int base = -1;  // a BaseKind; negative: any
};

/// A wrench on a body through the steps of [begin, end).
struct Push {
  int body = -1;  // negative: none
  int begin = 0, end = 0;
  Vector3 force = Vector3::Zero();   // N, at the origin of the body
  Vector3 moment = Vector3::Zero();  // N·m
};

struct Case {
  unsigned seed = 0;
  std::string description;  // one line
  Scene scene;              // its keyframe 0 is the start
  World::Options world;
  StepOptions step;
  int steps = 60;
  double size = 0;  // m, distance between neighboring bodies
  Push push;
  int jump_step = -1;  // at which set-points or base jump; negative: never
  VectorX set_points;  // after the jump
  bool base_jumps = false;
  Vector6 base_motion = Vector6::Zero();  // amplitudes or jump: rad; m
  double base_rate = 0;                   // rad/s of the sine that a driven base follows
  std::vector<double> radius;             // m, of the geometry of each body; 0: none

  const MechanismDef& mechanism() const { return scene.mechanisms[0]; }
  bool has_contact() const { return !scene.world.empty() || !scene.free_bodies.empty(); }
};

Case DrawCase(unsigned seed, const GeneratorOptions& options = {});
/// The same with steps of h/n, n times as many.
Case Refined(Case c, int n);

/// One line; mass [kg] of all that moves.
std::string Describe(const Case& c, double mass);

/// Measures of a run.
struct Result {
  unsigned seed = 0;
  std::string description;
  std::string refusal;       // of World::Create; empty: it ran
  bool finite = true;        // poses, velocities and energies
  double kinetic_ratio = 0;  // largest kinetic energy over what start and inputs explain
  bool has_energy_bound = false;
  double energy_excess = 0;  // largest energy beyond that after the last input, of the largest kinetic energy
  double energy_allowed = 0;  // of the same
  int energy_step = -1;
  bool has_momentum = false;                   // floating and without contact
  double linear_error = 0, angular_error = 0;  // of the sums of magnitudes
  std::string report_fault;                    // first contradiction within a StepReport
  int undone = 0, unconverged = 0, halved = 0, most_parts = 0, impacts = 0, contacts = 0;
  std::string undone_of;
  double passage = 0;                  // largest depth below the floor, of the size of the body
  double largest_rotation_vector = 0;  // rad, of joints that have one
  double largest_turn = 0;             // rad or shares of the size, of any body or joint within a step
};

/// `trace`: print every step.
Result Simulate(const Case& c, bool trace = false);

}  // namespace fork1s::random_motion
