#include "variables.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/sim/sensors.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <set>
#include <utility>

#include "sim/driven_base.hpp"

namespace fork1s::fmi {
namespace {

bool IsLetter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }
bool IsDigit(char c) { return c >= '0' && c <= '9'; }

// A name of a model as an identifier of FMI's structured names: as it is where it is one, else in quotes. Bytes that
// have no place in quotes become hexadecimal numbers.
std::string Identifier(const std::string& name) {
  if (!name.empty() && IsLetter(name[0]) &&
      std::all_of(name.begin(), name.end(), [](char c) { return IsLetter(c) || IsDigit(c); }))
    return name;
  constexpr const char* kHex = "0123456789abcdef";
  const std::string others = "!#$%&()*+,-./:;<>=?@[]^{}|~ ";
  std::string quoted = "'";
  for (const char c : name) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '\'' || c == '"' || c == '\\')
      quoted += std::string("\\") + c;
    else if (IsLetter(c) || IsDigit(c) || others.find(c) != std::string::npos)
      quoted += c;
    else
      quoted += std::string("{") + kHex[byte >> 4] + kHex[byte & 15] + "}";
  }
  return quoted + "'";
}

class Lister {
 public:
  explicit Lister(VariableList& list) : list_(list) {}

  int next() const { return static_cast<int>(list_.all.size()); }

  void Add(Variable variable) { list_.all.push_back(std::move(variable)); }

  // name[1], name[2], ...; of one number the name alone.
  void AddNumbers(const std::string& name, int count, Causality causality, const char* unit,
                  const std::string& description, bool depends_on_inputs = false) {
    for (int i = 1; i <= count; ++i) {
      Variable v;
      v.name = count == 1 ? name : name + '[' + std::to_string(i) + ']';
      v.causality = causality;
      v.unit = unit;
      v.description = description;
      v.depends_on_inputs = depends_on_inputs;
      Add(std::move(v));
    }
  }

  // Of names that occur twice the later ones are numbered.
  std::string Prefix(const std::string& group, const std::string& name) {
    std::string unique = name;
    for (int i = 2; !taken_.insert(group + '.' + Identifier(unique)).second; ++i)
      unique = name + " (" + std::to_string(i) + ')';
    return group + '.' + Identifier(unique);
  }

 private:
  VariableList& list_;
  std::set<std::string> taken_;
};

void AddControls(const Simulation& simulation, VariableList& list, Lister& lister) {
  list.first_control = lister.next();
  for (const std::string& name : simulation.control_names()) {
    Variable v;
    v.name = lister.Prefix("controls", name);
    v.causality = Causality::kInput;
    const int control = lister.next() - list.first_control;
    v.start = simulation.controls()[control];
    v.description = "control " + name;
    if (simulation.DrivesBase(control)) {
      v.unit = internal::IsBaseRotation(simulation, control) ? "rad" : "m";
      v.description = "coordinate " + name + " of a driven base, from its initial pose";
    }
    lister.Add(std::move(v));
  }
  int control = 0;
  for (const MechanismDynamics& m : simulation.world().mechanisms())
    for (const auto& c : m.mechanism().controls()) {
      Variable& v = list.all[static_cast<std::size_t>(list.first_control + control++)];
      if (!std::isfinite(c.lower) || !std::isfinite(c.upper)) continue;
      v.lower = c.lower;
      v.upper = c.upper;
    }
}

Vector3 CenterOf(const Simulation& simulation, const SceneBody& body) {
  const Scene& scene = simulation.present_scene();
  if (body.mechanism < 0) return scene.free_bodies[static_cast<std::size_t>(body.index)].inertia.center;
  return scene.mechanisms[static_cast<std::size_t>(body.mechanism)]
      .bodies[static_cast<std::size_t>(body.index)]
      .inertia.center;
}

void AddBodies(const Simulation& simulation, const std::vector<int>& bodies, VariableList& list,
               Lister& lister) {
  std::vector<std::string> prefixes;
  for (const int b : bodies) {
    const SceneBody& body = simulation.bodies()[static_cast<std::size_t>(b)];
    prefixes.push_back(lister.Prefix("bodies", body.name));
    VariableList::Body place;
    place.body = b;
    place.center_B = CenterOf(simulation, body);
    place.force = lister.next();
    lister.AddNumbers(prefixes.back() + ".force", 3, Causality::kInput, "N",
                      "force on " + body.name + " at its centre of mass, world axes");
    lister.AddNumbers(prefixes.back() + ".torque", 3, Causality::kInput, "N.m",
                      "torque on " + body.name + ", world axes");
    list.bodies.push_back(place);
  }
  for (std::size_t i = 0; i < list.bodies.size(); ++i) {
    VariableList::Body& place = list.bodies[i];
    const std::string& name = simulation.bodies()[static_cast<std::size_t>(place.body)].name;
    place.pose = lister.next();
    lister.AddNumbers(prefixes[i] + ".position", 3, Causality::kOutput, "m",
                      "origin of " + name + ", world axes");
    lister.AddNumbers(prefixes[i] + ".orientation", 4, Causality::kOutput, "1",
                      "unit quaternion w x y z of " + name + ", w of 0 or more");
    place.velocity = lister.next();
    lister.AddNumbers(prefixes[i] + ".angular_velocity", 3, Causality::kOutput, "rad/s",
                      "angular velocity of " + name + ", world axes");
    lister.AddNumbers(prefixes[i] + ".velocity", 3, Causality::kOutput, "m/s",
                      "velocity of the origin of " + name + ", world axes");
  }
}

void AddJoints(const std::vector<FileJoint>& joints, VariableList& list, Lister& lister) {
  std::vector<std::string> prefixes;
  for (const FileJoint& joint : joints) prefixes.push_back(lister.Prefix("joints", joint.name));
  using Kind = FileJoint::Kind;
  list.first_position = lister.next();
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const FileJoint& joint = joints[i];
    const std::string name = prefixes[i] + ".position";
    switch (joint.kind) {
      case Kind::kHinge:
        lister.AddNumbers(name, 1, Causality::kOutput, "rad",
                          "joint " + joint.name + ", as the file counts it");
        break;
      case Kind::kSlide:
        lister.AddNumbers(name, 1, Causality::kOutput, "m",
                          "joint " + joint.name + ", as the file counts it");
        break;
      case Kind::kBall:
        lister.AddNumbers(prefixes[i] + ".orientation", 4, Causality::kOutput, "1",
                          "unit quaternion w x y z of joint " + joint.name);
        break;
      case Kind::kFree:
        lister.AddNumbers(name, 3, Causality::kOutput, "m", "position of joint " + joint.name);
        lister.AddNumbers(prefixes[i] + ".orientation", 4, Causality::kOutput, "1",
                          "unit quaternion w x y z of joint " + joint.name);
        break;
    }
  }
  list.first_velocity = lister.next();
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const FileJoint& joint = joints[i];
    const std::string name = prefixes[i] + ".velocity", turning = prefixes[i] + ".angular_velocity";
    const std::string rate = "rate of joint " + joint.name;
    if (joint.kind == Kind::kHinge) lister.AddNumbers(name, 1, Causality::kOutput, "rad/s", rate);
    if (joint.kind == Kind::kSlide) lister.AddNumbers(name, 1, Causality::kOutput, "m/s", rate);
    if (joint.kind == Kind::kFree)
      lister.AddNumbers(name, 3, Causality::kOutput, "m/s", rate + ", world axes");
    if (joint.kind == Kind::kFree || joint.kind == Kind::kBall)
      lister.AddNumbers(turning, 3, Causality::kOutput, "rad/s", rate + ", axes of its body");
  }
}

// Empty where it depends on what the sensor is of.
const char* UnitOf(SensorKind kind) {
  switch (kind) {
    case SensorKind::kTime:
      return "s";
    case SensorKind::kKineticEnergy:
    case SensorKind::kPotentialEnergy:
      return "J";
    case SensorKind::kBallRotation:
    case SensorKind::kRotation:
    case SensorKind::kXAxis:
    case SensorKind::kYAxis:
    case SensorKind::kZAxis:
    case SensorKind::kInside:
      return "1";
    case SensorKind::kBallAngularVelocity:
    case SensorKind::kAngularVelocity:
      return "rad/s";
    case SensorKind::kPosition:
    case SensorKind::kSubtreeCenter:
    case SensorKind::kDistance:
      return "m";
    case SensorKind::kVelocity:
    case SensorKind::kSubtreeVelocity:
      return "m/s";
    case SensorKind::kAcceleration:
      return "m/s2";
    case SensorKind::kAngularAcceleration:
      return "rad/s2";
    case SensorKind::kSubtreeAngularMomentum:
      return "N.m.s";
    case SensorKind::kForce:
    case SensorKind::kTouch:
    case SensorKind::kTendonActuatorForce:
      return "N";
    case SensorKind::kTorque:
      return "N.m";
    default:
      return "";
  }
}

void AddSensors(const Simulation& simulation, VariableList& list, Lister& lister) {
  list.first_sensor = lister.next();
  const Sensors sensors(simulation);
  for (int i = 0; i < sensors.count(); ++i) {
    const SensorDef& sensor = sensors.definition(i);
    if (!sensor.reason.empty())
      list.notes.push_back("sensor '" + sensor.name +
                           "' has no values, and its outputs are NaN: " + sensor.reason);
    lister.AddNumbers(lister.Prefix("sensors", sensor.name), static_cast<int>(sensors[i].size()),
                      Causality::kOutput, UnitOf(sensor.kind), "sensor " + sensor.name, true);
  }
}

void AddReport(VariableList& list, Lister& lister) {
  list.first_report = lister.next();
  constexpr struct {
    const char *name, *unit, *description;
  } kReport[kNumReportVariables] = {
      {"step.contacts", "1", "contact points in the last step"},
      {"step.max_penetration", "m", "largest penetration in the last communication step"},
      {"step.residual", "1",
       "largest relative residual of the contact solver in the last communication step"},
      {"step.stage_residual", "m",
       "by how much another iteration would have moved something, at most, in the last communication step"},
      {"step.unconverged", "1", "steps of the last communication step that were not solved to tolerance"},
      {"step.halved", "1", "steps of the last communication step that were taken in parts"}};
  for (const auto& r : kReport) lister.AddNumbers(r.name, 1, Causality::kOutput, r.unit, r.description);
}

}  // namespace

VariableList ListVariables(const Simulation& simulation, const std::vector<FileJoint>& joints,
                           const std::vector<int>& bodies) {
  VariableList list;
  Lister lister(list);
  Variable time;
  time.name = "time";
  time.causality = Causality::kIndependent;
  time.unit = "s";
  time.description = "time";
  lister.Add(time);
  Variable step;
  step.name = "dt";
  step.causality = Causality::kConstant;
  step.unit = "s";
  step.description = "internal time step; communication steps are multiples of it";
  step.start = simulation.dt();
  lister.Add(step);
  AddControls(simulation, list, lister);
  AddBodies(simulation, bodies, list, lister);
  AddJoints(joints, list, lister);
  AddSensors(simulation, list, lister);
  AddReport(list, lister);
  return list;
}

}  // namespace fork1s::fmi
