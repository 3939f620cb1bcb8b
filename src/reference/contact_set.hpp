// Contacts and joint limits of one step in full coordinates.
//
// Points, frames, biases and curvature term follow the same definitions as in the reduced simulator. The
// response to impulses comes from the factored equations of all bodies, and the contact law is solved by a
// solver of this room (dense_contact_solver.hpp).
#pragma once

#include <fork1s/reference/full_simulation.hpp>
#include <memory>
#include <string>
#include <vector>

#include "contact_constraints.hpp"
#include "free_body.hpp"
#include "full_mechanism.hpp"

namespace fork1s::internal {

/// What a collision body stands for.
struct FullCollisionBody {
  enum class Kind { kWorld, kMechanism, kFreeBody };
  Kind kind = Kind::kWorld;
  int index = 0;        // mechanism or free body
  int body = 0;         // of the mechanism, in whose frame the shapes are
  int scene_body = -1;  // place in FullSimulation::bodies()
  double radius = 0;    // m, about the frame
};

class ContactSet {
 public:
  using Mechanisms = std::vector<FullMechanism>;
  using Bodies = std::vector<FullFreeBody>;

  /// `interfaces`: per mechanism the bodies that may touch, besides its base.
  Expected<void> Build(const Scene& scene, const Mechanisms& mechanisms, const Bodies& free_bodies,
                       const std::vector<std::vector<int>>& interfaces, const CollisionOptions& options);

  /// Contact points at the present poses; false when the detector ran out of room.
  bool Detect(const Mechanisms& mechanisms, const Bodies& free_bodies, double h, const Vector3& gravity_W);
  /// Ports, rows, biases and warm starts, from the state before the step.
  void Open(const Mechanisms& mechanisms, const Bodies& free_bodies, double h,
            const FullSimulationOptions& options);
  /// Contact points for a stage of h within a part of a step of `part`: where it starts, or, `at_guess`,
  /// where the bodies' guess of its end is, with gaps and rows of there. Detects and opens.
  bool OpenStage(const Mechanisms& mechanisms, const Bodies& free_bodies, double h, double part,
                 const Vector3& gravity_W, const FullSimulationOptions& options, bool at_guess);
  /// Whether something is met, faster than `speed` [m/s], in the part of a step of which this stage was
  /// solved: what bears now, bore nothing before and came at that speed, or what stands open and would be met
  /// before the part ends. Also where a contact bounces, and where, in the second stage, one leaves at that
  /// speed at which the first one had stopped something: what goes on from the end of an impact goes too far.
  bool HasImpact(const Mechanisms& mechanisms, double part, double speed, bool second) const;
  /// Forgets all impulses, for a fresh start after Newton went astray.
  void ClearImpulses();
  bool empty() const { return constraints_.empty() && limits_.empty(); }
  /// Solves the contact law on the mechanisms' present linearization. False for responses that are not
  /// finite.
  bool Solve(const Mechanisms& mechanisms, const Bodies& free_bodies, const FullContactOptions& options,
             FullContactReport& report);
  /// Unknowns of mechanism i with contact, after Solve.
  const MatrixX& unknowns(std::size_t i) const { return blocks_[i].unknowns; }
  Vector6 free_port_twist(std::size_t i) const { return free_twists_[i]; }
  /// Whether contact with other bodies or the world carries an impulse on mechanism i, or on free body i.
  bool PushesMechanism(std::size_t i) const { return pushes_mechanism_[i] != 0; }
  bool PushesFreeBody(std::size_t i) const { return pushes_free_body_[i] != 0; }
  /// Contact impulses on the bodies of mechanism i, in their axes at the present guess (6 x bodies).
  Matrix6X OnBodies(std::size_t i, const FullMechanism& mechanism) const;
  /// Keeps what the next step compares with, and reports.
  void Close(double h, FullStepReport& report, std::vector<FullContact>& contacts);
  /// The same after the first of two stages.
  void CloseStage(double h, double speed, FullStepReport& report, std::vector<FullContact>& contacts);

  struct Past {
    ContactPoint point;
    Vector3 impulse = Vector3::Zero(), moment = Vector3::Zero();
    Vector3 speed_W = Vector3::Zero();  // relative, after the solve, world axes
    double utilization = 0;             // of the friction cone, see PointConstraint
    bool fresh = false;                 // the first of two stages stopped what came there, or met it
  };
  /// All that a step starts from.
  struct Memory {
    std::vector<Past> past;
    double past_h = 0;
    std::vector<RigidTransform> previous_pose;
    std::vector<std::vector<double>> limit_impulses, friction_impulses;
  };
  Memory Save() const;
  void Restore(const Memory& memory);

 private:
  struct Port {
    int collision_body = 0;
    int offset = 0;  // in the stacked velocities
  };
  struct Block {
    std::vector<Port> ports;
    std::vector<int> limits;  // 2 k + side of length limit k, side 0 lower, 1 upper
    int offset = 0, rows = 0;
    MatrixX J_T, W, unknowns;
    std::vector<double> limit_impulses;  // 2 a length limit
    std::vector<double> friction_impulses;
  };
  void AssignPorts(const Mechanisms& mechanisms, const Bodies& free_bodies, double h);
  void FillVelocities(const Mechanisms& mechanisms, const Bodies& free_bodies, bool at_guess,
                      VectorX& velocities) const;
  RigidTransform PoseOf(const FullCollisionBody& collision_body, const Mechanisms& mechanisms,
                        const Bodies& free_bodies, bool at_guess) const;
  void AddRows(const Bodies& free_bodies, const Mechanisms& mechanisms, double h,
               const FullSimulationOptions& options);
  Vector3 Speed(const reference::PointConstraint& c) const;
  const Past* FindPast(const ContactPoint& point);

  std::unique_ptr<CollisionWorld> collision_;
  std::vector<FullCollisionBody> collision_bodies_;
  std::vector<RigidTransform> previous_pose_;
  bool has_previous_pose_ = false;
  double margin_max_ = 0;                  // m
  double h_ = 0;                           // s, of the step at hand
  bool stage_ = false, at_guess_ = false;  // rows and gaps are those of the guess

  std::vector<ContactPoint> points_;
  std::vector<double> approach_, bias_;  // per point: speed of approach where it may part again, plain bias
  std::vector<double> start_speed_,
      gap_;  // per point: normal speed at the start, gap at the start of the step
  std::vector<char> bore_, fresh_, bounces_;  // per point: in the step before; see Past; parts again
  std::vector<double> limit_gap_, limit_speed_;
  std::vector<std::vector<char>> limit_fresh_;
  std::vector<reference::PointConstraint> constraints_;
  std::vector<reference::BoundConstraint> limits_;
  std::vector<Block> blocks_;
  std::vector<Port> free_ports_;
  std::vector<int> port_offset_;  // per collision body, -1: none
  VectorX velocities_;            // at the start of the step in Open, solved in Solve
  std::vector<Vector6> free_twists_;
  std::vector<char> pushes_mechanism_, pushes_free_body_;
  std::vector<Past> past_;
  double past_h_ = 0;  // s, of their step
  std::vector<char> past_used_;
};

}  // namespace fork1s::internal
