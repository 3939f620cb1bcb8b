#include "instance.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/importer/file_state.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <limits>
#include <sstream>

#include "fmi/resources.hpp"
#include "sim/step_totals.hpp"

namespace fork1s::fmu {
namespace {

using internal::Refused;
using internal::ValueOrThrow;

// Of a step: what a master loses by adding up times in floating point, and far less than the half step at which the
// number of steps is in doubt.
constexpr double kMostRounding = 1e-3;

template <class... Parts>
std::string Join(const Parts&... parts) {
  std::ostringstream text;
  text.precision(std::numeric_limits<double>::max_digits10);
  (text << ... << parts);
  return text.str();
}

}  // namespace

void Misuse(std::string message) { throw Refused{{ErrorCode::kUsage, "", std::move(message)}}; }

void RequireGiven(const void* pointer, const char* argument) {
  if (!pointer) Misuse(std::string(argument) + " is NULL; give what it is to point to");
}

void SaveState(const Instance& instance, void** state) {
  RequireGiven(state, "the place of the state");
  auto saved = instance.Save();
  if (*state)
    *static_cast<Instance::State*>(*state) = std::move(*saved);
  else
    *state = saved.release();
}

void RestoreState(Instance& instance, void* state) {
  RequireGiven(state, "the state");
  instance.Restore(*static_cast<const Instance::State*>(state));
}

void FreeState(void** state) {
  if (!state) return;
  delete static_cast<Instance::State*>(*state);
  *state = nullptr;
}

Instance Instance::Read(const std::string& resources, const std::string& token, Log log) {
  const std::string own = ValueOrThrow(fmi::ReadToken(resources));
  if (own != token)
    Misuse("the token '" + token + "' is not that of the resources in " + resources + ", '" + own +
           "'; take description, program and resources from the same archive");
  fmi::UnitModel model = ValueOrThrow(fmi::ReadResources(resources));
  std::vector<FileJoint> joints = MovingJoints(model.imported.joints, model.imported.scene);
  Simulation simulation =
      ValueOrThrow(Simulation::Create(std::move(model.imported.scene), model.options), resources);
  for (const int body : model.bodies)
    if (body < 0 || static_cast<std::size_t>(body) >= simulation.bodies().size())
      throw Refused{{ErrorCode::kFormat, resources + "/unit.json",
                     Join("names body ", body, " of ", simulation.bodies().size(),
                          "; unpack the archive of the unit again")}};
  fmi::VariableList variables = fmi::ListVariables(simulation, joints, model.bodies);
  return {own, std::move(variables), std::move(joints), std::move(simulation), std::move(log)};
}

Instance::Instance(const std::string& resources, const std::string& token, Log log)
    : Instance(Read(resources, token, std::move(log))) {
  for (const std::string& warning : simulation_.warnings()) LogMessage(Status::kWarning, warning);
  start_ = Save();
}

Instance::Instance(std::string token, fmi::VariableList variables, std::vector<FileJoint> joints,
                   Simulation simulation, Log log)
    : token_(std::move(token)),
      variables_(std::move(variables)),
      joints_(std::move(joints)),
      simulation_(std::move(simulation)),
      log_(std::move(log)),
      values_(variables_.all.size()),
      derivatives_(variables_.all.size()),
      told_beyond_(variables_.all.size()) {
  for (std::size_t i = 0; i < values_.size(); ++i) values_[i] = variables_.all[i].start;
}

void Instance::LogMessage(Status status, const std::string& message) const noexcept {
  try {
    if (log_) log_(status, message);
  } catch (...) {  // the status says it
  }
}

void Instance::EnterInitialization(double start_time) {
  if (phase_ != Phase::kInstantiated)
    Misuse("the unit is initialized already; reset it or make another instance");
  if (!std::isfinite(start_time)) Misuse(Join("the start time must be finite, and is ", start_time));
  start_time_ = start_time;
  phase_ = Phase::kInitialization;
}

void Instance::ExitInitialization() {
  if (phase_ != Phase::kInitialization) Misuse("the unit is not in initialization mode; enter it first");
  phase_ = Phase::kStep;
}

void Instance::Terminate() {
  if (phase_ == Phase::kInstantiated) Misuse("the unit was not initialized; there is nothing to terminate");
  phase_ = Phase::kTerminated;
}

void Instance::Reset() { Restore(*start_); }

const fmi::Variable& Instance::VariableAt(std::uint32_t reference) const {
  if (reference >= variables_.all.size())
    Misuse(
        Join("there is no variable ", reference, "; value references go up to ", variables_.all.size() - 1));
  return variables_.all[reference];
}

void Instance::RequireInput(std::uint32_t reference, const char* action) const {
  const fmi::Variable& variable = VariableAt(reference);
  if (variable.causality != fmi::Causality::kInput)
    Misuse("'" + variable.name + "' is no input and cannot " + action +
           "; inputs are controls, forces and torques");
}

double Instance::Get(std::uint32_t reference) {
  VariableAt(reference);
  const int at = static_cast<int>(reference);
  if (at == fmi::VariableList::kTime) return time();
  if (at >= variables_.first_report)
    UpdateReport();
  else if (at >= variables_.first_sensor)
    UpdateSensors();
  else if (at >= variables_.first_position)
    UpdateJoints();
  else if (variables_.all[reference].causality == fmi::Causality::kOutput)
    UpdateBodies();
  return values_[reference];
}

void Instance::Set(std::uint32_t reference, double value) {
  RequireInput(reference, "be set");
  const fmi::Variable& variable = variables_.all[reference];
  if (phase_ == Phase::kTerminated)
    Misuse("the unit is terminated; reset it before '" + variable.name + "' is set");
  if (!std::isfinite(value)) Misuse(Join("'", variable.name, "' must be finite, and is ", value));
  if (variable.lower < variable.upper && (value < variable.lower || value > variable.upper) &&
      !told_beyond_[reference]) {
    told_beyond_[reference] = true;
    LogMessage(Status::kWarning,
               Join("'", variable.name, "' is set to ", value, ", outside its range from ", variable.lower,
                    " to ", variable.upper, ", and moved to the nearest end; this is said once"));
  }
  values_[reference] = value;
  has_sensors_ = false;
}

void Instance::SetDerivative(std::uint32_t reference, int order, double value) {
  RequireInput(reference, "have a derivative set");
  const std::string& name = variables_.all[reference].name;
  if (order != 1) Misuse(Join("'", name, "': order is ", order, "; inputs have a first derivative only"));
  if (!std::isfinite(value)) Misuse(Join("the derivative of '", name, "' must be finite, and is ", value));
  derivatives_[reference] = value;
}

void Instance::SetControls(double size) {
  VectorX controls(simulation_.controls().size());
  for (Eigen::Index i = 0; i < controls.size(); ++i) {
    const auto at = static_cast<std::size_t>(variables_.first_control + i);
    controls[i] = values_[at] + derivatives_[at] * size;
  }
  simulation_.SetControls(controls);
}

void Instance::ApplyWrenches(int step) {
  const double middle = (step + 0.5) * simulation_.dt();
  for (const fmi::VariableList::Body& body : variables_.bodies) {
    double wrench[6];
    bool acts = false;
    for (int i = 0; i < 6; ++i) {
      const auto at = static_cast<std::size_t>(body.force + i);
      wrench[i] = values_[at] + derivatives_[at] * middle;
      acts = acts || wrench[i] != 0;
    }
    if (!acts) continue;
    simulation_.ApplyWrench(body.body, Vector3(wrench[0], wrench[1], wrench[2]),
                            Vector3(wrench[3], wrench[4], wrench[5]),
                            simulation_.Pose(body.body) * body.center_B);
  }
}

void Instance::Step(double point, double size) {
  if (phase_ != Phase::kStep) Misuse("the unit is not in step mode; initialize it first");
  const double dt = simulation_.dt();
  if (!(std::abs(point - time()) <= kMostRounding * dt))
    Misuse(Join("the communication point is ", point, " s and the unit is at ", time(),
                " s; step on from there, or set the state of that time"));
  const double count = std::round(size / dt);
  if (!(count >= 1) || !(std::abs(size - count * dt) <= kMostRounding * dt))
    Misuse(Join("the communication step is ", size, " s; it must be a multiple of the internal step of ", dt,
                " s: take one, or export the model with another step"));
  constexpr int kMostSteps = std::numeric_limits<int>::max();
  if (count > kMostSteps)
    Misuse(Join("the communication step is ", size, " s, more than ", kMostSteps, " internal steps of ", dt,
                " s; take shorter ones"));
  const auto steps = static_cast<int>(count);
  const auto first = derivatives_.begin() + variables_.first_control;
  const bool moves =
      std::any_of(first, first + simulation_.controls().size(), [](double rate) { return rate != 0; });
  if (moves && simulation_.steps() == 0) {
    SetControls(0);
    simulation_.StartFromControls();
  }
  SetControls(static_cast<double>(steps) * dt);
  ClearOutputs();
  const internal::StepTotals totals =
      internal::RunSteps(simulation_, steps, moves, [&](int i) { ApplyWrenches(i); });
  report_ = {static_cast<double>(totals.contacts),
             totals.max_penetration,
             totals.residual,
             totals.stage_residual,
             static_cast<double>(totals.unconverged),
             static_cast<double>(totals.halved)};
  std::fill(derivatives_.begin(), derivatives_.end(), 0);
  if (totals.finite) return;
  throw Refused{
      {ErrorCode::kNumerics, Join("step at ", time(), " s"),
       "could not be solved even in its shortest parts and was undone; export the model with a smaller "
       "step, or look for forces and stiffnesses that are too large"}};
}

std::unique_ptr<Instance::State> Instance::Save() const {
  auto state = std::make_unique<State>();
  state->simulation = simulation_.Save();
  state->phase = phase_;
  state->start_time = start_time_;
  state->inputs = values_;
  state->derivatives = derivatives_;
  state->report = report_;
  return state;
}

void Instance::RequireOwn(const State& state) const {
  if (state.inputs.size() != values_.size() || state.derivatives.size() != values_.size())
    Misuse("the state is of another unit; set one of an instance of this");
}

void Instance::Restore(const State& state) {
  RequireOwn(state);
  ValueOrThrow(simulation_.Restore(state.simulation));
  phase_ = state.phase;
  start_time_ = state.start_time;
  values_ = state.inputs;
  derivatives_ = state.derivatives;
  report_ = state.report;
  sensors_.reset();
  ClearOutputs();
}

void Instance::ClearOutputs() { has_bodies_ = has_joints_ = has_sensors_ = false; }

void Instance::UpdateBodies() {
  if (has_bodies_) return;
  for (const fmi::VariableList::Body& body : variables_.bodies) {
    const RigidTransform X_WB = simulation_.Pose(body.body);
    const Quaternion q = X_WB.quaternion();
    const double sign = q.w() < 0 ? -1 : 1;
    double* pose = values_.data() + body.pose;
    for (int i = 0; i < 3; ++i) pose[i] = X_WB.translation()[i];
    pose[3] = sign * q.w();
    pose[4] = sign * q.x();
    pose[5] = sign * q.y();
    pose[6] = sign * q.z();
    const Vector6 V = simulation_.Velocity(body.body);
    std::copy(V.data(), V.data() + 6, values_.data() + body.velocity);
  }
  has_bodies_ = true;
}

void Instance::UpdateJoints() {
  if (has_joints_) return;
  const FileState state = ComputeFileState(joints_, simulation_.scene(), simulation_.State());
  std::copy(state.positions.data(), state.positions.data() + state.positions.size(),
            values_.data() + variables_.first_position);
  std::copy(state.velocities.data(), state.velocities.data() + state.velocities.size(),
            values_.data() + variables_.first_velocity);
  has_joints_ = true;
}

void Instance::UpdateSensors() {
  if (has_sensors_) return;
  if (sensors_)
    sensors_->Update(simulation_);
  else
    sensors_.emplace(simulation_);
  const VectorX& all = sensors_->values();
  std::copy(all.data(), all.data() + all.size(), values_.data() + variables_.first_sensor);
  has_sensors_ = true;
}

void Instance::UpdateReport() {
  std::copy(report_.begin(), report_.end(), values_.data() + variables_.first_report);
}

}  // namespace fork1s::fmu
