// One reduced mechanism in motion: forces, the implicit operator, refresh.
//
// docs/method.md, section 5. With x = [ξ; w] (base twist where the base floats, reduced rates):
//     A x⁺ = M x + h (f(z) + loads) + Jᵀλ,   A = M + h D + h² K, factored in each step.
// M is that of the present pose (twist mode: of the reference): with a stale one a body in free fall would push its
// own legs about, the harder the faster it moves. Forces, velocity forces included, are evaluated at the present
// pose in joint coordinates and projected, f_z = Q(q)ᵀ g(q): on trees this is -K z + F_u u exactly, with loops it
// carries the projector, and dead loads bring their geometric stiffness. A step of second order has equations
// of its own: theta_step.cpp.
#pragma once

#include <algorithm>
#include <fork1s/dynamics/mechanism_state.hpp>
#include <fork1s/dynamics/step_rule.hpp>
#include <fork1s/dynamics/theta_scheme.hpp>
#include <fork1s/linalg/cholesky.hpp>
#include <fork1s/linalg/row_squares.hpp>
#include <fork1s/recovery/recovery.hpp>
#include <fork1s/reduction/reduced_jacobian.hpp>
#include <fork1s/reduction/reduced_model.hpp>
#include <vector>

namespace fork1s {

/// A rigid group of bodies that may touch something: an interface body with all that is welded to it, or the
/// base.
struct ContactGroup {
  int last_joint = -1;            // the joint that carries the group; -1: the base
  BodyIndex body;                 // the body that names it
  std::vector<BodyIndex> bodies;  // all of the group
};

class MechanismDynamics {
 public:
  struct Options {
    ReductionOptions reduction;
    Recovery recovery = Recovery::kExact;
    double refresh_angle = 0.2617993877991494;  // rad (15 degrees); slides: this share of the length scale
    double refresh_gap = 2e-4;                  // m: of loops, by curved recovery
    double complement_relaxation = 0.1;  // s, time in which a refresh's leftover interior displacement fades
  };

  /// Starts at joint displacements q0 (loops closed first where they are not) and rates q_dot0.
  static Expected<MechanismDynamics> Create(std::shared_ptr<const Mechanism> mechanism, const VectorX& q0,
                                            const VectorX& q_dot0, const RigidTransform& X_WR,
                                            const Vector6& V_R, const Options& options);

  const Mechanism& mechanism() const { return *model().mechanism; }
  const ReducedModel& model() const { return *state_.model; }
  const ReducedState& state() const { return state_.reduced; }
  const Configuration& configuration() const { return configuration_; }
  const std::vector<ContactGroup>& groups() const { return groups_; }
  Recovery recovery() const { return options_.recovery; }
  /// Number of generalized velocities: r, plus 6 where the base floats.
  int num_velocities() const { return base_size_ + model().size(); }

  /// Inputs; they hold until changed. `controls` one per Mechanism::controls().
  VectorX& controls() { return state_.controls; }
  const VectorX& controls() const { return state_.controls; }
  /// In the next step controls move evenly from these, counted from the `first`, to controls(), rather than
  /// stand there throughout it; all have to be given. A step of second order sees that; implicit Euler asks
  /// for nothing but the end.
  void MoveControlsFrom(int first, const Eigen::Ref<const VectorX>& from) {
    state_.controls_from.segment(first, from.size()) = from;
    state_.controls_move = true;
  }
  /// Wrench on a body in world axes about a point p_W that moves with nothing: applied in the next step only.
  void AddWrench(BodyIndex body, const Vector3& force_W, const Vector3& moment_W, const Vector3& point_W);
  /// Those added for the next step [6 x bodies], about the world's origin in world axes.
  const Matrix6X& wrenches_W() const { return state_.wrenches_W; }
  /// Pose that a driven base reaches at the end of the next step.
  void DriveBase(const RigidTransform& X_WR_next) { state_.driven_next = X_WR_next; }
  /// Twist in R [6] that takes a driven base to its next pose within h [s].
  Vector6 DrivenTwist(double h) const { return Log(state_.reduced.X_WR.inverse() * state_.driven_next) / h; }

  /// Begins a step by this rule (docs/method.md, section 5). By kMiddle the mechanism stands where its
  /// velocity takes it in half the step, from here to Integrate, and Predict, ports and lengths
  /// speak of that pose. By kTwoSteps velocities x from Predict on are a share of those of the end. Not by
  /// twists, which know no other rule than kEuler.
  void Begin(double h, const Vector3& gravity_W, StepRule rule);
  /// Wrenches for the next step are those of `start`, and controls and the pose of a driven base where they
  /// are after a share of a step that begins there.
  void SetInputsWithin(const MechanismState& start, double share);
  /// Between Begin and Predict: whether anything may touch it in this step. Then all forces act at the end of
  /// the step, as rows of contact ask: J (x⁺ + ContactShift()) is the mean velocity that they bound.
  void ExpectContact(bool touches) { touches_ = touches; }
  /// Between Begin and Predict: this step is of first order, implicit Euler's. By kMiddle all forces act at its
  /// end, and it goes all the way at the velocity that it ends with.
  void ActAtEnd() { touches_ = first_order_ = true; }
  /// What the mean velocity of a step has beyond x, after Predict [num_velocities].
  const VectorX& ContactShift() const { return contact_shift_; }
  /// Phase 1: free velocity x* under all forces but contact. Sets the operator for this h.
  void Predict(double h, const Vector3& gravity_W);
  /// Velocities [begin, begin + size) that neither inertia nor damping nor any contact group couples to the
  /// others: the fingers of a hand whose palm is held, for instance. W is formed and contacts are solved part
  /// by part.
  using Part = VelocityRange;
  const std::vector<Part>& parts() const { return parts_; }
  /// The part that moves group g; -1 where it only follows the base.
  int PartOfGroup(int g) const { return part_of_group_[static_cast<std::size_t>(g)]; }
  /// The part that moves length_limits()[k].
  int PartOfLimited(std::size_t k) const { return part_of_limited_[k]; }
  /// 6 x (size of its part) map from x to the twist of group g in R; the driven base's own twist comes on
  /// top.
  void GroupJacobian(int g, Eigen::Ref<Matrix6X> J) const;
  /// Twist of group g at velocity x: before Predict the present one, after it the free one.
  Vector6 GroupTwist(int g, const Eigen::Ref<const MatrixX>& J_T) const;
  /// After a step by kTwoSteps: the twist that its end velocities would have been at its start, along the
  /// axes of R then and about R's origin, J_T as then.
  Vector6 GroupTwistFromStart(int g, const Eigen::Ref<const MatrixX>& J_T) const;
  RigidTransform GroupPose(int g) const;
  /// Twist of group g in world axes about the origin of the body that names it.
  Vector6 GroupVelocity(int g) const { return BodyVelocity(groups_[static_cast<std::size_t>(g)].body); }
  /// Solves L Y = Jᵀ in place (columns of one part), A = L Lᵀ with the part's velocities from the last to the
  /// first, as the rows of Y are then: W = Yᵀ Y.
  void HalfSolve(const Part& part, Eigen::Ref<MatrixX> Jt) const;
  /// x += A⁻¹ Jᵀ F for generalized impulses p [num_velocities]. `from_outside`: other bodies or the world had
  /// part in them, so the base has gaps to keep; limits and self-contact are the mechanism's own affair.
  void ApplyImpulse(const VectorX& p, bool from_outside);
  /// Rate of a length per unit of its part's velocities, at the present pose (twist mode: the reference's).
  void LengthRow(const Mechanism::Length& length, const Part& part, Eigen::Ref<VectorX> row) const;
  double LengthRate(const Mechanism::Length& length) const;
  /// Counted from q = 0.
  double Length(const Mechanism::Length& length) const;
  /// tau [n] += what a force along a length is on the joints.
  void AddLengthForce(const Mechanism::Length& length, double force, VectorX& tau) const;
  /// The part that moves frictions()[k] of the mechanism.
  int PartOfFriction(std::size_t k) const { return part_of_friction_[k]; }
  /// Limits in force: those of the mechanism, widened to the initial pose where that was outside.
  const std::vector<Mechanism::LengthLimit>& length_limits() const { return length_limits_; }
  const std::vector<std::string>& warnings() const { return warnings_; }

  /// Whether servos with bounds or springs with slack make the step solve in rounds.
  bool HasSwitches() const { return !state_.at_bound.empty() || !slack_.empty(); }
  /// After contact: which servos are at a bound of their force at the present velocity, and which springs are
  /// slack. True if that differs from what the velocity was computed with; then PredictAgain and solve
  /// contact anew.
  bool UpdateSwitches(double h);
  /// The free velocity again, as before contact acted, with the servos at their bounds that are there now.
  void PredictAgain(double h);
  /// Servos and motors that give all they can.
  int NumForcesAtBound() const {
    return static_cast<int>(
        std::count_if(state_.at_bound.begin(), state_.at_bound.end(), [](signed char s) { return s != 0; }));
  }

  /// Newton iterations of the last step beyond the first: where forces bent more within it than one could
  /// follow.
  int NewtonSteps() const { return newton_steps_; }
  /// False where those iterations ended short of the minimum.
  bool FoundMinimum() const { return minimum_found_; }
  /// All that the next step depends on, into `out`; does not allocate where `out` has its sizes. Between
  /// steps.
  void Save(MechanismState& out) const;
  /// Puts back what Save gave, here or of another that was created the same way.
  void Restore(const MechanismState& state);
  /// Phase 2: moves the state by x⁺ over h and brings poses up to date.
  void Integrate(double h);
  /// Largest turn since the reference, as a share of the refresh angle, of joints whose turn matters, or gap
  /// of a loop that is closed by its curvature, as a share of the refresh gap. A wheel
  /// may spin, and a finger whose every motion the model has may bend. Steps of second order go by the modes
  /// of the reference: there a finger's turn matters.
  double Staleness(bool second_order = false) const;
  /// Moves the reference to the present pose. False if the mechanism cannot be reduced there: the old model
  /// stays.
  bool Refresh();

  double KineticEnergy() const;
  /// Springs, controls and gravity at the present pose [J].
  double PotentialEnergy(const Vector3& gravity_W) const;
  double ClosureGapNow() const;
  /// Forces of the rigid closures and couplings [num_constraints], in the order and axes of ClosureResidual:
  /// what the joined parts bear so that the residual stays 0, positive where springs and loads would open it.
  /// From the balance of joint forces after a step of h [s], by the metric of the loop correction where the
  /// interior is not in balance. What rows bear against each other where the joints can hardly yield stays
  /// that of `near` [num_constraints]. `contacts_R` [6 x bodies]: wrenches of the step's contacts in R. By
  /// twists zeros. Allocates.
  VectorX ClosureForces(double h, const Matrix6X& contacts_R, const VectorX& near) const;
  bool IsFinite() const {
    return x_.allFinite() && state_.reduced.z.allFinite() && configuration_.q.allFinite() &&
           state_.reduced.X_WR.IsFinite();
  }
  /// Pose of a body in the world at the present state.
  RigidTransform BodyPose(BodyIndex b) const;
  /// Of all bodies in the frame of its root, side by side where they are many.
  void BodyPoses(std::vector<RigidTransform>& X_RB) const;
  /// Twist of a body in world axes about its own origin.
  Vector6 BodyVelocity(BodyIndex b) const;

 private:
  explicit MechanismDynamics(ReducedModel model);
  const RowMatrixX& Q_now() const { return configuration_.Q_now; }
  void Size();
  void StartAtReference();
  void FindParts();
  void UpdateConfiguration(bool loops_are_closed = false);  // by the µ at hand
  void TakeReferenceForces();
  void Factor(double h);
  void LoadForces(const Vector3& gravity_R);
  void FollowLoads();
  const VectorX& WrenchForces();
  void ApplyStiffness(const VectorX& q, VectorX& force) const;
  void SolveFree(double h);
  void TakeMomenta();
  void TakeForces(double h);
  void ForgetInputs();
  // By twists (twist_step.cpp).
  void PredictTwist(double h, const Vector3& gravity_W);
  void LoadForcesTwist(const Vector3& gravity_R, const Vector6& A_R);
  void SolveFreeTwist(double h);
  void IntegrateTwist(double h);
  // Bounds of forces (force_limits.cpp).
  void SizeForceLimits();
  void OpenSwitches();
  void OpenForceLimits();
  bool AnyAtBound() const;
  bool ServosTurn() const;
  void TurnServos(double h);
  void TakeBoundedSpringsOut(double h);
  void TurnSprings(double h);
  void TurnDampers(double h);
  bool DampersTurn() const;
  // Modes are those of the reference's springs; only where all acts at the end are those of the pose as easily
  // taken.
  bool ActsAtPose() const {
    return options_.recovery != Recovery::kTwist && (rule_ != StepRule::kMiddle || all_at_end_);
  }
  bool TakesBentSprings() const {
    return rule_ == StepRule::kMiddle && all_at_end_ &&
           (has_bent_springs_ || (model().loop_rank() > 0 && !mechanism().force_limits().empty()));
  }
  void TakeStiffnessBeyond();
  void AddDampersBeyond(double weight, bool bent, const VectorX& w, Eigen::Ref<MatrixX> D);
  void FindDampers();
  void AddSpringOf(const Mechanism::Length& length, double weight, bool bends);
  void ReducedRow(const Mechanism::Length& length, const std::vector<PathState>& paths, const RowMatrixX& Q,
                  VectorX& out) const;
  const std::vector<PathState>& Paths() const { return configuration_.kinematics.paths; }
  void AddSwitchedForces();
  bool UpdateForceLimits(double h);
  // Springs that are slack over a range (slack.cpp).
  struct SlackSpring {
    std::size_t spring = 0;        // in springs()
    int side = 0;                  // at which the step takes it to end
    double length = 0, force = 0;  // at the start of the step
  };
  void FindSlackSprings();
  void OpenSlackSprings();
  bool SwitchesSlack() const { return rule_ != StepRule::kMiddle && options_.recovery != Recovery::kTwist; }
  bool UpdateSlackSprings(double h);
  double SlackStiffness(const SlackSpring& slack) const;
  void AddSlackForces();
  // Forces without potential (follower.cpp).
  void FindFollowers();
  void AddFollowerForce(double factor, VectorX& tau) const;
  double UnboundedForce(const Mechanism::ForceLimit& limit) const;
  double EnergyBeyondBounds() const;
  template <typename Pose>
  double BeyondBoundsTaken(const Pose& pose) const;
  void KeepBoundedLengths();
  double BeyondBoundsAtStart() const;
  bool base_moves() const { return mechanism().base() != BaseKind::kFixed; }
  void UpdateInertia();
  // The step of second order (theta_step.cpp, theta_minimum.cpp).
  void SizeTheta();
  // Lasting contact (two_steps.cpp).
  void KeepPast(double h);
  void TakePast(double h);
  void SolveFreeTwoSteps(double h);
  void IntegrateTwoSteps(double h);
  void MoveToMiddle(double h);
  void SolveFreeMiddle(double h);
  void SolveFreeMiddleWith(const ThetaScheme& rule, const VectorX& w_drag);
  double WorkOfChord(double h);
  void IntegrateMiddle(double h);
  void TurnAndMove(double h, double share_of_end);
  bool BendsTooMuch(double work);
  void TakeRelativeMotion(const Eigen::Ref<const VectorX>& w);
  double MinimiseAtEnd(double h);
  double EndForces(VectorX& f_z);
  const ThetaScheme& scheme() const { return all_at_end_ ? at_end_ : theta_; }
  void TakeVelocityAtEnd(double work);
  void MatchWork(double energy);
  double PotentialOfStep(const RigidTransform& X_WR) const;
  double PotentialOfSprings(const RigidTransform& X_WR, const Vector3& gravity_W) const;
  double PotentialEnergyOn(const RigidTransform& X_WR, const Vector3& gravity_W) const;
  double WayToForce(const Mechanism::Length& length, double h);
  void SpringPull(const VectorX& moved, VectorX& force);
  double Turn(int coordinate) const;
  struct PoseEnergy {
    bool valid = false;
    double springs = 0;                // J
    Vector3 moment = Vector3::Zero();  // Σ mass × centre in R [kg·m]
  };
  const PoseEnergy& EnergyOfPose() const;

  Options options_;
  MechanismState state_;
  Configuration configuration_;
  RigidParts rigid_parts_;
  std::vector<char> spins_;   // n: whether a joint may turn for ever without the model growing old
  std::vector<char> whole_;   // n: the same, of the model at hand, but for its modes
  ReducedJacobian jacobian_;  // of configuration_
  ReducedInertia inertia_;
  std::vector<ContactGroup> groups_;
  std::vector<Part> parts_;
  VectorX coordinate_reach_;  // r: most that a joint moves per z, slides in lengths of the mechanism
  std::vector<int> part_of_group_, part_of_limited_, part_of_friction_;
  std::vector<Mechanism::LengthLimit> length_limits_;
  std::vector<std::string> warnings_;
  int base_size_ = 0;  // 6 where the base floats

  Vector6 V_R_before_ = Vector6::Zero();  // base twist at the start of the step
  Vector3 drift_R_ = Vector3::Zero();     // velocity of a floating mechanism's centre of mass at that time
  bool pushed_ = false;                   // contact from outside acted in this step

  // Between refreshes.
  VectorX rest_, q_perp_step_, stretched_, held_back_;  // n
  MatrixX stiffness_ref_;       // n x n: K_q at the reference where it is not diagonal and q_perp is there
  std::vector<WeightedRows> dampers_;      // of joints
  MatrixX joint_damping_ref_;  // r x r, lower triangle, with loops: what dampers of joints are in D of the model
  MatrixX A_, M_full_;                             // num_velocities²
  MatrixX D_beyond_, K_beyond_;                    // r x r, scratch
  Cholesky factor_;
  double factored_h_ = -1;
  VectorX f_ref_;              // twist mode: Qᵀ g_ref
  double springs_ref_ = 0;     // twist mode: J in the springs at the reference
  MatrixX gravity_map_;        // twist mode: r x 3, force per unit gravity in R at the reference
  MatrixX control_map_;        // twist mode: r x controls
  Matrix6X base_gravity_map_;  // 6 x 3

  MatrixX rigid_motion_map_;  // twist mode: r x 36, force per entry of ξξᵀ at the reference

  // Scratch of a step.
  Matrix6 M_00_;
  Matrix6X M_0z_;  // of the present pose
  VectorX q_dot_, q_ddot_;
  Vector3 gravity_W_ = Vector3::Zero();
  std::vector<PathState> paths_ref_;                  // at the reference of the model
  std::vector<double> spring_stiffness_ref_;          // of springs() at the reference
  std::vector<SlackSpring> slack_;                    // those of springs() that have slack
  bool has_followers_ = false;                        // forces along lengths without potential
  bool has_follower_springs_ = false;                 // and some of them hang on the length
  bool has_bent_springs_ = false;                     // of paths, or not linear
  VectorX limit_force_, limit_row_, f_z_of_springs_;  // force limits: f₀, Qᵀe, and f_z without bounds
  std::vector<std::pair<double, double>> limits_start_;  // force without bounds and length at the start
  Vector6 V_free_ = Vector6::Zero();  // base twist without drift that the free solve starts from
  mutable PoseEnergy pose_energy_;
  VectorX z_before_, w_before_;  // at the start of the step
  RigidTransform X_WR_before_;
  VectorX x_, rhs_, solved_, f_z_, g_, tau_, momentum_;
  Matrix6X F_;
  Vector6 base_force_;
  double relaxed_ = 0;  // J, what q_perp gave up in this step

  // A step of second order.
  StepRule rule_ = StepRule::kEuler;   // of the step at hand
  ThetaScheme theta_, at_end_;         // the modal rule, and all forces at the end
  bool all_at_end_ = false;            // which of the two this step takes
  bool touches_ = false;               // something may touch it in this step
  bool first_order_ = false;           // ActAtEnd()
  double order_ = 1;                   // by two steps velocities of the end are x_ times this
  Vector6 V_end_ = Vector6::Zero();    // of a driven base at the end of the step
  MechanismPast past_next_;            // what the next step will know of this one's start
  VectorX q_dot_mixed_;                // n
  VectorX w_start_;                    // r: rates at the start beside the base's own motion of then
  VectorX contact_shift_;              // num_velocities
  Configuration elsewhere_;            // of the pose that configuration_ is not at
  MaterialVelocities start_velocity_, other_velocity_;
  Cholesky inertia_factor_;
  VectorX u_;            // velocity of the start as the middle sees it
  VectorX q_dot_start_;  // n
  VectorX w_mean_, f_used_, f_turn_, f_wrench_;
  VectorX f_moved_;              // r: what controls that move within the step add to the force by its end
  bool controls_moved_ = false;  // in this step
  Matrix6X F_parts_;
  Vector6 base_wrench_;
  VectorX impulse_;            // num_velocities: of contact and limits in this step
  bool minimum_found_ = true;  // in this step, where one was sought
  int newton_steps_ = 0;       // beyond the first, in this step
  Vector3 center_W_, linear_W_;  // of a floating mechanism: centre of mass [m], momentum [N·s]
  Vector3 linear_end_;  // at the end of the step, in the axes of R of its start
  double potential_start_ = 0, potential_size_ = 0;  // J, and of the terms that make it
  RigidTransform
      weighed_on_;  // where a driven base stands while weights work, so that its own way counts for none
};

}  // namespace fork1s
