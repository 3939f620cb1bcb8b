// A simulation that several Python threads may hold at a time.
#pragma once

#include <fork1s/record/recording.hpp>
#include <fork1s/sim/queries.hpp>
#include <fork1s/sim/sensors.hpp>
#include <fork1s/sim/simulation.hpp>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "model.hpp"
#include "record/simulation_bytes.hpp"
#include "released_gil.hpp"
#include "sensor_values.hpp"
#include "sim/error_figure.hpp"
#include "sim/run_watch.hpp"
#include "sim/step_totals.hpp"

namespace fork1s::python {

struct RunOptions {
  double dt = 0;  // s; 0: the scene's
  std::string keyframe;
  Recovery recovery = Recovery::kExact;
  DetailLevel detail = DetailLevel::kInterface;
  Integrator integrator = Integrator::kTwoStage;
};

/// The error figure of all steps so far.
struct ErrorFigureReport {
  std::vector<fork1s::internal::ErrorFigure::Body> bodies;
  fork1s::internal::ErrorFigure::Largest largest;
  std::vector<std::string> warnings;
};

/// Options that a simulation of this model is made with. Throws Refused.
SimulationOptions OptionsOf(const Model& model, const RunOptions& options);

/// Every method may be called by any Python thread that holds the GIL. It releases the GIL before it locks
/// the simulation, so no thread waits for the simulation with the GIL in its hands, and no Python object is
/// made under the lock. `Step` locks each step by itself: calls of other threads take effect between two
/// steps.
class Runner {
 public:
  /// estimates_error: simulations of shorter steps go beside this one, for ErrorFigureSoFar. watches: for Warnings.
  Runner(std::shared_ptr<const Model> model, const RunOptions& options, bool estimates_error = false,
         bool watches = false);
  ~Runner() { DropRecordingOfParent(); }

  /// All that a simulation goes on from, but for its recording and the simulations that estimate its errors.
  struct Content {
    SimulationContent simulation;
    double time_before = 0, state_change = 0;  // s; rad or m
    std::vector<internal::BodyPush> pushes;
    bool estimates_error = false, watches = false;
  };
  Content GetContent();
  /// Goes on from there with the same bits. The error figure begins again, and says so. Throws Refused.
  Runner(std::shared_ptr<const Model> model, Content content);

  const std::shared_ptr<const Model>& model() const { return model_; }
  /// Pushes act through all of these steps. Throws nb::python_error within 0.1 s, or one step if that is
  /// longer, of a signal whose handler raises; the state is then that after the last step made.
  /// move: controls move linearly over the steps, from where the last step left them, else they are held. One
  /// that is set meanwhile is where it moves to from then on.
  internal::StepTotals Step(int steps, bool move);
  /// Goes on from this state instead, with the same controls; poses of driven bases count from there again.
  void SetState(const KeyframeDef& state);
  /// Largest difference [rad or m] between a joint coordinate as SetState was given it and what it became with loops
  /// closed; 0 before the first.
  double StateChange();
  /// Every step from now on goes into a recording, until StopRecording. Throws Refused.
  void Record(const std::string& path);
  /// Throws Refused where the file could not be written whole. Without a recording it does nothing.
  void StopRecording();
  /// Where the recording is, with all steps so far; empty where none was begun.
  std::string FlushRecording();
  /// Goes on with other stiffnesses of joints. Throws as Model::SetStiffnesses.
  void SetStiffness(const std::map<std::string, double>& stiffness);
  /// StepOptions::newton_tolerance. Throws Refused.
  void SetNewtonTolerance(double tolerance);
  /// Goes on with more or less detail: values that are given. Throws Refused.
  void SetDetail(std::optional<DetailLevel> level, std::optional<int> modes,
                 std::optional<Recovery> recovery);
  /// Of all steps since the beginning, or since SetState. None where errors are not estimated.
  std::optional<ErrorFigureReport> ErrorFigureSoFar();
  /// Of the reduction and the start; where steps are watched, what they showed since the beginning, SetState or Restore.
  std::vector<std::string> Warnings();
  /// The first body along a ray, world frame; none within `reach` [m].
  std::optional<BodyHit> Ray(const Vector3& origin, const Vector3& direction, double reach);
  /// At the present state.
  SensorValues ReadSensors();
  /// Of all actuators of the file, one value each.
  ActuatorForces ReadActuatorForces();
  /// s since the beginning, through all states that were set.
  double Time();
  void AddPush(const internal::BodyPush& push);
  /// internal::Pull, until Release, through states, stiffnesses and details that are set. Throws Refused.
  void Pull(int body, const std::optional<Vector3>& point_W, const Vector3& target_W, double stiffness,
            std::optional<double> damping);
  /// The pull on this body, if there is one; all of them without a body.
  void Release(std::optional<int> body);
  /// A moment to come back to: the simulation's, the clock and the pushes of the next call.
  struct Snapshot {
    Simulation::Snapshot simulation;
    double time_before = 0;  // s
    std::vector<internal::BodyPush> pushes;
    double dt = 0;                                          // s
    std::vector<std::pair<std::string, double>> stiffness;  // of every joint freedom, by its joint
    std::optional<fork1s::internal::ErrorFigure::Snapshot> error;
  };
  Snapshot Save();
  /// Throws Refused where it is of another scene, dt or stiffness.
  void Restore(const Snapshot& snapshot);

  /// f(simulation) under the lock and without the GIL: f makes no Python object.
  template <class F>
  auto With(F&& f) {
    static_assert(!std::is_base_of_v<nb::handle, std::invoke_result_t<F, Simulation&>>);
    const ReleasedGil others_run;
    const std::lock_guard lock(mutex_);
    return f(simulation_);
  }
  /// Place of a body or control; throws UnknownName.
  int FindBody(const std::string& name);
  int FindControl(const std::string& name);

 private:
  /// Of a child process the recording of its parent is no part: neither steps of the child nor its exit go
  /// into it.
  void DropRecordingOfParent();

  std::shared_ptr<const Model> model_;
  FairMutex mutex_;
  std::vector<SensorDef> actuators_;  // with the stiffnesses of now
  Simulation simulation_;
  std::optional<RayCaster> rays_;  // when first asked for
  std::optional<Sensors> sensors_;
  std::unique_ptr<Recorder> recorder_;
  int recorder_generation_ = 0;  // of the process that began it
  std::string recording_;        // the file of the last recording
  /// What a recording has no word for is refused while one goes on.
  void RefuseWhileRecording(const char* what);
  std::vector<internal::BodyPush> pushes_;
  std::optional<fork1s::internal::ErrorFigure> error_;
  std::optional<fork1s::internal::RunWatch> watch_;
  double time_before_ = 0;   // s, of simulations that set_state replaced
  double state_change_ = 0;  // rad or m
};

/// Errors: kUsage where a moment is of another dt [s] than the simulation.
Expected<void> FitsStep(double dt, const Simulation& simulation);
/// Errors: kUsage where joints of the simulation have another stiffness than at that moment.
Expected<void> FitsStiffness(const Runner::Snapshot& snapshot, const Simulation& simulation);

}  // namespace fork1s::python
