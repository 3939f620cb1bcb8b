// The one object that users hold: a scene in motion.
#pragma once

#include <cstdint>
#include <fork1s/mechanism/scene.hpp>
#include <fork1s/sim/fidelity.hpp>
#include <fork1s/world/world.hpp>
#include <memory>
#include <string>
#include <vector>

namespace fork1s {

struct SimulationOptions {
  double dt = 0;  // s; 0: the scene's time step
  Recovery recovery = Recovery::kExact;
  ReductionOptions reduction;  // `interfaces` is not used here: every mechanism's definition names its own
  double refresh_angle = 0.2617993877991494;  // rad
  int initial_keyframe = -1;                  // index in the scene
  StepOptions step;                           // h and gravity are set from dt and the scene
  CollisionOptions collision =
      World::Options{}.collision;  // margin: how far ahead contacts are looked for, at most
  int reserved_contacts = World::Options{}.reserved_contacts;  // 3 kB each
  DetailLevel detail = DetailLevel::kInterface;  // not kObject: nothing is held before the first step
};

/// A body of the scene by its place in Simulation::bodies(), which stays the same whatever the fidelity.
struct SceneBody {
  std::string name;
  int mechanism = -1;  // of world(); -1: a free body
  int index = 0;       // body of the mechanism, or free body, of world()
  bool is_interface = false;
  int given = -1;  // mechanism of scene() that it is of; -1: a free body, held or not
};

/// How a body starts a step.
struct BodyMotion {
  RigidTransform X_WB;
  Vector6 V_W = Vector6::Zero();  // [ω_W; velocity of its origin]
  /// Of ApplyWrench in the step: [moment about the origin of the body; force], N·m and
  /// N, world axes.
  Vector6 load_W = Vector6::Zero();
};

/// Steps a scene. Inputs hold until changed; poses are those after the last step. Functions throw
/// std::invalid_argument, and change nothing, for indices and names that there are not, names that several
/// bodies or controls have, and numbers that are not finite; the message names function, value and remedy.
///
///     auto simulation = Simulation::Create(scene);          // Expected<Simulation>
///     simulation->SetControl("grip", 0.4);
///     StepReport report = simulation->Step();
///     RigidTransform X_WB = simulation->Pose("fingertip");
class Simulation {
 public:
  /// Throws std::invalid_argument for options that make no sense; errors are those of the scene.
  static Expected<Simulation> Create(Scene scene, const SimulationOptions& options = {});

  /// Advances by dt, with controls as StepOptions::controls_move says. What went wrong numerically stands in
  /// the report; the state stays finite.
  StepReport Step() { return Step(options_.step.controls_move); }
  /// The same with controls that move linearly within the step, from start_controls() to those set, or are
  /// held at those set. Samples of a path move; the output of a controller is held. Driven bases move in both
  /// cases, from pose to pose. The step of euler depends on the end alone.
  StepReport Step(bool controls_move);
  double time() const { return static_cast<double>(steps_) * dt_; }
  std::int64_t steps() const { return steps_; }
  double dt() const { return dt_; }
  const Scene& scene() const { return scene_; }
  /// What world() was made of: the scene with interface bodies refined and held bodies taken into mechanisms.
  const Scene& present_scene() const { return *present_scene_; }
  /// Those it was made with; `step` as it is now.
  const SimulationOptions& options() const { return options_; }

  /// Simulates with more or less detail from the present state on: poses stay, velocities as far as the new
  /// model can follow them. kObject freezes the contacts of every free body that two or more bodies of
  /// mechanisms press on, and makes one of mechanisms that hold it together; other levels let go again.
  /// Errors leave everything as it was: kModel where nothing is held, mechanisms cannot be joined or one
  /// cannot be reduced to the bodies asked for. Builds the world again: milliseconds. `known_grasps`: what
  /// kObject freezes where contacts do not tell it, before the first step: holds() of another simulation of
  /// the same bodies.
  Expected<void> SetFidelity(const Fidelity& fidelity, const std::vector<FrozenGrasp>& known_grasps = {});
  const Fidelity& fidelity() const { return fidelity_; }
  /// What is frozen at present.
  const std::vector<FrozenGrasp>& frozen_grasps() const { return frozen_grasps_; }
  /// Forces of the frozen contacts after the last step, in the order of holds().
  std::vector<FrozenContactForce> FrozenContactForces() const;
  /// The present state as a keyframe of scene().
  KeyframeDef State() const;
  /// Where a mechanism of scene() stands in world(): elsewhere than at its own place only while it holds
  /// something together with others.
  const MechanismPlace& place(int mechanism) const {
    internal::RequireIndex("mechanism", mechanism, places_.size());
    return places_[static_cast<std::size_t>(mechanism)];
  }
  /// As scene() has it, built, whatever it holds.
  const Mechanism& given_mechanism(int mechanism) const {
    internal::RequireIndex("mechanism", mechanism, given_.size());
    return *given_[static_cast<std::size_t>(mechanism)];
  }
  /// Of a mechanism of scene(): pose of its base in the world, and its twist in axes of the base.
  RigidTransform BasePose(int mechanism) const;
  Vector6 BaseTwist(int mechanism) const;
  /// Joint displacements of a mechanism in the order of its definition in scene(), what it holds left out.
  VectorX JointCoordinates(int mechanism) const;
  /// Their rates.
  VectorX JointRates(int mechanism) const;
  /// Names of the joint coordinates of all mechanisms, in that order.
  std::vector<std::string> CoordinateNames() const;
  /// Place in bodies() of a body of world(): of a mechanism, or -1 and a free body.
  int BodyOf(int mechanism, int index) const;
  /// Place in bodies() of a collision body of world(), -1: the still world.
  int BodyOfCollisionBody(int collision_body) const;

  /// Inputs: the controls of all mechanisms, then for every driven base six coordinates BASE.x .y .z (m) and
  /// .rx .ry .rz (rotation vector, rad), all relative to its initial pose.
  const std::vector<std::string>& control_names() const { return control_names_; }
  int FindControl(const std::string& name) const;  // the first; -1: none
  /// Whether a control is a coordinate of a driven base.
  bool DrivesBase(int index) const;
  const VectorX& controls() const { return controls_; }
  /// Limits of all controls, infinite where there is none.
  const VectorX& control_lower() const { return control_lower_; }
  const VectorX& control_upper() const { return control_upper_; }
  /// Values outside the control's limits are moved to the nearest limit. Whether what is set is held
  /// throughout the next step or is where the step ends: Step.
  void SetControl(int index, double value);
  void SetControl(const std::string& name, double value);
  void SetControls(const VectorX& values);
  /// Where the next step starts if controls move: where they were at the end of the last step, before the
  /// first their initial values.
  const VectorX& start_controls() const { return last_controls_; }
  /// The first step starts at the controls set now instead, for a path that begins elsewhere; driven bases
  /// start at their pose. Clears rates of bases. Throws std::invalid_argument after the first step: a later
  /// jump is a step in which controls are held.
  void StartFromControls();
  /// The rate at the end of the next step [m/s, or that of the rotation vector in rad/s] of a coordinate of a driven
  /// base, where the value set for it is a sample of a path that is known; of the next step only. Else steps of two
  /// stages estimate it from the steps before. To be set after the value.
  void SetBaseRate(int index, double rate);
  /// Of the coordinates of driven bases, in their order among the controls; NaN: not known. Of the next step.
  const VectorX& base_rates() const { return base_rates_; }
  int num_base_coordinates() const { return static_cast<int>(base_rates_.size()); }

  const std::vector<SceneBody>& bodies() const { return bodies_; }
  int FindBody(const std::string& name) const;  // the first; -1: none
  RigidTransform Pose(int body) const;
  RigidTransform Pose(const std::string& body) const;
  /// Of all bodies at once, in the order of bodies().
  void Poses(std::vector<RigidTransform>& X_WB) const;
  /// Twist of a body [ω_W; velocity of its origin], world axes.
  Vector6 Velocity(int body) const;
  /// Force [N] and moment [N·m], constant in world axes during the next step only. The force acts at the
  /// point of the body that is at `point_W` now.
  void ApplyWrench(int body, const Vector3& force_W, const Vector3& moment_W, const Vector3& point_W);
  /// A spring and a damper between a point of a body and a target in the world; holds until changed. It is
  /// evaluated in every stage, with its stiffness.
  /// A mechanism or free body has one. SetFidelity clears it.
  void SetPointSpring(int body, const PointSpring& spring);
  void ClearPointSprings();
  struct BodyPointSpring {
    int body = 0;  // place in bodies()
    PointSpring spring;
  };
  /// What the last step was given, for who records it, and how bodies started it, for sensors.
  struct LastStep {
    /// Whether world() has its contacts and stops: not before the first one, and not between SetFidelity and the
    /// next one.
    bool exists = false;
    bool controls_moved = false;
    VectorX base_rates;
    std::vector<BodyPointSpring> point_springs;  // targets as they moved within it
    std::vector<Matrix6X> wrenches_W;  // per body of each mechanism of world(); empty where nothing is held
    /// Of all bodies, in scenes whose sensors need them: those of accelerations and of forces between bodies. Empty
    /// where there is none and after one that was undone.
    std::vector<BodyMotion> start_motions;
  };
  const LastStep& last_step() const { return last_step_; }

  double KineticEnergy() const { return world_.KineticEnergy(); }
  double PotentialEnergy() const { return world_.PotentialEnergy(options_.step.gravity); }
  double Energy() const { return KineticEnergy() + PotentialEnergy(); }
  /// Largest opening of any loop [m].
  double ClosureGap() const;
  /// Largest opening of any joint or loop, measured on the recovered poses [m].
  double JointGap() const;

  /// 64 bits over all that the next step reads: coordinates, rates, warm starts, inputs. Equal where every
  /// bit of those is.
  std::uint64_t HashState() const;

  /// A moment to come back to. Plain values, which may be copied; it outlives the simulation.
  struct Snapshot {
    std::int64_t steps = 0;
    VectorX controls, last_controls, base_rates;
    Fidelity fidelity;
    std::vector<FrozenGrasp> frozen_grasps;
    std::shared_ptr<const Scene> made_of;    // present_scene() of then
    int keyframe = -1;                       // at which that world was made
    std::vector<RigidTransform> base_start;  // where the controls of driven bases count from
    LastStep last_step;
    WorldState world;
  };
  Snapshot Save() const;
  /// Likewise into `out`; does not allocate where `out` has its sizes.
  void Save(Snapshot& out) const;
  /// Goes back to it: the same steps from there give the same bits. Options of the step (dt, gravity,
  /// contact) are those of now. Errors leave everything as it was: kUsage for a snapshot of another scene.
  Expected<void> Restore(const Snapshot& snapshot);

  const World& world() const { return world_; }
  World& world() { return world_; }
  StepOptions& step_options() { return options_.step; }
  const StepOptions& step_options() const { return options_.step; }
  /// Sentences about doubtful decisions in the reduction of the mechanisms as the scene gives them.
  const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  Simulation() = default;
  World::Options WorldOptions(const Fidelity& fidelity) const;
  void ListBodies();
  void ListWarnings();
  void PassControls(bool controls_move);
  void CollectPointSprings();
  void RecordStartMotions();

  std::vector<std::string> warnings_;
  std::vector<std::vector<std::string>> own_warnings_;  // of each mechanism while it held nothing
  Scene scene_;
  std::shared_ptr<const Scene> present_scene_;
  int world_keyframe_ = -1;                              // of present_scene_, at which world_ was made
  std::vector<std::shared_ptr<const Mechanism>> given_;  // mechanisms of scene_, built
  Fidelity fidelity_;
  std::vector<FrozenGrasp> frozen_grasps_;
  std::vector<MechanismPlace> places_;  // per mechanism of scene_
  SimulationOptions options_;
  double dt_ = 1.0 / 60;
  std::int64_t steps_ = 0;
  World world_ = World::Empty();
  std::vector<std::string> control_names_;
  VectorX controls_, control_lower_, control_upper_;
  VectorX last_controls_;  // at the end of the last step
  VectorX base_rates_;
  std::vector<RigidTransform> base_start_;  // per mechanism
  LastStep last_step_;
  bool records_start_motions_ = false;
  std::vector<SceneBody> bodies_;
  std::vector<std::vector<int>>
      body_of_;  // places in bodies_ by body of world_: of free ones, then of mechanisms
};

/// Values of named controls over time, linear between rows, held before the first and after the last. Of
/// driven bases, corners of that path are rounded within 1/60 s of a row: bodies have no jumps of velocity.
struct ControlTrack {
  std::vector<std::string> names;
  std::vector<double> times;              // s, increasing
  std::vector<std::vector<double>> rows;  // one per time, one value per name

  /// Names of the track that the simulation does not have.
  std::vector<std::string> FindMissing(const Simulation& simulation) const;
  /// Sets every named control to its value at `time` [s], the end of the next step. That is to be Step(true):
  /// held at the samples of a path, controls jump at every step.
  void Apply(double time, Simulation& simulation) const;
  /// Sets those of time 0, where the first step starts. Before the first step.
  void Start(Simulation& simulation) const;
};

}  // namespace fork1s
