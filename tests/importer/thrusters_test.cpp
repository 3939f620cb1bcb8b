// Actuators on free joints and on sites of free bodies in motion, by closed forms.
#include <fmt/format.h>
#include <fork1s/sim/simulation.hpp>

#include <array>
#include <cmath>
#include <numbers>

#include "helpers.hpp"

namespace fork1s::testing_importer {
namespace {

Simulation MustStart(const std::string& text, double dt) {
  const ImportedScene loaded = MustLoad(text);
  EXPECT_FALSE(HasNote(loaded.report, ImportNote::Kind::kDropped, "actuator"));
  SimulationOptions options;
  options.dt = dt;
  auto simulation = Simulation::Create(loaded.scene, options);
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  return std::move(*simulation);
}

// A box of half sides a, 1.5 a, 2 a and density ρ that nothing else acts on, turned at the start.
struct Satellite {
  double a;    // m
  double rho;  // kg/m³
  Quaternion turn;

  Vector3 half() const { return a * Vector3(1, 1.5, 2); }
  double mass() const { return 8 * rho * half().prod(); }
  Vector3 inertia() const {
    const Vector3 s = half().cwiseAbs2();
    return mass() / 3 * Vector3(s.y() + s.z(), s.x() + s.z(), s.x() + s.y());
  }
  std::string Text(const std::string& actuators, bool bystander_first) const {
    const Vector3 h = half();
    const std::string other =
        "<body name='other' pos='50 0 0'><freejoint name='away'/><geom size='.1'/></body>";
    const std::string box = fmt::format(
        "<body name='box' quat='{:.17g} {:.17g} {:.17g} {:.17g}'><freejoint name='f'/><geom type='box' "
        "size='{:.17g} {:.17g} {:.17g}' density='{:.17g}'/></body>",
        turn.w(), turn.x(), turn.y(), turn.z(), h.x(), h.y(), h.z(), rho);
    return fmt::format(
        "<mujoco><option gravity='0 0 0'/><worldbody>{}{}</worldbody><actuator>{}</actuator></mujoco>",
        bystander_first ? other : box, bystander_first ? box : other, actuators);
  }
};

const std::array<Satellite, 3> kSatellites = {{{0.1, 1000, Quaternion::Identity()},
                                               {0.005, 2000, Quaternion(0.5, 0.5, -0.5, 0.5)},
                                               {2, 100, Quaternion(0.8, -0.3, 0.4, 0.33).normalized()}}};

// A constant force moves the center by F t²/2m along fixed axes of the world, a torque about a principal axis of
// inertia turns by τ t²/2I; `joint` has torques about axes of the body, `jointinparent` about those of the world.
TEST(ImportThrusters, MotorsOnAFreeJoint_AccelerateByForceOverMassAndTorqueOverInertia) {
  for (const Satellite& box : kSatellites)
    for (const bool other_first : {false, true}) {
      const double T = 1, dt = 1. / 240;
      // A tenth of its size and a radian in T, whatever its scale.
      const double force = 0.2 * box.a * box.mass();
      const Vector3 axis = box.turn * Vector3::UnitZ();  // a principal axis at the start and for ever
      const double torque = 2 * box.inertia().z();
      const std::string in_body = "<motor name='m' joint='f' gear='1 -2 .5 0 0 {:.17g}'/>";
      const std::string in_world =
          "<motor name='m' jointinparent='f' gear='1 -2 .5 {:.17g} {:.17g} {:.17g}'/>";
      for (const bool parent : {false, true}) {
        SCOPED_TRACE(fmt::format("a {}, other first {}, jointinparent {}", box.a, other_first, parent));
        const Vector3 t = torque / force * axis;
        Simulation simulation =
            MustStart(box.Text(parent ? fmt::format(fmt::runtime(in_world), t.x(), t.y(), t.z())
                                      : fmt::format(fmt::runtime(in_body), torque / force),
                               other_first),
                      dt);
        simulation.SetControl("m", force);
        simulation.StartFromControls();
        while (simulation.time() < T - dt / 2) EXPECT_TRUE(simulation.Step().stages_converged);
        const RigidTransform X = simulation.Pose("box");
        const Vector3 way = 0.5 * force / box.mass() * T * T * Vector3(1, -2, 0.5);
        // A constant acceleration is exact in a step of two stages but for its solution, 1e-6 of the motion.
        EXPECT_LT((X.translation() - way).norm(), 1e-5 * way.norm());
        const double angle = 0.5 * torque / box.inertia().z() * T * T;
        const Quaternion expected = Quaternion(Eigen::AngleAxisd(angle, axis)) * box.turn;
        EXPECT_LT(2 * std::acos(std::min(1.0, std::abs(expected.dot(Quaternion(X.rotation()))))),
                  1e-5 * angle);
        EXPECT_LT((simulation.Pose("other").translation() - Vector3(50, 0, 0)).norm(), 1e-12);
      }
    }
}

// Four rotors of equal thrust m g/4 hover; more on one side turns by τ t²/2I about the other axis for small angles,
// and unequal drag of rotors that turn either way yaws.
TEST(ImportThrusters, DroneOfFourSiteMotors_HoversAndYaws) {
  for (const double scale : {0.01, 1.0, 20.0})
    for (const double frame : {0.0, 1.1}) {
      SCOPED_TRACE(fmt::format("scale {}, frame {}", scale, frame));
      std::string sites, motors;
      const double drag = 0.1 * scale;  // N·m per N
      for (int i = 0; i < 4; ++i) {
        const double phi = std::numbers::pi / 2 * (i + 0.5);
        sites += fmt::format("<site name='r{}' pos='{:.17g} {:.17g} 0'/>", i, scale * std::cos(phi),
                             scale * std::sin(phi));
        motors += fmt::format("<motor name='m{}' site='r{}' gear='0 0 1 0 0 {:.17g}'/>", i, i,
                              i % 2 ? -drag : drag);
      }
      const double h = scale, mass = 1000 * 8 * h * h * 0.1 * h, g = 9.81, I_z = mass / 3 * (h * h + h * h);
      const std::string text = fmt::format(
          "<mujoco><compiler angle='radian'/><worldbody><body name='drone' pos='0 0 {0:.17g}' euler='0 0 {1}'>"
          "<freejoint/><geom type='box' size='{2:.17g} {2:.17g} {3:.17g}'/>{4}</body></worldbody><actuator>{5}"
          "</actuator></mujoco>",
          10 * scale, frame, h, 0.1 * h, sites, motors);
      const double T = 1, dt = 1. / 240, more = 0.2 * I_z / drag / 2;  // N: 0.1 rad in T
      Simulation simulation = MustStart(text, dt);
      for (int i = 0; i < 4; ++i)
        simulation.SetControl(fmt::format("m{}", i), mass * g / 4 + (i % 2 ? -more : more) / 2);
      simulation.StartFromControls();
      while (simulation.time() < T - dt / 2) EXPECT_TRUE(simulation.Step().stages_converged);
      const RigidTransform X = simulation.Pose("drone");
      EXPECT_LT((X.translation() - Vector3(0, 0, 10 * scale)).norm(), 1e-6 * scale);
      const double yaw = 0.5 * (4 * more / 2 * drag) / I_z * T * T;
      const Quaternion expected(Eigen::AngleAxisd(frame + yaw, Vector3::UnitZ()));
      EXPECT_LT(2 * std::acos(std::min(1.0, std::abs(expected.dot(Quaternion(X.rotation()))))),
                1e-5 * yaw + 1e-7);
    }
}

}  // namespace
}  // namespace fork1s::testing_importer
