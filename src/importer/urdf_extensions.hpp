// Extensions of URDF that change the mechanism: <gazebo>, <loop_joint> and constraints of Drake.
#pragma once

#include <mujoco/mujoco.h>
#include <fork1s/base/error.hpp>
#include <fork1s/spatial/rigid_transform.hpp>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace tinyxml2 {
class XMLElement;
}

namespace fork1s::internal {

struct UrdfWork;

/// What <gazebo reference="JOINT"> says of a joint; replaces what its <dynamics> says.
struct GazeboJoint {
  std::string joint;
  std::optional<double> stiffness;  // N/m or N·m/rad
  double reference = 0;             // m or rad, coordinate at which the spring is relaxed
  std::optional<double> damping;    // N s/m or N·m s/rad
  std::optional<double> friction;   // N or N·m, dry
};

/// Frame J_a on link_a stays on frame J_b on link_b: its origin, all of it, or all but its rotation about z.
struct UrdfLoop {
  enum class Kind { kBall, kFixed, kHinge };
  std::string name, link_a, link_b;
  Kind kind = Kind::kBall;
  RigidTransform X_AJ;
  std::optional<RigidTransform> X_BJ;  // nothing: as J_a at the reference pose; of kBall alone
};

/// A joint of URDF's type `floating` below a link other than `world`: MuJoCo's free joint hangs on the world alone.
struct FloatingJoint {
  std::string joint, link;
};

struct UrdfExtensions {
  std::vector<FloatingJoint> floating;
  std::vector<GazeboJoint> joints;
  std::map<std::string, double> friction;  // coefficient of all shapes of a link
  std::set<std::string> weightless;        // links on which gravity does not act
  std::map<std::string, double> start;     // rad or m, of joints, by ros2_control
  std::vector<UrdfLoop> loops;
  std::vector<std::pair<std::string, std::string>> excluded;  // links that do not touch
  std::set<std::string> self_colliding;                       // links of which it is said that they do
};

/// Why an element or attribute was left out, by its name.
const char* WhyUnread(const std::string& name);

/// Whether ReadExtensions reads elements of that name, or notes them one by one.
bool IsExtension(const std::string& element);

/// Reads the extensions among the children of <robot>, which is otherwise as the file has it; what is not
/// read becomes a note. Errors: kModel for unknown links and joints and for words in place of numbers, with
/// line.
std::optional<Error> ReadExtensions(UrdfWork& work, const tinyxml2::XMLElement& robot);

/// Adds them to the elements of the parsed model. A hinge becomes a weld of its name.
void AddExtensions(mjSpec* spec, const UrdfExtensions& extensions);

/// Replaces the welds that stand for hinges by two points on their axis, as MJCF has no hinge equality.
/// `length` [m] is their distance.
void SplitHinges(mjSpec* spec, const UrdfExtensions& extensions, double length);

}  // namespace fork1s::internal
