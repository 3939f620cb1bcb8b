// MJCF and URDF files to scenes.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/importer/file_state.hpp>
#include <fork1s/mechanism/scene.hpp>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace fork1s {

/// What happened to a part of the file.
struct ImportNote {
  enum class Kind {
    kDropped,  ///< has no meaning here and was left out
    kChanged,  ///< kept, but not as written
    kChosen,   ///< the file left it open; says what was taken
  };
  Kind kind;
  std::string where;    // element and name, "actuator 'grip'"
  std::string message;  // what happened and why

  /// "dropped: WHERE: MESSAGE"
  std::string Text() const;
};

/// What holds one joint coordinate.
struct JointHold {
  std::string joint;
  /// "spring 2 N·m/rad", "position actuator 'a' 10 N·m/rad", "closed by 'loop'", "nothing", ...
  std::string held_by;
};

/// What a servo of one input brings to the stiffness and damping of its joint, or to the spring of its name,
/// per unit of its own length ℓ from the reference: F = gain u + bias - stiffness (at_reference + ℓ) -
/// damping dℓ/dt. In the scene these stand in one sum with those of the joint.
struct ServoGains {
  int mechanism = 0;    // of the scene
  std::string control;  // ControlDef::name
  double stiffness = 0, damping = 0;
  double bias = 0, at_reference = 0;
};

struct ImportReport {
  std::string format;  // "MJCF" or "URDF"
  std::vector<ImportNote> notes;
  std::vector<JointHold> holds;
  std::vector<ServoGains> servos;
  /// `velocity` of <limit> in URDF [rad/s or m/s], by joint, where it is above 0. Nothing keeps to it: `run` tells what
  /// moved faster.
  std::map<std::string, double> velocity_limits;
};

/// Stiffness and damping that hold a joint by proportional-derivative control at its initial displacement.
struct PdGains {
  double kp = 0;
  double kv = 0;
};

struct ImportOptions {
  std::vector<std::string> interfaces;  // body names; replaces what the file says
  /// Names of welds and connects that the file starts active and a control switches; replaces what the file says.
  std::vector<std::string> switched;
  std::optional<BaseKind> base;  // replaces what the file says
  std::optional<int> modes;      // exactly so many fixed-interface modes at most
  bool modes_by_step = false;    // as many as the time step resolves, whatever the file says
  std::optional<ModeChoice> mode_choice;
  double stiffness_scale = 1;
  std::optional<PdGains> pd;                // joints that no spring and no servo holds
  std::map<std::string, PdGains> joint_pd;  // by joint name or "all", in place of `pd`, on top of holds
  std::string keyframe;                     // name; empty: the file's reference pose

  // Where it starts and what it stands on; all change the initial state only, on top of `keyframe`.
  std::optional<RigidTransform> base_pose;          // X_WB of the base of the only mechanism or free body
  std::map<std::string, double> joint_coordinates;  // by joint name, as the file counts them: rad or m
  bool keep_start = false;                          // joints that the file starts outside their limits too
  bool hold = false;    // set-points of position servos are where their joints start, not those of the file
  bool ground = false;  // adds a level plane; refused where there is one
  std::optional<double> ground_height;  // m; else 0 with a base pose, without: under the robot

  /// URDF: folder of a ROS package, by name. A package without an entry is looked for below
  /// AMENT_PREFIX_PATH, then ROS_PACKAGE_PATH, then in the folders above the file.
  std::map<std::string, std::string> packages;
};

/// A site of the file, or a camera that follows no other body: a frame fixed to a body or to the world.
struct FileFrame {
  enum class Kind { kSite, kCamera };
  std::string name;
  Kind kind = Kind::kSite;
  SensorFrame frame;
};

struct ImportedScene {
  Scene scene;
  ImportReport report;
  int initial_keyframe = -1;  // index in scene.keyframes: the requested one, or one made of the options
  /// All joints of the file in its order, and before those of a mechanism a free joint for a base that floats without one
  /// in the file (URDF).
  std::vector<FileJoint> joints;
  /// What evaluates the force of each actuator of the file (Sensors), by its name: of kActuatorForce, or kUnknown with the
  /// reason.
  std::vector<SensorDef> actuators;
  std::vector<FileFrame> frames;  // sites, then cameras, in the order of the file
};

/// Reads a model file (.xml/.mjcf, .urdf; the root element decides). Errors: kFile (cannot be read),
/// kFormat (does not parse, with line), kModel (bad numbers, missing meshes, unknown names), kUsage.
Expected<ImportedScene> LoadMechanism(const std::string& path, const ImportOptions& options = {});

/// The same from MJCF text, without files beside it. `name` stands for the path in messages.
Expected<ImportedScene> LoadMechanismFromString(const std::string& mjcf, const std::string& name,
                                                const ImportOptions& options = {});

}  // namespace fork1s
