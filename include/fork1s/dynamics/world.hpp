// Everything that moves and touches, and the step that moves it.
#pragma once

#include <fork1s/collision/collision_world.hpp>
#include <fork1s/dynamics/free_body.hpp>
#include <fork1s/dynamics/island_solver.hpp>
#include <fork1s/dynamics/mechanism_dynamics.hpp>
#include <fork1s/mechanism/scene.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace fork1s {

struct StepOptions {
  double h = 1.0 / 60;                     // s
  Vector3 gravity = Vector3(0, 0, -9.81);  // m/s²
  double penetration_correction = 0.2;     // β: share of the penetration beyond the slop undone per step
  double slop = 1e-4;                      // m of penetration that is left alone
  double max_correction_speed = 3;         // m/s
  bool contact_curvature = true;           // adds (h/2) J̇ V to the rows of contacts that persist
  bool refresh = true;                     // move the reference when the pose has left it
  ContactSolverOptions contact;
};

/// A contact as it was solved.
struct ContactRecord {
  ContactPoint point;
  Vector3 impulse = Vector3::Zero();  // normal, tangents [N·s], in the frame of the point, on body b
  double friction = 0;
};

struct StepReport {
  int contacts = 0;
  int limits = 0;              // joint limits that acted
  ContactSolverReport solver;  // of all islands of contact: the worst of each
  double max_penetration = 0;  // m
  int refreshes = 0;
  int failed_refreshes = 0;
  bool contacts_dropped = false;  // the collision detector ran out of room
  bool finite = true;             // false: the step was undone and the state is that before it
};

/// What a collision body stands for.
struct Contactor {
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
    int initial_keyframe = -1;  // of the scene
    int max_contacts = 256;     // room reserved; more allocate
  };

  /// Builds every mechanism and the collision world. Errors as of BuildMechanism, Reduce,
  /// CollisionWorld::Create.
  static Expected<World> Create(const Scene& scene, const Options& options);

  /// A world without anything in it.
  static World Empty() { return World(); }

  std::vector<MechanismDynamics>& mechanisms() { return mechanisms_; }
  const std::vector<MechanismDynamics>& mechanisms() const { return mechanisms_; }
  std::vector<FreeBody>& free_bodies() { return free_bodies_; }
  const std::vector<FreeBody>& free_bodies() const { return free_bodies_; }
  const std::vector<ContactRecord>& contacts() const { return contacts_; }
  const std::vector<Contactor>& contactors() const { return contactors_; }
  /// Pose of a collision body when contacts() were found: at the start of the last step.
  const RigidTransform& PoseAtDetection(int contactor) const {
    return contactor_pose_[static_cast<std::size_t>(contactor)];
  }
  const std::vector<std::string>& warnings() const { return warnings_; }

  /// One step of the scheme of docs/method.md, section 5. Never throws for numerical reasons: see StepReport.
  StepReport Step(const StepOptions& options);

  double KineticEnergy() const;
  double PotentialEnergy(const Vector3& gravity) const;
  /// Forgets contacts and their warm starts, after a state was set from outside.
  void ResetContacts();

 private:
  World() = default;
  Expected<void> BuildCollision(const Scene& scene, const Options& options);
  void FindContacts(const StepOptions& options, StepReport& report);
  void LayOutPorts(const StepOptions& options);
  void SizeBlocks(std::size_t mechanism);
  void AssembleOperators();
  void AssembleConstraints(const StepOptions& options);
  void MatchPrevious();
  void ApplyImpulses();
  void KeepForNextStep(StepReport& report);
  void MoveMechanisms(const StepOptions& options, StepReport& report);
  int MechanismGrain() const;
  Matrix36 PortRows(const Contactor& contactor, const ContactPoint& point) const;

  std::vector<MechanismDynamics> mechanisms_;
  std::vector<FreeBody> free_bodies_;
  std::unique_ptr<CollisionWorld> collision_;
  std::vector<Contactor> contactors_;
  std::vector<std::string> warnings_;
  double margin_max_ = 0;                       // m
  std::vector<double> contactor_radius_;        // m, about the contactor's frame
  std::vector<RigidTransform> contactor_pose_;  // at the previous detection
  bool has_previous_pose_ = false;

  IslandSolver solver_;
  std::vector<ContactPoint> points_;  // of this step, those that can touch within it
  std::vector<ContactRecord> contacts_, previous_;
  std::vector<Vector3> speed_W_, previous_speed_W_;  // relative, after the solve, world axes
  std::vector<int> match_;                           // contact -> previous contact or -1
  std::vector<char> previous_used_;
  std::vector<int> previous_order_;  // of previous_, by what touches what
  bool curvature_valid_ = false;     // previous_speed_W_ is of the step before
  std::vector<ContactConstraint> constraints_;
  std::vector<LimitConstraint> limits_;
  std::vector<VelocityBlock> blocks_;
  std::vector<int> port_offset_;  // per contactor: row in the stacked velocities or -1
  std::vector<int> port_part_;    // per contactor: part block of its mechanism
  VectorX velocities_;
  Matrix6X J_scratch_;

  // Ports and limits of one part of a mechanism, or (the last one) of groups that only follow its driven
  // base.
  struct PartBlock {
    std::vector<int> groups;  // in port order
    std::vector<int> limits;  // 2 k + side of entries k of limited_coordinates(), side 0 lower, 1 upper
    int offset = 0, rows = 0;
    MatrixX J_T;  // size of the part x rows
    MatrixX Y;    // L⁻¹ J_T
    MatrixX W;    // YᵀY
    VectorX port_impulse;
  };
  struct MechanismBlock {
    std::vector<PartBlock> parts;
    std::vector<double> limit_impulses;  // 2 per limited coordinate, for warm starts
    VectorX impulse;
    bool pushed_from_outside = false;
    int refreshed = 0;  // at the end of the last step: 1 done, -1 failed
  };
  std::vector<MechanismBlock> mechanism_blocks_;
  std::vector<Matrix6> free_W_;
};

}  // namespace fork1s
