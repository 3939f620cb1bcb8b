// Models with equalities that a control switches.
#pragma once

#include <array>
#include <cmath>
#include <mjcf_text.hpp>
#include <string>

namespace fork1s::switched_equalities_test {

using namespace testing;

/// Of a switched equality, on its second body in the last step [N].
inline Vector3 Force(const Simulation& simulation, std::size_t closure = 0) {
  return simulation.world().switched_closures().at(closure).impulse_W / simulation.dt();
}

/// An arm on a hinge with a servo, and a box under its tip that a weld "grab" or a connect may hold. In the frame of the
/// model gravity is along -z; `turn` turns all of it, `size` scales it.
struct Arm {
  double size = 1;  // m, of the arm
  double mass = 2;  // kg, of the box
  Quaternion turn = Quaternion::Identity();
  bool box_first = false, swap_bodies = false;
  std::string equality = "<weld name='grab' {} active='false'/>";
  std::string more = "";    // further bodies
  std::string custom = "";  // texts of <custom>

  std::string Vec(const Vector3& v) const {
    const Vector3 t = turn * v;
    return fmt::format("{:.17g} {:.17g} {:.17g}", t.x(), t.y(), t.z());
  }
  std::string Body(const std::string& name, const Vector3& p, const std::string& inside) const {
    return fmt::format("<body name='{}' pos='{}' quat='{:.17g} {:.17g} {:.17g} {:.17g}'>{}</body>", name,
                       Vec(size * p), turn.w(), turn.x(), turn.y(), turn.z(), inside);
  }
  // The servo is so stiff that the arm sinks by some 1e-6 rad.
  double stiffness() const { return 1e6 * mass * kGravity * size; }
  std::string Text(const std::string& options = "") const {
    const std::string arm = Body(
        "arm", Vector3::Zero(),
        fmt::format("<joint name='shoulder' axis='0 1 0'/><geom type='capsule' fromto='0 0 0 {0:.17g} 0 0' "
                    "size='{1:.17g}' mass='{2:.17g}' contype='0' conaffinity='0'/>",
                    size, 0.05 * size, mass / 2));
    const std::string box =
        Body("box", Vector3(1, 0, -0.3),
             fmt::format("<freejoint/><geom type='box' size='{0:.17g} {1:.17g} {0:.17g}' mass='{2:.17g}'/>",
                         0.1 * size, 0.2 * size, mass));
    const std::string bodies = swap_bodies ? "body1='box' body2='arm'" : "body1='arm' body2='box'";
    return fmt::format(
        "<mujoco><option gravity='{}' {}/><custom>{}</custom><worldbody>{}{}{}</worldbody><actuator><position name='servo' "
        "joint='shoulder' kp='{:.17g}' kv='{:.17g}'/></actuator><equality>{}</equality></mujoco>",
        Vec(Vector3(0, 0, -kGravity)), options, custom, box_first ? box : arm, box_first ? arm : box, more,
        stiffness(), 0.05 * stiffness(), fmt::format(fmt::runtime(equality), bodies));
  }
  /// In the frame of the model.
  Vector3 In(const Vector3& v) const { return turn.conjugate() * v; }
};

/// Its weld is on in the file, and named as switched.
inline Arm ArmThatHolds() {
  Arm arm;
  arm.equality = "<weld name='grab' {}/>";
  arm.custom = "<text name='fork1s_switched' data='grab'/>";
  return arm;
}
/// Released after `time` [s].
inline ControlTrack ReleaseAt(double time) { return {{"grab"}, {0, time, time + 1e-4}, {{1}, {1}, {0}}}; }

inline const std::array<double, 3> kSizes = {0.01, 1, 20};  // m

}  // namespace fork1s::switched_equalities_test
