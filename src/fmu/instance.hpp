// An instance of a functional mock-up unit, whatever the version of FMI.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <fork1s/sim/sensors.hpp>
#include <fork1s/sim/simulation.hpp>
#include <functional>
#include <memory>
#include <new>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/refused.hpp"
#include "fmi/variables.hpp"

namespace fork1s::fmu {

/// In the order of FMI's own, which is the same in 2.0 and 3.0.
enum class Status { kOk, kWarning, kDiscard, kError, kFatal };

[[noreturn]] void Misuse(std::string message);

enum class Phase { kInstantiated, kInitialization, kStep, kTerminated };

class Instance {
 public:
  using Log = std::function<void(Status, const std::string&)>;

  /// Reads the unit's resources. Throws Refused.
  Instance(const std::string& resources, const std::string& token, Log log);

  Phase phase() const { return phase_; }
  void EnterInitialization(double start_time);
  void ExitInitialization();
  void Terminate();
  void Reset();

  double Get(std::uint32_t reference);
  void Set(std::uint32_t reference, double value);
  /// First derivative of an input [unit/s] throughout the next communication step, and of that only.
  void SetDerivative(std::uint32_t reference, int order, double value);

  /// Advances by `size` [s], a multiple of dt. Throws Refused; of kNumerics where a step could not be solved: the state
  /// is that at time().
  void Step(double point, double size);
  double time() const { return start_time_ + simulation_.time(); }

  struct State;
  std::unique_ptr<State> Save() const;
  void Restore(const State& state);
  /// For instances of the same unit and version. Throws Refused.
  std::string WriteState(const State& state) const;
  /// Throws Refused; of kUsage or kFormat for bytes of another unit or version, and for damaged ones.
  std::unique_ptr<State> ReadState(const std::string& bytes) const;

  void LogMessage(Status status, const std::string& message) const noexcept;

 private:
  Instance(std::string token, fmi::VariableList variables, std::vector<FileJoint> joints,
           Simulation simulation, Log log);
  static Instance Read(const std::string& resources, const std::string& token, Log log);
  const fmi::Variable& VariableAt(std::uint32_t reference) const;
  void RequireInput(std::uint32_t reference, const char* action) const;
  void RequireOwn(const State& state) const;
  void SetControls(double size);
  void ApplyWrenches(int step);
  void ClearOutputs();
  void UpdateBodies();
  void UpdateJoints();
  void UpdateSensors();
  void UpdateReport();

  std::string token_;  // of the unit
  fmi::VariableList variables_;
  std::vector<FileJoint> joints_;
  Simulation simulation_;
  Log log_;
  Phase phase_ = Phase::kInstantiated;
  double start_time_ = 0;            // s
  std::vector<double> values_;       // of all variables; inputs as they were set
  std::vector<double> derivatives_;  // of inputs, in the next communication step
  std::vector<bool> told_beyond_;    // per variable: that it was outside its range
  bool has_bodies_ = false, has_joints_ = false, has_sensors_ = false;  // values_ are those of now
  std::array<double, fmi::kNumReportVariables> report_{};               // of the last communication step
  std::optional<Sensors> sensors_;
  std::unique_ptr<const State> start_;
};

/// A moment of an instance, inputs included.
struct Instance::State {
  Simulation::Snapshot simulation;
  Phase phase = Phase::kInstantiated;
  double start_time = 0;
  std::vector<double> inputs, derivatives;
  std::array<double, fmi::kNumReportVariables> report{};
};

// What the functions of both versions do the same.
void RequireGiven(const void* pointer, const char* argument);
/// Into *state, a State or null, which the caller owns.
void SaveState(const Instance& instance, void** state);
void RestoreState(Instance& instance, void* state);
void FreeState(void** state);
std::size_t CountStateBytes(const Instance& instance, const void* state);
/// `size`: that of CountStateBytes.
void WriteStateBytes(const Instance& instance, const void* state, void* place, std::size_t size);
/// Into *state, a new State, which the caller owns.
void ReadStateBytes(const Instance& instance, const void* bytes, std::size_t size, void** state);

/// Calls f(), whose exceptions become a status and a sentence of the log; the sentence begins with `function`.
template <class LogTo, class F>
Status GuardCall(const char* function, const LogTo& log, const F& f) noexcept {
  const auto tell = [&](Status status, const std::string& text) {
    log(status, std::string(function) + ": " + text);
    return status;
  };
  try {
    try {
      f();
      return Status::kOk;
    } catch (const internal::Refused& refused) {
      return tell(refused.error.code == ErrorCode::kNumerics ? Status::kDiscard : Status::kError,
                  refused.error.Text());
    } catch (const std::bad_alloc&) {
      return tell(Status::kError, "out of memory; free instances and states, or simplify the model");
    } catch (const std::exception& fault) {
      return tell(Status::kError, fault.what());
    } catch (...) {
      return tell(Status::kError, "an error of the unit itself; report it with the model");
    }
  } catch (...) {  // no memory for a sentence, or the log failed
    return Status::kError;
  }
}

}  // namespace fork1s::fmu
