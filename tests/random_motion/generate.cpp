#include <cmath>
#include <fork1s/mechanism/kinematics.hpp>
#include <mechanisms.hpp>
#include <random_mechanism.hpp>

#include "random_motion.hpp"

namespace fork1s::random_motion {
namespace {

using testing::RandomSource;

constexpr double kUnitSize = 0.2;  // m, between bodies of RandomMechanismDef
constexpr double kGravity = 9.81;  // m/s²

enum Stream : unsigned {
  kTree = 1,
  kScale,
  kSprings,
  kDampers,
  kArmatures,
  kLimits,
  kFrictions,
  kServos,
  kMotion,
  kContact,
  kPush,
  kJumps
};

RandomSource Numbers(unsigned seed, Stream stream) { return RandomSource(seed * 64u + stream); }

double LogUniform(RandomSource& random, double low, double high) {
  return low * std::pow(std::max(high / low, 1.0), random.Uniform(0, 1));
}

bool Turns(const FreedomDef& f) { return f.screw_B.head<3>().norm() > 0; }

RigidTransform ScaledPose(const RigidTransform& X, double s) { return {X.rotation(), s * X.translation()}; }

void ScaleInertia(SpatialInertia& I, double s, double mass_scale) {
  I.mass *= mass_scale;
  I.center *= s;
  I.rotational *= mass_scale * s * s;
}

const FreedomDef& At(const MechanismDef& def, const FreedomRef& ref) {
  return def.joints[ref.joint.u()].freedoms[static_cast<std::size_t>(ref.freedom)];
}

// All lengths times s. Lengths of tendons are in m: the coefficient of an angle is a radius.
void ScaleSize(MechanismDef& def, double s, double mass_scale) {
  def.X_WR = ScaledPose(def.X_WR, s);
  for (BodyDef& body : def.bodies) {
    body.X_PB = ScaledPose(body.X_PB, s);
    ScaleInertia(body.inertia, s, mass_scale);
  }
  for (JointDef& joint : def.joints)
    for (FreedomDef& f : joint.freedoms)
      if (Turns(f)) f.screw_B.tail<3>() *= s;
  for (ClosureDef& c : def.closures) {
    c.X_AJ = ScaledPose(c.X_AJ, s);
    c.X_BJ = ScaledPose(c.X_BJ, s);
  }
  for (CouplingDef& c : def.couplings) {
    const double a = Turns(At(def, c.a)) ? 1 : s, b = Turns(At(def, c.b)) ? 1 : s;
    for (int k = 0; k < 5; ++k) c.polynomial[k] *= a / std::pow(b, k);
    for (auto& [freedom, coefficient] : c.terms) coefficient *= a / (Turns(At(def, freedom)) ? 1 : s);
  }
  for (SpringDef& spring : def.springs) {
    spring.slack *= s;
    for (auto& [freedom, coefficient] : spring.terms)
      if (Turns(At(def, freedom))) coefficient *= s;
  }
}

struct Scales {
  double size;  // m
  double mass;  // kg, of the whole
  double Inertia(bool turns) const { return turns ? mass * size * size : mass; }
  double SoftStiffness(bool turns) const { return turns ? mass * kGravity * size : mass * kGravity / size; }
  double Force(bool turns) const { return turns ? mass * kGravity * size : mass * kGravity; }
};

// Of one mechanism all alike within a decade, or each anywhere in the range.
class Stiffnesses {
 public:
  Stiffnesses(RandomSource& random, const Scales& scales, double most)
      : random_(random),
        scales_(scales),
        most_(most),
        alike_(random.Chance(0.5)),
        share_(random.Uniform(0, 1)) {}
  double Draw(bool turns) {
    const double low = 0.1 * scales_.SoftStiffness(turns), high = std::max(low, most_);
    const double own = random_.Uniform(0, 1);
    return std::min(high,
                    low * std::pow(high / low, alike_ ? share_ : own) * (alike_ ? std::pow(10, own) : 1));
  }

 private:
  RandomSource& random_;
  Scales scales_;
  double most_;
  bool alike_;
  double share_;
};

void DrawSprings(RandomSource random, const GeneratorOptions& options, const Scales& scales,
                 MechanismDef& def) {
  Stiffnesses stiffness(random, scales, options.max_stiffness);
  constexpr double kSprungShares[] = {0, 0.5, 1, 1};
  const double sprung = kSprungShares[random.Below(4)], preloaded = random.Chance(0.3) ? 0.3 : 0;
  for (JointDef& joint : def.joints) {
    const bool has_spring = random.Chance(sprung);
    for (FreedomDef& f : joint.freedoms) {
      const double k = stiffness.Draw(Turns(f)), rest = random.Uniform(-1, 1);
      f.stiffness = has_spring ? k : 0;
      // Preload of up to a few weights at any stiffness.
      f.rest = has_spring
                   ? preloaded * rest * std::min(Turns(f) ? 1 : scales.size, 3 * scales.Force(Turns(f)) / k)
                   : 0;
    }
  }
  for (ClosureDef& c : def.closures)
    for (int i = 0; i < 6; ++i) {
      const double k = stiffness.Draw(i < 3);
      if (c.stiffness(i) > 0) c.stiffness(i) = k;
    }
  for (SpringDef& s : def.springs) {
    const double k = stiffness.Draw(false);
    for (std::size_t i = 0; i < 2; ++i)
      s.higher_stiffness[i] *= k / s.stiffness / std::pow(scales.size / kUnitSize, i + 1);
    s.stiffness = k;
  }
}

void DrawDampers(RandomSource random, const GeneratorOptions& options, const Scales& scales,
                 MechanismDef& def) {
  const double share = random.Chance(0.5) && options.dampers ? 0.7 : 0;
  const auto damping = [&](double k, bool turns) {
    const double ratio = random.Uniform(0, 1);
    const double of = k > 0 ? k : scales.SoftStiffness(turns);
    return random.Chance(share) ? 2 * ratio * std::sqrt(of * scales.Inertia(turns)) : 0;
  };
  for (JointDef& joint : def.joints)
    for (FreedomDef& f : joint.freedoms) f.damping = damping(f.stiffness, Turns(f));
  for (ClosureDef& c : def.closures)
    for (int i = 0; i < 6; ++i) c.damping(i) = c.stiffness(i) > 0 ? damping(c.stiffness(i), i < 3) : 0;
  for (SpringDef& s : def.springs) s.damping = damping(s.stiffness, false);
}

void DrawArmatures(RandomSource random, const GeneratorOptions& options, const Scales& scales,
                   MechanismDef& def) {
  const double share = random.Chance(0.25) && options.armatures ? 0.5 : 0;
  for (JointDef& joint : def.joints)
    for (FreedomDef& f : joint.freedoms) {
      const double armature = LogUniform(random, 1e-3, 1) * scales.Inertia(Turns(f));
      f.armature = random.Chance(share) ? armature : 0;
    }
}

void DrawLimits(RandomSource random, const GeneratorOptions& options, const Scales& scales,
                MechanismDef& def) {
  const double share = random.Chance(0.3) && options.limits ? 0.4 : 0;
  for (JointDef& joint : def.joints)
    for (FreedomDef& f : joint.freedoms) {
      const double unit = Turns(f) ? 1 : scales.size;
      const double lower = -unit * random.Uniform(0.02, 0.8), upper = unit * random.Uniform(0.02, 0.8);
      if (random.Chance(share)) f.lower = lower, f.upper = upper;
    }
}

void DrawFrictions(RandomSource random, const GeneratorOptions& options, const Scales& scales,
                   MechanismDef& def) {
  const double share = random.Chance(0.25) && options.frictions ? 0.5 : 0;
  for (std::size_t j = 0; j < def.joints.size(); ++j)
    for (std::size_t k = 0; k < def.joints[j].freedoms.size(); ++k) {
      const double force = LogUniform(random, 1e-3, 1) * scales.Force(Turns(def.joints[j].freedoms[k]));
      if (!random.Chance(share)) continue;
      DryFrictionDef friction;
      friction.name = "friction" + std::to_string(def.frictions.size());
      friction.terms.emplace_back(FreedomRef{JointIndex(static_cast<int>(j)), static_cast<int>(k)}, 1.0);
      friction.force = force;
      def.frictions.push_back(friction);
    }
}

void DrawServos(RandomSource random, const GeneratorOptions& options, const Scales& scales,
                MechanismDef& def) {
  if (!random.Chance(0.35) || !options.servos || def.joints.empty()) return;
  Stiffnesses stiffness(random, scales, options.max_stiffness);
  const int count = 1 + random.Below(3);
  for (int i = 0; i < count; ++i) {
    const FreedomRef freedom = testing::internal::RandomFreedom(random, def);
    const bool turns = Turns(At(def, freedom));
    const std::string name = "servo" + std::to_string(i);
    const double k = stiffness.Draw(turns);
    const double damping = random.Chance(0.7) && options.dampers
                               ? 2 * random.Uniform(0, 1) * std::sqrt(k * scales.Inertia(turns))
                               : 0;
    const double bound = LogUniform(random, 0.03, 3) * scales.Force(turns);
    const bool bounded = random.Chance(0.5) && options.bounds;
    ControlDef control;
    control.name = name;
    control.terms.emplace_back(freedom, 1.0);
    control.gain = k;
    control.is_setpoint = true;
    def.controls.push_back(control);
    SpringDef spring;
    spring.name = name;
    spring.terms = control.terms;
    spring.stiffness = k;
    spring.damping = damping;
    def.springs.push_back(spring);
    if (!bounded) continue;
    ForceLimitDef limit;
    limit.name = name;
    limit.terms = control.terms;
    limit.inputs.emplace_back(name, 1.0);
    limit.stiffness = k;
    limit.damping = damping;
    limit.lower = -bound;
    limit.upper = bound;
    def.force_limits.push_back(limit);
  }
}

MechanismDef DrawMechanism(unsigned seed, const GeneratorOptions& options, Scales& scales) {
  RandomSource random = Numbers(seed, kTree);
  testing::RandomMechanismOptions tree;
  tree.bodies = std::min(options.max_bodies, 1 + random.Below(8));
  const int bases = random.Below(5);
  tree.base = options.base >= 0 ? static_cast<BaseKind>(options.base)
              : bases < 2       ? BaseKind::kFixed
              : bases < 4       ? BaseKind::kFloating
                                : BaseKind::kDriven;
  tree.hinges_only = random.Chance(0.2);
  tree.chain = random.Uniform(0, 1);
  tree.armature = false;
  tree.interfaces = 1 + random.Below(3);
  tree.rigid_closures = random.Chance(0.35) ? 1 + random.Below(2) : 0;
  tree.springy_closures = random.Chance(0.15) ? 1 : 0;
  tree.couplings = random.Chance(0.15) ? 1 : 0;
  tree.springs = random.Chance(0.25) ? 1 + random.Below(2) : 0;
  tree.bent_springs = random.Chance(0.3);
  tree.slack = random.Chance(0.3) ? 0.1 : 0;
  if (!options.closures) tree.rigid_closures = tree.springy_closures = 0;
  if (!options.couplings) tree.couplings = 0;
  if (!options.tendons) tree.springs = 0;
  if (!options.nonlinear_tendons) tree.bent_springs = false, tree.slack = 0;
  MechanismDef def = testing::RandomMechanismDef(seed, tree);
  def.modes = 100;  // all

  RandomSource scale_numbers = Numbers(seed, kScale);
  const double s = LogUniform(scale_numbers, 5e-3, 50);  // 1 mm to 10 m
  ScaleSize(def, s, s * s * s * LogUniform(scale_numbers, 0.3, 3));
  scales.size = kUnitSize * s;
  scales.mass = 0;
  for (const BodyDef& body : def.bodies)
    if (body.parent.valid() || def.base == BaseKind::kFloating) scales.mass += body.inertia.mass;
  DrawSprings(Numbers(seed, kSprings), options, scales, def);
  DrawDampers(Numbers(seed, kDampers), options, scales, def);
  DrawArmatures(Numbers(seed, kArmatures), options, scales, def);
  DrawLimits(Numbers(seed, kLimits), options, scales, def);
  DrawFrictions(Numbers(seed, kFrictions), options, scales, def);
  DrawServos(Numbers(seed, kServos), options, scales, def);
  return def;
}

GeometryDef Shaped(const std::string& name, const Shape& shape, const Vector3& at, double friction,
                   int contype, int conaffinity) {
  GeometryDef g;
  g.name = name;
  g.shape = shape;
  g.X_BG = RigidTransform(at);
  g.friction = friction;
  g.contype = contype;
  g.conaffinity = conaffinity;
  return g;
}

// A floor below everything, and now and then a free body between. Bodies of the mechanism do not touch each
// other.
void DrawContact(RandomSource random, const GeneratorOptions& options, const Scales& scales, Case& c) {
  const int kind = random.Below(10);  // 0 to 4: none
  const double friction = random.Uniform(0, 1),
               gap = random.Chance(0.2) ? 0 : random.Uniform(0, 0.5) * scales.size;
  MechanismDef& def = c.scene.mechanisms[0];
  c.radius.assign(def.bodies.size(), 0);
  if (kind < 5 || !options.floor) return;
  const Mechanism m = testing::BuildOrThrow(def);
  double lowest = std::numeric_limits<double>::infinity();
  Vector3 lowest_at = Vector3::Zero();
  for (std::size_t b = 1; b < def.bodies.size(); ++b) {
    const double radius = random.Uniform(0.1, 0.4) * scales.size;
    const bool is_box = random.Chance(0.3);
    // Interior bodies touch nothing.
    if (std::find(def.interfaces.begin(), def.interfaces.end(), def.bodies[b].name) == def.interfaces.end())
      continue;
    const Vector3& center = def.bodies[b].inertia.center;
    const Shape shape =
        is_box ? Shape(Box{Vector3::Constant(radius / std::sqrt(3.0))}) : Shape(Sphere{radius});
    def.bodies[b].geometries.push_back(Shaped(def.bodies[b].name, shape, center, friction, 1, 2));
    c.radius[b] = radius;
    const Vector3 at = def.X_WR * (m.body(BodyIndex(static_cast<int>(b))).X_RB0 * center);
    if (at.z() - radius < lowest) lowest = at.z() - radius, lowest_at = at;
  }
  double floor = lowest - gap;
  if (kind >= 8 && options.free_bodies) {
    const double half = random.Uniform(0.1, 0.4) * scales.size;
    FreeBodyDef body;
    body.name = "block";
    body.inertia = testing::Brick(8 * half * half * half * 1000, Vector3::Constant(half));
    body.X_WB = RigidTransform(Vector3(lowest_at.x(), lowest_at.y(), floor - half));
    const Shape shape = random.Chance(0.5) ? Shape(Box{Vector3::Constant(half)}) : Shape(Sphere{half});
    body.geometries.push_back(Shaped("block", shape, Vector3::Zero(), friction, 2, 3));
    c.scene.free_bodies.push_back(body);
    floor -= 2 * half;
  }
  GeometryDef plane = Shaped("floor", Plane{}, Vector3(0, 0, floor), friction, 2, 3);
  c.scene.world.push_back(plane);
}

void DrawMotion(RandomSource random, const GeneratorOptions& options, const Scales& scales, Case& c) {
  const MechanismDef& def = c.mechanism();
  c.step.integrator = Integrator::kTwoStage;
  c.step.h = 1 / LogUniform(random, 30, 960);
  if (!random.Chance(0.7) || !options.gravity) c.step.gravity.setZero();
  double rate = LogUniform(random, 0.1, 10);  // rad/s
  if (random.Chance(0.3) || !options.spin) rate = 0;
  KeyframeDef::MechanismState start;
  std::vector<double> q_dot;
  for (const JointDef& joint : def.joints)
    for (const FreedomDef& f : joint.freedoms)
      q_dot.push_back(rate * random.Uniform(-1, 1) * (Turns(f) ? 1 : scales.size));
  start.q_dot = Eigen::Map<VectorX>(q_dot.data(), static_cast<Eigen::Index>(q_dot.size()));
  start.q = VectorX::Zero(start.q_dot.size());
  start.X_WR = def.X_WR;
  const Vector6 twist = rate * random.Six(1);
  if (def.base == BaseKind::kFloating) start.V_R << twist.head<3>(), scales.size * twist.tail<3>();
  start.controls = VectorX::Zero(static_cast<Eigen::Index>(def.controls.size()));
  KeyframeDef key;
  key.mechanisms.push_back(start);
  for (const FreeBodyDef& body : c.scene.free_bodies) {
    KeyframeDef::FreeBodyState state;
    state.X_WB = body.X_WB;
    key.free_bodies.push_back(state);
  }
  c.scene.keyframes.push_back(key);
}

void DrawInputs(unsigned seed, const GeneratorOptions& options, const Scales& scales, Case& c) {
  const MechanismDef& def = c.mechanism();
  RandomSource random = Numbers(seed, kPush);
  if (random.Chance(0.3) && options.pushes) {
    c.push.body = 1 + random.Below(static_cast<int>(def.bodies.size()) - 1);
    c.push.begin = random.Below(20);
    c.push.end = c.push.begin + 1 + random.Below(20);
    c.push.force = LogUniform(random, 0.1, 10) * scales.Force(false) * random.Direction();
    if (random.Chance(0.3)) c.push.moment = scales.size * random.Uniform(-0.5, 0.5) * c.push.force;
  }
  RandomSource jumps = Numbers(seed, kJumps);
  const Vector6 base_motion = 0.3 * jumps.Six(1);
  const bool base_jumps = jumps.Chance(0.5);
  const double base_rate = LogUniform(jumps, 0.5, 10);
  if (def.base == BaseKind::kDriven) {
    c.base_jumps = base_jumps && options.base_jumps;
    c.base_motion << base_motion.head<3>(), scales.size * base_motion.tail<3>();
    c.base_rate = base_rate;
  }
  const bool set_points_jump = jumps.Chance(0.7) && options.set_point_jumps && !def.controls.empty();
  if (set_points_jump || c.base_jumps) c.jump_step = 5 + jumps.Below(30);
  c.set_points = VectorX::Zero(static_cast<Eigen::Index>(def.controls.size()));
  for (std::size_t i = 0; i < def.controls.size(); ++i) {
    const double unit = Turns(At(def, def.controls[i].terms[0].first)) ? 1 : scales.size;
    const double to = 0.5 * unit * jumps.Uniform(-1, 1);
    if (set_points_jump) c.set_points(static_cast<Eigen::Index>(i)) = to;
  }
}

}  // namespace

Case DrawCase(unsigned seed, const GeneratorOptions& options) {
  Case c;
  Scales scales{};
  c.seed = seed;
  c.scene.mechanisms.push_back(DrawMechanism(seed, options, scales));
  c.size = scales.size;
  DrawContact(Numbers(seed, kContact), options, scales, c);
  DrawMotion(Numbers(seed, kMotion), options, scales, c);
  DrawInputs(seed, options, scales, c);
  c.world.reduction.promote_hidden = true;
  c.world.reduction.modes = 100;
  c.world.initial_keyframe = 0;
  c.world.collision.margin = std::max(c.world.collision.margin, 2 * scales.size);
  c.description = Describe(c, scales.mass);
  return c;
}

}  // namespace fork1s::random_motion
