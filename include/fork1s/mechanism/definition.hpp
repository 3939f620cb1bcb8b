// Definition structs that a user or an importer fills before a Mechanism is built.
#pragma once

#include <array>
#include <fork1s/base/error.hpp>
#include <fork1s/base/index.hpp>
#include <fork1s/geometry/shape.hpp>
#include <fork1s/spatial/rigid_transform.hpp>
#include <fork1s/spatial/spatial_inertia.hpp>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace fork1s {

/// A shape fixed to a body, with its contact parameters.
struct GeometryDef {
  std::string name;
  Shape shape = Sphere{};
  RigidTransform X_BG;  // pose of the shape in its body (world geometry: in the world)
  double friction = 1;  // sliding coefficient; a pair takes the larger, or the higher priority's
  int priority = 0;
  int contype = 1;  // two shapes may touch if (contype1 & conaffinity2) | (contype2 & conaffinity1)
  int conaffinity = 1;
  bool frictionless = false;  // MJCF condim = 1
  double torsion = 0.005;   // m: moment about the normal that a contact bears, as a share of the normal force
  double rolling = 0.0001;  // m: the same about the tangents
  int moments =
      0;  // 0: contacts bear none, 1: torsion, 2: rolling too (condim 3, 4, 6); a pair takes the more
  double restitution = 0;  // share of its speed with which parts again what meets it, 0 to 1; a pair has the
                           // mean of its damping ratios (restitution.hpp), or the higher priority's
  double margin = 0;       // m: distance of the contact surface from the shape, outwards; a pair has the sum
  double gap = 0;  // m: how far beyond its margin a shape is within reach of adhesion; a pair has the sum
  double adhesion =
      0;  // N: what each contact pulls both sides together by; a pair has the sum, or the higher priority's
  /// [ω; v] that its surface moves by within itself, as a belt's or turntable's does, in and about the frame of the shape
  /// [rad/s, m/s]; contacts feel its part along their tangents and the spin about their normal.
  Vector6 surface_velocity = Vector6::Zero();
  std::vector<int> pairs;  // explicit contact pairs of which it is one side: indices in Scene::contact_pairs
  Vector4 rgba = Vector4(0.6, 0.6, 0.6, 1);
  int group = 0;  // for drawing only
  /// For drawing only, of meshes with corner_uv and of planes; it multiplies rgba. None: nullptr.
  std::shared_ptr<const Picture> picture;
  double picture_x = 0, picture_y = 0;  // 1/m: pictures along x and y of a plane, one in its middle

  bool Collides() const { return contype != 0 || conaffinity != 0 || !pairs.empty(); }
};

/// Contact law of two shapes that touch whatever contype, conaffinity, ParentFilter and
/// Scene::excluded_pairs say. GeometryDef::pairs names it on both sides.
struct ContactPairDef {
  std::string name;
  double friction = 1;  // sliding coefficient
  /// Shares of it along the first and the second tangent of ContactPoint::frame.
  Vector2 friction_scale = Vector2::Ones();
  double torsion = 0;  // m: moment about the normal as a share of the normal force
  double rolling = 0;  // m: the same about the tangents
  double restitution = 0;
  double margin = 0;    // m: distance at which the shapes touch
  double gap = 0;       // m: how far beyond it adhesion pulls
  double adhesion = 0;  // N: of each contact
};

/// One degree of freedom of a joint.
struct FreedomDef {
  Vector6 screw_B =
      Vector6::Zero();   // [ω; v] per unit of the displacement, about B's origin, in B, at the reference
  double stiffness = 0;  // N·m/rad or N/m
  double damping = 0;    // N·m·s/rad or N·s/m
  double armature = 0;   // rotor inertia seen at the joint, kg·m² or kg
  double rest = 0;       // displacement from the reference at which the spring is unloaded, rad or m
  double lower = -std::numeric_limits<double>::infinity();  // limits of the displacement, rad or m
  double upper = std::numeric_limits<double>::infinity();
};

enum class JointKind { kHinge, kSlide, kBall, kCylindrical, kPlanar, kFree, kGeneral };

/// A joint moves body B relative to its parent by Exp(Σ screw_i q_i). Several joints on one body
/// compose in the order in which they were added, the first being nearest the parent.
struct JointDef {
  std::string name;
  BodyIndex body;
  JointKind kind = JointKind::kGeneral;
  std::vector<FreedomDef> freedoms;  // 1 to 6, linearly independent

  static JointDef Hinge(std::string name, BodyIndex body, const Vector3& axis_B,
                        const Vector3& anchor_B = Vector3::Zero());
  static JointDef Slide(std::string name, BodyIndex body, const Vector3& axis_B);
  static JointDef Ball(std::string name, BodyIndex body, const Vector3& anchor_B = Vector3::Zero());
  /// Turns about and slides along one axis.
  static JointDef Cylindrical(std::string name, BodyIndex body, const Vector3& axis_B,
                              const Vector3& anchor_B = Vector3::Zero());
  /// Turns about `normal_B` and slides across it.
  static JointDef Planar(std::string name, BodyIndex body, const Vector3& normal_B,
                         const Vector3& anchor_B = Vector3::Zero());
  static JointDef Free(std::string name, BodyIndex body);
  /// Any 1 to 6 independent screws [ω; v] about the origin of B.
  static JointDef General(std::string name, BodyIndex body, const Matrix6X& screws_B);

  /// The same spring and damper on every freedom.
  JointDef& WithSpring(double stiffness, double damping = 0);
  JointDef& WithArmature(double armature);
  JointDef& WithRest(double rest);
  JointDef& WithLimits(double lower, double upper);
};

/// Two hinges that cross: first about axis1 (parent side), then about axis2.
std::pair<JointDef, JointDef> UniversalJoint(const std::string& name, BodyIndex body, const Vector3& axis1_B,
                                             const Vector3& axis2_B,
                                             const Vector3& anchor_B = Vector3::Zero());

struct BodyDef {
  std::string name;
  BodyIndex parent;        // invalid for the base, which must be body 0
  RigidTransform X_PB;     // pose in the parent at the reference
  SpatialInertia inertia;  // in B
  std::vector<GeometryDef> geometries;
  double gravity_compensation = 0;  // share of the weight that is compensated, as in MJCF; 1: all of it
};

/// Closes a loop between frame J on body a and frame J on body b. With E = X_aJ⁻¹ X_bJ the closure
/// works on c = [log R_E ; p_E] (rotation rad, translation m); a direction is rigid, springy or free.
struct ClosureDef {
  std::string name;
  BodyIndex body_a;
  BodyIndex body_b;
  RigidTransform X_AJ;  // frame on body a
  RigidTransform X_BJ;  // frame on body b
  Eigen::Matrix<bool, 6, 1> rigid = Eigen::Matrix<bool, 6, 1>::Constant(false);
  Vector6 stiffness = Vector6::Zero();  // of directions that are not rigid: N·m/rad, N/m; 0 = free
  Vector6 damping = Vector6::Zero();

  /// All six directions rigid.
  static ClosureDef Weld(std::string name, BodyIndex a, BodyIndex b, const RigidTransform& X_AJ,
                         const RigidTransform& X_BJ);
  /// A point of a stays on a point of b; rotation is free.
  static ClosureDef Connect(std::string name, BodyIndex a, BodyIndex b, const Vector3& point_A,
                            const Vector3& point_B);
};

/// One freedom of one joint.
struct FreedomRef {
  JointIndex joint;
  int freedom = 0;
};

/// q_a = Σ polynomial[k] q_b^k + Σ coefficient q of `terms`. Without b the polynomial is its constant. No freedom
/// occurs twice.
struct CouplingDef {
  std::string name;
  FreedomRef a;
  FreedomRef b;  // b.joint may be invalid
  double polynomial[5] = {0, 1, 0, 0, 0};
  std::vector<std::pair<FreedomRef, double>> terms = {};
};

/// Element of a spatial tendon, in order: a point of a body, an obstacle that it wraps around if the straight line
/// would pass through it, or a pulley, after which another branch begins.
struct PathElementDef {
  enum class Kind { kPoint, kSphere, kCylinder, kPulley };
  Kind kind = Kind::kPoint;
  BodyIndex body;       // not of a pulley
  RigidTransform X_BE;  // point: its place; sphere: centre; cylinder: centre, its axis along z
  double radius = 0;    // m, of an obstacle
  double divisor = 1;   // pulley: weight 1 / divisor of the following branches
  bool has_side =
      false;            // obstacle with a side site; a site within the obstacle: the tendon passes inside it
  BodyIndex side_body;  // that point's
  Vector3 side_B = Vector3::Zero();  // m, in side_body
};

/// Kind of a path (docs/method.md, section 5).
enum class PathKind {
  /// A spatial tendon. Every branch begins and ends with a point, obstacles are between points.
  kTendon,
  /// A rod of length `rod` from the point elements[1] to a pin on the z axis of elements[0]: where on that
  /// axis the pin is, on the side from which the rod pushes up the axis.
  kSliderCrank,
  /// A force that turns with a body: `gear` at the origin of elements[0], in its axes, which has no length.
  /// With a second element it is in that one's axes, and acts back on it by -gear at its own origin; the
  /// length is gear · [log R; p] of the pose of the first in the second.
  kWrench,
  /// The angle [rad] by which the first of two frames is turned in the second, 0 to π.
  kAngle,
};

/// A length that is a nonlinear function of the pose.
struct PathDef {
  std::string name;
  std::vector<PathElementDef> elements;
  PathKind kind = PathKind::kTendon;
  double rod = 0;                  // m, of a slider-crank
  Vector6 gear = Vector6::Zero();  // [moment; force] per unit of force, of a wrench
};

/// A path as a length: gear times its elongation from the reference.
struct PathRef {
  int path = -1;  // index in MechanismDef::paths; -1: none
  double gear = 1;
};

/// A spring on the length ℓ = Σ coefficient q, such as a servo that pulls a tendon over several joints, or on
/// that of a path: ℓ counts from the reference, where it is 0. Both are summed, here and in what follows. Terms
/// may mix turns and slides: {slide, 1}, {turn, pitch/2π} act along a screw.
struct SpringDef {
  std::string name;
  std::vector<std::pair<FreedomRef, double>> terms;
  double stiffness = 0;  // N/m or N·m/rad of the length
  double damping = 0;
  double rest = 0;  // length at which it is unloaded
  PathRef along = {};
  // Beyond what is linear, per power: N/m² and N/m³ of the stretch s from rest, N·s²/m² and N·s³/m³ of its
  // rate v, or those of an angle. The force is -(k s + k₂ s² + k₃ s³) - (d v + d₂ v |v| + d₃ v³).
  std::array<double, 2> higher_stiffness = {}, higher_damping = {};
  // Slack, as a rope or a stop with play is: from rest to rest + slack there is no force but the damper's,
  // and s is the stretch beyond the nearer end.
  double slack = 0;  // of the length, 0 or more
};

/// Dry friction: a force of at most `force` along the length Σ coefficient q, against its rate; it holds the
/// length still as long as that is enough.
struct DryFrictionDef {
  std::string name;
  std::vector<std::pair<FreedomRef, double>> terms;
  double force = 0;  // N, or N·m where the length is an angle
  PathRef along = {};
};

/// A stop: the length Σ coefficient q stays within [lower, upper], as a rope that is not longer than it is.
/// Limits of single freedoms stand in FreedomDef.
struct LengthLimitDef {
  std::string name;
  std::vector<std::pair<FreedomRef, double>> terms;
  double lower = -std::numeric_limits<double>::infinity();
  double upper = std::numeric_limits<double>::infinity();
  PathRef along = {};
};

/// A servo or motor with bounded force: f = Σ share gain u - stiffness (ℓ - rest) - damping dℓ/dt on the
/// length ℓ = Σ coefficient q stays within [lower, upper]. Spring, damper and controls are defined elsewhere in
/// the mechanism and repeated here, so that force beyond the bounds can be subtracted.
struct ForceLimitDef {
  std::string name;
  std::vector<std::pair<FreedomRef, double>> terms;
  std::vector<std::pair<std::string, double>> inputs;  // name of a control, its share in f
  double stiffness = 0;                                // of the length: N/m or N·m/rad
  double damping = 0;
  double rest = 0;                                          // of the length
  double lower = -std::numeric_limits<double>::infinity();  // N or N·m
  double upper = std::numeric_limits<double>::infinity();
  PathRef along = {};
};

/// How the activation a of a control, by which its force is gain·a, follows its input u.
enum class ControlDynamics {
  kNone,        ///< a = u
  kLag,         ///< da/dt = (u - a)/time_constant
  kIntegrator,  ///< da/dt = u
  /// da/dt = (u - a)/τ with u held between 0 and 1: τ = time_constant (0.5 + 1.5 a) where a rises, deactivation_time /
  /// (0.5 + 1.5 a) where it falls, a held between 0 and 1 in both.
  kMuscle,
};

/// An input u that pushes with force gain·coefficient·u on each of its freedoms, and gain·u along a path. For
/// a servo the gain is its stiffness, so that u is the set-point; the stiffness itself stands in a joint or
/// SpringDef. Where the control has dynamics, its activation takes the place of u in all that.
struct ControlDef {
  std::string name;
  std::vector<std::pair<FreedomRef, double>> terms;
  double gain = 0;
  bool is_setpoint = false;  // gain scales with the stiffness of the mechanism
  double lower = -std::numeric_limits<double>::infinity();
  double upper = std::numeric_limits<double>::infinity();
  double initial = 0;
  PathRef along = {};
  ControlDynamics dynamics = ControlDynamics::kNone;
  double time_constant = 0;  // s, above 0, of a lag, and of a muscle whose activation rises
  // Of the activation, in units of u, or u·s where it is integrated; it stops at its bounds.
  double activation_lower = -std::numeric_limits<double>::infinity();
  double activation_upper = std::numeric_limits<double>::infinity();
  double initial_activation = 0;
  double deactivation_time = 0;  // s, of a muscle whose activation falls
  double smoothing =
      0;  // of a muscle: over this range of u - a its τ goes from one to the other; 0: it jumps
  // Of a servo: its own spring rests at the length setpoint_rest + setpoint_per_unit·u [m or rad].
  double setpoint_per_unit = 1, setpoint_rest = 0;
  bool is_velocity_setpoint = false;  // gain is the damping of its servo and scales with it

  /// What the spring of a servo stores more with the input u than without, at length 0 [J].
  double SetPointEnergy(double u) const {
    return is_setpoint ? gain * u * (setpoint_rest + 0.5 * setpoint_per_unit * u) : 0;
  }
};

/// A muscle with the curves of MuJoCo: the force along the length ℓ is
///     -force (a F_L(L) F_V(V) + F_P(L)),   V = dL/dt / vmax
/// with the activation a of a control and the normalized length L: from range_lower at length_lower to range_upper at
/// length_upper, 1 where the muscle is strongest.
struct MuscleDef {
  std::string name;
  std::vector<std::pair<FreedomRef, double>> terms;
  std::string control;                        // name
  double force = 0;                           // N: at a = 1, L = 1 and V = 0
  double length_lower = 0, length_upper = 0;  // m, counted from the reference
  double range_lower = 0.75, range_upper = 1.05;
  double lmin = 0.5, lmax = 1.6;  // L between which it can act
  double vmax = 1.5;              // 1/s: dL/dt at which the force is 0
  double fpmax = 1.3;             // twice F_P half way from L = 1 to lmax; it is linear beyond
  double fvmax = 1.2;             // F_V at large lengthening velocities
  PathRef along = {};
};

/// Suction: the force [N] gain · (activation or input of a control), within its bounds, pulls the shapes of a body and
/// what they touch together. All contact points of the body whose gap is at most GeometryDef::gap have equal shares of
/// it, along their normals; without such a point there is no force. Contact and friction bear the compression.
struct AdhesionDef {
  std::string name;
  std::string body;
  std::string control;                                      // name
  double gain = 0;                                          // N per unit of the control
  double lower = -std::numeric_limits<double>::infinity();  // N
  double upper = std::numeric_limits<double>::infinity();   // N
};

/// A closure that a control switches while a simulation runs. While IsOn(control), frame J of a body of this
/// mechanism and frame J of another body of the scene are held together, exactly, however large the force. How far they
/// are apart when it is switched on falls by exp(-t / time_constant).
struct SwitchedClosureDef {
  std::string name;
  std::string body_a;   // of this mechanism
  std::string body_b;   // of any mechanism, a free body, or "world"
  RigidTransform X_AJ;  // frame on body a
  RigidTransform X_BJ;  // frame on body b
  /// Directions held, in the axes of J on body a, as of ClosureDef; of rotations all, all but that about z, or none.
  Eigen::Matrix<bool, 6, 1> rigid = Eigen::Matrix<bool, 6, 1>::Constant(true);
  std::string control;          // name
  double time_constant = 0.02;  // s

  static bool IsOn(double control_value) { return control_value > 0.5; }
};

enum class BaseKind {
  kFixed,     ///< still at X_WR
  kFloating,  ///< moves freely, gravity acts on it
  kDriven,    ///< follows a prescribed pose
};

/// Which joints exclude contact between the two bodies that they join. Closures always do.
enum class ParentFilter {
  kAll,     ///< all
  kMoving,  ///< those whose parent can move, as in MJCF: a fixed base is part of the still world
  kNone,
};

/// Which fixed-interface modes a reduced model keeps when it does not keep all.
enum class ModeChoice {
  kLowest,        ///< those of lowest frequency (Craig and Bampton)
  kContribution,  ///< those of largest contribution to the displacement of the interface
};

/// Definition of one mechanism.
struct MechanismDef {
  std::string name;
  BaseKind base = BaseKind::kFixed;
  RigidTransform X_WR;          // pose of the base in the world at the reference
  std::vector<BodyDef> bodies;  // bodies[0] is the base; parents come before children
  std::vector<JointDef> joints;
  std::vector<ClosureDef> closures;
  std::vector<CouplingDef> couplings;
  std::vector<PathDef> paths;
  std::vector<SpringDef> springs;
  std::vector<ControlDef> controls;
  std::vector<DryFrictionDef> frictions;
  std::vector<LengthLimitDef> length_limits;
  std::vector<ForceLimitDef> force_limits;
  std::vector<MuscleDef> muscles;
  std::vector<AdhesionDef> adhesions;
  std::vector<SwitchedClosureDef> switched_closures;
  std::vector<std::string> interfaces;  // names of the bodies that touch the world
  bool interfaces_chosen = true;        // false: picked by the importer, not named by the user
  int modes = 4;                        // fixed-interface modes to keep
  bool modes_by_step = true;            // more where the time step resolves more: ReductionOptions::step
  ModeChoice mode_choice = ModeChoice::kLowest;
  ParentFilter parent_filter = ParentFilter::kAll;

  /// Joints that move a part of a path against another and so may change its length, ascending.
  std::vector<JointIndex> JointsOfPath(int path) const;
  /// Whether `parent_filter` applies to a joint whose parent is rigid with the base (true) or moves.
  bool FiltersParent(bool parent_is_base) const {
    if (parent_filter == ParentFilter::kMoving) return !(parent_is_base && base == BaseKind::kFixed);
    return parent_filter == ParentFilter::kAll;
  }
  BodyIndex FindBody(const std::string& body_name) const;
  JointIndex FindJoint(const std::string& joint_name) const;
};

}  // namespace fork1s
