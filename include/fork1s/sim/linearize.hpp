// A step of a simulation to first order: what design of controllers and observers starts from.
#pragma once

#include <fork1s/sim/simulation.hpp>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace fork1s {

struct LinearizeOptions {
  /// Bodies whose poses are the outputs, places in Simulation::bodies().
  std::vector<int> outputs;
  /// By how much coordinates are moved: radians, and shares of a length of what they move. Rates by that a step.
  double change = 1e-6;
  /// Places of the controls that are inputs, in Simulation::control_names(); all, where it has no value.
  std::optional<std::vector<int>> inputs;
  /// Controls move within the step, as of Simulation::Step(true).
  bool controls_move = false;
  /// Inputs at the start of the step are inputs too, B_start. The step depends on them where controls move, and where
  /// held ones jump whose jump stiff servos are to follow without overshoot.
  bool start_controls = false;
  /// What δx' counts from instead of x*: the state after the step in a run of the same simulation, so that its steps
  /// chain, δx_2 = A_1 A_0 δx_0.
  std::optional<Simulation::Snapshot> end;
  /// Contacts and joints with dry friction start a step from the forces that they bore at the end of the last one, since
  /// their material's springs remember them. These count as q more entries of δx, as many as there are at x*, and q' more
  /// of δx', as many as at `end`, or at x*: A is (N + q') x (N + q). Else they stay as they are at x*.
  bool friction_forces = false;
  /// What else is differentiated: numbers of the simulation after the step, as many whatever its state; forces of
  /// contact, sensors, a cost. It is called after every step that is taken here, and is to change nothing. What it throws
  /// comes through.
  std::function<VectorX(Simulation&)> outcome;
};

/// A step x' = f(x, u) of length dt about the state x* and the held controls u* of a simulation:
///     δx' = c + A δx + B δu,   δy = C δx,   c = f(x*, u*) ⊖ x*
/// δx = [δp; δv; δa] counts from x*. δp: for every mechanism independent joint coordinates [rad or m], as many as it has
/// freedoms, and of a base that floats its rotation vector [rad] and the displacement of its origin [m]; for every
/// free body the same six; world axes. δv: their rates, of rotations the angular velocity. δa: activations of controls
/// with dynamics. δu: of the inputs. δy: of every output six as of a free body.
struct LinearizedStep {
  double dt = 0;                                  // s
  std::size_t num_joints = 0;                     // joint coordinates of the scene
  std::vector<std::string> coordinates;           // n names, of δp and of δv: "elbow", "drone.rx", "ball.z"
  std::vector<std::string> activations;           // k names of controls, of δa
  std::vector<std::string> forces;                // q names, where they were asked for
  std::vector<std::string> inputs;                // m names of controls
  std::vector<std::string> outputs;               // l: "cup.rx"
  MatrixX A;                                      // N x N, N = 2n + k
  MatrixX B;                                      // N x m
  MatrixX B_start;                                // N x m, where asked for
  VectorX c;                                      // N: 0 where the state is at rest
  MatrixX C;                                      // l x N
  VectorX outcome;                                // o, of the step from x* with u*, and its derivatives
  MatrixX outcome_A, outcome_B, outcome_B_start;  // o x N, o x m, o x m
  VectorX controls;                               // of all controls: u*
  /// Shares by which differences to both sides of a column of A and B differ from each other: those that do by more
  /// than 0.01 stand on a switch, where a contact or stop opens, friction begins to slide, or a force meets its bound,
  /// and their column is the mean of two.
  struct Switch {
    std::string of;  // "rate of elbow", or the name of an input
    double share =
        0;  // |f(+) - 2 f(0) + f(-)| over |f(+) - f(-)|, or over 0.01 of the change where that is larger
    std::string
        change;  // what differs from the step that is not moved: "contacts that bear: 4, with changes to both sides 3 and 4"
  };
  std::vector<Switch> switches;
  /// Names of the dry friction of joints and tendons that holds in the step from x* with u*: no small change of anything
  /// moves what it acts on.
  std::vector<std::string> stuck;
  /// Share by which the derivative along a direction through all coordinates and inputs, by two steps of its
  /// own, differs from that by A and B; not a number where the state stands on a switch.
  double difference = 0;

  /// Whether a simulation has as many mechanisms, free bodies and joint coordinates.
  bool IsOf(const Simulation& simulation) const;
  /// δx of a state of the same scene, [N]: what a feedback u = u* - K δx asks of each step. Throws
  /// std::invalid_argument where IsOf is false.
  VectorX Deviation(const Simulation& simulation) const;

  // x*, by which Deviation counts.
  struct Reference {
    std::vector<int> joints;  // coordinates of the mechanism that are independent
    VectorX q, q_dot;         // of those
    bool has_base = false;    // six of a floating base, or of a free body
    RigidTransform X;
    Vector6 V = Vector6::Zero();  // world axes, of the origin
    std::vector<int> controls;    // of the mechanism, with dynamics
    VectorX activation;           // of those
  };
  std::vector<Reference> mechanisms, free_bodies;
};

/// By central differences of whole steps: 2 N + 2 m + 3 steps, 2 m more for controls at the start and
/// 2 q for forces, each solved to rounding.
/// Contact, stops and friction are what the step makes of them. The simulation is stepped and put back: all of its
/// bits are as before. Within the step no mechanism gets a new reference, and a driven base goes where its controls
/// are. Errors: kUsage for outputs and inputs that there are not, for a change that is not in (0, 0.01],
/// and while bodies are held by frozen contacts; those of Restore for `end`; kNumerics where a step is not solved.
Expected<LinearizedStep> Linearize(Simulation& simulation, const LinearizeOptions& options = {});

}  // namespace fork1s
