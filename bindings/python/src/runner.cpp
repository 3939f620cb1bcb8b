#include "runner.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/sim/continue.hpp>
#include <fork1s/sim/control_move.hpp>
#include <sstream>

#include "errors.hpp"
#include "sim/point_springs.hpp"
#include "sim/restart.hpp"

namespace fork1s::python {

SimulationOptions OptionsOf(const Model& model, const RunOptions& given) {
  SimulationOptions options;
  options.dt = given.dt;
  options.recovery = given.recovery;
  options.detail = given.detail;
  options.step.integrator = given.integrator;
  options.initial_keyframe = model.imported().initial_keyframe;
  if (given.keyframe.empty()) return options;
  const auto& keys = model.scene().keyframes;
  std::vector<std::string> names;
  for (const KeyframeDef& key : keys) names.push_back(key.name);
  const auto at = std::find(names.begin(), names.end(), given.keyframe);
  if (at == names.end()) RefuseName("keyframe", given.keyframe, names);
  options.initial_keyframe = static_cast<int>(at - names.begin());
  return options;
}

Runner::Runner(std::shared_ptr<const Model> model, const RunOptions& options, bool estimates_error,
               bool watches)
    : model_(std::move(model)),
      actuators_(model_->imported().actuators),
      simulation_(
          ValueOrThrow(Simulation::Create(model_->scene(), OptionsOf(*model_, options)), model_->origin())) {
  if (estimates_error) error_.emplace();
  if (watches) watch_.emplace(simulation_);
}

Runner::Runner(std::shared_ptr<const Model> model, Content content)
    : model_(std::move(model)),
      actuators_(std::move(content.simulation.actuators)),
      simulation_(
          ValueOrThrow(Simulation::Create(std::move(content.simulation.scene), content.simulation.options),
                       model_->origin())),
      pushes_(std::move(content.pushes)),
      time_before_(content.time_before),
      state_change_(content.state_change) {
  ValueOrThrow(simulation_.Restore(content.simulation.snapshot), model_->origin());
  if (content.watches) watch_.emplace(simulation_);
  if (!content.estimates_error) return;
  error_.emplace();
  if (simulation_.steps() > 0) error_->Reset("where the simulation was copied");
}

Runner::Content Runner::GetContent() {
  const ReleasedGil others_run;
  const std::lock_guard lock(mutex_);
  return {{simulation_.scene(), simulation_.options(), actuators_, simulation_.Save()},
          time_before_,
          state_change_,
          pushes_,
          error_.has_value(),
          watch_.has_value()};
}

internal::StepTotals Runner::Step(int steps, bool move) {
  ReleasedGil others_run;
  internal::StepTotals report;
  std::vector<internal::BodyPush> pushes;
  std::vector<AppliedWrench> wrenches;
  std::optional<ControlMove> controls;
  {
    const std::lock_guard lock(mutex_);
    DropRecordingOfParent();
    pushes.swap(pushes_);
    if (move && steps > 0) controls.emplace(simulation_, steps);
  }
  for (int i = 0; i < steps && report.finite; ++i) {
    if (others_run.IsPauseDue() && others_run.Pause()) break;
    const std::lock_guard lock(mutex_);
    wrenches.clear();
    for (const internal::BodyPush& p : pushes)
      wrenches.push_back({p.body, p.force_W, p.moment_W, simulation_.Pose(p.body) * p.point_B});
    ApplyWrenches(wrenches, simulation_);
    if (error_) error_->BeginStep(simulation_);
    const StepReport step = controls ? controls->Step(simulation_) : simulation_.Step();
    if (error_) error_->EndStep(simulation_, step);
    if (watch_ && step.finite) {
      // The energy leaves springs to targets out: what they do comes from outside.
      const bool pushed = !wrenches.empty() || !simulation_.last_step().point_springs.empty();
      watch_->Update(simulation_, {simulation_.Energy(), simulation_.KineticEnergy(), simulation_.JointGap(),
                                   pushed, step.IsSolved(), step.stages_converged ? 0 : step.stage_residual});
    }
    if (watch_ && !step.finite) watch_->NoteUndone(simulation_, step);
    report.Add(step, simulation_.world());
    if (recorder_) ValueOrThrow(recorder_->Append(simulation_, step, wrenches), recording_);
  }
  others_run.ThrowIfInterrupted();
  return report;
}

void Runner::SetState(const KeyframeDef& state) {
  const ReleasedGil others_run;
  const std::lock_guard lock(mutex_);
  RefuseWhileRecording("set_state");
  auto next = ValueOrThrow(fork1s::internal::RestartAt(simulation_, state, model_->scene().keyframes.size()),
                           model_->origin());
  fork1s::internal::SetPointSprings(fork1s::internal::PointSprings(simulation_), next.simulation);
  time_before_ += simulation_.time();
  simulation_ = std::move(next.simulation);
  sensors_.reset();
  if (error_) error_.emplace();
  if (watch_) watch_.emplace(simulation_);
  state_change_ = next.change;
}

double Runner::StateChange() {
  const ReleasedGil others_run;
  const std::lock_guard lock(mutex_);
  return state_change_;
}

void Runner::DropRecordingOfParent() {
  if (!recorder_ || recorder_generation_ == ForkGeneration()) return;
  static_cast<void>(recorder_.release());
  recording_.clear();
}

void Runner::RefuseWhileRecording(const char* what) {
  DropRecordingOfParent();
  if (recorder_)
    throw Refused{
        {ErrorCode::kUsage, what, "a recording goes on, which could not tell it; call stop_recording first"}};
}

void Runner::Record(const std::string& path) {
  const ReleasedGil others_run;
  const std::lock_guard lock(mutex_);
  RefuseWhileRecording("record");
  recorder_ = std::make_unique<Recorder>(ValueOrThrow(Recorder::Create(path, simulation_), path));
  recorder_generation_ = ForkGeneration();
  recording_ = path;
}

void Runner::StopRecording() {
  const ReleasedGil others_run;
  const std::lock_guard lock(mutex_);
  DropRecordingOfParent();
  if (!recorder_) return;
  auto finished = recorder_->Finish();
  recorder_.reset();
  ValueOrThrow(std::move(finished), recording_);
}

std::string Runner::FlushRecording() {
  const ReleasedGil others_run;
  const std::lock_guard lock(mutex_);
  DropRecordingOfParent();
  if (recorder_) ValueOrThrow(recorder_->Flush(), recording_);
  return recording_;
}

void Runner::SetStiffness(const std::map<std::string, double>& stiffness) {
  const ReleasedGil others_run;
  const std::lock_guard lock(mutex_);
  RefuseWhileRecording("set_stiffness");
  std::vector<SensorDef> actuators = actuators_;
  Scene scene = model_->SetStiffnesses(simulation_.scene(), stiffness, actuators);
  Simulation next = ValueOrThrow(Continue(simulation_, std::move(scene)), model_->origin());
  fork1s::internal::SetPointSprings(fork1s::internal::PointSprings(simulation_), next);
  simulation_ = std::move(next);
  actuators_ = std::move(actuators);
  sensors_.reset();
  if (error_) error_->Restart("where stiffnesses changed");
  if (watch_) watch_->Changed(simulation_);
}

void Runner::SetNewtonTolerance(double tolerance) {
  if (!(tolerance > 0 && tolerance <= 0.01))
    throw Refused{{ErrorCode::kUsage, "newton_tolerance",
                   std::to_string(tolerance) + " is no share above 0 and up to 0.01"}};
  const ReleasedGil others_run;
  const std::lock_guard lock(mutex_);
  RefuseWhileRecording("newton_tolerance");
  simulation_.step_options().newton_tolerance = tolerance;
}

void Runner::SetDetail(std::optional<DetailLevel> level, std::optional<int> modes,
                       std::optional<Recovery> recovery) {
  const ReleasedGil others_run;
  const std::lock_guard lock(mutex_);
  Fidelity fidelity = simulation_.fidelity();
  if (level) fidelity.level = *level;
  if (modes) fidelity.modes = *modes;
  if (recovery) fidelity.recovery = *recovery;
  const auto springs = fork1s::internal::PointSprings(simulation_);
  ValueOrThrow(simulation_.SetFidelity(fidelity), model_->origin());
  fork1s::internal::SetPointSprings(springs, simulation_);
  if (error_) error_->Restart("where the detail changed");
  if (watch_) watch_->Changed(simulation_);
}

std::optional<ErrorFigureReport> Runner::ErrorFigureSoFar() {
  const ReleasedGil others_run;
  const std::lock_guard lock(mutex_);
  if (!error_) return std::nullopt;
  return ErrorFigureReport{error_->bodies(), error_->largest(), error_->Warnings()};
}

std::vector<std::string> Runner::Warnings() {
  const ReleasedGil others_run;
  const std::lock_guard lock(mutex_);
  std::vector<std::string> all = simulation_.warnings();
  if (!watch_) return all;
  for (auto& sentences :
       {watch_->Implausible(),
        Sentences(watch_->Passed(), "add it to interface= of load, or let all bodies touch by detail='all'")})
    all.insert(all.end(), sentences.begin(), sentences.end());
  return all;
}

std::optional<BodyHit> Runner::Ray(const Vector3& origin, const Vector3& direction, double reach) {
  const ReleasedGil others_run;
  const std::lock_guard lock(mutex_);
  if (!rays_) rays_ = ValueOrThrow(RayCaster::Create(simulation_), model_->origin());
  return rays_->Cast(simulation_, origin, direction, reach);
}

namespace {

std::string ShortNumber(double number) {
  std::ostringstream text;
  text << number;
  return text.str();
}

std::vector<std::pair<std::string, double>> Stiffnesses(const Scene& scene) {
  std::vector<std::pair<std::string, double>> all;
  for (const MechanismDef& mechanism : scene.mechanisms)
    for (const JointDef& joint : mechanism.joints)
      for (const FreedomDef& freedom : joint.freedoms)
        all.emplace_back("joint '" + joint.name + "'", freedom.stiffness);
  for (const MechanismDef& mechanism : scene.mechanisms)
    for (const SpringDef& spring : mechanism.springs)
      all.emplace_back("spring '" + spring.name + "'", spring.stiffness);
  return all;
}

}  // namespace

Runner::Snapshot Runner::Save() {
  const ReleasedGil others_run;
  const std::lock_guard lock(mutex_);
  Snapshot snapshot{
      simulation_.Save(), time_before_, pushes_, simulation_.dt(), Stiffnesses(simulation_.scene()),
      std::nullopt};
  if (error_) snapshot.error = error_->Save();
  return snapshot;
}

Expected<void> FitsStep(double dt, const Simulation& simulation) {
  if (dt == simulation.dt()) return {};
  return Fail(ErrorCode::kUsage, "restore",
              "the moment is of another dt, " + ShortNumber(dt) + " s, than the present " +
                  ShortNumber(simulation.dt()) + " s; make what is to go back to it with that dt");
}

Expected<void> FitsStiffness(const Runner::Snapshot& snapshot, const Simulation& simulation) {
  const auto stiffness = Stiffnesses(simulation.scene());
  // Of another scene where they are not the same joints, which Restore refuses.
  if (stiffness.size() != snapshot.stiffness.size()) return {};
  for (std::size_t i = 0; i < stiffness.size(); ++i) {
    const auto& [name, then] = snapshot.stiffness[i];
    const double now = stiffness[i].second;
    // Beyond rounding, which the shares of springs and servos leave where a stiffness is set back.
    if (stiffness[i].first == name && std::abs(now - then) > 1e-12 * std::max(now, then))
      return Fail(ErrorCode::kUsage, "restore",
                  "the moment is of another stiffness: " + name + " had " + ShortNumber(then) + " and has " +
                      ShortNumber(now) + "; call set_stiffness with that first");
  }
  return {};
}

void Runner::Restore(const Snapshot& snapshot) {
  const ReleasedGil others_run;
  const std::lock_guard lock(mutex_);
  RefuseWhileRecording("restore");
  ValueOrThrow(FitsStep(snapshot.dt, simulation_));
  ValueOrThrow(FitsStiffness(snapshot, simulation_));
  ValueOrThrow(simulation_.Restore(snapshot.simulation), model_->origin());
  time_before_ = snapshot.time_before;
  pushes_ = snapshot.pushes;
  if (watch_) watch_.emplace(simulation_);
  if (error_ && snapshot.error) {
    error_->Restore(simulation_, *snapshot.error);
  } else if (error_) {
    error_->Reset("at a moment that was saved without it");
  }
}

double Runner::Time() {
  const ReleasedGil others_run;
  const std::lock_guard lock(mutex_);
  return time_before_ + simulation_.time();
}

void Runner::AddPush(const internal::BodyPush& push) {
  const ReleasedGil others_run;
  const std::lock_guard lock(mutex_);
  pushes_.push_back(push);
}

void Runner::Pull(int body, const std::optional<Vector3>& point_W, const Vector3& target_W, double stiffness,
                  std::optional<double> damping) {
  const ReleasedGil others_run;
  const std::lock_guard lock(mutex_);
  ValueOrThrow(fork1s::internal::Pull(body, point_W, target_W, stiffness, damping, simulation_));
}

void Runner::Release(std::optional<int> body) {
  const ReleasedGil others_run;
  const std::lock_guard lock(mutex_);
  if (body)
    fork1s::internal::Release(*body, simulation_);
  else
    simulation_.ClearPointSprings();
}

int Runner::FindBody(const std::string& name) {
  const int body = With([&](Simulation& s) { return s.FindBody(name); });
  if (body < 0) RefuseName("body", name, model_->BodyNames());
  return body;
}

namespace {

SensorValues ValuesOf(const Sensors& sensors) {
  SensorValues read;
  for (int i = 0; i < sensors.count(); ++i) {
    const SensorDef& sensor = sensors.definition(i);
    const std::span<const double> values = sensors[i];
    read.names.push_back(sensor.name);
    read.reasons.push_back(sensor.reason);
    read.first.push_back(read.values.size());
    read.values.insert(read.values.end(), values.begin(), values.end());
  }
  read.first.push_back(read.values.size());
  return read;
}

}  // namespace

SensorValues Runner::ReadSensors() {
  const ReleasedGil others_run;
  const std::lock_guard lock(mutex_);
  if (sensors_)
    sensors_->Update(simulation_);
  else
    sensors_.emplace(simulation_);
  SensorValues read = ValuesOf(*sensors_);
  for (int i = 0; i < sensors_->count(); ++i) {
    const SensorDef& sensor = sensors_->definition(i);
    // Since the beginning, also of the simulation that a state set in between has replaced.
    if (sensor.kind == SensorKind::kTime)
      read.values[read.first[static_cast<std::size_t>(i)]] =
          std::clamp(time_before_ + simulation_.time(), sensor.clip_lower, sensor.clip_upper);
  }
  return read;
}

ActuatorForces Runner::ReadActuatorForces() {
  const ReleasedGil others_run;
  const std::lock_guard lock(mutex_);
  return {ValuesOf(Sensors(simulation_, actuators_))};
}

int Runner::FindControl(const std::string& name) {
  return With([&](Simulation& s) {
    const int control = s.FindControl(name);
    if (control < 0) RefuseName("control", name, s.control_names());
    return control;
  });
}

}  // namespace fork1s::python
