#include "base_text.hpp"

#include <fmt/format.h>

#include <set>
#include <vector>

#include "base/near_names.hpp"
#include "mechanism/names.hpp"

namespace fork1s::app {
namespace {

// Three translations, as the importer makes them of the position of a free joint; its rotation follows as a ball.
bool IsPosition(const Mechanism& m, const Mechanism::Joint& joint) {
  if (joint.size != 3) return false;
  for (int i = joint.offset; i < joint.offset + joint.size; ++i)
    if (m.Turns(i)) return false;
  return true;
}

}  // namespace

void PutBase(const Mechanism& mechanism, Json& out) {
  std::vector<std::string> free;
  std::set<int> on_base, on_free_joint;  // bodies that joints join to the base
  for (int j = 0; j < mechanism.num_joints(); ++j) {
    const Mechanism::Joint& joint = mechanism.joint(JointIndex(j));
    if (joint.previous < 0) on_base.insert(joint.body.value());
    if (joint.kind != JointKind::kBall || joint.previous < 0) continue;
    const Mechanism::Joint& before = mechanism.joint(JointIndex(joint.previous));
    if (before.previous >= 0 || before.body != joint.body || !IsPosition(mechanism, before)) continue;
    on_free_joint.insert(joint.body.value());
    free.push_back(mechanism.body(joint.body).name);
  }
  out["base"] = Name(mechanism.base());
  out["free_joint_bodies"] = free;
  out["is_free"] = mechanism.base() == BaseKind::kFixed && !free.empty() && on_base == on_free_joint;
}

std::string BaseText(const Json& mechanism) {
  const auto free = mechanism["free_joint_bodies"].get<std::vector<std::string>>();
  const std::string base = "base " + mechanism["base"].get<std::string>();
  if (free.empty()) return base;
  const std::string names = Quoted(free, 6);
  if (mechanism["is_free"].get<bool>())
    return fmt::format("free bod{} {}", free.size() == 1 ? "y" : "ies", names);
  return fmt::format("{}, {} on {}", base, names, free.size() == 1 ? "a free joint" : "free joints");
}

}  // namespace fork1s::app
