// The work table of one import: the compiled model, what is being built, and who became what.
#pragma once

#include <mujoco/mujoco.h>
#include <algorithm>
#include <fork1s/importer/importer.hpp>
#include <fork1s/mechanism/mechanism.hpp>
#include <fork1s/mechanism/scene.hpp>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "actuator_law.hpp"

namespace fork1s::internal {

/// Where a body of the file ended up.
struct BodyPlace {
  int mechanism = -1;  // index in Scene::mechanisms
  BodyIndex body;      // in that mechanism
  int free_body = -1;  // index in Scene::free_bodies
  bool still() const { return mechanism < 0 && free_body < 0; }
};

struct JointPlace {
  int mechanism = -1;  // -1: the joint became a base or a free body
  JointIndex joint;    // of a free joint its position; the one after it is its rotation
};

/// Trees of the file that move together as one mechanism.
struct Component {
  std::vector<int> tops;  // children of the world, as MuJoCo body ids
  BaseKind base = BaseKind::kFixed;
  int base_body = 0;       // MuJoCo id; 0: a massless body named "world"
  bool free_body = false;  // a single rigid body without joints of its own
};

/// Bookkeeping beside a ControlDef.
struct ControlSource {
  int ctrl = -1;       // index of the file's control; -1: made by pd, or of a switched equality
  int act = -1;        // of its activation, of a control with dynamics
  bool motor = false;  // pushes on one freedom and holds nothing
  bool servo = false;  // has a position gain
  std::vector<int> dofs;
  std::vector<std::pair<int, double>> pd;  // dof and rest, for controls made by pd
  PdGains gains;                           // of those
};

/// A coupling read from a URDF mimic: q_joint = offset + multiplier q_leader.
struct Mimic {
  std::string joint, leader;
  double multiplier = 1, offset = 0;
};

/// The base of option or <custom>, where one of them names any.
struct WantedBase {
  std::optional<BaseKind> kind;
  std::string where = "option base";  // in messages
  ErrorCode code = ErrorCode::kUsage;
};

struct Conversion {
  Conversion(const mjModel& model, const mjData& data, std::string file_name)
      : m(model), d(data), file(std::move(file_name)) {}

  const mjModel& m;
  const mjData& d;   // kinematics and lengths at qpos0
  std::string file;  // in messages
  bool is_urdf = false;
  std::set<std::string> self_colliding;  // links that a URDF says touch their own robot
  std::map<std::string, double> start;   // rad or m, of joints, as the file has them beside qpos0
  std::set<std::string> hinges;          // welds of sites that leave the rotation about z free

  Scene scene;
  ImportReport report;
  WantedBase wanted_base;
  std::vector<Component> components;
  std::vector<BodyPlace> body;    // per MuJoCo body
  std::vector<JointPlace> joint;  // per MuJoCo joint
  std::vector<int> shape;         // per MuJoCo geom: index among those of its body in `scene`; -1: left out
  std::vector<bool> rigid_root;  // per MuJoCo body: its free joint and a weld to the base became a fixed link
  std::vector<bool> used_equality;
  std::vector<bool> switched_by_name;  // per equality: options or <custom> name it as one that is switched
  std::vector<std::string> body_names, joint_names, actuator_names, sensor_names;

  // Per degree of freedom of MuJoCo: force = c - k q of all that acts on this freedom alone.
  std::vector<double> k, c;
  std::vector<std::vector<std::string>> held_by;
  std::vector<bool> in_spring, coupled;
  std::vector<std::vector<ControlSource>> controls;                 // parallel to MechanismDef::controls
  std::vector<int> path_of_tendon, path_of_actuator, path_of_ball;  // in its mechanism; -1: not yet made
  int initial_keyframe = -1;
  std::vector<SensorDef> actuators;  // what evaluates their forces
  std::vector<FileFrame> frames;

  void Note(ImportNote::Kind kind, std::string where, std::string message);
  void Dropped(std::string where, std::string message) {
    Note(ImportNote::Kind::kDropped, std::move(where), std::move(message));
  }
  /// One note for several elements of a kind; nothing for none.
  void NoteMany(ImportNote::Kind note, const std::string& kind, const std::vector<std::string>& names,
                const std::string& message);
  void DroppedMany(const std::string& kind, const std::vector<std::string>& names, const std::string& why) {
    NoteMany(ImportNote::Kind::kDropped, kind, names, why);
  }
  void ChangedMany(const std::string& kind, const std::vector<std::string>& names, const std::string& how) {
    NoteMany(ImportNote::Kind::kChanged, kind, names, how);
  }

  RigidTransform WorldPose(int body) const;  // at qpos0
  FreedomRef Freedom(int dof) const;         // joint invalid if the dof is not part of a mechanism
  int MechanismOf(int dof) const;
  FreedomDef& FreedomOf(int dof);
  std::string DofName(int dof) const;  // joint name, with its axis if it has several
  double Reference(int dof) const;     // qpos0 of a hinge or slide, 0 otherwise
  const char* StiffnessUnit(int dof) const;
  bool IsActive(int equality) const;  // on in the file, and for good
  /// A control of its name switches it: a weld or connect with a name that is off in the file, or named as switched.
  bool IsSwitchable(int equality) const;
  bool EqualityWorks(int equality) const;  // active, understood, and joins something
  /// What a length is in a definition: `terms` of freedoms, or a path, which is made where it is asked for
  /// the first time.
  template <class Def>
  void PutLength(const Length& length, Def& def) {
    if (length.has_path())
      def.along = {PathOf(length), length.gear};
    else
      for (const auto& [dof, coefficient] : length.terms) def.terms.emplace_back(Freedom(dof), coefficient);
  }
  int PathOf(const Length& length);
  Error ModelError(const std::string& where, const std::string& message) const;
};

/// A limit of MuJoCo's where it comes to bear: `margin` inside of `range`, in the middle where that is beyond it.
inline std::pair<double, double> LimitedRange(const mjtNum* range, double margin) {
  const double inside = std::min(margin, (range[1] - range[0]) / 2);
  return {range[0] + inside, range[1] - inside};
}

/// MuJoCo's arrays as vectors and quaternions.
inline Vector3 Vec3(const mjtNum* p) { return {p[0], p[1], p[2]}; }
inline Quaternion Quat(const mjtNum* q) { return Quaternion(q[0], q[1], q[2], q[3]); }

/// Body of a mechanism that stands for a body of the file; still bodies are part of the base.
struct Anchor {
  BodyIndex body;
  RigidTransform X_AB;  // the file's body in it
};
Anchor AnchorIn(const Conversion& c, int mechanism, int body);

/// An equality of joints or of fixed tendons as the row of a CouplingDef, of displacements by MuJoCo's degrees of
/// freedom: x_a = polynomial(x_b) + Σ coefficient x of `terms`; b = -1: none. Where no joint has a part in it a = -1
/// as well, and it says 0 = polynomial[0].
struct JointEquality {
  int a = -1, b = -1;
  double polynomial[5] = {};
  std::vector<std::pair<int, double>> terms;

  bool is_linear() const { return polynomial[2] == 0 && polynomial[3] == 0 && polynomial[4] == 0; }
  /// a, b and those of the terms; empty where no joint has a part in it.
  std::vector<int> Dofs() const;
};
/// Nothing for other kinds, nor where two of its joints are in a polynomial of second or higher order (closures.cpp).
std::optional<JointEquality> JointEqualityOf(const Conversion& c, int equality);
/// What is wrong with equalities of joints and tendons: none of their joints has a part, or they contradict each other.
std::optional<Error> CheckJointEqualities(const Conversion& c);

/// Where an equality holds on one of its two bodies (`which` 0 or 1): a body's origin, or a site on a body.
struct EqualityPlace {
  int body = 0;  // MuJoCo's
  RigidTransform X_BS;
};
EqualityPlace PlaceOfEquality(const mjModel& m, int equality, int which);
inline bool HoldsSites(const mjModel& m, int equality) { return m.eq_objtype[equality] == mjOBJ_SITE; }

/// Frames J on both bodies that a connect or weld holds together, in these bodies, and the directions in which it does.
struct EqualityFrames {
  RigidTransform X_AJ, X_BJ;
  Eigen::Matrix<bool, 6, 1> rigid = Eigen::Matrix<bool, 6, 1>::Constant(true);
};
EqualityFrames FramesOfEquality(const Conversion& c, int equality);
/// Whether two bodies of the file are no single rigid one.
bool MovesRelative(const mjModel& m, int a, int b);
/// Name in the scene of a body of the file; "world" of a still one.
std::string SceneName(const Conversion& c, int body);

std::string NameOr(const mjModel& m, int address, const char* kind, int id);

/// Everything below, in order (importer.cpp).
std::optional<Error> Convert(Conversion& c, const ImportOptions& options, const std::vector<Mimic>& mimics);

/// Sets c.wanted_base (interfaces.cpp).
std::optional<Error> FindWantedBase(Conversion& c, const ImportOptions& options);
/// Which trees form which mechanism (components.cpp).
std::optional<Error> FindComponents(Conversion& c);
/// Bodies, joints and free bodies of every component (bodies.cpp).
void ConvertBodies(Conversion& c);
/// Shapes (geoms.cpp).
void ConvertGeoms(Conversion& c);
/// Meshes in a unit that cannot be, and hollow ones (mesh_notes.cpp).
void ListDoubtfulMeshes(Conversion& c);
/// Closures, couplings, excluded pairs (closures.cpp).
void ConvertEqualities(Conversion& c);
/// Which equalities options or <custom> name as switched (switched_equalities.cpp); before all that asks for IsActive.
std::optional<Error> FindSwitchedByName(Conversion& c, const ImportOptions& options);
/// Equalities that a control switches; after ConvertActuators, whose names are taken.
void ConvertSwitchedEqualities(Conversion& c);
/// Their bodies become interface bodies; after ApplyCustom.
void AddSwitchedInterfaces(Conversion& c);
std::optional<Error> ConvertMimics(Conversion& c, const std::vector<Mimic>& mimics);
/// Actuators as inputs and springs (actuators.cpp).
bool TendonWorks(const mjModel& m, const mjData& d, int tendon);
void ConvertActuators(Conversion& c);
/// The input of an actuator as a control of a mechanism that acts along no length yet; it is the last one.
ControlDef& AddControl(Conversion& c, int actuator, int mechanism, const ActuatorInput& input);
/// Adhesion actuators (adhesion.cpp).
bool IsAdhesion(const mjModel& m, int actuator);
/// Whether it is one that no option of the file switches off.
bool ActsByAdhesion(const mjModel& m, int actuator);
void ConvertAdhesions(Conversion& c);
/// Dry friction, and bounds of what actuators give (bounded_forces.cpp); after ApplyPd.
void ConvertBoundedForces(Conversion& c);
/// Sensors (sensors.cpp); after ApplyPd, which takes the place of motors.
void ConvertSensors(Conversion& c);
/// Springs of joints and tendons (springs.cpp); FinishSprings writes k and c into the freedoms.
void ConvertSprings(Conversion& c);
void FinishSprings(Conversion& c);
/// Text of that name in the file's <custom> (interfaces.cpp).
std::optional<std::string> CustomText(const mjModel& m, const std::string& name);
/// Names with blanks or commas between; a comma within a known name is part of it.
std::vector<std::string> ListedNames(const std::string& text,
                                     const std::function<bool(const std::string&)>& is_known);
/// Interfaces, base and modes, from options or the file's <custom>.
std::optional<Error> ApplyCustom(Conversion& c, const ImportOptions& options);
/// Initial states (keyframes.cpp).
std::optional<Error> ConvertKeyframes(Conversion& c, const std::string& wanted);
/// Stops of tendons and ball joints (bounded_forces.cpp).
void ConvertLengthLimits(Conversion& c);
/// Base pose and joint coordinates of the options, followers with an offset, joints and tendons inside their limits,
/// loops closed (initial_state.cpp); before ApplyPd, which holds it.
std::optional<Error> ApplyInitialState(Conversion& c, const ImportOptions& options,
                                       const std::vector<Mimic>& mimics);
/// The initial state so far: the chosen keyframe, or the file's reference (initial_state.cpp).
KeyframeDef PresentStart(const Conversion& c);
/// Makes a state the initial one, as a keyframe "start" of its own.
void AddStart(Conversion& c, KeyframeDef start);
/// Set-points of position servos at where each keyframe, and the start, has their joints (held_start.cpp); after
/// ApplyPd, whose set-points hold them already.
std::optional<Error> ApplyHold(Conversion& c, const ImportOptions& options);
/// Whether body b touches anything: it is rigid with the base or with an interface body.
bool Touches(const Mechanism& mechanism, int b);
/// A plane under the model (ground.cpp).
std::optional<Error> ApplyGround(Conversion& c, const ImportOptions& options);
/// Pairs of bodies of one mechanism that overlap at the start and cannot part never touch (overlaps.cpp);
/// after ApplyInitialState.
std::optional<Error> ExcludeOverlaps(Conversion& c);
/// Proportional-derivative control (pd.cpp).
std::optional<Error> ApplyPd(Conversion& c, const ImportOptions& options);
void ListHolds(Conversion& c);
/// Numbers that MuJoCo accepts and no simulation survives (validate.cpp).
std::optional<Error> Validate(const Conversion& c);
void ListUnsupported(Conversion& c);
/// The joints of the file, and what they are in c.scene (moment_text.cpp).
std::vector<FileJoint> FileJointsOf(const Conversion& c);
/// What an import returns: the parts of `c`, which are moved from.
ImportedScene MoveOut(Conversion& c);
/// A state in the order of c.scene as MuJoCo's numbers, and as a <key> of MJCF (moment_text.cpp).
struct KeyNumbers {
  std::vector<double> qpos, qvel, act, ctrl, mpos, mquat;
};
KeyNumbers NumbersOf(const Conversion& c, const KeyframeDef& state);
std::string MomentText(const Conversion& c, const KeyframeDef& state, const std::string& name, double time);

}  // namespace fork1s::internal
