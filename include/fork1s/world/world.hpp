// Everything that moves and touches, and the step that moves it.
#pragma once

#include <array>
#include <fork1s/collision/collision_world.hpp>
#include <fork1s/constraints/contact_solver.hpp>
#include <fork1s/constraints/material.hpp>
#include <fork1s/mechanism/scene.hpp>
#include <fork1s/recovery/recovery.hpp>
#include <fork1s/reduction/reduced_model.hpp>
#include <fork1s/stepping/free_body.hpp>
#include <fork1s/stepping/linearization_drift.hpp>
#include <fork1s/world/world_state.hpp>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace fork1s {

class MechanismDynamics;  // mechanism_dynamics.hpp, for who looks into a mechanism
struct ContactProblem;    // contact_problem.hpp
struct StepPartTimes;     // step_times.hpp

/// How a step is taken: by implicit stages, each solved by Newton iteration to a residual (docs/method.md,
/// section 5). kTwoStage: two of them, of second order (Alexander's SDIRK2); a step through an impact is
/// halved. kEuler: one, backward Euler, of first order. A step that does not converge is halved.
enum class Integrator { kEuler, kTwoStage };

/// The words for them, in files, on the command line and in Python.
inline constexpr std::pair<Integrator, const char*> kIntegratorNames[] = {
    {Integrator::kEuler, "euler"}, {Integrator::kTwoStage, "two-stage"}};

constexpr const char* Name(Integrator integrator) {
  for (const auto& [value, name] : kIntegratorNames)
    if (value == integrator) return name;
  return "";
}

constexpr std::optional<Integrator> IntegratorNamed(std::string_view word) {
  for (const auto& [value, name] : kIntegratorNames)
    if (word == name) return value;
  return std::nullopt;
}

/// For whoever asks for the integrator of versions before 0.2.
inline constexpr const char* kThetaIsGone =
    "'theta' is no longer an integrator; choose 'two-stage', which is of second order too and takes its "
    "place";

inline constexpr double kToRounding = 1e-15;  // StepOptions::newton_tolerance

struct StepOptions {
  double h = 1.0 / 60;  // s
  Integrator integrator = Integrator::kTwoStage;
  // Inputs are samples of a trajectory, which moves evenly from those of the last step to those of this one.
  // Otherwise they stand throughout the step, as a controller's output does. No difference for kEuler, which
  // asks for nothing but the end.
  bool controls_move = false;
  Vector3 gravity = Vector3(0, 0, -9.81);  // m/s²
  ContactMaterial material;
  bool refresh = true;  // move the reference when the pose has left it
  // Share of the motion of a stage that its solution may be off by. Below 1e-6 loops close to as small a share of
  // kClosingTolerance, or to what rounding leaves; kToRounding is for differences of steps.
  double newton_tolerance = 1e-6;
  ContactSolverOptions contact;
};

/// What a figure of a step is about; World::NameOf says its name.
struct StepSubject {
  enum class Kind { kNone, kMechanism, kFreeBody, kServo, kSpring, kStop, kContact, kCoordinate };
  Kind kind = Kind::kNone;
  int index = -1;  // mechanism, free body, or first collision body of a contact
  int part = -1;   // servo, spring, stop or joint coordinate of the mechanism, or second collision body
};

/// Why a step was taken as two of half the length.
enum class HalvingCause { kNone, kImpact, kSaturation, kUnsolved };

/// Mechanisms that were relinearized for one cause.
struct Relinearizations {
  int count = 0;
  LinearizationDrift largest;  // by its share
  StepSubject of;              // of the largest: joint coordinate, or mechanism of a loop
};

struct StepReport {
  int contacts = 0;
  int limits = 0;              // joint limits that acted
  int forces_at_bound = 0;     // servos and motors that gave all they can
  ContactSolverReport solver;  // of all islands of contact: the worst of each
  double max_penetration = 0;  // m
  int refreshes = 0;
  std::array<Relinearizations, std::size(kDriftCauseNames)> refreshes_by_cause;  // by DriftCause
  int failed_refreshes = 0;
  int by_expansion = 0;           // mechanisms that went by an expansion (Recovery::kExpanded)
  int expansions = 0;             // made at the end of the step, beside those of new references
  bool contacts_dropped = false;  // the collision detector ran out of room
  int stages = 0;                 // implicit stages, those of attempts that were dropped included
  int stage_iterations = 0;       // Newton iterations of all of them; 2 where each of two took one
  int max_stage_iterations = 0;   // of one stage
  /// m: the largest change of a pose that another Newton iteration of a stage would make, in the kinetic
  /// metric: b |A⁻¹r| over the root of the mass, r the residual of the stage's equation. Of parts with artificial damping:
  /// by how much farther joints would have moved without.
  double stage_residual = 0;
  StepSubject stage_residual_of;
  /// False where a stage stagnated above its tolerance within 1e-6 of a length, where a shortest part converged with
  /// artificial damping only or the step was undone because it did not even then, or where shortest parts have led
  /// one shape through another; `stage_residual` is at least what the two have moved then.
  bool stages_converged = true;
  HalvingCause halving = HalvingCause::kNone;  // of the whole step
  StepSubject halving_of;                      // what caused it
  bool impact = false;                         // kTwoStage: something was met at speed within the step
  int parts = 1;             // shorter steps that made this one, of one stage each or of two
  double loop_residual = 0;  // rad or m by which the rows of any loop are open, of the mechanism's own
  bool finite = true;        // false: the step was undone and the state is that before it

  /// Contacts and stages met their tolerance.
  bool IsSolved() const { return solver.converged && stages_converged; }
};

/// What a collision body stands for.
struct CollisionBody {
  enum class Kind { kWorld, kGroup, kFreeBody };
  Kind kind = Kind::kWorld;
  int index = 0;  // mechanism or free body
  int group = 0;  // of the mechanism
  std::string name;
};

class World {
 public:
  struct Options {
    ReductionOptions reduction;
    Recovery recovery = Recovery::kExact;
    double refresh_angle = 0.2617993877991494;  // rad
    // Contacts are looked for as far ahead as a step may carry anything, at most `margin`: 12 m/s at 1/60 s.
    CollisionOptions collision = {.margin = 0.2};
    int initial_keyframe = -1;    // of the scene
    int reserved_contacts = 256;  // contact points that a step handles without allocating; more allocate once
  };

  /// Builds every mechanism and the collision world. Errors as of BuildMechanism, Reduce,
  /// CollisionWorld::Create.
  static Expected<World> Create(const Scene& scene, const Options& options);

  /// A world without anything in it.
  static World Empty();
  ~World();
  World(World&&) noexcept;
  World& operator=(World&&) noexcept;

  std::vector<MechanismDynamics>& mechanisms();
  const std::vector<MechanismDynamics>& mechanisms() const;
  std::vector<FreeBody>& free_bodies();
  const std::vector<FreeBody>& free_bodies() const;
  const std::vector<ContactRecord>& contacts() const;
  /// Contacts as they were found at the start of the last step; some of them were not touched in it. Those of
  /// contacts() lie where its last stage ends.
  const std::vector<ContactPoint>& start_points() const;
  const std::vector<CollisionBody>& collision_bodies() const;
  /// One per SwitchedClosureDef, by mechanism and in the order of its definition.
  const std::vector<SwitchedClosureRecord>& switched_closures() const;
  /// Pairs of collision_bodies() that the collision detector tests, the smaller index first, sorted.
  std::vector<std::pair<int, int>> PairsThatMayTouch() const;
  /// Pose of a collision body when contacts() were found: at the start of the last step.
  const RigidTransform& PoseAtDetection(int collision_body) const;
  /// A shape of a collision body, as the points of contacts() name it.
  const GeometryDef& geometry(int collision_body, int geometry) const;
  /// Radius [m] of the smaller of the two shapes of a contact.
  double PairSize(const ContactPoint& point) const;
  const std::vector<std::string>& warnings() const;
  /// "servo 'boom' of 'excavator'"; empty for kNone.
  std::string NameOf(const StepSubject& subject) const;
  /// N·s or N·m·s, at least 0: what the lower (2 k) and upper (2 k + 1) stop of entry k of a mechanism's length_limits()
  /// bore in the last step.
  const std::vector<double>& StopImpulses(int mechanism) const;
  /// τ += joint forces [n] of the stops and dry frictions that acted on a mechanism in the last step, of
  /// length h.
  void AddStopForces(int mechanism, double h, VectorX& tau) const;

  /// One step of the scheme of docs/method.md, section 5. Never throws for numerical reasons: see StepReport.
  StepReport Step(const StepOptions& options);
  /// The state at which the last step began, with its inputs: controls, loads, paths of bases, point springs. Not before
  /// the first step.
  const WorldState& StartOfLastStep() const;
  /// A step of length options.h as that many shorter ones, with inputs as they are within a step that began at `inputs`,
  /// of this world or of another of the same bodies and controls.
  StepReport StepInParts(const WorldState& inputs, const StepOptions& options, int parts);
  /// From now on every step writes into `times` how long its parts took; nullptr: none does, and no clock is
  /// read.
  void Watch(StepPartTimes* times);
  /// What the last step asked of its contacts and stops, to be solved by other means: velocities before them
  /// and impulses of the step before as a warm start. Of its last stage; of no blocks where nothing could
  /// touch.
  ContactProblem LastContactProblem() const;

  double KineticEnergy() const;
  double PotentialEnergy(const Vector3& gravity) const;
  /// All that the next step depends on, into `out`; does not allocate where `out` has its sizes.
  void Save(WorldState& out) const;
  /// Puts back what Save gave, here or of a world made of the same scene with the same options: the next
  /// steps give the same bits. Throws where CanRestore has an error.
  void Restore(const WorldState& state);
  /// kUsage where the state has other bodies, coordinates or controls than this world.
  Expected<void> CanRestore(const WorldState& state) const;
  /// Forgets contacts and their warm starts, after a state was set from outside.
  void ResetContacts();

 private:
  World();
  struct Detail;
  std::unique_ptr<Detail> detail_;
};

}  // namespace fork1s
