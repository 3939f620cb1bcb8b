// Scenes that touch, scenes with everything in them, and the bits of a scene.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <bit>
#include <cstdint>
#include <filesystem>
#include <fork1s/record/recording.hpp>
#include <fstream>
#include <sstream>
#include <string>

#include "random_mechanism.hpp"

namespace fork1s::testing {

/// A folder that is gone after the test.
class Folder {
 public:
  Folder() {
    std::string name = (std::filesystem::temp_directory_path() / "fork1s_record_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder");
    path_ = name;
  }
  ~Folder() {
    std::error_code error;
    std::filesystem::remove_all(path_, error);
  }
  std::string operator/(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

inline std::string Bytes(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

inline void WriteBytes(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
}

inline GeometryDef Geometry(const std::string& name, Shape shape, const Vector3& at = Vector3::Zero()) {
  GeometryDef g;
  g.name = name;
  g.shape = std::move(shape);
  g.X_BG = RigidTransform(at);
  g.friction = 0.8;
  return g;
}

inline SpatialInertia Ball(double mass, double radius) {
  return {mass, Vector3::Zero(), Matrix3(Matrix3::Identity() * 0.4 * mass * radius * radius)};
}

/// A springy chain that hangs from its base along -z, with a ball at its end.
inline MechanismDef Chain(const std::string& name, BaseKind base, int links, const RigidTransform& X_WR) {
  MechanismBuilder builder(name, base, Ball(0.5, 0.1));
  BodyIndex parent = builder.base();
  for (int i = 1; i <= links; ++i) {
    BodyDef body;
    body.name = name + std::to_string(i);
    body.parent = parent;
    body.X_PB = RigidTransform(Vector3(0, 0, -0.08));
    body.inertia = Ball(0.05, 0.03);
    if (i == links) body.geometries.push_back(Geometry(name + "_tip", Sphere{0.03}));
    parent = builder.AddBody(body);
    builder.AddJoint(JointDef::Hinge(name + "_joint" + std::to_string(i), parent,
                                     i % 2 ? Vector3::UnitY() : Vector3::UnitX(), Vector3(0, 0, 0.08))
                         .WithSpring(4.0, 0.05));
  }
  ControlDef control;
  control.name = name + "_pull";
  control.terms = {{FreedomRef{JointIndex(0), 0}, 1.0}};
  control.gain = 4;
  control.is_setpoint = true;
  control.lower = -0.6;
  control.upper = 0.6;
  builder.AddControl(control);
  builder.SetInterfaces({name + std::to_string(links)});
  builder.SetModes(1);
  MechanismDef def = builder.definition();
  def.X_WR = X_WR;
  def.bodies[0].name = name + "_base";
  return def;
}

/// A driven and a fixed chain press on a free box that stands on the ground; a floating chain falls beside
/// it.
inline Scene TouchingScene() {
  Scene scene;
  scene.name = "touching";
  scene.timestep = 0.005;
  scene.mechanisms.push_back(Chain("hand", BaseKind::kDriven, 4, RigidTransform(Vector3(0.02, 0, 0.56))));
  scene.mechanisms.push_back(Chain("pusher", BaseKind::kFixed, 5, RigidTransform(Vector3(-0.14, 0.01, 0.5))));
  scene.mechanisms[1].controls[0].dynamics = ControlDynamics::kLag;
  scene.mechanisms[1].controls[0].time_constant = 0.02;
  MechanismDef walker = Chain("walker", BaseKind::kFloating, 2, RigidTransform(Vector3(0.6, 0, 0.25)));
  walker.bodies[0].geometries.push_back(Geometry("trunk", Box{Vector3(0.06, 0.04, 0.02)}));
  walker.interfaces.push_back("walker_base");
  scene.mechanisms.push_back(walker);
  FreeBodyDef box;
  box.name = "box";
  box.X_WB = RigidTransform(Vector3(0, 0, 0.101));
  box.inertia = {0.4, Vector3::Zero(), Matrix3(Matrix3::Identity() * 0.003)};
  box.geometries.push_back(Geometry("box", Box{Vector3(0.1, 0.1, 0.1)}));
  scene.free_bodies.push_back(box);
  scene.world.push_back(Geometry("ground", Plane{}));
  return scene;
}

/// Inputs of step i: sweeps the controls, drives the hand, pushes now and then.
inline std::vector<AppliedWrench> SetInputs(int i, Simulation& simulation) {
  const double t = simulation.time();
  simulation.SetControl("pusher_pull", 0.5 * std::sin(3 * t));
  simulation.SetControl("hand_base.z", -0.03 * std::sin(5 * t));
  simulation.SetControl("hand_base.rx", 0.1 * std::sin(4 * t));
  if (i % 3 > 0) {  // what the base is driven along is known now and then
    simulation.SetBaseRate(simulation.FindControl("hand_base.z"), -0.15 * std::cos(5 * t));
    simulation.SetBaseRate(simulation.FindControl("hand_base.rx"), 0.4 * std::cos(4 * t));
  }
  if (i % 5 == 1) {  // grips, moves on, lets go
    PointSpring spring{Vector3(0.1, 0, 0.1), Vector3(0.2, 0.1, 0.3), Vector3(0.2, 0.1 + 0.01 * t, 0.3), 20,
                       1};
    simulation.SetPointSpring(simulation.FindBody("box"), spring);
    spring.stiffness = 2;
    simulation.SetPointSpring(simulation.FindBody("walker2"), spring);
  } else if (i % 5 == 4) {
    simulation.ClearPointSprings();
  }
  std::vector<AppliedWrench> wrenches;
  if (i % 7 == 3) {
    const int body = simulation.FindBody("box");
    wrenches.push_back(
        {body, Vector3(0.3, 0.2, 0), Vector3(0, 0, 0.01), simulation.Pose(body).translation()});
    wrenches.push_back(
        {simulation.FindBody("walker2"), Vector3(0, 0.5, 0), Vector3::Zero(), Vector3(0.6, 0, 0.2)});
  }
  return wrenches;
}

inline Simulation CreateOrThrow(const Scene& scene, const SimulationOptions& options = {}) {
  auto simulation = Simulation::Create(scene, options);
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  return std::move(*simulation);
}

/// Records `steps` steps of a scene under SetInputs.
inline void Record(Simulation& simulation, Recorder& recorder, int steps) {
  for (int i = 0; i < steps; ++i) {
    const auto wrenches = SetInputs(i, simulation);
    ApplyWrenches(wrenches, simulation);
    const StepReport report = simulation.Step();
    auto ok = recorder.Append(simulation, report, wrenches);
    ASSERT_TRUE(ok) << ok.error().Text();
  }
}

/// A scene with every kind of shape, body, joint, connection and value, for round trips.
inline Scene SceneWithEverything(unsigned seed) {
  RandomSource random(seed);
  Scene scene;
  scene.name = seed % 2 ? "näme, \"quoted\"\n\x01" : std::string("bytes \xff\xfe") + '\0' + "end";
  scene.gravity = random.InBox(10);
  scene.timestep = random.Uniform(1e-4, 0.1);
  RandomMechanismOptions options;
  options.rigid_closures = 1;
  options.springy_closures = 1;
  options.couplings = 1;
  options.coupling_terms = 2;
  options.springs = 1;
  options.controls = 2;
  options.rest = true;
  options.joints_in_order = seed % 2;
  for (int i = 0; i < 3; ++i) {
    options.base = i == 0 ? BaseKind::kFixed : i == 1 ? BaseKind::kFloating : BaseKind::kDriven;
    scene.mechanisms.push_back(RandomMechanismDef(3 * seed + static_cast<unsigned>(i), options));
    MechanismDef& m = scene.mechanisms.back();
    m.interfaces_chosen = random.Chance(0.5);
    m.modes = random.Below(9);
    m.modes_by_step = random.Chance(0.5);
    m.mode_choice = static_cast<ModeChoice>(random.Below(2));
    m.bodies[1].gravity_compensation = random.Uniform(0, 1);
    m.parent_filter = static_cast<ParentFilter>(i);
    m.joints[0].freedoms[0].lower = -random.Uniform(0, 2);
    m.controls[0].upper = random.Uniform(1, 2);
    m.controls[0].initial = -0.0;
    m.controls[1].dynamics = static_cast<ControlDynamics>((i + static_cast<int>(seed % 2)) % 4);
    m.controls[1].deactivation_time = random.Uniform(0.01, 1);
    m.controls[1].smoothing = random.Uniform(0, 1);
    m.controls[0].setpoint_per_unit = random.Uniform(0.1, 3);
    m.controls[0].setpoint_rest = random.Uniform(-1, 1);
    m.controls[1].is_velocity_setpoint = true;
    MuscleDef muscle;
    muscle.name = "muscle";
    muscle.terms = m.controls[0].terms;
    muscle.control = m.controls[0].name;
    muscle.force = random.Uniform(0, 100);
    muscle.length_lower = -random.Uniform(0.1, 1), muscle.length_upper = random.Uniform(0.1, 1);
    muscle.range_lower = random.Uniform(0.5, 0.8), muscle.range_upper = random.Uniform(1, 1.2);
    muscle.lmin = random.Uniform(0.3, 0.6), muscle.lmax = random.Uniform(1.4, 1.8);
    muscle.vmax = random.Uniform(1, 2), muscle.fpmax = random.Uniform(1, 2),
    muscle.fvmax = random.Uniform(1, 2);
    m.muscles.push_back(muscle);
    m.controls[1].time_constant = random.Uniform(0.01, 1);
    m.controls[1].activation_upper = random.Uniform(1, 2);
    m.controls[1].initial_activation = random.Uniform(0, 1);
    PathDef path{"path", {}};
    path.kind = PathKind::kWrench;
    path.rod = random.Uniform(0, 1);
    path.gear = random.Six(1);
    for (const auto kind :
         {PathElementDef::Kind::kPoint, PathElementDef::Kind::kSphere, PathElementDef::Kind::kPulley}) {
      PathElementDef e;
      e.kind = kind;
      e.body = BodyIndex(random.Below(3));
      e.X_BE = random.Pose(1);
      e.radius = random.Uniform(0, 1);
      e.divisor = random.Uniform(1, 2);
      e.has_side = random.Chance(0.5);
      e.side_body = BodyIndex(random.Below(3));
      e.side_B = random.InBox(1);
      path.elements.push_back(e);
    }
    m.paths = {path, path};
    m.paths[0].kind = PathKind::kAngle;
    m.springs[0].slack = random.Uniform(0, 1);
    m.springs[0].higher_stiffness = {random.Uniform(0, 1), random.Uniform(0, 1)};
    m.springs[0].higher_damping = {random.Uniform(0, 1), random.Uniform(0, 1)};
    const auto& terms = m.springs[0].terms;
    m.frictions = {{"friction", terms, random.Uniform(0, 1), {0, random.Uniform(0, 1)}}};
    m.length_limits = {{"rope", terms, -random.Uniform(0, 1), random.Uniform(0, 1), {1, 0.5}}};
    m.force_limits = {{"servo",
                       terms,
                       {{m.controls[0].name, random.Uniform(0, 1)}},
                       random.Uniform(0, 1),
                       random.Uniform(0, 1),
                       random.Uniform(0, 1),
                       -random.Uniform(0, 1),
                       random.Uniform(0, 1),
                       {1, random.Uniform(0, 1)}}};
    m.adhesions = {{"suction", m.bodies[1].name, m.controls[0].name, random.Uniform(0, 1),
                    -random.Uniform(0, 1), random.Uniform(0, 1)}};
    m.switched_closures = {{"hook", m.bodies[1].name, "free", random.Pose(1), random.Pose(1),
                            Eigen::Matrix<bool, 6, 1>::Constant(random.Chance(0.5)), m.controls[0].name,
                            random.Uniform(0, 1)}};
    m.springs[0].along = {1, random.Uniform(0, 1)};
    m.controls[1].along = {0, -0.5};
  }
  auto mesh = std::make_shared<TriangleMesh>();
  mesh->name = "tetrahedron";
  for (int i = 0; i < 4; ++i) mesh->vertices.push_back(random.InBox(1).cast<float>());
  mesh->triangles = {{0, 1, 2}, {0, 1, 3}, {1, 2, 3}, {0, 2, 3}};
  for (int i = 0; i < 12; ++i) mesh->corner_uv.push_back(random.InBox(1).head<2>().cast<float>());
  auto grid = std::make_shared<HeightGrid>();
  *grid = {"hills", 3, 4, random.Uniform(0, 1), random.Uniform(0, 1), random.Uniform(0, 1), 0.1, {}};
  for (int i = 0; i < 12; ++i) grid->values.push_back(static_cast<float>(random.Uniform(0, 1)));
  auto picture = std::make_shared<Picture>();
  *picture = {"stripes", 2, 1, {255, 0, 0, 0, 0, 255}};
  FreeBodyDef body;
  body.name = "free";
  body.X_WB = random.Pose(1);
  body.inertia = random.Inertia();
  body.gravity_compensation = random.Uniform(0, 1);
  const Shape shapes[] = {Plane{0.1, 0},
                          Sphere{random.Uniform(0, 1)},
                          Capsule{0.1, random.Uniform(0, 1)},
                          Cylinder{0.2, 0.3},
                          Ellipsoid{random.InBox(1)},
                          Box{random.InBox(1)},
                          MeshShape{mesh},
                          MeshShape{mesh},
                          HeightField{grid},
                          MeshShape{}};
  for (const Shape& shape : shapes) {
    GeometryDef g = Geometry(ShapeName(shape), shape);
    g.X_BG = random.Pose(1);
    g.friction = random.Uniform(0, 2);
    g.priority = random.Below(3);
    g.contype = random.Below(4);
    g.conaffinity = random.Below(4);
    g.frictionless = random.Chance(0.5);
    g.margin = random.Uniform(0, 1);
    g.gap = random.Uniform(0, 1);
    g.adhesion = random.Uniform(0, 1);
    g.surface_velocity = random.Uniform(0, 1) * Vector6::Ones();
    g.torsion = random.Uniform(0, 1);
    g.rolling = random.Uniform(0, 1);
    g.moments = random.Below(3);
    g.restitution = random.Uniform(0, 1);
    g.pairs = {random.Below(3), 1};
    g.rgba = Vector4(0.1, random.Uniform(0, 1), 1.0 / 3, 1);
    if (random.Chance(0.5)) g.picture = picture;
    g.picture_x = random.Uniform(0, 1);
    g.picture_y = random.Uniform(0, 1);
    g.group = random.Below(5);
    body.geometries.push_back(g);
  }
  scene.mechanisms[0].bodies[1].geometries = body.geometries;
  scene.world = body.geometries;
  scene.free_bodies = {body, body};
  scene.excluded_pairs = {{"free", "world"}, {"a", ""}};
  scene.contact_pairs.resize(2);
  ContactPairDef& pair = scene.contact_pairs[0];
  pair = {"pair", random.Uniform(0, 1), Vector2(0.2, random.Uniform(0, 1)), 0.1, 0.2, 0.3};
  for (double* value : {&pair.margin, &pair.gap, &pair.adhesion}) *value = random.Uniform(0, 1);
  KeyframeDef key;
  key.name = "key";
  for (const MechanismDef& m : scene.mechanisms) {
    KeyframeDef::MechanismState s;
    s.q = random.Vector(5, 1);
    s.X_WR = random.Pose(1);
    s.V_R = random.Six(1);
    s.controls = random.Vector(static_cast<int>(m.controls.size()), 1);
    s.activation = random.Vector(static_cast<int>(m.controls.size()), 1);
    key.mechanisms.push_back(s);
  }
  key.free_bodies.push_back({random.Pose(1), random.InBox(1), random.InBox(1)});
  scene.keyframes.push_back(key);
  SensorDef sensor;
  sensor.name = "sensor";
  sensor.kind = SensorKind::kJointActuatorForce;
  sensor.size = random.Below(4);
  sensor.frame = {{1, BodyIndex(random.Below(3)), -1}, random.Pose(1)};
  sensor.reference = {{-1, {}, 1}, random.Pose(1)};
  sensor.own_axes = random.Chance(0.5);
  sensor.subtree = {sensor.frame.body, sensor.reference.body};
  sensor.mechanism = random.Below(3);
  sensor.terms = {{{JointIndex(0), 0}, random.Uniform(-1, 1)}};
  sensor.along = {1, random.Uniform(0, 1)};
  sensor.at_reference = random.Uniform(-1, 1);
  sensor.upper = random.Uniform(0, 1);
  sensor.volume = Box{random.InBox(1)};
  sensor.field_W = random.InBox(1);
  sensor.actuators = {{random.Below(3),
                       sensor.terms,
                       {0, -0.5},
                       random.Uniform(-1, 1),
                       {{"control", random.Uniform(-1, 1)}},
                       "muscle",
                       random.Uniform(0, 1),
                       random.Uniform(0, 1),
                       random.Uniform(-1, 1),
                       -random.Uniform(0, 1),
                       random.Uniform(0, 1)}};
  sensor.springs = {{1, scene.mechanisms[0].springs[0]}};
  sensor.unseen = {2, 0};
  sensor.limit = "rope";
  sensor.clip_lower = -random.Uniform(0, 1);
  sensor.reason = "none";
  scene.sensors = {sensor, {}};
  return scene;
}

}  // namespace fork1s::testing
