#include <fork1s/sim/scene_factors.hpp>

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "server/live_settings.hpp"

namespace fork1s {
namespace {

// The joints of each body and the bodies of each body.
struct Tree {
  std::vector<std::vector<int>> children, joints;
  explicit Tree(const MechanismDef& def) : children(def.bodies.size()), joints(def.bodies.size()) {
    for (std::size_t b = 1; b < def.bodies.size(); ++b)
      children[def.bodies[b].parent.u()].push_back(static_cast<int>(b));
    for (std::size_t j = 0; j < def.joints.size(); ++j)
      joints[def.joints[j].body.u()].push_back(static_cast<int>(j));
  }
  void Gather(int body, std::vector<int>& out) const {
    std::vector<int> open = {body};
    while (!open.empty()) {
      const auto b = static_cast<std::size_t>(open.back());
      open.pop_back();
      out.insert(out.end(), joints[b].begin(), joints[b].end());
      open.insert(open.end(), children[b].begin(), children[b].end());
    }
  }
};

void FindGroups(const MechanismDef& def, int mechanism, std::vector<JointGroup>& groups) {
  const Tree tree(def);
  JointGroup trunk{def.bodies[0].name, mechanism, {}, 1};
  std::size_t at = 0;
  while (true) {
    std::vector<int> branches;  // children that carry joints
    for (int child : tree.children[at]) {
      std::vector<int> joints;
      tree.Gather(child, joints);
      if (!joints.empty()) branches.push_back(child);
    }
    if (branches.size() == 1 && !(tree.children[static_cast<std::size_t>(branches[0])].empty())) {
      at = static_cast<std::size_t>(branches[0]);
      trunk.joints.insert(trunk.joints.end(), tree.joints[at].begin(), tree.joints[at].end());
      continue;
    }
    if (!trunk.joints.empty() && branches.size() > 1) groups.push_back(trunk);
    if (branches.size() <= 1) {  // a chain: one group
      std::vector<int> all;
      tree.Gather(0, all);
      if (!all.empty()) groups.push_back({def.name, mechanism, all, 1});
      return;
    }
    for (int branch : branches) {
      JointGroup group{def.bodies[static_cast<std::size_t>(branch)].name, mechanism, {}, 1};
      tree.Gather(branch, group.joints);
      groups.push_back(std::move(group));
    }
    return;
  }
}

// As ScaleStiffness does for a whole mechanism: dampers by the root, so that damping ratios stay.
void ScaleGroup(const JointGroup& group, MechanismDef& def) {
  if (group.scale == 1) return;
  std::vector<char> mine(def.joints.size(), 0);
  for (int j : group.joints) mine[static_cast<std::size_t>(j)] = 1;
  auto inside = [&](const auto& d) {
    std::vector<JointIndex> on;
    if (d.along.path >= 0) on = def.JointsOfPath(d.along.path);
    for (const auto& term : d.terms) on.push_back(term.first.joint);
    return !on.empty() && std::all_of(on.begin(), on.end(), [&](JointIndex j) { return mine[j.u()] != 0; });
  };
  const double root = std::sqrt(group.scale);
  for (std::size_t j = 0; j < def.joints.size(); ++j)
    if (mine[j])
      for (FreedomDef& f : def.joints[j].freedoms) {
        f.stiffness *= group.scale;
        f.damping *= root;
      }
  for (SpringDef& s : def.springs)
    if (inside(s)) {
      s.stiffness *= group.scale;
      s.damping *= root;
      for (double& higher : s.higher_stiffness) higher *= group.scale;
      for (double& higher : s.higher_damping) higher *= root;
    }
  for (ForceLimitDef& f : def.force_limits)
    if (inside(f)) {
      f.stiffness *= group.scale;
      f.damping *= root;
    }
  for (ControlDef& c : def.controls)
    if (c.is_setpoint && inside(c)) c.gain *= group.scale;
}

void ScaleDamping(double scale, MechanismDef& def) {
  for (JointDef& j : def.joints)
    for (FreedomDef& f : j.freedoms) f.damping *= scale;
  for (SpringDef& s : def.springs) {
    s.damping *= scale;
    for (double& higher : s.higher_damping) higher *= scale;
  }
  for (ForceLimitDef& f : def.force_limits) f.damping *= scale;
  for (ClosureDef& c : def.closures) c.damping *= scale;
}

}  // namespace

std::vector<JointGroup> FindJointGroups(const std::vector<MechanismDef>& mechanisms) {
  std::vector<JointGroup> groups;
  for (std::size_t i = 0; i < mechanisms.size(); ++i) FindGroups(mechanisms[i], static_cast<int>(i), groups);
  return groups;
}

Scene ApplySettings(Scene scene, const LiveSettings& settings) {
  ApplyTunables(settings.tunables, settings.servos, scene);
  for (std::size_t i = 0; i < scene.mechanisms.size(); ++i) {
    MechanismDef& def = scene.mechanisms[i];
    for (const JointGroup& group : settings.groups)
      if (group.mechanism == static_cast<int>(i)) ScaleGroup(group, def);
    if (settings.damping_scale != 1) ScaleDamping(settings.damping_scale, def);
    if (i < settings.interfaces.size() && !settings.interfaces[i].empty()) {
      def.interfaces = settings.interfaces[i];
      def.interfaces_chosen = true;
    }
  }
  scene = Vary(std::move(scene), {.friction = settings.friction_scale});
  scene.gravity = settings.gravity;
  return scene;
}

std::vector<ServoShare> ServosNow(const Scene& scene, const LiveSettings& settings) {
  std::vector<ServoShare> servos = TunedServos(settings.tunables, settings.servos);
  for (ServoShare& s : servos) {
    s.damping *= settings.damping_scale;
    for (const ControlDef& c : scene.mechanisms[static_cast<std::size_t>(s.mechanism)].controls) {
      if (c.name != s.control || c.terms.empty()) continue;
      const auto joint = static_cast<int>(c.terms[0].first.joint.value());
      for (const JointGroup& g : settings.groups)
        if (g.mechanism == s.mechanism &&
            std::find(g.joints.begin(), g.joints.end(), joint) != g.joints.end()) {
          s.stiffness *= g.scale;
          s.bias *= g.scale;
          s.damping *= std::sqrt(g.scale);
        }
    }
  }
  return servos;
}

Expected<SettingKind> ChangeSetting(const std::string& name, int index, double value,
                                    LiveSettings& settings) {
  auto within = [&](double low, double high) -> Expected<void> {
    if (value >= low && value <= high) return {};
    return Fail(ErrorCode::kUsage, name,
                fmt::format("must lie between {:g} and {:g}, not {:g}", low, high, value));
  };
  struct Range {
    const char* name;
    double low, high;
  };
  static constexpr Range kRanges[] = {{"dt", 1e-4, 0.05},
                                      {"gravity", -100, 100},
                                      {"damping", 0, 100},
                                      {"friction", 0, 10},
                                      {"modes", 0, 64},
                                      {"detail", 0, 3},
                                      {"recovery", 0, kNumRecoveries - 1},
                                      {"pull_stiffness", 1e-3, 1e7},
                                      {"speed", 0.01, 4},
                                      {"stiffness", 1e-3, 1e4},
                                      {"signals", 0, 1},
                                      {"error", 0, 1},
                                      {"accuracy", 0, 1},
                                      {"tune", -1e7, 1e7}};
  const auto* range =
      std::find_if(std::begin(kRanges), std::end(kRanges), [&](const Range& r) { return name == r.name; });
  if (range == std::end(kRanges)) return Fail(ErrorCode::kUsage, name, "is no setting of this program");
  if (auto fits = within(range->low, range->high); !fits) return tl::unexpected(fits.error());

  if (name == "gravity") return settings.gravity = Vector3(0, 0, value), SettingKind::kPlain;
  if (name == "pull_stiffness") return settings.pull_stiffness = value, SettingKind::kPlain;
  if (name == "signals") return settings.signals = value > 0.5, SettingKind::kPlain;
  if (name == "error") {
    settings.error = value > 0.5;
    if (!settings.error) settings.accuracy = 0;
    return SettingKind::kPlain;
  }
  if (name == "accuracy") {
    settings.accuracy = value;
    settings.error |= value > 0;
    return SettingKind::kPlain;
  }
  if (name == "tune") {
    if (index < 0 || index >= static_cast<int>(settings.tunables.size()))
      return Fail(ErrorCode::kUsage, name, fmt::format("has no number {}", index));
    Tunable& t = settings.tunables[static_cast<std::size_t>(index)];
    if (value < t.least)
      return Fail(ErrorCode::kUsage, fmt::format("{} of {} '{}'", Name(t.quantity), Name(t.of), t.owner),
                  fmt::format("must be {:g} or more, not {:g}", t.least, value));
    t.value = value;
    return SettingKind::kModel;
  }
  if (name == "speed") return settings.speed = value, SettingKind::kPlain;
  if (name == "dt") return settings.dt = value, SettingKind::kModel;
  if (name == "damping") return settings.damping_scale = value, SettingKind::kModel;
  if (name == "friction") return settings.friction_scale = value, SettingKind::kModel;
  if (name == "modes") return settings.modes = static_cast<int>(value), SettingKind::kFidelity;
  if (name == "detail") {
    settings.detail = static_cast<DetailLevel>(static_cast<int>(value));
    return SettingKind::kFidelity;
  }
  if (name == "recovery") {
    settings.recovery = static_cast<Recovery>(static_cast<int>(value));
    return SettingKind::kFidelity;
  }
  if (index < 0 || index >= static_cast<int>(settings.groups.size()))
    return Fail(ErrorCode::kUsage, name, fmt::format("has no joint group {}", index));
  settings.groups[static_cast<std::size_t>(index)].scale = value;
  return SettingKind::kModel;
}

}  // namespace fork1s
