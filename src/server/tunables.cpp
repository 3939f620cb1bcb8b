#include "server/tunables.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace fork1s {
namespace {

using Of = Tunable::Of;
using Quantity = Tunable::Quantity;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kMost = 1e7;

const ServoShare* ShareOf(const std::vector<ServoShare>& servos, int mechanism, const std::string& control) {
  const auto at = std::find_if(servos.begin(), servos.end(), [&](const ServoShare& s) {
    return s.mechanism == mechanism && s.control == control;
  });
  return at == servos.end() ? nullptr : &*at;
}

bool OnOneFreedom(const ControlDef& c) { return c.terms.size() == 1 && c.along.path < 0; }

// The spring that a servo over several joints or along a path became.
SpringDef* SpringOf(MechanismDef& def, const std::string& name) {
  const auto at = std::find_if(def.springs.begin(), def.springs.end(),
                               [&](const SpringDef& s) { return s.name == name; });
  return at == def.springs.end() ? nullptr : &*at;
}

ForceLimitDef* LimitOf(MechanismDef& def, const std::string& name) {
  const auto at = std::find_if(def.force_limits.begin(), def.force_limits.end(),
                               [&](const ForceLimitDef& f) { return f.name == name; });
  return at == def.force_limits.end() ? nullptr : &*at;
}

struct Finder {
  const Scene& scene;
  const std::vector<ServoShare>& servos;
  std::vector<Tunable> out;

  void Add(Of of, Quantity quantity, const std::string& owner, const char* unit, int mechanism,
           std::size_t item, std::size_t freedom, double value, double least = 0) {
    Tunable t;
    t.of = of;
    t.quantity = quantity;
    t.owner = owner;
    t.unit = unit;
    t.mechanism = mechanism;
    t.item = static_cast<int>(item);
    t.freedom = static_cast<int>(freedom);
    t.original = t.value = value;
    t.least = least;
    t.most = kMost;
    out.push_back(std::move(t));
  }

  void AddJoints(const MechanismDef& def, int mechanism) {
    for (std::size_t j = 0; j < def.joints.size(); ++j) {
      const JointDef& joint = def.joints[j];
      for (std::size_t i = 0; i < joint.freedoms.size(); ++i) {
        const FreedomDef& f = joint.freedoms[i];
        const bool turns = f.screw_B.head<3>().squaredNorm() > 1e-18;
        const std::string name =
            joint.freedoms.size() == 1 ? joint.name : joint.name + "." + std::to_string(i);
        double stiffness = f.stiffness, damping = f.damping;
        for (const ControlDef& c : def.controls) {
          const ServoShare* share = ShareOf(servos, mechanism, c.name);
          if (!share || !OnOneFreedom(c) || c.terms[0].first.joint.u() != j ||
              c.terms[0].first.freedom != static_cast<int>(i))
            continue;
          const double arm2 = c.terms[0].second * c.terms[0].second;
          stiffness -= share->stiffness * arm2;
          damping -= share->damping * arm2;
        }
        // The rest of a difference of equal sums.
        if (std::abs(stiffness) < 1e-12 * f.stiffness) stiffness = 0;
        if (std::abs(damping) < 1e-12 * f.damping) damping = 0;
        const auto add = [&](Quantity q, const char* unit, double value, double least) {
          Add(Of::kJoint, q, name, unit, mechanism, j, i, value, least);
        };
        add(Quantity::kStiffness, turns ? "N·m/rad" : "N/m", stiffness, 0);
        add(Quantity::kDamping, turns ? "N·m·s/rad" : "N·s/m", damping, 0);
        if (joint.freedoms.size() == 1) {
          add(Quantity::kLower, turns ? "rad" : "m", f.lower, -kMost);
          add(Quantity::kUpper, turns ? "rad" : "m", f.upper, -kMost);
          for (const DryFrictionDef& d : def.frictions)
            if (d.name == joint.name) add(Quantity::kDryFriction, turns ? "N·m" : "N", d.force, 0);
        }
      }
    }
  }

  void AddActuators(const MechanismDef& def, int mechanism) {
    for (std::size_t k = 0; k < def.controls.size(); ++k) {
      const ControlDef& c = def.controls[k];
      const ServoShare* share = ShareOf(servos, mechanism, c.name);
      if (!share) continue;
      const auto add = [&](Quantity q, const char* unit, double value, double least) {
        Add(Of::kActuator, q, c.name, unit, mechanism, k, 0, value, least);
      };
      bool turns = false;  // a tendon's length is a way, as that of several joints mostly is
      if (OnOneFreedom(c)) {
        const FreedomRef at = c.terms[0].first;
        const FreedomDef& f = def.joints[at.joint.u()].freedoms[static_cast<std::size_t>(at.freedom)];
        turns = f.screw_B.head<3>().squaredNorm() > 1e-18;
      }
      if (share->stiffness > 0) add(Quantity::kStiffness, turns ? "N·m/rad" : "N/m", share->stiffness, 0);
      if (share->stiffness > 0 || share->damping > 0)
        add(Quantity::kDamping, turns ? "N·m·s/rad" : "N·s/m", share->damping, 0);
      const auto limit = std::find_if(def.force_limits.begin(), def.force_limits.end(),
                                      [&](const ForceLimitDef& f) { return f.name == c.name; });
      const bool limited = limit != def.force_limits.end();
      add(Quantity::kForceLower, turns ? "N·m" : "N", limited ? limit->lower : -kInfinity, -kMost);
      add(Quantity::kForceUpper, turns ? "N·m" : "N", limited ? limit->upper : kInfinity, -kMost);
    }
  }

  void AddBody(const std::string& name, const SpatialInertia& inertia, bool massive,
               const std::vector<GeometryDef>& shapes, int mechanism, std::size_t item) {
    if (massive && inertia.mass > 0)
      Add(Of::kBody, Quantity::kMass, name, "kg", mechanism, item, 0, inertia.mass, 1e-9);
    double friction = -1;
    for (const GeometryDef& g : shapes)
      if (g.Collides() && !g.frictionless) friction = std::max(friction, g.friction);
    if (friction >= 0) Add(Of::kBody, Quantity::kFriction, name, "", mechanism, item, 0, friction);
  }
};

void SetFriction(std::vector<GeometryDef>& shapes, double value) {
  for (GeometryDef& g : shapes) g.friction = value;
}

void SetMass(SpatialInertia& inertia, double mass) {
  inertia.rotational *= mass / inertia.mass;
  inertia.mass = mass;
}

// k (q - rest) becomes that of a spring that pulls with c more at the reference.
void AddSpring(double k, double at_reference, double& stiffness, double& rest) {
  const double c = stiffness * rest + at_reference;
  stiffness = std::max(0.0, stiffness + k);
  rest = stiffness > 0 ? c / stiffness : 0;
}

void ApplyJoint(const Tunable& t, MechanismDef& def) {
  JointDef& joint = def.joints[static_cast<std::size_t>(t.item)];
  FreedomDef& f = joint.freedoms[static_cast<std::size_t>(t.freedom)];
  const double more = t.value - t.original;
  switch (t.quantity) {
    case Quantity::kStiffness: {
      // Its own spring keeps its own rest where it alone holds the joint; beside a servo it is unloaded at 0.
      const bool alone = f.stiffness > 0 && t.original >= f.stiffness * (1 - 1e-9);
      AddSpring(more, alone ? more * f.rest : 0, f.stiffness, f.rest);
      break;
    }
    case Quantity::kDamping:
      f.damping = std::max(0.0, f.damping + more);
      break;
    case Quantity::kLower:
      f.lower = t.value;
      break;
    case Quantity::kUpper:
      f.upper = t.value;
      break;
    default:
      for (DryFrictionDef& d : def.frictions)
        if (d.name == joint.name) d.force = t.value;
  }
}

// `share` as the file has it, `now` with all that is tuned.
void ApplyActuator(const Tunable& t, const ServoShare& share, const ServoShare& now, MechanismDef& def) {
  ControlDef& c = def.controls[static_cast<std::size_t>(t.item)];
  const double more = t.value - t.original;
  ForceLimitDef* limit = LimitOf(def, c.name);
  if (t.quantity == Quantity::kForceLower || t.quantity == Quantity::kForceUpper) {
    if (!limit) {
      ForceLimitDef made;
      made.name = c.name;
      made.terms = c.terms;
      made.along = c.along;
      made.inputs = {{c.name, 1.0}};
      made.stiffness = now.stiffness;
      made.damping = now.damping;
      made.rest = now.Rest();
      def.force_limits.push_back(std::move(made));
      limit = &def.force_limits.back();
    }
    (t.quantity == Quantity::kForceLower ? limit->lower : limit->upper) = t.value;
    return;
  }
  const bool stiffness = t.quantity == Quantity::kStiffness;
  if (limit) {
    (stiffness ? limit->stiffness : limit->damping) += more;
    limit->rest = now.Rest();
  }
  // A speed servo's damping is what its input is multiplied by.
  if (stiffness && c.is_setpoint) {
    c.gain += more * c.setpoint_per_unit;
    c.setpoint_rest = now.Rest();
  } else if (!stiffness && !c.is_setpoint && share.stiffness == 0) {
    c.gain += more;
  }
  if (OnOneFreedom(c)) {
    const auto [at, arm] = c.terms[0];
    FreedomDef& f = def.joints[at.joint.u()].freedoms[static_cast<std::size_t>(at.freedom)];
    if (stiffness)
      AddSpring(more * arm * arm, -more * arm * share.at_reference, f.stiffness, f.rest);
    else
      f.damping = std::max(0.0, f.damping + more * arm * arm);
  } else if (SpringDef* spring = SpringOf(def, c.name)) {
    (stiffness ? spring->stiffness : spring->damping) += more;
    spring->rest = now.Rest();
  }
}

}  // namespace

const char* Name(Tunable::Of of) {
  static constexpr const char* kNames[] = {"joint", "actuator", "body", "world"};
  return kNames[static_cast<int>(of)];
}

const char* Name(Tunable::Quantity quantity) {
  static constexpr const char* kNames[] = {"stiffness",   "damping",     "lower", "upper",   "dry_friction",
                                           "force_lower", "force_upper", "mass",  "friction"};
  return kNames[static_cast<int>(quantity)];
}

std::vector<Tunable> FindTunables(const Scene& scene, const std::vector<ServoShare>& servos) {
  Finder finder{scene, servos, {}};
  for (std::size_t i = 0; i < scene.mechanisms.size(); ++i) {
    const MechanismDef& def = scene.mechanisms[i];
    const int mechanism = static_cast<int>(i);
    finder.AddActuators(def, mechanism);
    finder.AddJoints(def, mechanism);
    for (std::size_t b = 0; b < def.bodies.size(); ++b) {
      const bool moves = b > 0 || def.base == BaseKind::kFloating;
      finder.AddBody(def.bodies[b].name, def.bodies[b].inertia, moves, def.bodies[b].geometries, mechanism,
                     b);
    }
  }
  for (std::size_t b = 0; b < scene.free_bodies.size(); ++b)
    finder.AddBody(scene.free_bodies[b].name, scene.free_bodies[b].inertia, true,
                   scene.free_bodies[b].geometries, -1, b);
  for (std::size_t g = 0; g < scene.world.size(); ++g)
    if (scene.world[g].Collides())
      finder.Add(Of::kWorld, Quantity::kFriction, scene.world[g].name, "", -1, g, 0, scene.world[g].friction);
  return std::move(finder.out);
}

std::vector<ServoShare> TunedServos(const std::vector<Tunable>& tunables, std::vector<ServoShare> servos) {
  for (const Tunable& t : tunables) {
    if (t.of != Of::kActuator || t.value == t.original) continue;
    for (ServoShare& s : servos)
      if (s.mechanism == t.mechanism && s.control == t.owner) {
        if (t.quantity == Quantity::kStiffness) s.stiffness = t.value;
        if (t.quantity == Quantity::kDamping) s.damping = t.value;
      }
  }
  return servos;
}

void ApplyTunables(const std::vector<Tunable>& tunables, const std::vector<ServoShare>& servos,
                   Scene& scene) {
  const std::vector<ServoShare> now = TunedServos(tunables, servos);
  for (const Tunable& t : tunables) {
    if (t.value == t.original) continue;
    const auto item = static_cast<std::size_t>(t.item);
    if (t.of == Of::kWorld) {
      scene.world[item].friction = t.value;
    } else if (t.of == Of::kBody) {
      BodyDef* body =
          t.mechanism < 0 ? nullptr : &scene.mechanisms[static_cast<std::size_t>(t.mechanism)].bodies[item];
      if (t.quantity == Quantity::kMass)
        SetMass(body ? body->inertia : scene.free_bodies[item].inertia, t.value);
      else
        SetFriction(body ? body->geometries : scene.free_bodies[item].geometries, t.value);
    } else {
      MechanismDef& def = scene.mechanisms[static_cast<std::size_t>(t.mechanism)];
      if (t.of == Of::kJoint)
        ApplyJoint(t, def);
      else if (const ServoShare* share = ShareOf(servos, t.mechanism, def.controls[item].name))
        ApplyActuator(t, *share, *ShareOf(now, t.mechanism, share->control), def);
    }
  }
}

}  // namespace fork1s
