#include "hand_scenario.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fork1s/importer/importer.hpp>
#include <fstream>
#include <map>
#include <numbers>

namespace fork1s::examples {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kCloseEnd = 1.0, kSqueezeEnd = 1.5, kLiftStart = 1.7, kLiftEnd = 2.7, kShakeEnd = 4.7;
constexpr double kLift = 0.15;  // m

struct Flexion {
  double knuckle, middle, tip;  // degrees
};

// Where the fingertips meet the box, and how much further the servos are told to go.
struct Grasp {
  Flexion touch;
  double squeeze;  // degrees on each of the three
};

const std::map<std::string, Grasp>& Grasps() {
  static const std::map<std::string, Grasp> grasps = {{"index", {{75, 30, 7}, 3}},
                                                      {"middle", {{72, 28, 7}, 3}},
                                                      {"ring", {{75, 30, 7}, 3}},
                                                      {"little", {{81, 32, 6}, 3.5}},
                                                      {"thumb", {{70, 28, 8}, 3.8}}};
  return grasps;
}

Flexion OpenPose(const std::string& finger) {
  return finger == "thumb" ? Flexion{52, 28, 8} : Flexion{52, 30, 7};
}

double Smooth(double s) {
  s = std::clamp(s, 0.0, 1.0);
  return s * s * s * (10 + s * (6 * s - 15));
}

}  // namespace

std::vector<std::pair<std::string, double>> HandSetPoints(double t, const HandScenario& scenario) {
  std::vector<std::pair<std::string, double>> values;
  const double close = Smooth(t / kCloseEnd), squeeze = Smooth((t - kCloseEnd) / (kSqueezeEnd - kCloseEnd));
  for (const auto& [finger, grasp] : Grasps()) {
    const Flexion open = OpenPose(finger);
    // A servo's pull at the same squeeze grows with its gain; the same force needs the squeeze divided by it.
    const double extra = squeeze * grasp.squeeze / scenario.stiffness_scale;
    auto angle = [&](double from, double to) { return kDegree * (from + close * (to - from) + extra); };
    values.emplace_back(finger + "_knuckle_flex", angle(open.knuckle, grasp.touch.knuckle));
    values.emplace_back(finger + "_middle_flex", angle(open.middle, grasp.touch.middle));
    values.emplace_back(finger + "_tip_flex", angle(open.tip, grasp.touch.tip));
  }
  double z = kLift * Smooth((t - kLiftStart) / (kLiftEnd - kLiftStart)), x = 0;
  if (scenario.shake && t > kLiftEnd && t < kShakeEnd) {
    // A second up and down, a second to and fro: 20 mm at 3 Hz, faded in and out.
    const double half = 0.5 * (kShakeEnd - kLiftEnd);
    const double s = std::fmod(t - kLiftEnd, half) / half;
    const double wave =
        0.02 * std::min({1.0, 4 * s, 4 * (1 - s)}) * std::sin(2 * std::numbers::pi * 3 * (t - kLiftEnd));
    (t < kLiftEnd + half ? z : x) += wave;
  }
  values.emplace_back("palm.z", z);
  values.emplace_back("palm.x", x);
  return values;
}

namespace {

void WriteControls(std::ofstream& out, const Simulation& simulation, double t) {
  if (t == 0) {
    out << "time";
    for (const std::string& name : simulation.control_names()) out << ',' << name;
    out << '\n';
  }
  out << t;
  for (int i = 0; i < static_cast<int>(simulation.control_names().size()); ++i)
    out << ',' << simulation.controls()(i);
  out << '\n';
}

Vector3 InPalm(const Simulation& simulation) {
  return simulation.Pose("palm").inverse() * simulation.Pose("box").translation();
}

// Sum of contact forces on the object, and the normal force of the thumb.
Vector3 ContactForce(const Simulation& simulation, double& thumb) {
  Vector3 sum = Vector3::Zero();
  thumb = 0;
  const World& world = simulation.world();
  for (const ContactRecord& c : world.contacts()) {
    const std::string& a = world.collision_bodies()[static_cast<std::size_t>(c.point.body_a)].name;
    const std::string& b = world.collision_bodies()[static_cast<std::size_t>(c.point.body_b)].name;
    if (a != "box" && b != "box") continue;
    const Vector3 on_b = c.point.frame.transpose() * c.impulse / simulation.dt();
    sum += b == "box" ? on_b : Vector3(-on_b);
    if (a == "thumb_tip" || b == "thumb_tip") thumb += c.impulse(0) / simulation.dt();
  }
  return sum;
}

}  // namespace

Expected<Scene> LoadHandScene(const std::string& scene_path, const HandScenario& scenario) {
  ImportOptions import;
  import.keyframe = "open";
  import.stiffness_scale = scenario.stiffness_scale;
  auto imported = LoadMechanism(scene_path, import);
  if (!imported) return tl::unexpected(imported.error());
  Scene scene = std::move(imported->scene);
  scene.keyframes = {scene.keyframes[static_cast<std::size_t>(imported->initial_keyframe)]};
  for (auto& g : scene.world) g.friction = scenario.friction;
  for (auto& body : scene.mechanisms[0].bodies)
    for (auto& g : body.geometries) g.friction = scenario.friction;
  for (FreeBodyDef& body : scene.free_bodies) {
    for (auto& g : body.geometries) g.friction = scenario.friction;
    body.inertia.rotational *= scenario.object_mass / body.inertia.mass;
    body.inertia.mass = scenario.object_mass;
  }
  return scene;
}

Expected<HandMeasurement> RunHandScenario(const std::string& scene_path, const HandScenario& scenario) {
  auto scene = LoadHandScene(scene_path, scenario);
  if (!scene) return tl::unexpected(scene.error());
  SimulationOptions options;
  options.dt = scenario.dt;
  options.step.integrator = scenario.integrator;
  options.initial_keyframe = 0;
  auto created = Simulation::Create(std::move(*scene), options);
  if (!created) return tl::unexpected(created.error());
  Simulation& simulation = *created;

  HandMeasurement m;
  m.weight = scenario.object_mass * simulation.scene().gravity.norm();
  const double height_start = simulation.Pose("box").translation().z();
  Vector3 before_shake = Vector3::Zero(), at_rest = Vector3::Zero();
  const double end = kHandRestStart + scenario.rest;
  const auto steps = static_cast<int>(std::lround(end / scenario.dt));
  std::ofstream controls;
  if (!scenario.controls_csv.empty()) {
    controls.open(scenario.controls_csv);
    if (!controls)
      return Fail(ErrorCode::kFile, scenario.controls_csv, "cannot be written; choose a folder that exists");
    controls.precision(12);
  }
  for (int i = 0; i < steps; ++i) {
    const double t = (i + 1) * scenario.dt;
    for (const auto& [name, value] : HandSetPoints(t, scenario)) simulation.SetControl(name, value);
    if (controls.is_open()) WriteControls(controls, simulation, i * scenario.dt);
    const auto start = std::chrono::steady_clock::now();
    const StepReport report = simulation.Step();
    m.step_us.push_back(
        std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count());
    m.finite = m.finite && report.finite;
    if (!report.finite) break;
    ++m.steps;
    m.contacts_max = std::max(m.contacts_max, report.contacts);
    m.penetration_max = std::max(m.penetration_max, report.max_penetration);
    (t > kHandRestStart ? m.unconverged_rest : m.unconverged_closing) += report.solver.converged ? 0 : 1;
    m.max_newton_iterations = std::max(m.max_newton_iterations, report.solver.newton_iterations);
    m.refreshes += report.refreshes;

    const Vector3 object = InPalm(simulation);
    if (t <= kLiftEnd) {
      before_shake = object;
      m.lift_height = simulation.Pose("box").translation().z() - height_start;
    } else if (t <= kHandRestStart) {
      m.sway_in_shake = std::max(m.sway_in_shake, (object - before_shake).norm());
      m.slip_by_shake = (object - before_shake).norm();
      at_rest = object;
    } else {
      m.drift_at_rest = std::max(m.drift_at_rest, (object - at_rest).norm());
      for (const SceneBody& body : simulation.bodies())
        if (body.is_interface)
          m.max_speed_at_rest = std::max(
              m.max_speed_at_rest, simulation.Velocity(simulation.FindBody(body.name)).tail<3>().norm());
      if (t > end - 1) {
        const Vector3 sum = ContactForce(simulation, m.grip_force);
        const Vector3 missing = sum + scenario.object_mass * simulation.scene().gravity;
        m.load_error = std::max(m.load_error, missing.norm() / m.weight);
      }
    }
  }
  m.final_height = simulation.Pose("box").translation().z();
  return m;
}

HandScenario SlipperyHand() {
  HandScenario scenario;
  scenario.friction = 0.2;
  scenario.shake = false;
  scenario.rest = 0;
  return scenario;
}

namespace {

double Percentile(std::vector<double> values, double p) {
  std::sort(values.begin(), values.end());
  return values.empty() ? 0 : values[static_cast<std::size_t>(p * static_cast<double>(values.size() - 1))];
}

}  // namespace

std::vector<HandRow> HandTable(const HandMeasurement& m, const HandMeasurement& dropped) {
  const auto mm = [](double x, int places) { return fmt::format("{:.{}f} mm", 1e3 * x, places); };
  const double median = Percentile(m.step_us, 0.5), left_behind = kLift - dropped.lift_height;
  return {
      {"steps", fmt::format("{}", m.steps), ""},
      {"time a step, median", fmt::format("{:.1f} us", median), ""},
      {"time a step, 99th percentile", fmt::format("{:.1f} us", Percentile(m.step_us, 0.99)), ""},
      {"times real time", fmt::format("{:.0f}", 1e6 / 60 / median), ""},
      {"contacts, most at once", fmt::format("{}", m.contacts_max), ""},
      {"penetration, most", mm(m.penetration_max, 3), "< 0.5 mm", m.penetration_max < 5e-4},
      {"refreshes of the reduced model", fmt::format("{}", m.refreshes), ""},
      {"lifted by", mm(m.lift_height, 1), "> 140 mm", m.lift_height > 0.14},
      {"sways in the grip while shaken, 20 mm at 3 Hz", mm(m.sway_in_shake, 3), ""},
      {"slipped by the shaking", mm(m.slip_by_shake, 3), "< 0.5 mm", m.slip_by_shake < 5e-4},
      {"grip force of the thumb", fmt::format("{:.2f} N", m.grip_force), ""},
      {"load carried against the weight, off by", fmt::format("{:.1e}", m.load_error), "< 1e-3",
       m.load_error < 1e-3},
      {"drift in 5 s of rest", mm(m.drift_at_rest, 5), "< 0.01 mm", m.drift_at_rest < 1e-5},
      {"contact solves not converged, at rest", fmt::format("{}", m.unconverged_rest), "0",
       m.unconverged_rest == 0},
      {"contact solves not converged, before", fmt::format("{}", m.unconverged_closing), ""},
      {"friction 0.2 instead of 0.8: left behind by", mm(left_behind, 1), "> 100 mm", left_behind > 0.1},
  };
}

}  // namespace fork1s::examples
