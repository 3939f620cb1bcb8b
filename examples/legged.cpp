#include "legged.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fork1s/mechanism/kinematics.hpp>
#include <limits>
#include <random>

#include <fmt/format.h>

#include "standing_pose.hpp"

namespace fork1s::examples {
namespace {

// Feet collide with whatever group they are in; the ground itself has none to collide with.
constexpr int kEverything = 0xf;

std::vector<Vector3> TouchingPoints(const GeometryDef& g) {
  if (const auto* capsule = std::get_if<Capsule>(&g.shape)) {
    const Vector3 end(0, 0, capsule->half_length);
    return {g.X_BG * end, g.X_BG * Vector3(-end)};
  }
  if (std::holds_alternative<Sphere>(g.shape)) return {g.X_BG.translation()};
  return {};
}

double Radius(const GeometryDef& g) {
  if (const auto* capsule = std::get_if<Capsule>(&g.shape)) return capsule->radius;
  return std::get<Sphere>(g.shape).radius;
}

bool IsInterface(const MechanismDef& m, const std::string& body) {
  return std::find(m.interfaces.begin(), m.interfaces.end(), body) != m.interfaces.end();
}

// Only feet are to touch, the balls and capsules of interface bodies: boxes and cylinders are the rest of
// ANYmal's legs.
void KeepFeet(LeggedScene& legged, MechanismDef& m) {
  for (BodyDef& body : m.bodies)
    for (GeometryDef& g : body.geometries) {
      if (!g.Collides()) continue;
      const std::vector<Vector3> points = TouchingPoints(g);
      if (!IsInterface(m, body.name) || points.empty()) {
        g.contype = g.conaffinity = 0;
        continue;
      }
      for (const Vector3& p : points) legged.feet.push_back({body.name, p});
    }
}

GeometryDef Floor() {
  GeometryDef floor;
  floor.name = "floor";
  floor.shape = Plane{};
  floor.rgba = Vector4(0.5, 0.5, 0.55, 1);
  return floor;
}

// How uneven: deepest tile [m], tilt [rad].
struct Roughness {
  double depth, tilt;
};

void LayGround(LeggedGround ground, const Roughness& roughness, Scene& scene) {
  scene.world = {Floor()};
  if (ground == LeggedGround::kUneven) {
    scene.world.front().X_BG.translation().z() = -0.1;
    for (GeometryDef& tile : UnevenGround(1, 0.25, roughness.depth, roughness.tilt))
      scene.world.push_back(std::move(tile));
  }
  for (GeometryDef& g : scene.world) {
    g.contype = 0;
    g.conaffinity = kEverything;
    g.friction = 0.9;
  }
}

// Starts the robot so that its lowest foot point touches z = 0. `q` its displacements, `u` its controls.
Expected<void> StandUp(LeggedScene& legged, const Matrix3& R_WR, const VectorX& q, const VectorX& u) {
  Scene& scene = legged.imported.scene;
  KeyframeDef key;
  key.name = "standing";
  KeyframeDef::MechanismState state;
  state.q = q;
  state.q_dot = VectorX::Zero(q.size());
  state.controls = u;
  state.X_WR.rotation() = R_WR;
  key.mechanisms = {state};
  scene.keyframes = {key};
  legged.imported.initial_keyframe = 0;
  SimulationOptions options;
  options.initial_keyframe = 0;
  auto probe = Simulation::Create(scene, options);  // closes loops
  if (!probe) return tl::unexpected(probe.error());
  double lowest = std::numeric_limits<double>::infinity();
  for (const BodyDef& body : scene.mechanisms[0].bodies)
    for (const GeometryDef& g : body.geometries) {
      if (!g.Collides()) continue;
      for (const Vector3& p : TouchingPoints(g))
        lowest = std::min(lowest, (probe->Pose(body.name) * p).z() - Radius(g));
    }
  scene.keyframes[0].mechanisms[0].X_WR.translation().z() = -lowest;
  legged.R_trunk = probe->Pose(legged.trunk).rotation();
  return {};
}

Expected<LeggedScene> LoadHexapod(const LeggedOptions& options) {
  ImportOptions import;
  import.stiffness_scale = options.gain_scale;
  const char* file = options.ground == LeggedGround::kFlat ? "hexapod.xml" : "hexapod_terrain.xml";
  auto imported = LoadMechanism((std::filesystem::path(options.scenes) / file).string(), import);
  if (!imported) return tl::unexpected(imported.error());
  LeggedScene legged{std::move(*imported), "trunk", Matrix3::Identity(), {}};
  for (const MechanismDef& m : legged.imported.scene.mechanisms)
    for (const BodyDef& body : m.bodies)
      for (const GeometryDef& g : body.geometries)
        if (g.name.ends_with("_foot")) legged.feet.push_back({body.name, g.X_BG.translation()});
  return legged;
}

Expected<ImportedScene> LoadModel(LeggedRobot robot, const LeggedOptions& options, ImportOptions import) {
  const std::string file = ModelFile(robot, options.models);
  if (!std::filesystem::exists(file))
    return Fail(ErrorCode::kFile, file,
                "is not there; name the folder of robot models, of which this project has no copy");
  auto imported = LoadMechanism(file, import);
  if (imported && imported->scene.mechanisms.size() != 1)
    return Fail(ErrorCode::kModel, file, "is not the model known here: it has several mechanisms");
  return imported;
}

Expected<LeggedScene> LoadAnymal(const LeggedOptions& options) {
  ImportOptions import;
  import.interfaces = {"LF_SHANK", "RF_SHANK", "LH_SHANK", "RH_SHANK"};
  import.stiffness_scale = options.gain_scale;
  auto imported = LoadModel(LeggedRobot::kAnymal, options, import);
  if (!imported) return tl::unexpected(imported.error());
  LeggedScene legged{std::move(*imported), "base", Matrix3::Identity(), {}};
  Scene& scene = legged.imported.scene;
  MechanismDef& m = scene.mechanisms[0];
  KeepFeet(legged, m);
  LayGround(options.ground, {0.03, 0.08}, scene);
  // Its set-points are zero, as the file has them: what it sinks below that is its servos' affair.
  if (auto ok = StandUp(legged, m.X_WR.rotation(), VectorX::Zero(static_cast<Eigen::Index>(m.joints.size())),
                        VectorX::Zero(static_cast<Eigen::Index>(m.controls.size())));
      !ok)
    return tl::unexpected(ok.error());
  return legged;
}

// The sole of one of Cassie's feet is the underside of a capsule: its middle, x along it.
Footing CassieSole(const MechanismDef& m, const std::string& body, const RigidTransform& X_RB) {
  for (const GeometryDef& g : m.bodies[m.FindBody(body).u()].geometries) {
    if (!g.Collides() || !std::holds_alternative<Capsule>(g.shape)) continue;
    Vector3 x = g.X_BG.rotation().col(2);
    if ((X_RB.rotation() * x).x() < 0) x = -x;
    Vector3 y = Vector3::UnitZ();  // the axis of the ankle
    if ((X_RB.rotation() * y).y() < 0) y = -y;
    Footing sole{body, g.X_BG, X_RB * g.X_BG, true};
    sole.X_BS.rotation() << x, y, x.cross(y);
    sole.X_RS.rotation().setIdentity();
    return sole;
  }
  return {};
}

Expected<LeggedScene> LoadCassie(const LeggedOptions& options) {
  ImportOptions import;
  import.interfaces = {"left-foot", "right-foot"};
  import.keyframe = "home";
  // The file has motors only. Its leaf springs stay as they are, whatever the gains.
  import.pd = PdGains{1000 * options.gain_scale, 50 * std::sqrt(options.gain_scale)};
  auto imported = LoadModel(LeggedRobot::kCassie, options, import);
  if (!imported) return tl::unexpected(imported.error());
  LeggedScene legged{std::move(*imported), "cassie-pelvis", Matrix3::Identity(), {}};
  Scene& scene = legged.imported.scene;
  const VectorX home =
      scene.keyframes[static_cast<std::size_t>(legged.imported.initial_keyframe)].mechanisms[0].q;
  MechanismDef& m = scene.mechanisms[0];
  auto built = BuildMechanism(m);
  if (!built) return tl::unexpected(built.error());
  Kinematics kinematics(*built);
  ComputeKinematics(*built, home, kinematics);
  std::vector<Footing> soles;
  for (const char* foot : {"left-foot", "right-foot"})
    soles.push_back(CassieSole(m, foot, kinematics.X_RB[built->FindBody(foot).u()]));
  // Feet straight below the hips, 0.27 m apart, fall over sideways on a slope of half a degree: the leaf
  // springs of the lower leg give way and no joint of the foot resists. Twice as far apart the springs are
  // four times as stiff against it.
  soles[0].X_RS.translation().y() = 0.25;
  soles[1].X_RS.translation().y() = -0.25;
  auto pose = FindStandingPose(m, home, soles);
  if (!pose) return tl::unexpected(pose.error());
  KeepFeet(legged, m);
  // Rods between two balls spin about themselves: no spring holds that and no foot sees it.
  for (const char* rod : {"left-achilles-rod", "right-achilles-rod"}) m.interfaces.push_back(rod);
  LayGround(options.ground, {0.005, 0.02}, scene);
  if (auto ok = StandUp(legged, Matrix3::Identity(), pose->q, pose->controls); !ok)
    return tl::unexpected(ok.error());
  return legged;
}

// loops.xml has hinges where the robot has balls and crossed hinges (robot.yaml), and its rods are welded as
// far open as they are drawn. With those its legs are locked.
void MendRods(MechanismDef& m) {
  for (JointDef& joint : m.joints) {
    if (!joint.name.starts_with("spherical_free_")) continue;
    const double damping = joint.freedoms[0].damping, armature = joint.freedoms[0].armature;
    const bool crossed =
        joint.name.find("knee") != std::string::npos || joint.name.find("foot") != std::string::npos;
    if (crossed) {  // about x and y of the rod, which lies along z
      Matrix6X screws = Matrix6X::Zero(6, 2);
      screws(0, 0) = screws(1, 1) = 1;
      joint = JointDef::General(joint.name, joint.body, screws);
    } else {
      joint = JointDef::Ball(joint.name, joint.body);
    }
    joint.WithSpring(0, damping).WithArmature(armature);
  }
  for (ClosureDef& c : m.closures) c.X_AJ = c.X_BJ = RigidTransform();
}

// A ball at each corner of a sole whose middle is the frame of `sole`, a body welded to `foot`.
void AddSole(MechanismDef& m, const std::string& foot, const std::string& sole) {
  constexpr double kBall = 0.008, kLength = 0.237, kWidth = 0.083;  // m, the last two of the mesh
  BodyDef& frame = m.bodies[m.FindBody(sole).u()];
  FORK1S_REQUIRE(m.bodies[frame.parent.u()].name == foot, foot);
  for (double x : {-0.5 * kLength + kBall, 0.5 * kLength - kBall})
    for (double y : {-0.5 * kWidth + kBall, 0.5 * kWidth - kBall}) {
      GeometryDef ball;
      ball.name = fmt::format("{}_ball{}", sole, m.bodies[frame.parent.u()].geometries.size());
      ball.shape = Sphere{kBall};
      ball.X_BG = frame.X_PB * RigidTransform(Vector3(x, y, kBall));
      ball.rgba = Vector4(0.15, 0.15, 0.15, 1);
      m.bodies[frame.parent.u()].geometries.push_back(ball);
    }
}

Expected<LeggedScene> LoadDigit(const LeggedOptions& options) {
  ImportOptions import;
  import.interfaces = {"foot_part", "foot_part_2"};
  import.base = BaseKind::kFloating;
  import.stiffness_scale = options.gain_scale;
  auto imported = LoadModel(LeggedRobot::kDigit, options, import);
  if (!imported) return tl::unexpected(imported.error());
  LeggedScene legged{std::move(*imported), "torso", Matrix3::Identity(), {}};
  Scene& scene = legged.imported.scene;
  MechanismDef& m = scene.mechanisms[0];
  MendRods(m);
  AddSole(m, "foot_part", "foot");
  AddSole(m, "foot_part_2", "foot_left");
  auto built = BuildMechanism(m);
  if (!built) return tl::unexpected(built.error());
  m = built->definition();
  // First the rods meet, which brings the feet near the ground's attitude.
  auto q = PlaceFeet(m, VectorX::Zero(built->num_coordinates()), {});
  if (!q) return tl::unexpected(q.error());
  const std::vector<Footing> soles = {{"foot", {}, RigidTransform(Vector3(0, -0.1, -0.62))},
                                      {"foot_left", {}, RigidTransform(Vector3(0, 0.1, -0.62))}};
  auto pose = FindStandingPose(m, *q, soles);
  if (!pose) return tl::unexpected(pose.error());
  KeepFeet(legged, m);
  LayGround(options.ground, {0.02, 0.04}, scene);
  if (auto ok = StandUp(legged, Matrix3::Identity(), pose->q, pose->controls); !ok)
    return tl::unexpected(ok.error());
  return legged;
}

}  // namespace

const char* Name(LeggedRobot robot) {
  switch (robot) {
    case LeggedRobot::kHexapod:
      return "hexapod";
    case LeggedRobot::kAnymal:
      return "anymal";
    case LeggedRobot::kCassie:
      return "cassie";
    default:
      return "digit";
  }
}

const char* Name(LeggedGround ground) { return ground == LeggedGround::kFlat ? "flat" : "uneven"; }

std::string ModelFile(LeggedRobot robot, const std::string& models) {
  const std::filesystem::path folder(models);
  switch (robot) {
    case LeggedRobot::kHexapod:
      return "";
    case LeggedRobot::kAnymal:
      return (folder / "anybotics_anymal_c/anymal_c.xml").string();
    case LeggedRobot::kCassie:
      return (folder / "agility_cassie/cassie.xml").string();
    default:
      return (folder / "digit_like_2legs/loops.xml").string();
  }
}

std::vector<GeometryDef> UnevenGround(double half, double pitch, double depth, double tilt) {
  FORK1S_REQUIRE(half > 0 && pitch > 0 && depth >= 0 && tilt >= 0, half, pitch, depth, tilt);
  std::mt19937 random(1);  // its numbers are the same everywhere, those of distributions are not
  auto uniform = [&] { return static_cast<double>(random()) / 4294967295.0; };
  const int count = static_cast<int>(std::ceil(2 * half / pitch));
  const double thick = 0.05, wide = 0.56 * pitch;
  std::vector<GeometryDef> tiles;
  for (int i = 0; i < count; ++i)
    for (int j = 0; j < count; ++j) {
      GeometryDef tile;
      tile.name = fmt::format("tile_{}_{}", i, j);
      tile.shape = Box{Vector3(wide, wide, thick)};
      const double a = tilt * (2 * uniform() - 1), b = tilt * (2 * uniform() - 1);
      tile.X_BG.rotation() = ExpRotation(Vector3(a, 0, 0)) * ExpRotation(Vector3(0, b, 0));
      double highest = -std::numeric_limits<double>::infinity();
      for (double x : {-wide, wide})
        for (double y : {-wide, wide})
          highest = std::max(highest, (tile.X_BG.rotation() * Vector3(x, y, thick)).z());
      tile.X_BG.translation() =
          Vector3((i + 0.5) * pitch - half, (j + 0.5) * pitch - half, -highest - depth * uniform());
      tile.rgba = Vector4(0.45, 0.42, 0.36, 1);
      tiles.push_back(tile);
    }
  return tiles;
}

Expected<LeggedScene> LoadLegged(LeggedRobot robot, const LeggedOptions& options) {
  switch (robot) {
    case LeggedRobot::kHexapod:
      return LoadHexapod(options);
    case LeggedRobot::kAnymal:
      return LoadAnymal(options);
    case LeggedRobot::kCassie:
      return LoadCassie(options);
    default:
      return LoadDigit(options);
  }
}

SimulationOptions StandingOptions(const LeggedScene& legged) {
  SimulationOptions options;
  options.initial_keyframe = legged.imported.initial_keyframe;
  return options;
}

StandMeasurement Stand(Simulation& simulation, const LeggedScene& legged, double settling, double time) {
  StandMeasurement m;
  std::vector<int> body;
  for (const FootPoint& foot : legged.feet) body.push_back(simulation.FindBody(foot.body));
  const int trunk = simulation.FindBody(legged.trunk);
  auto feet = [&] {
    std::vector<Vector3> p;
    for (std::size_t i = 0; i < body.size(); ++i) p.push_back(simulation.Pose(body[i]) * legged.feet[i].p_B);
    return p;
  };
  std::vector<Vector3> settled, before;
  Vector3 trunk_settled = Vector3::Zero();
  const auto steps = static_cast<int>(std::lround(time / simulation.dt()));
  m.contacts_min = std::numeric_limits<int>::max();
  for (int i = 0; i < steps && m.finite; ++i) {
    const auto start = std::chrono::steady_clock::now();
    const StepReport report = simulation.Step();
    m.step_us.push_back(
        std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count());
    ++m.steps;
    m.finite = report.finite;
    m.unconverged += report.solver.converged ? 0 : 1;
    m.joint_gap = std::max(m.joint_gap, simulation.JointGap());
    if (simulation.time() < settling) continue;
    const std::vector<Vector3> now = feet();
    const RigidTransform X_WT = simulation.Pose(trunk);
    if (settled.empty()) {
      settled = before = now;
      trunk_settled = X_WT.translation();
    }
    for (std::size_t k = 0; k < now.size(); ++k) {
      m.foot_motion = std::max(m.foot_motion, (now[k] - settled[k]).norm());
      m.foot_step = std::max(m.foot_step, (now[k] - before[k]).norm());
    }
    before = now;
    double& swing = m.swing[simulation.time() < 0.5 * (settling + time) ? 0 : 1];
    swing = std::max(swing, simulation.KineticEnergy());
    m.trunk_motion = std::max(m.trunk_motion, (X_WT.translation() - trunk_settled).norm());
    const Vector3 up = X_WT.rotation() * legged.R_trunk.transpose() * Vector3::UnitZ();
    m.lean = std::max(m.lean, std::acos(std::clamp(up.z(), -1.0, 1.0)));
    m.penetration = std::max(m.penetration, report.max_penetration);
    m.contacts_min = std::min(m.contacts_min, report.contacts);
  }
  return m;
}

}  // namespace fork1s::examples
