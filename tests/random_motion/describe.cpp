#include <cmath>
#include <limits>
#include <sstream>

#include "random_motion.hpp"

namespace fork1s::random_motion {

std::string Describe(const Case& c, double mass) {
  const MechanismDef& def = c.mechanism();
  std::ostringstream out;
  out.precision(3);
  constexpr const char* kBases[] = {"fixed", "floating", "driven"};
  constexpr const char* kJoints[] = {"hinge", "slide", "ball", "cylindrical", "planar", "free", "general"};
  double low = std::numeric_limits<double>::infinity(), high = 0;
  bool damped = false, armature = false, limited = false;
  const auto count_stiffness = [&](double k) {
    if (k > 0) low = std::min(low, k), high = std::max(high, k);
  };
  out << kBases[static_cast<int>(def.base)] << " base, " << def.bodies.size() - 1 << " bodies, joints";
  for (const JointDef& joint : def.joints) {
    out << ' ' << kJoints[static_cast<int>(joint.kind)];
    for (const FreedomDef& f : joint.freedoms) {
      count_stiffness(f.stiffness);
      damped |= f.damping > 0;
      armature |= f.armature > 0;
      limited |= std::isfinite(f.lower);
    }
  }
  for (const SpringDef& s : def.springs) count_stiffness(s.stiffness), damped |= s.damping > 0;
  for (const ClosureDef& s : def.closures)
    for (int i = 0; i < 6; ++i) count_stiffness(s.stiffness(i)), damped |= s.damping(i) > 0;
  out << "; size " << c.size << " m, " << mass << " kg, h 1/" << 1 / c.step.h << " s";
  if (high > 0) out << ", stiffness " << low << " to " << high;
  for (const auto& [count, name] : {std::pair{def.closures.size(), "closures"},
                                    {def.couplings.size(), "couplings"},
                                    {def.springs.size() - def.controls.size(), "tendons"},
                                    {def.controls.size(), "servos"},
                                    {def.force_limits.size(), "of them bounded"},
                                    {def.frictions.size(), "dry frictions"}})
    if (count > 0) out << ", " << count << ' ' << name;
  if (damped) out << ", dampers";
  if (armature) out << ", armature";
  if (limited) out << ", limits";
  out << (c.step.gravity.isZero(0) ? "; no gravity" : "; gravity");
  if (!c.scene.keyframes[0].mechanisms[0].q_dot.isZero(0)) out << ", spun";
  if (!c.scene.world.empty()) out << ", floor";
  if (!c.scene.free_bodies.empty()) out << ", free body";
  if (c.push.body >= 0) out << ", pushed in steps " << c.push.begin << " to " << c.push.end;
  if (!c.set_points.isZero(0)) out << ", set-points jump at step " << c.jump_step;
  if (c.base_jumps) out << ", base jumps at step " << c.jump_step;
  return out.str();
}

Case Refined(Case c, int n) {
  c.step.h /= n;
  c.steps *= n;
  c.push.begin *= n;
  c.push.end *= n;
  c.jump_step *= n;
  return c;
}

}  // namespace fork1s::random_motion
