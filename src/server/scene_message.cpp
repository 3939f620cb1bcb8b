// Names, trees and screws, told whenever the model is built again; settings, told whenever one changes.
#include <algorithm>
#include <cmath>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <nlohmann/json.hpp>

#include "mechanism/names.hpp"
#include "scene_description.hpp"
#include "server/live_simulation.hpp"
#include "server/pull_spring.hpp"
#include "signals.hpp"
#include "sim/driven_base.hpp"

namespace fork1s {
namespace {

using Json = nlohmann::json;

Json Pose(const RigidTransform& X) {
  const Vector3& p = X.translation();
  const Quaternion q = X.quaternion();
  return Json::array({p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z()});
}

Json Numbers(const Vector3& v) { return Json::array({v.x(), v.y(), v.z()}); }

// xx yy zz xy xz yz about the centre of mass, in the axes of the body.
Json Moments(const SpatialInertia& inertia) {
  const Matrix3& I = inertia.rotational;
  return Json::array({I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2)});
}

Json PathElement(const PathElementDef& e, int first_body) {
  Json one = {{"kind", NameIn(kPathElementNames, e.kind)}};
  if (e.kind == PathElementDef::Kind::kPulley) return one;
  one["body"] = first_body + e.body.value();
  one["pose"] = Pose(e.X_BE);
  if (e.kind == PathElementDef::Kind::kPoint) return one;
  one["radius"] = e.radius;
  if (e.has_side) one["side"] = {{"body", first_body + e.side_body.value()}, {"at", Numbers(e.side_B)}};
  return one;
}

void AddMechanism(const MechanismDynamics& dynamics, Json& out) {
  const Mechanism& m = dynamics.mechanism();
  const ReducedModel& model = dynamics.model();
  const auto first_body = static_cast<int>(out["bodies"].size());
  const auto first_joint = static_cast<int>(out["joints"].size());
  const auto first_coordinate = static_cast<int>(out["screws"].size());
  const auto root = static_cast<int>(out["roots"].size());
  Json one;
  one["name"] = m.name();
  one["base"] = Name(m.base());
  one["first_body"] = first_body;
  one["bodies"] = m.num_bodies();
  one["first_coordinate"] = first_coordinate;
  one["coordinates"] = m.num_coordinates();
  one["mass"] = m.total_mass();
  one["closures"] = m.closures().size();
  one["reduced"] = {{"free", model.num_free},
                    {"elastic", model.num_elastic},
                    {"modes", model.num_modes},
                    {"loads", model.num_loads}};
  out["roots"].push_back(std::move(one));
  for (int b = 0; b < m.num_bodies(); ++b) {
    const Mechanism::Body& body = m.body(BodyIndex(b));
    const bool is_interface =
        std::find(model.interfaces.begin(), model.interfaces.end(), BodyIndex(b)) != model.interfaces.end();
    out["bodies"].push_back({{"name", body.name},
                             {"root", root},
                             {"parent", body.parent.valid() ? first_body + body.parent.value() : -1},
                             {"last_joint", body.last_joint < 0 ? -1 : first_joint + body.last_joint},
                             {"interface", is_interface},
                             {"mass", body.inertia_B.mass},
                             {"center", Numbers(body.inertia_B.center)},
                             {"inertia", Moments(body.inertia_B)},
                             {"pose", Pose(body.X_RB0)}});
  }
  for (const Mechanism::Joint& j : m.joints())
    out["joints"].push_back({{"name", j.name},
                             {"kind", Name(j.kind)},
                             {"body", first_body + j.body.value()},
                             {"previous", j.previous < 0 ? -1 : first_joint + j.previous},
                             {"offset", first_coordinate + j.offset},
                             {"size", j.size}});
  for (int i = 0; i < m.num_coordinates(); ++i) {
    Json screw = Json::array();
    for (int k = 0; k < 6; ++k) screw.push_back(m.screws()(k, i));
    out["screws"].push_back(std::move(screw));
  }
  for (const Mechanism::Path& path : m.paths()) {
    if (path.kind != PathKind::kTendon) continue;  // what the page draws
    Json elements = Json::array();
    for (const PathElementDef& e : path.elements) elements.push_back(PathElement(e, first_body));
    out["tendons"].push_back({{"name", path.name}, {"root", root}, {"elements", std::move(elements)}});
  }
}

void AddFreeBody(const FreeBody& body, Json& out) {
  const auto root = static_cast<int>(out["roots"].size());
  out["roots"].push_back({{"name", body.name()},
                          {"base", "free"},
                          {"first_body", out["bodies"].size()},
                          {"bodies", 1},
                          {"first_coordinate", out["screws"].size()},
                          {"coordinates", 0},
                          {"mass", body.inertia().mass}});
  out["bodies"].push_back({{"name", body.name()},
                           {"root", root},
                           {"parent", -1},
                           {"last_joint", -1},
                           {"interface", false},
                           {"mass", body.inertia().mass},
                           {"center", Numbers(body.inertia().center)},
                           {"inertia", Moments(body.inertia())},
                           {"pose", Pose(RigidTransform())}});
}

// The range of a slider: the control's own, else that of the joint it moves, else one that suits the model.
Json ControlRange(const Mechanism& m, std::size_t control, double radius) {
  const Mechanism::Control& c = m.controls()[control];
  double low = c.lower, high = c.upper;
  const bool is_rate = m.definition().controls[control].dynamics == ControlDynamics::kIntegrator;
  if (!is_rate && !(std::isfinite(low) && std::isfinite(high)) && c.length.is_single()) {
    const int i = c.length.terms[0].first;
    const bool turns = m.Turns(i);
    const double span = turns ? 1.6 : 0.3 * radius;
    if (!std::isfinite(low)) low = std::isfinite(m.lower()(i)) ? m.lower()(i) : c.initial - span;
    if (!std::isfinite(high)) high = std::isfinite(m.upper()(i)) ? m.upper()(i) : c.initial + span;
  }
  if (!std::isfinite(low)) low = c.initial - 1;
  if (!std::isfinite(high)) high = c.initial + 1;
  return Json::array({low, high});
}

// What an actuator moves: places in the list of joints, each once.
Json JointsOf(const Mechanism& m, const Mechanism::Control& c, int first_joint) {
  std::vector<int> joints;
  for (int i : m.CoordinatesOf(c.length)) joints.push_back(first_joint + m.CoordinateJoint(i).value());
  std::sort(joints.begin(), joints.end());
  joints.erase(std::unique(joints.begin(), joints.end()), joints.end());
  return joints;
}

}  // namespace

nlohmann::json internal::DescribeScene(const Simulation& simulation, const std::string& title,
                                       std::uint32_t epoch, std::uint32_t geometry, bool separate) {
  Json out;
  out["type"] = "scene";
  out["version"] = kWireVersion;
  out["epoch"] = epoch;
  out["geometry"] = geometry;
  out["title"] = title;
  out["recovery"] = simulation.fidelity().recovery == Recovery::kTwist && !separate ? "twist" : "exact";
  out["radius"] = SceneRadius(simulation);
  out["scalars"] = ScalarNames();
  for (const char* list :
       {"roots", "bodies", "joints", "screws", "tendons", "controls", "groups", "signals", "warnings"})
    out[list] = Json::array();
  for (const MechanismDynamics& m : simulation.world().mechanisms()) AddMechanism(m, out);
  for (const FreeBody& b : simulation.world().free_bodies()) AddFreeBody(b, out);
  if (!separate) return out;
  out["roots"] = out["joints"] = out["screws"] = Json::array();
  int number = 0;
  for (Json& body : out["bodies"]) {
    out["roots"].push_back({{"name", body["name"]},
                            {"base", "free"},
                            {"first_body", number},
                            {"bodies", 1},
                            {"first_coordinate", 0},
                            {"coordinates", 0},
                            {"mass", body["mass"]}});
    body["root"] = number++;
    body["last_joint"] = -1;
    body["pose"] = Pose(RigidTransform());
  }
  return out;
}

std::string internal::Dump(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string internal::ProblemMessage(const std::string& about, const std::string& sentence) {
  return Dump({{"type", "problem"}, {"about", about}, {"message", sentence}});
}

std::string LiveSimulation::SceneMessage() const {
  Json out = internal::DescribeScene(simulation_, title_, latest_.epoch, latest_.geometry_version, false);
  const double radius = out["radius"].get<double>();
  std::vector<int> first_joint{0};  // of every mechanism in the list of joints
  for (const MechanismDynamics& m : simulation_.world().mechanisms())
    first_joint.push_back(first_joint.back() + m.mechanism().num_joints());
  std::size_t next = 0;
  for (std::size_t i = 0; i < simulation_.scene().mechanisms.size(); ++i) {
    const MechanismPlace& at = simulation_.place(static_cast<int>(i));
    const auto within = static_cast<std::size_t>(at.mechanism);
    const Mechanism& m = simulation_.world().mechanisms()[within].mechanism();
    const std::size_t count = simulation_.given_mechanism(static_cast<int>(i)).controls().size();
    for (std::size_t k = 0; k < count; ++k) {
      const Mechanism::Control& c = m.controls()[static_cast<std::size_t>(at.first_control) + k];
      out["controls"].push_back(
          {{"name", simulation_.control_names()[next++]},
           {"range", ControlRange(m, static_cast<std::size_t>(at.first_control) + k, radius)},
           {"base", false},
           {"joints", JointsOf(m, c, first_joint[within])}});
    }
  }
  for (; next < simulation_.control_names().size(); ++next) {
    const std::string& name = simulation_.control_names()[next];
    const double span = internal::IsBaseRotation(simulation_, static_cast<int>(next)) ? 1.6 : radius;
    out["controls"].push_back(
        {{"name", name}, {"range", {-span, span}}, {"base", true}, {"joints", Json::array()}});
  }
  for (const internal::SignalInfo& s : internal::ListSignals(simulation_))
    out["signals"].push_back({{"name", s.name}, {"group", s.group}, {"unit", s.unit}, {"body", s.body}});
  for (const JointGroup& g : settings_.groups)
    out["groups"].push_back({{"name", g.name}, {"mechanism", g.mechanism}});
  for (const std::string& w : simulation_.warnings()) out["warnings"].push_back(w);
  return internal::Dump(out);
}

void LiveSimulation::PublishSettings() {
  ++latest_.settings_version;
  latest_.settings = std::make_shared<const std::string>(SettingsMessage());
}

std::string LiveSimulation::SettingsMessage() const {
  const LiveSettings& s = settings_;
  Json out;
  out["type"] = "settings";
  out["dt"] = s.dt;
  out["gravity"] = s.gravity.z();
  out["damping"] = s.damping_scale;
  out["friction"] = s.friction_scale;
  int modes = s.modes;
  for (const MechanismDynamics& m : simulation_.world().mechanisms())
    if (s.modes < 0) modes = std::max(modes, m.mechanism().definition().modes);
  out["modes"] = std::max(modes, 0);
  out["detail"] = static_cast<int>(s.detail);
  out["recovery"] = static_cast<int>(s.recovery);
  out["pull_stiffness"] = s.pull_stiffness;
  out["speed"] = s.speed;
  out["ghost"] = ghost_on_;
  out["signals"] = s.signals;
  out["error"] = s.error;
  out["accuracy"] = s.accuracy;
  out["stiffness"] = Json::array();
  for (const JointGroup& g : s.groups) out["stiffness"].push_back(g.scale);
  out["controls"] = Json::array();
  for (Eigen::Index i = 0; i < targets_.size(); ++i) out["controls"].push_back(targets_(i));
  return internal::Dump(out);
}

}  // namespace fork1s
