// Random motions for the error estimate: one second each, of the families that users simulate.
#include <cmath>
#include <lab/error_families.hpp>
#include <numbers>
#include <stdexcept>
#include <tests/mechanisms.hpp>
#include <tests/random_mechanism.hpp>

namespace fork1s {
namespace {

using testing::RandomMechanismDef;
using testing::RandomMechanismOptions;
using testing::RandomSource;

constexpr double kSecond = 1;  // s

GeometryDef Ground(double friction) {
  GeometryDef ground;
  ground.name = "ground";
  ground.shape = Plane{};
  ground.friction = friction;
  return ground;
}

// Joint rates that the reduced coordinates have: what a reduction loses of a start before the first step is
// not for the estimate to know.
void SetStart(TransientCase& c, const VectorX& q_dot, const Vector6& V_R) {
  const MechanismDef& def = c.scene.mechanisms[0];
  KeyframeDef key;
  key.mechanisms.push_back({VectorX::Zero(q_dot.size()), q_dot, def.X_WR, V_R, {}});
  c.scene.keyframes.push_back(key);
  c.initial_keyframe = 0;
  SimulationOptions start;
  start.initial_keyframe = 0;
  start.step.integrator = Integrator::kEuler;  // without load columns: these rates suit every integrator
  auto guide = Simulation::Create(c.scene, start);
  if (!guide) throw std::runtime_error(c.name + ": " + guide.error().Text());
  const MechanismDynamics& m = guide->world().mechanisms()[0];
  c.scene.keyframes[0].mechanisms[0].q_dot = m.configuration().Q_now * m.state().w;
  c.scene.keyframes[0].mechanisms[0].V_R = m.state().V_R;
}

// Trees, with loops or not, on a still or a floating base. What floats has no weight, else it would only fall.
TransientCase MechanismCase(ErrorFamily family, unsigned seed) {
  const bool floats = family == ErrorFamily::kFloating;
  RandomMechanismOptions options;
  options.base = floats ? BaseKind::kFloating : BaseKind::kFixed;
  options.rigid_closures = family == ErrorFamily::kLoop ? 1 : 0;
  options.springs = family == ErrorFamily::kTree ? 0 : 1;
  options.stiffness_low = 20;
  options.damping_ratio = 0.005;
  TransientCase c;
  c.scene.mechanisms.push_back(RandomMechanismDef(seed, options));
  MechanismDef& def = c.scene.mechanisms[0];
  def.modes = static_cast<int>(seed % 4);
  if (floats) c.scene.gravity.setZero();
  RandomSource random(seed + 11000);
  const int n = testing::BuildOrThrow(def).num_coordinates();
  const VectorX q_dot = random.Vector(n, 1);
  SetStart(c, q_dot, floats ? random.Six(1) : Vector6(Vector6::Zero()));
  return c;
}

// A base that is driven along a path with corners from a start at full speed, and two servos.
TransientCase DrivenCase(unsigned seed) {
  RandomMechanismOptions options;
  options.bodies = 5;
  options.base = BaseKind::kDriven;
  options.rigid_closures = static_cast<int>(seed % 2);
  options.stiffness_low = 20;
  options.damping_ratio = 0.02;
  TransientCase c;
  c.scene.gravity.setZero();
  c.scene.mechanisms.push_back(RandomMechanismDef(seed, options));
  MechanismDef& def = c.scene.mechanisms[0];
  RandomSource random(seed + 12000);
  const std::string base = def.bodies[0].name;
  c.controls.times = {0, 0.4, 0.7, 1};
  c.controls.rows.resize(4);
  const auto add = [&](const std::string& name, double size) {
    c.controls.names.push_back(name);
    c.controls.rows[0].push_back(0);
    for (std::size_t k = 1; k < 4; ++k) c.controls.rows[k].push_back(random.Uniform(-size, size));
  };
  for (const char* axis : {".x", ".y", ".z"}) add(base + axis, 0.05);
  add(base + ".rz", 0.3);
  for (int k = 0; k < 2; ++k) {
    ControlDef servo;
    servo.name = "servo" + std::to_string(k);
    const int joint = random.Below(static_cast<int>(def.joints.size()));
    servo.terms.emplace_back(FreedomRef{JointIndex(joint), 0}, 1.0);
    servo.gain = random.Uniform(20, 100);
    servo.is_setpoint = true;
    def.controls.push_back(servo);
    add(servo.name, 0.2);
  }
  return c;
}

// A sphere or a cylinder on its side, its centre of mass beside its axis by up to a third of the radius, set
// rolling. It stays on the ground: the offset mass turns slower than sqrt(g/r).
TransientCase RollingCase(unsigned seed) {
  RandomSource random(seed + 13000);
  const bool cylinder = random.Below(2) == 0;
  const double radius = random.Uniform(0.03, 0.1), friction = random.Uniform(0.6, 1.2);
  const double offset = random.Uniform(0, 1.0 / 3) * radius, angle = random.Uniform(0, 2 * std::numbers::pi);
  const double rate = random.Uniform(0.2, 0.8) * std::sqrt(9.81 / radius);  // rad/s
  const double half = random.Uniform(0.5, 1.5) * radius, course = random.Uniform(0, 2 * std::numbers::pi);
  TransientCase c;
  FreeBodyDef body;
  body.name = cylinder ? "cylinder" : "sphere";
  body.inertia.mass = random.Uniform(0.2, 2);
  const double m = body.inertia.mass;
  // Axis of the cylinder along z of the body, which lies along y of the course.
  body.inertia.center = offset * Vector3(std::cos(angle), std::sin(angle), 0);
  if (cylinder) {
    const double across = m * (3 * radius * radius + 4 * half * half) / 12;
    body.inertia.rotational = Vector3(across, across, 0.5 * m * radius * radius).asDiagonal();
  } else {
    body.inertia.rotational = 0.4 * m * radius * radius * Matrix3::Identity();
  }
  GeometryDef shape;
  shape.name = body.name;
  if (cylinder)
    shape.shape = Cylinder{radius, half};
  else
    shape.shape = Sphere{radius};
  shape.friction = friction;
  body.geometries.push_back(shape);
  const Matrix3 along = ExpRotation(Vector3(0, 0, course));
  body.X_WB =
      RigidTransform(along * ExpRotation(Vector3(-std::numbers::pi / 2, 0, 0)), Vector3(0, 0, radius));
  c.scene.free_bodies.push_back(body);
  c.scene.world.push_back(Ground(friction));
  KeyframeDef key;
  KeyframeDef::FreeBodyState start;
  start.X_WB = body.X_WB;
  start.omega_W = along * Vector3(0, rate, 0);
  start.velocity_W = along * Vector3(rate * radius, 0, 0);
  key.free_bodies.push_back(start);
  c.scene.keyframes.push_back(key);
  c.initial_keyframe = 0;
  return c;
}

BodyIndex AddLink(MechanismBuilder& builder, const std::string& name, BodyIndex parent,
                  const RigidTransform& X_PB, double mass, double length, const Vector3& axis,
                  double stiffness, double damping) {
  BodyDef link;
  link.name = name;
  link.parent = parent;
  link.X_PB = X_PB;
  link.inertia = testing::Rod(mass, length);
  const BodyIndex body = builder.AddBody(link);
  builder.AddJoint(JointDef::Hinge(name, body, axis).WithSpring(stiffness, damping));
  return body;
}

void AddTip(MechanismDef& def, const std::string& body, double radius, double length, double friction) {
  for (BodyDef& b : def.bodies) {
    if (b.name != body) continue;
    GeometryDef tip;
    tip.name = body + "_tip";
    tip.shape = Sphere{radius};
    tip.X_BG = RigidTransform(Vector3(length, 0, 0));
    tip.friction = friction;
    tip.contype = 1;
    tip.conaffinity = 2;
    b.geometries.push_back(tip);
  }
}

// Two or three fingers of two links hang from a palm around a box that stands on the ground. Servos bend them
// inwards until they press on its sides.
TransientCase GraspCase(unsigned seed) {
  RandomSource random(seed + 14000);
  const int fingers = 2 + random.Below(2);
  const double half = random.Uniform(0.02, 0.03), friction = random.Uniform(0.8, 1.2);
  const double length = random.Uniform(0.05, 0.07), tip = 0.008;
  const double gap = random.Uniform(0.002, 0.006);  // of a tip from the box
  TransientCase c;
  c.controls.times = {0, random.Uniform(0.3, 0.5), kSecond};
  c.controls.rows.resize(3);
  MechanismBuilder builder("hand", BaseKind::kFixed, testing::Brick(0.5, Vector3(0.05, 0.05, 0.02)));
  std::vector<std::string> tips;
  const Matrix3 down = ExpRotation(Vector3(0, std::numbers::pi / 2, 0));  // x of a link points down
  for (int i = 0; i < fingers; ++i) {
    const std::string n = std::to_string(i);
    const double turn = fingers == 2 ? std::numbers::pi * i : std::numbers::pi * i / 2;
    const Matrix3 R = ExpRotation(Vector3(0, 0, turn));
    const double k = random.Uniform(1, 3), d = k * random.Uniform(0.01, 0.03);
    const BodyIndex upper = AddLink(builder, "upper" + n, builder.base(),
                                    RigidTransform(R * down, R * Vector3(half + gap + tip, 0, 0)), 0.05,
                                    length, Vector3::UnitY(), k, d);
    AddLink(builder, "lower" + n, upper, RigidTransform(Vector3(length, 0, 0)), 0.03, length,
            Vector3::UnitY(), k, d);
    tips.push_back("lower" + n);
  }
  builder.SetInterfaces(tips);
  MechanismDef def = builder.definition();
  for (const std::string& name : tips) AddTip(def, name, tip, length, friction);
  for (int i = 0; i < fingers; ++i) {
    ControlDef servo;
    servo.name = "close" + std::to_string(i);
    servo.terms.emplace_back(FreedomRef{JointIndex(2 * i), 0}, 1.0);
    servo.gain = random.Uniform(2, 4);
    servo.is_setpoint = true;
    def.controls.push_back(servo);
    c.controls.names.push_back(servo.name);
    const double close = gap / (2 * length) + random.Uniform(0.15, 0.3);
    c.controls.rows[0].push_back(0);
    c.controls.rows[1].push_back(close);
    c.controls.rows[2].push_back(close + random.Uniform(-0.05, 0.05));
  }
  def.X_WR = RigidTransform(Vector3(0, 0, half + 2 * length));
  c.scene.mechanisms.push_back(def);
  FreeBodyDef box;
  box.name = "box";
  box.inertia = testing::Brick(random.Uniform(0.05, 0.3), Vector3(half, half, half));
  GeometryDef shape;
  shape.name = "box";
  shape.shape = Box{Vector3(half, half, half)};
  shape.friction = friction;
  shape.contype = 2;
  shape.conaffinity = 1;
  box.geometries.push_back(shape);
  box.X_WB = RigidTransform(Vector3(0, 0, half));
  c.scene.free_bodies.push_back(box);
  GeometryDef ground = Ground(0.5);
  ground.contype = ground.conaffinity = 3;
  c.scene.world.push_back(ground);
  return c;
}

// A body on three to five legs with bent knees and round feet above the ground.
TransientCase LeggedCase(unsigned seed, double friction, double height, const Vector6& V_R) {
  RandomSource random(seed + 15000);
  const int legs = 3 + random.Below(3);
  constexpr double kFoot = 0.015;  // m
  MechanismBuilder builder("walker", BaseKind::kFloating, testing::Brick(2, Vector3(0.15, 0.12, 0.04)));
  TransientCase c;
  c.controls.times = {0, 0.3, 0.6, kSecond};
  c.controls.rows.resize(4);
  const double length = random.Uniform(0.12, 0.2), spread = random.Uniform(0.4, 0.7);
  std::vector<std::string> feet;
  for (int i = 0; i < legs; ++i) {
    const std::string n = std::to_string(i);
    const double turn = 2 * std::numbers::pi * (i + random.Uniform(-0.2, 0.2)) / legs;
    const double stiffness = random.Uniform(15, 40), damping = stiffness * random.Uniform(0.01, 0.04);
    const Matrix3 R = ExpRotation(Vector3(0, 0, turn));
    const BodyIndex thigh =
        AddLink(builder, "thigh" + n, builder.base(), RigidTransform(R, R * Vector3(0.12, 0, 0)), 0.2, 0.12,
                Vector3::UnitZ(), stiffness, damping);
    const Matrix3 bent = ExpRotation(Vector3(0, std::numbers::pi / 2 - spread, 0));
    AddLink(builder, "shank" + n, thigh, RigidTransform(bent, Vector3(0.12, 0, 0)), 0.1, length,
            Vector3::UnitY(), stiffness, damping);
    feet.push_back("shank" + n);
  }
  builder.SetInterfaces(feet);
  MechanismDef def = builder.definition();
  for (const std::string& name : feet) AddTip(def, name, kFoot, length, friction);
  for (int j = 0; j < 2 * legs; ++j) {
    ControlDef servo;
    servo.name = "servo" + std::to_string(j);
    servo.terms.emplace_back(FreedomRef{JointIndex(j), 0}, 1.0);
    servo.gain = random.Uniform(15, 30);
    servo.is_setpoint = true;
    def.controls.push_back(servo);
    c.controls.names.push_back(servo.name);
    for (std::size_t k = 0; k < 4; ++k)
      c.controls.rows[k].push_back(k == 0 ? 0 : random.Uniform(-0.02, 0.02));
  }
  def.X_WR = RigidTransform(Vector3(0, 0, length * std::cos(spread) + kFoot + height));
  GeometryDef ground = Ground(friction);
  ground.contype = ground.conaffinity = 3;
  c.scene.world.push_back(ground);
  c.scene.mechanisms.push_back(def);
  const VectorX still = VectorX::Zero(2 * legs);
  KeyframeDef key;
  key.mechanisms.push_back({still, still, def.X_WR, V_R, {}});
  c.scene.keyframes.push_back(key);
  c.initial_keyframe = 0;
  return c;
}

// A leg of two links on a still base swings down on the ground.
TransientCase SwingingLegCase(unsigned seed) {
  RandomSource random(seed + 16000);
  TransientCase c;
  const double length = random.Uniform(0.2, 0.3), tip = 0.02, friction = random.Uniform(0.3, 1);
  MechanismBuilder builder("leg", BaseKind::kFixed, testing::Brick(1, Vector3(0.05, 0.05, 0.05)));
  const double tilt = random.Uniform(0.3, 0.7);
  BodyIndex last = builder.base();
  for (int i = 0; i < 2; ++i) {
    const double k = random.Uniform(30, 80);
    last = AddLink(builder, "link" + std::to_string(i), last,
                   i == 0 ? RigidTransform(ExpRotation(Vector3(0, tilt, 0)), Vector3::Zero())
                          : RigidTransform(Vector3(length, 0, 0)),
                   random.Uniform(0.3, 0.8), length, Vector3::UnitY(), k, k * random.Uniform(0.01, 0.03));
  }
  builder.SetInterfaces({"link1"});
  MechanismDef def = builder.definition();
  AddTip(def, "link1", tip, length, friction);
  def.X_WR = RigidTransform(Vector3(0, 0, 2 * length * std::sin(tilt) + tip + random.Uniform(0.005, 0.02)));
  c.scene.mechanisms.push_back(def);
  GeometryDef ground = Ground(friction);
  ground.contype = ground.conaffinity = 3;
  c.scene.world.push_back(ground);
  return c;
}

TransientCase LandingCase(unsigned seed) {
  RandomSource random(seed + 17000);
  if (random.Below(2) == 0) return SwingingLegCase(seed);
  return LeggedCase(seed, random.Uniform(1.2, 2), random.Uniform(0.005, 0.03), Vector6::Zero());
}

// Legs that slide from a start at speed, or a box.
TransientCase SlidingCase(unsigned seed) {
  RandomSource random(seed + 18000);
  const double friction = random.Uniform(0.1, 0.25), course = random.Uniform(0, 2 * std::numbers::pi);
  const double speed = random.Uniform(1, 2.5), spin = random.Uniform(-1, 1);
  Vector6 V;
  V << 0, 0, spin, speed * std::cos(course), speed * std::sin(course), 0;
  if (random.Below(2) == 0) return LeggedCase(seed, friction, 0, V);
  TransientCase c;
  FreeBodyDef box;
  box.name = "box";
  const Vector3 half(random.Uniform(0.05, 0.1), random.Uniform(0.05, 0.1), random.Uniform(0.02, 0.04));
  box.inertia = testing::Brick(random.Uniform(0.2, 2), half);
  GeometryDef shape;
  shape.name = "box";
  shape.shape = Box{half};
  shape.friction = friction;
  box.geometries.push_back(shape);
  box.X_WB = RigidTransform(Vector3(0, 0, half.z()));
  c.scene.free_bodies.push_back(box);
  c.scene.world.push_back(Ground(friction));
  KeyframeDef key;
  KeyframeDef::FreeBodyState start;
  start.X_WB = box.X_WB;
  start.omega_W = V.head<3>();
  start.velocity_W = V.tail<3>();
  key.free_bodies.push_back(start);
  c.scene.keyframes.push_back(key);
  c.initial_keyframe = 0;
  return c;
}

}  // namespace

const char* Name(ErrorFamily family) {
  switch (family) {
    case ErrorFamily::kTree:
      return "trees";
    case ErrorFamily::kLoop:
      return "loops";
    case ErrorFamily::kFloating:
      return "floating bases";
    case ErrorFamily::kDriven:
      return "driven bases";
    case ErrorFamily::kRolling:
      return "rolling";
    case ErrorFamily::kGrasp:
      return "grasps";
    case ErrorFamily::kLanding:
      return "landings";
    case ErrorFamily::kSliding:
      return "sliding";
  }
  return "";
}

TransientCase DrawErrorCase(ErrorFamily family, unsigned seed) {
  TransientCase c;
  switch (family) {
    case ErrorFamily::kTree:
    case ErrorFamily::kLoop:
    case ErrorFamily::kFloating:
      c = MechanismCase(family, seed);
      break;
    case ErrorFamily::kDriven:
      c = DrivenCase(seed);
      break;
    case ErrorFamily::kRolling:
      c = RollingCase(seed);
      break;
    case ErrorFamily::kGrasp:
      c = GraspCase(seed);
      break;
    case ErrorFamily::kLanding:
      c = LandingCase(seed);
      break;
    case ErrorFamily::kSliding:
      c = SlidingCase(seed);
      break;
  }
  c.name = std::string(Name(family)) + " " + std::to_string(seed);
  c.time = kSecond;
  return c;
}

}  // namespace fork1s
