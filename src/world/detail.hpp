// The insides of a World: what it holds between steps, and the parts of a step.
#pragma once

#include <array>
#include <fork1s/dynamics/mechanism_dynamics.hpp>
#include <fork1s/dynamics/mechanism_model.hpp>
#include <fork1s/parallel/parallel_for.hpp>
#include <fork1s/world/island_solver.hpp>
#include <fork1s/world/world.hpp>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "part_clock.hpp"

namespace fork1s {

/// solver <- the worst of two solves of one step.
void MergeSolverReport(const ContactSolverReport& then, ContactSolverReport& solver);

/// How well an implicit stage is solved at the pose found.
struct StageResidual {
  double ratio = 0;     // largest residual, in tolerances
  double largest = 0;   // m
  StepSubject subject;  // of the largest ratio
  // Every residual is: too small to matter, as the motion goes; within its tolerance or a share of the length
  // that noise may leave.
  bool is_negligible = true, is_small = true;
  bool is_slow = false;  // the iteration contracts so slowly that a new matrix is worth its cost
};

struct World::Detail {
  StepReport Step(const StepOptions& options);
  void Save(WorldState& out) const;
  void Restore(const WorldState& state);
  bool IsFinite(bool poses);
  StepSubject FindNotFinite() const;
  static void ForgetInputs(WorldState& state);
  StepReport UndoStep(WorldState& start, StepReport report);
  Expected<void> BuildCollision(const Scene& scene, const Options& options);
  // False: a stage moves something beyond the range of numbers, and none are looked for.
  bool FindContacts(const StepOptions& options, StepReport& report);
  bool PrepareContacts(const StepOptions& options, StepReport& report);
  // The step (stages.cpp).
  void BeginStep(double h);
  StepReport StepByStages(const StepOptions& options);
  enum class StageScheme { kFirstOfTwo, kSecondOfTwo, kBackwardEuler };
  // What may be met within a stage (reach.cpp).
  static double InnerRadius(const Shape& shape);
  /// Largest displacement [m] of a point within `radius` of the frame.
  static double MotionBetween(const RigidTransform& from, const RigidTransform& to, double radius);
  double LargestPairMotion() const;
  RigidTransform PoseOf(const Contactor& contactor) const;
  bool MayHavePassed();
  void RecordStageStart(bool of_step);
  bool PrepareContactsAtStageStart(const StepOptions& stage, StepReport& report);
  bool CoversMotion();
  bool PassesStop() const;
  bool BasePointIsBeyond(const StepOptions& options, StepSubject& subject) const;
  HalvingCause SolveStage(const StepOptions& options, StageScheme scheme, StepReport& report);
  HalvingCause FindStageEvent(const StepOptions& options, StageScheme scheme, int iteration, StepReport& report) const;
  void MoveAllToStagePoses(double b, double time);
  StageResidual MoveAndComputeResiduals(const StepOptions& stage, StageScheme scheme, double time,
                                        bool is_first);
  bool ChangesSaturation(double b, StepReport& report);
  bool LeavesAgain(double b, StepSubject& subject) const;
  void StoreStage(double b, StageScheme scheme, StepReport& report);
  StepReport HalveOrUndo(const StepOptions& options, HalvingCause cause, const StepReport& attempt);
  StepReport FinishStep(const StepOptions& options, WorldState& start, StepReport report);
  // What the parts of a step add up to (sums.cpp).
  static void AddReport(const StepReport& part, StepReport& whole);
  void ClearSums();
  void SumImpulses(double weight = 1);
  void StoreSums();
  struct ContactSum {                    // of a contact, over the stages of the step
    Vector6 wrench_W = Vector6::Zero();  // moment [N m s] and impulse [N s]
    double normal = 0, tangential = 0;   // see ContactRecord [N s]
  };
  static void SetSum(const ContactSum& sum, ContactRecord& contact);
  double StepsRatio(double h) const;
  void StartRows(double b);
  void Rebound(double h);
  // Impacts (impact.cpp).
  void FindTouchedBodies();
  bool Bore(std::size_t contact) const;
  bool CarriedAtRest(std::size_t contact, double speed) const;
  double PairSize(const ContactPoint& point) const;
  void RecordStops(double h);
  void RecordStartGaps();
  void CarryStartGaps();
  double StartGap(std::size_t contact) const;
  double SpeedOfImpact(const ContactPoint& point) const;
  bool ClosesAtSpeed(const StepOptions& options, StepSubject* subject = nullptr) const;
  // Way to a stop that bore nothing, m, and its speed, m/s; of what turns in lengths of its mechanism.
  struct StopApproach {
    bool bore = true;
    double gap = 0, speed = 0;
    double base_gap = 0;            // m, at the base point of a stage
    double size = 0;                // m, of its mechanism
    double scale = 1;               // m a unit of its length: rad or m
    int mechanism = -1, stop = -1;  // of length_limits()
  };
  static double MetersPerUnit(const MechanismDynamics& m, const Mechanism::Length& length);
  StopApproach ApproachOf(const MechanismDynamics& m, const Mechanism::LengthLimit& stop, bool upper) const;
  bool MetAtSpeed(const StepOptions& options, StepSubject* subject = nullptr) const;
  double MotionWithin(double h) const;
  void LayOutPorts(const StepOptions& options);
  void LayOutLimits(std::size_t mechanism, const StepOptions& options);
  void FillRows(std::size_t mechanism);
  void SizeBlocks(std::size_t mechanism);
  void AssembleOperators();
  void AssembleConstraints(const StepOptions& options);
  void AssembleContact(std::size_t contact, const StepOptions& options);
  void AssembleLimits(const StepOptions& options);
  void FillLimits(std::size_t mechanism, const StepOptions& options);
  void MatchPrevious();
  struct MatchBench;
  void MatchPatch(std::size_t begin, std::size_t end, MatchBench& bench);
  void AddCandidates(std::size_t begin, std::size_t end, const int* first, const int* last,
                     MatchBench& bench) const;
  void SolveContacts(const StepOptions& options, StepReport& report);
  bool UpdateSwitches(const StepOptions& options);
  void PredictAllAgain(double h);
  // Forces with bounds in the contact solve (bounded_forces.cpp).
  void AddBoundedForceRows(double h);
  void SolveWithSidesFound(double h);
  void AssembleBoundedForces(double h);
  void GatherPushes();
  void ApplyImpulses(bool of_bounded_forces);
  void KeepForNextStep(double h, StepReport& report);
  void GatherContactImpulses(std::size_t mechanism);
  void RefreshIfStale(std::size_t mechanism, double h);
  void CountRefreshes(StepReport& report) const;
  int WorthAThread() const;
  // act(i) for every mechanism or contact, side by side where they are many: each on its own data alone.
  template <class Act>
  void ForMechanisms(const Act& act) const {
    ForAll(mechanisms_.size(), mechanism_grain_, act);
  }
  template <class Act>
  void ForContacts(const Act& act) const {
    constexpr int kWorthAThread = 64;  // some 30 us
    ForAll(points_.size(), kWorthAThread, act);
  }
  template <class Act>
  static void ForAll(std::size_t count, int grain, const Act& act) {
    ParallelFor(0, static_cast<int>(count), grain, [&act](int begin, int end) {
      for (int i = begin; i < end; ++i) act(static_cast<std::size_t>(i));
    });
  }
  void FindPortFrames();
  Matrix36 PortRows(int contactor, const Vector3& point, const Matrix3& frame) const;
  static Vector3 RelativeSpeed(const ContactConstraint& c, const VectorX& velocities);

  std::vector<MechanismDynamics> mechanisms_;
  int mechanism_grain_ = 1;  // WorthAThread()
  std::vector<FreeBody> free_bodies_;
  std::unique_ptr<CollisionWorld> collision_;
  std::vector<Contactor> contactors_;
  std::vector<std::string> warnings_;
  double margin_max_ = 0;                       // m
  std::vector<std::vector<GeometryDef>> geometries_;  // per contactor
  std::vector<double> contactor_radius_;              // m, about the contactor's frame
  std::vector<std::vector<double>> geometry_radius_;  // m, per contactor and geometry; infinite for planes
  std::vector<RigidTransform> contactor_pose_;  // at the previous detection
  std::vector<RigidTransform> previous_pose_;   // of the contacts of the step before

  IslandSolver solver_;
  std::vector<ContactPoint> start_points_;  // of the start of the step
  std::vector<ContactPoint> points_;  // of this step, those that can touch within it
  std::vector<ContactRecord> contacts_, previous_;
  double contacts_h_ = 0, previous_h_ = 0;           // s, of the steps that gave them their impulses
  std::vector<int> match_;                           // contact -> previous contact or -1
  std::vector<char> previous_used_;
  std::vector<int> previous_order_;  // of previous_, by what touches what
  // Where patches are matched, several side by side.
  struct MatchBench {
    std::vector<std::tuple<double, int, int>> candidates;  // m², contact, previous contact
    std::vector<std::array<Vector3, 4>>
        places;  // of points on body a and b: in their axes, and in the world's
    MatchBench() {
      candidates.reserve(16);  // a patch of four beside one of four
      places.reserve(16);
    }
  };
  static constexpr std::size_t kMostBenches = 64;
  // What contacts may move a body by that was not foreseen, as a share of the size of what touches.
  static constexpr double kClearShare = 0.02;
  double least_size_ = 0;  // m, of the shapes that move
  std::vector<MatchBench> match_benches_;
  std::vector<std::size_t> patches_;  // first point of each, and the end
  bool in_stage_ = false;             // contacts and rows are those of the pose that a stage is linearised at
  bool is_backward_euler_ = false;    // the step at hand, or its part, is one stage
  // How far contacts were sought last and are at least to be [m]; whether all stops
  // are rows, and rows are those of the pose where the stage starts.
  double search_margin_ = 0, least_margin_ = 0;
  std::vector<RigidTransform> stage_start_pose_;  // per contactor
  bool all_stops_ = false, from_stage_start_ = false;
  std::vector<std::vector<double>> inner_radius_;  // m, of a sphere within, per contactor and geometry
  // Of Newton's iteration, as measured last: [1] in the second of two stages, whose matrix is older, [0] in
  // others.
  std::array<double, 2> contraction_ = {1, 1};
  std::vector<StageChange> stage_changes_;  // of mechanisms_
  std::vector<char> previous_is_fresh_;  // of previous_, in the second stage: met in the first
  // Of previous_: the gap [m] at the start of the step of what carried load there,
  // else NaN.
  std::vector<double> start_gap_, next_start_gap_;
  // Of previous_, in their frames: from the end of the first stage to the base point of the second [N m; N].
  std::vector<Vector6> to_base_point_;
  std::vector<double> approach_;     // m/s, of points that may part again; 0 for others
  std::vector<double> closing_;      // m/s, of all, at the start of the step
  std::vector<StopApproach> stop_approach_;  // of limits_
  std::vector<ContactConstraint> constraints_;
  std::vector<LimitConstraint> limits_;
  std::vector<VelocityBlock> blocks_;
  std::vector<int> port_offset_;  // per contactor: row in the stacked velocities or -1
  std::vector<RigidTransform> port_frames_;
  std::vector<int> port_part_;    // per contactor: part block of its mechanism
  VectorX velocities_;
  VectorX start_velocities_;              // of a stage of backward Euler: at its start, as velocities_
  std::vector<double> contactor_motion_;  // m, in a stage: since its start

  // Ports and limits of one part of a mechanism, or (the last one) of groups that only follow its driven
  // base.
  struct PartBlock {
    std::vector<int> groups;  // in port order
    std::vector<int> limits;  // 2 k + side of entries k of length_limits(), side 0 lower, 1 upper
    std::vector<int> frictions;  // of the mechanism, all that this part moves
    std::vector<int> bounded_forces;  // of the mechanism that are rows, in the order in which they came
    int offset = 0, rows = 0;
    int room = 0;  // rows beyond these that bounded forces may ask for
    MatrixX J_T;  // size of the part x rows
    MatrixX Y;    // L⁻¹ J_T
    VectorX port_impulse;

    Eigen::Index FrictionRow(std::size_t k) const {
      return static_cast<Eigen::Index>(6 * groups.size() + limits.size() + k);
    }
    Eigen::Index BoundedForceRow(std::size_t k) const { return FrictionRow(frictions.size() + k); }
  };
  struct MechanismBlock {
    std::vector<PartBlock> parts;
    std::vector<double> limit_impulses;  // 2 per limited length, for warm starts
    // As limit_impulses: whether a stop carried load at the start of the step or in
    // its first stage, whether in the stage alone, and the distance to the stop [m or rad] at the start if
    // there, else NaN.
    std::vector<char> stop_carried, stop_is_fresh, stop_is_row;
    std::vector<double> stop_start_gap;
    std::vector<double> friction_impulses;
    std::vector<double> friction_held;  // N s: what dry friction bears where the stage starts
    VectorX impulse;
    Matrix6X contact_impulses_R;  // of the last stage, 6 x bodies, about R's origin
    int refreshed = 0;  // at the end of the last step: 1 done, -1 failed
    LinearizationDrift drift;     // for which it was refreshed
    std::size_t first_limit = 0;  // of its rows in limits_
    bool finite = true;
  };
  std::vector<MechanismBlock> mechanism_blocks_;
  // Bounded forces that are rows of the contact solve, whose limits_ stand last, in this order.
  struct BoundedForceInSolve {
    std::size_t mechanism = 0, part = 0, row_in_part = 0, index = 0;
  };
  std::vector<BoundedForceInSolve> bounded_forces_;
  // What the impulse of one contact does to the ports of both sides.
  struct Push {
    bool any = false;
    int body_a = -1, body_b = -1;
    int port_a = -1, port_b = -1;
    Vector6 on_a, on_b;
  };
  std::vector<Push> pushes_;
  std::vector<char> is_pushed_;  // per contactor
  std::vector<char> touched_;    // per free body: whether contacts at hand may
  std::vector<Matrix6> free_Y_;
  std::vector<FreeBody::Velocity> free_velocity_;  // of free bodies before contact, where forces have bounds
  bool has_switches_ = false;
  WorldState before_;  // of the step at hand
  // Share of its size by which what the first stage stopped may part again in the second: the extrapolation
  // between the stages would turn a speed v into 1.4 v the other way.
  static constexpr double kPartingShare = 1e-6;
  // Of its parts so far: wrenches of contacts in world axes, contacts that have ended, stops and dry
  // friction.
  struct Sums {
    std::vector<ContactSum> contacts;
    std::vector<ContactRecord> ended;
    std::vector<WorldState::Rows> rows;
  };
  Sums sums_;
  std::vector<ContactSum> next_sums_;
  std::vector<char> goes_on_;
  // A step that contains an event is halved up to this often (docs/decisions/001-time-stepping.md); the
  // shortest parts are one stage of backward Euler each. Where such a stage does not converge it is halved
  // further.
  static constexpr int kMaxEventHalvings = 3, kMaxHalvings = 6;
  struct Halving {
    WorldState start;  // of the step that is halved
    Sums sums;         // until then
  };
  std::array<Halving, kMaxHalvings + 1> halvings_;
  int depth_ = 0;       // halvings of the step at hand
  double impact_speed_ = 0;   // m/s, by the length of the whole step
  double carried_speed_ = 0;  // m/s, below which a contact that bore a load in the last step goes on
  StepPartTimes* times_ = nullptr;
};

}  // namespace fork1s
