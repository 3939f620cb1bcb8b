#include <fork1s/sim/scene_factors.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fork1s/mechanism/mechanism.hpp>
#include <fork1s/mechanism/set_stiffness.hpp>
#include <utility>

#include "base/near_names.hpp"
#include "mechanism/freedoms.hpp"
#include "mechanism/sensor_stiffness.hpp"
#include "sim/vary.hpp"

namespace fork1s {
namespace {

void ScaleFriction(double factor, std::vector<GeometryDef>& geometries) {
  for (GeometryDef& g : geometries) g.friction *= factor;
}

void ScaleMass(double factor, SpatialInertia& inertia) {
  inertia.mass *= factor;
  inertia.rotational *= factor;
}

// f(body) of all bodies of the scene.
template <class SceneType, class F>
void ForBodies(SceneType& scene, F&& f) {
  for (auto& def : scene.mechanisms)
    for (auto& b : def.bodies) f(b);
  for (auto& b : scene.free_bodies) f(b);
}

struct Key {
  std::string quantity, name;  // "mass", "cube"; without a name: of all
};

Key Split(const std::string& key) {
  const auto colon = key.find(':');
  if (colon == std::string::npos) return {key, ""};
  return {key.substr(0, colon), key.substr(colon + 1)};
}

std::string NameOf(const JointDef& joint, int freedom) {
  return internal::CoordinateName(joint.name, static_cast<int>(joint.freedoms.size()), freedom);
}

// Freedoms of that name, as Mechanism::CoordinateName has it, or all of a joint.
std::vector<FreedomRef> FreedomsOf(const MechanismDef& def, const std::string& name) {
  std::vector<FreedomRef> all;
  for (std::size_t j = 0; j < def.joints.size(); ++j)
    for (int f = 0; f < static_cast<int>(def.joints[j].freedoms.size()); ++f)
      if (def.joints[j].name == name || NameOf(def.joints[j], f) == name)
        all.push_back({JointIndex(static_cast<int>(j)), f});
  return all;
}

bool HasDamping(const SpringDef& s) { return s.damping > 0 || s.higher_damping != std::array<double, 2>{}; }

// What a quantity can be scaled of.
struct Candidates {
  const char* what;
  std::vector<std::string> names;
};

Candidates FindCandidates(const std::string& quantity, const Scene& scene) {
  Candidates found{"body with mass", {}};
  const auto add = [&](const std::string& name) {
    if (std::find(found.names.begin(), found.names.end(), name) == found.names.end())
      found.names.push_back(name);
  };
  if (quantity == "mass") {
    ForBodies(scene, [&](const auto& b) {
      if (b.inertia.mass > 0) add(b.name);
    });
    return found;
  }
  if (quantity == "friction") {
    found.what = "body with shapes";
    ForBodies(scene, [&](const auto& b) {
      if (!b.geometries.empty()) add(b.name);
    });
    if (!scene.world.empty()) add("world");
    return found;
  }
  const bool of_stiffness = quantity == "stiffness", of_friction = quantity == "frictionloss";
  found.what = of_stiffness  ? "joint or tendon that a spring or servo holds"
               : of_friction ? "joint or tendon with dry friction"
                             : "joint or tendon with damping";
  for (const MechanismDef& def : scene.mechanisms) {
    if (of_friction) {
      for (const DryFrictionDef& friction : def.frictions) add(friction.name);
      continue;
    }
    for (const JointDef& joint : def.joints)
      for (std::size_t f = 0; f < joint.freedoms.size(); ++f) {
        if (!((of_stiffness ? joint.freedoms[f].stiffness : joint.freedoms[f].damping) > 0)) continue;
        add(NameOf(joint, static_cast<int>(f)));
        if (joint.freedoms.size() > 1) add(joint.name);
      }
    for (const SpringDef& spring : def.springs)
      if (of_stiffness ? internal::HasStiffness(spring) : HasDamping(spring)) add(spring.name);
  }
  return found;
}

std::vector<std::pair<std::string, double>> AllOf(const SceneFactors& factors) {
  std::vector<std::pair<std::string, double>> all = {
      {"stiffness", factors.stiffness}, {"friction", factors.friction}, {"mass", factors.mass}};
  all.insert(all.end(), factors.named.begin(), factors.named.end());
  return all;
}

Expected<void> CheckKey(const Scene& scene, const std::string& key) {
  const auto [quantity, name] = Split(key);
  // Those of all of these are members of their own.
  if (!internal::IsOfQuantity(key) || key == "stiffness" || key == "friction" || key == "mass")
    return Fail(ErrorCode::kUsage, "factor '" + key + "'",
                std::string("is none of: ") + internal::kFactorKeys);
  if (key.find(':') == std::string::npos) return {};
  const Candidates candidates = FindCandidates(quantity, scene);
  if (std::find(candidates.names.begin(), candidates.names.end(), name) != candidates.names.end()) return {};
  return Fail(ErrorCode::kUsage, "factor '" + key + "'",
              "there is no " + std::string(candidates.what) + " '" + name + "'" +
                  Suggestion(name, candidates.names) +
                  (quantity == "friction" && !scene.world.empty() ? "; what stands still is 'world'" : ""));
}

void ScaleDamper(double factor, SpringDef& spring) {
  spring.damping *= factor;
  for (double& higher : spring.higher_damping) higher *= factor;
}

template <class IsScaled>
void ScaleSensorDampers(double factor, Scene& scene, const IsScaled& is_scaled) {
  for (SensorDef& sensor : scene.sensors)
    for (SensorActuator& actuator : sensor.actuators) {
      if (!is_scaled(actuator)) continue;
      actuator.damping *= factor;
      for (const ControlDef& control :
           scene.mechanisms[static_cast<std::size_t>(actuator.mechanism)].controls)
        for (auto& [name, gain] : actuator.inputs)
          if (name == control.name && control.is_velocity_setpoint) gain *= factor;
    }
}

// Of a freedom itself, with the shares of servos in it.
void ScaleFreedomDamping(std::size_t mechanism, FreedomRef freedom, double factor, Scene& scene) {
  MechanismDef& def = scene.mechanisms[mechanism];
  def.joints[freedom.joint.u()].freedoms[static_cast<std::size_t>(freedom.freedom)].damping *= factor;
  for (ForceLimitDef& limit : def.force_limits)
    if (internal::IsAlong(freedom, limit)) limit.damping *= factor;
  for (ControlDef& control : def.controls)
    if (control.is_velocity_setpoint && internal::IsAlong(freedom, control)) control.gain *= factor;
  ScaleSensorDampers(factor, scene, [&](const SensorActuator& actuator) {
    return actuator.mechanism == static_cast<int>(mechanism) && internal::IsAlong(freedom, actuator);
  });
}

void ScaleStiffnessOf(const std::string& name, double factor, Scene& scene) {
  for (std::size_t i = 0; i < scene.mechanisms.size(); ++i) {
    MechanismDef& def = scene.mechanisms[i];
    const std::vector<FreedomRef> freedoms = FreedomsOf(def, name);
    for (const FreedomRef freedom : freedoms) {
      const double own =
          def.joints[freedom.joint.u()].freedoms[static_cast<std::size_t>(freedom.freedom)].stiffness;
      if (own > 0) {
        internal::SetSensorStiffness(i, freedom, own * factor, scene);
        def = SetStiffness(std::move(def), freedom, own * factor);
      } else if (std::any_of(def.springs.begin(), def.springs.end(), [&](const SpringDef& s) {
                   return s.name == name && internal::IsAlong(freedom, s) && internal::HasStiffness(s);
                 })) {  // the joint has a spring that is not linear
        ScaleFreedomDamping(i, freedom, std::sqrt(factor), scene);
      }
    }
    internal::ScaleSensorSprings(i, name, freedoms, factor, scene);
    internal::ScaleSprings(name, freedoms, factor, def);
  }
}

void ScaleDampingOf(const std::string& name, double factor, Scene& scene) {
  for (std::size_t i = 0; i < scene.mechanisms.size(); ++i) {
    MechanismDef& def = scene.mechanisms[i];
    const std::vector<FreedomRef> freedoms = FreedomsOf(def, name);
    const auto is_of_tendon = [&](const auto& length) {
      return std::none_of(freedoms.begin(), freedoms.end(),
                          [&](FreedomRef freedom) { return internal::IsAlong(freedom, length); });
    };
    for (const FreedomRef freedom : freedoms) ScaleFreedomDamping(i, freedom, factor, scene);
    for (SpringDef& spring : def.springs)
      if (spring.name == name) ScaleDamper(factor, spring);
    for (ForceLimitDef& limit : def.force_limits)
      if (limit.name == name && is_of_tendon(limit)) limit.damping *= factor;
    for (ControlDef& control : def.controls)
      if (control.name == name && control.is_velocity_setpoint && is_of_tendon(control))
        control.gain *= factor;
    ScaleSensorDampers(factor, scene, [&](const SensorActuator& actuator) {
      return actuator.mechanism == static_cast<int>(i) && is_of_tendon(actuator) &&
             std::any_of(actuator.inputs.begin(), actuator.inputs.end(),
                         [&](const auto& input) { return input.first == name; });
    });
  }
}

void ScaleDamping(double factor, Scene& scene) {
  for (MechanismDef& def : scene.mechanisms) {
    for (JointDef& joint : def.joints)
      for (FreedomDef& f : joint.freedoms) f.damping *= factor;
    for (ClosureDef& closure : def.closures) closure.damping *= factor;
    for (SpringDef& spring : def.springs) ScaleDamper(factor, spring);
    for (ForceLimitDef& limit : def.force_limits) limit.damping *= factor;
    for (ControlDef& control : def.controls)
      if (control.is_velocity_setpoint) control.gain *= factor;
  }
  ScaleSensorDampers(factor, scene, [](const SensorActuator&) { return true; });
}

void ScaleFrictionOf(const std::string& body, double factor, Scene& scene) {
  std::vector<char> is_scaled(scene.contact_pairs.size());
  const auto scale = [&](std::vector<GeometryDef>& geometries) {
    ScaleFriction(factor, geometries);
    for (const GeometryDef& g : geometries)
      for (const int pair : g.pairs) is_scaled[static_cast<std::size_t>(pair)] = 1;
  };
  ForBodies(scene, [&](auto& b) {
    if (b.name == body) scale(b.geometries);
  });
  if (body == "world") scale(scene.world);
  for (std::size_t p = 0; p < is_scaled.size(); ++p)
    if (is_scaled[p]) scene.contact_pairs[p].friction *= factor;
}

void ScaleNamed(const std::string& key, double factor, Scene& scene) {
  const auto [quantity, name] = Split(key);
  if (quantity == "gravity") {
    scene.gravity *= factor;
  } else if (quantity == "mass") {
    ForBodies(scene, [&, &body = name](auto& b) {
      if (b.name == body) ScaleMass(factor, b.inertia);
    });
  } else if (quantity == "friction") {
    ScaleFrictionOf(name, factor, scene);
  } else if (quantity == "stiffness") {
    ScaleStiffnessOf(name, factor, scene);
  } else if (quantity == "damping") {
    if (name.empty())
      ScaleDamping(factor, scene);
    else
      ScaleDampingOf(name, factor, scene);
  } else {
    for (MechanismDef& def : scene.mechanisms)
      for (DryFrictionDef& friction : def.frictions)
        if (name.empty() || friction.name == name) friction.force *= factor;
  }
}

}  // namespace

void SetFactor(const std::string& key, double factor, SceneFactors& factors) {
  if (key == "stiffness")
    factors.stiffness = factor;
  else if (key == "friction")
    factors.friction = factor;
  else if (key == "mass")
    factors.mass = factor;
  else
    factors.named[key] = factor;
}

Expected<void> CheckFactors(const Scene& scene, const SceneFactors& factors) {
  for (const auto& [key, factor] : AllOf(factors)) {
    const bool may_be_zero = !key.starts_with("mass") && !key.starts_with("stiffness:");
    if (!std::isfinite(factor) || factor < 0 || (factor == 0 && !may_be_zero))
      return Fail(
          ErrorCode::kUsage, "factor '" + key + "'",
          fmt::format("is {}; give a finite factor {}", factor, may_be_zero ? "of 0 or more" : "above 0"));
  }
  for (const auto& [key, factor] : factors.named)
    if (auto known = CheckKey(scene, key); !known) return known;
  return {};
}

Scene Vary(Scene scene, const SceneFactors& factors) {
  const auto passes = CheckFactors(scene, factors);
  FORK1S_REQUIRE(passes.has_value(), passes ? "" : passes.error().Text());
  return internal::VaryChecked(std::move(scene), factors);
}

Scene internal::VaryChecked(Scene scene, const SceneFactors& factors) {
  if (factors.stiffness != 1) {
    for (MechanismDef& def : scene.mechanisms) def = ScaleStiffness(std::move(def), factors.stiffness);
    internal::ScaleSensorLaws(factors.stiffness, scene);
  }
  ForBodies(scene, [&](auto& b) {
    ScaleFriction(factors.friction, b.geometries);
    ScaleMass(factors.mass, b.inertia);
  });
  ScaleFriction(factors.friction, scene.world);
  for (ContactPairDef& pair : scene.contact_pairs) pair.friction *= factors.friction;
  for (const auto& [key, factor] : factors.named)
    if (factor != 1) ScaleNamed(key, factor, scene);
  return scene;
}

}  // namespace fork1s
