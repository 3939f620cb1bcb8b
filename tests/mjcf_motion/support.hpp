// A cup over a box, of any size, turned in space.
#pragma once

#include <array>
#include <cmath>
#include <mjcf_text.hpp>
#include <string>

namespace fork1s::adhesion_test {

using namespace testing;

/// A plate on a slide along its normal, and a flat box under it. In the frame of the scene the normal is z.
struct Cup {
  double size = 0.1;     // m: half side of the box; the plate is five times as wide
  double density = 500;  // kg/m³, of the box; the plate has ten times its mass
  double friction = 0.5;
  double distance = 0;  // m, between box and plate
  double gap = 0;       // m, of the plate
  double gain = 1;      // N
  Vector3 gravity = Vector3(0, 0, -kGravity);
  Quaternion turn = Quaternion::Identity();
  bool box_first = false;
  std::string slide = "";   // attributes of the joint
  std::string motors = "";  // further actuators
  std::string more = "";    // further bodies

  Vector3 half() const { return size * Vector3(1, 1, 0.4); }
  double mass() const { return 8 * density * half().prod(); }
  double weight() const { return mass() * gravity.norm(); }
  Vector3 Axis(int i) const { return turn * Vector3(Vector3::Unit(i)); }

  std::string Body(const std::string& name, double z, const std::string& inside) const {
    const Vector3 p = turn * Vector3(0, 0, z);
    return fmt::format(
        "<body name='{}' pos='{:.17g} {:.17g} {:.17g}' quat='{:.17g} {:.17g} {:.17g} {:.17g}'>{}</body>",
        name, p.x(), p.y(), p.z(), turn.w(), turn.x(), turn.y(), turn.z(), inside);
  }
  std::string Text(const std::string& options = "") const {
    const Vector3 h = half(), g = turn * gravity;
    const std::string plate =
        Body("cup", size,
             fmt::format("<joint name='slide' type='slide' axis='0 0 1' {}/><geom name='plate' type='box' "
                         "size='{:.17g} {:.17g} {:.17g}' mass='{:.17g}' friction='{}' gap='{:.17g}'/>",
                         slide, 5 * size, 5 * size, size, 10 * mass(), friction, gap));
    const std::string box =
        Body("box", -h.z() - distance,
             fmt::format("<freejoint/><geom type='box' size='{:.17g} {:.17g} {:.17g}' mass='{:.17g}' "
                         "friction='{}'/>",
                         h.x(), h.y(), h.z(), mass(), friction));
    return fmt::format(
        "<mujoco><option gravity='{:.17g} {:.17g} {:.17g}' {}/><worldbody>{}{}{}</worldbody><actuator>{}<adhesion "
        "name='suction' body='cup' ctrlrange='0 1' gain='{:.17g}'/></actuator></mujoco>",
        g.x(), g.y(), g.z(), options, box_first ? box : plate, box_first ? plate : box, more, motors, gain);
  }
};

/// Of contacts, on body b along their normals, and of adhesion [N].
struct Normal {
  double contact = 0, pull = 0;
  int count = 0;
};
inline Normal NormalForces(const Simulation& simulation) {
  Normal sum;
  for (const ContactRecord& c : simulation.world().contacts()) {
    sum.contact += c.impulse.x() / simulation.dt();
    sum.pull -= c.pull.x() / simulation.dt();
    sum.count += c.pull.x() != 0 ? 1 : 0;
  }
  return sum;
}

inline const std::array<double, 3> kSizes = {0.005, 0.1, 1};  // m

}  // namespace fork1s::adhesion_test
