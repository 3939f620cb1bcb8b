// The functions of FMI 3.0 for co-simulation. Those for other kinds of units and of variables are refused with a sentence.
#include <fmi3Functions.h>

#include <memory>
#include <new>
#include <string>

#include "instance.hpp"

using fork1s::fmu::CountStateBytes;
using fork1s::fmu::FreeState;
using fork1s::fmu::GuardCall;
using fork1s::fmu::Instance;
using fork1s::fmu::Misuse;
using fork1s::fmu::ReadStateBytes;
using fork1s::fmu::RequireGiven;
using fork1s::fmu::RestoreState;
using fork1s::fmu::SaveState;
using fork1s::fmu::Status;
using fork1s::fmu::WriteStateBytes;

namespace {

struct Unit3 {
  fmi3InstanceEnvironment environment = nullptr;
  fmi3LogMessageCallback log = nullptr;
  bool logs_warnings = false;
  std::unique_ptr<Instance> instance;

  void LogMessage(Status status, const std::string& message) const {
    if (!log || (status == Status::kWarning && !logs_warnings)) return;
    log(environment, static_cast<fmi3Status>(status),
        status == Status::kWarning ? "logStatusWarning" : "logStatusError", message.c_str());
  }
};

Unit3* UnitOf(fmi3Instance instance) { return static_cast<Unit3*>(instance); }

// f(Instance&), which throws what goes wrong. Without an instance there is nobody to tell.
template <class F>
fmi3Status Call(fmi3Instance instance, const char* function, const F& f) noexcept {
  if (!instance) return fmi3Error;
  const Unit3& unit = *UnitOf(instance);
  return static_cast<fmi3Status>(GuardCall(
      function, [&](Status status, const std::string& message) { unit.LogMessage(status, message); },
      [&] { f(*unit.instance); }));
}

fmi3Status Refuse(fmi3Instance instance, const char* function, const char* message) noexcept {
  return Call(instance, function, [&](Instance&) { Misuse(message); });
}

void RequireArrays(const void* references, size_t num_references, const void* values, size_t num_values) {
  if (num_references != num_values)
    Misuse("there are " + std::to_string(num_references) + " value references and " +
           std::to_string(num_values) + " values; all variables are scalars");
  if (num_references == 0) return;
  RequireGiven(references, "valueReferences");
  RequireGiven(values, "values");
}

// Of variables of other types than Float64, of which there are none.
fmi3Status RefuseType(fmi3Instance instance, const char* function, size_t count) noexcept {
  return Call(instance, function, [&](Instance&) {
    if (count > 0) Misuse("all variables are of the type Float64; get and set them as that");
  });
}

constexpr const char* kNoClocks = "the unit has no clocks";
constexpr const char* kNoEvents = "the unit has no event mode";
constexpr const char* kNoContinuous = "the unit is for co-simulation and has no continuous states";
constexpr const char* kNoDerivatives = "the unit gives no derivatives; its description says so";
constexpr const char* kNoDependencies = "the unit gives no dependencies beyond those of its description";

fmi3Instance RefuseKind(fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                        const char* message) noexcept {
  if (log) log(environment, fmi3Error, "logStatusError", message);
  return nullptr;
}

}  // namespace

extern "C" {

const char* fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories,
                               const fmi3String categories[]) {
  return Call(instance, __func__, [&](Instance&) {
    if (nCategories > 0) RequireGiven(categories, "categories");
    bool warnings = nCategories == 0;
    for (size_t i = 0; i < nCategories; ++i) {
      RequireGiven(categories[i], "a category");
      const std::string category = categories[i];
      warnings = warnings || category == "logStatusWarning";
      if (category != "logStatusWarning" && category != "logStatusError")
        Misuse("there is no category '" + category + "'; there are: logStatusError, logStatusWarning");
    }
    if (warnings) UnitOf(instance)->logs_warnings = loggingOn;
  });
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String, fmi3String, fmi3String, fmi3Boolean, fmi3Boolean,
                                          fmi3InstanceEnvironment instanceEnvironment,
                                          fmi3LogMessageCallback logMessage) {
  return RefuseKind(instanceEnvironment, logMessage,
                    "fmi3InstantiateModelExchange: the unit is for co-simulation; instantiate it as that");
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String, fmi3String, fmi3String, fmi3Boolean, fmi3Boolean,
                                               fmi3InstanceEnvironment instanceEnvironment,
                                               fmi3LogMessageCallback logMessage, fmi3ClockUpdateCallback,
                                               fmi3LockPreemptionCallback, fmi3UnlockPreemptionCallback) {
  return RefuseKind(
      instanceEnvironment, logMessage,
      "fmi3InstantiateScheduledExecution: the unit is for co-simulation; instantiate it as that");
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String, fmi3String instantiationToken, fmi3String resourcePath,
                                         fmi3Boolean, fmi3Boolean loggingOn, fmi3Boolean eventModeUsed,
                                         fmi3Boolean, const fmi3ValueReference[], size_t,
                                         fmi3InstanceEnvironment instanceEnvironment,
                                         fmi3LogMessageCallback logMessage, fmi3IntermediateUpdateCallback) {
  auto unit = std::unique_ptr<Unit3>(new (std::nothrow) Unit3);
  if (!unit) return RefuseKind(instanceEnvironment, logMessage, "fmi3InstantiateCoSimulation: out of memory");
  unit->environment = instanceEnvironment;
  unit->log = logMessage;
  unit->logs_warnings = loggingOn;
  const auto log = [of = unit.get()](Status status, const std::string& message) {
    of->LogMessage(status, message);
  };
  const Status status = GuardCall(__func__, log, [&] {
    RequireGiven(instantiationToken, "instantiationToken");
    RequireGiven(resourcePath, "resourcePath");
    if (eventModeUsed) Misuse(kNoEvents);
    unit->instance = std::make_unique<Instance>(resourcePath, instantiationToken, log);
  });
  return status == Status::kOk ? unit.release() : nullptr;
}

void fmi3FreeInstance(fmi3Instance instance) { delete UnitOf(instance); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean, fmi3Float64, fmi3Float64 startTime,
                                       fmi3Boolean, fmi3Float64) {
  return Call(instance, __func__, [&](Instance& unit) { unit.EnterInitialization(startTime); });
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
  return Call(instance, __func__, [&](Instance& unit) { unit.ExitInitialization(); });
}
fmi3Status fmi3EnterEventMode(fmi3Instance instance) { return Refuse(instance, __func__, kNoEvents); }
fmi3Status fmi3Terminate(fmi3Instance instance) {
  return Call(instance, __func__, [&](Instance& unit) { unit.Terminate(); });
}
fmi3Status fmi3Reset(fmi3Instance instance) {
  return Call(instance, __func__, [&](Instance& unit) { unit.Reset(); });
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                          size_t nValueReferences, fmi3Float64 values[], size_t nValues) {
  return Call(instance, __func__, [&](Instance& unit) {
    RequireArrays(valueReferences, nValueReferences, values, nValues);
    for (size_t i = 0; i < nValues; ++i) values[i] = unit.Get(valueReferences[i]);
  });
}
fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                          size_t nValueReferences, const fmi3Float64 values[], size_t nValues) {
  return Call(instance, __func__, [&](Instance& unit) {
    RequireArrays(valueReferences, nValueReferences, values, nValues);
    for (size_t i = 0; i < nValues; ++i) unit.Set(valueReferences[i], values[i]);
  });
}

#define FORK1S_NO_VARIABLES(TYPE)                                                                         \
  fmi3Status fmi3Get##TYPE(fmi3Instance instance, const fmi3ValueReference[], size_t count, fmi3##TYPE[], \
                           size_t) {                                                                      \
    return RefuseType(instance, __func__, count);                                                         \
  }                                                                                                       \
  fmi3Status fmi3Set##TYPE(fmi3Instance instance, const fmi3ValueReference[], size_t count,               \
                           const fmi3##TYPE[], size_t) {                                                  \
    return RefuseType(instance, __func__, count);                                                         \
  }
FORK1S_NO_VARIABLES(Float32)
FORK1S_NO_VARIABLES(Int8)
FORK1S_NO_VARIABLES(UInt8)
FORK1S_NO_VARIABLES(Int16)
FORK1S_NO_VARIABLES(UInt16)
FORK1S_NO_VARIABLES(Int32)
FORK1S_NO_VARIABLES(UInt32)
FORK1S_NO_VARIABLES(Int64)
FORK1S_NO_VARIABLES(UInt64)
FORK1S_NO_VARIABLES(Boolean)
FORK1S_NO_VARIABLES(String)
#undef FORK1S_NO_VARIABLES

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference[], size_t count, size_t[],
                         fmi3Binary[], size_t) {
  return RefuseType(instance, __func__, count);
}
fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference[], size_t count, const size_t[],
                         const fmi3Binary[], size_t) {
  return RefuseType(instance, __func__, count);
}
fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference[], size_t count, fmi3Clock[]) {
  return RefuseType(instance, __func__, count);
}
fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference[], size_t count, const fmi3Clock[]) {
  return RefuseType(instance, __func__, count);
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance, fmi3ValueReference, size_t*) {
  return Refuse(instance, __func__, kNoDependencies);
}
fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference, size_t[],
                                       fmi3ValueReference[], size_t[], fmi3DependencyKind[], size_t) {
  return Refuse(instance, __func__, kNoDependencies);
}

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState* state) {
  return Call(instance, __func__, [&](Instance& unit) { SaveState(unit, state); });
}
fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state) {
  return Call(instance, __func__, [&](Instance& unit) { RestoreState(unit, state); });
}
fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState* state) {
  return Call(instance, __func__, [&](Instance&) { FreeState(state); });
}
fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState state, size_t* size) {
  return Call(instance, __func__, [&](Instance& unit) {
    RequireGiven(size, "size");
    *size = CountStateBytes(unit, state);
  });
}
fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState state, fmi3Byte serialized[],
                                 size_t size) {
  return Call(instance, __func__, [&](Instance& unit) { WriteStateBytes(unit, state, serialized, size); });
}
fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte serialized[], size_t size,
                                   fmi3FMUState* state) {
  return Call(instance, __func__, [&](Instance& unit) { ReadStateBytes(unit, serialized, size, state); });
}

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference[], size_t,
                                        const fmi3ValueReference[], size_t, const fmi3Float64[], size_t,
                                        fmi3Float64[], size_t) {
  return Refuse(instance, __func__, kNoDerivatives);
}
fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference[], size_t,
                                    const fmi3ValueReference[], size_t, const fmi3Float64[], size_t,
                                    fmi3Float64[], size_t) {
  return Refuse(instance, __func__, kNoDerivatives);
}
fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference[], size_t,
                                    const fmi3Int32[], fmi3Float64[], size_t) {
  return Refuse(instance, __func__, kNoDerivatives);
}

fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance) {
  return Refuse(instance, __func__, "the unit has no structural parameters to configure");
}
fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance) {
  return Refuse(instance, __func__, "the unit has no structural parameters to configure");
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference[], size_t, fmi3Float64[],
                                  fmi3IntervalQualifier[]) {
  return Refuse(instance, __func__, kNoClocks);
}
fmi3Status fmi3GetIntervalFraction(fmi3Instance instance, const fmi3ValueReference[], size_t, fmi3UInt64[],
                                   fmi3UInt64[], fmi3IntervalQualifier[]) {
  return Refuse(instance, __func__, kNoClocks);
}
fmi3Status fmi3GetShiftDecimal(fmi3Instance instance, const fmi3ValueReference[], size_t, fmi3Float64[]) {
  return Refuse(instance, __func__, kNoClocks);
}
fmi3Status fmi3GetShiftFraction(fmi3Instance instance, const fmi3ValueReference[], size_t, fmi3UInt64[],
                                fmi3UInt64[]) {
  return Refuse(instance, __func__, kNoClocks);
}
fmi3Status fmi3SetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference[], size_t,
                                  const fmi3Float64[]) {
  return Refuse(instance, __func__, kNoClocks);
}
fmi3Status fmi3SetIntervalFraction(fmi3Instance instance, const fmi3ValueReference[], size_t,
                                   const fmi3UInt64[], const fmi3UInt64[]) {
  return Refuse(instance, __func__, kNoClocks);
}
fmi3Status fmi3SetShiftDecimal(fmi3Instance instance, const fmi3ValueReference[], size_t,
                               const fmi3Float64[]) {
  return Refuse(instance, __func__, kNoClocks);
}
fmi3Status fmi3SetShiftFraction(fmi3Instance instance, const fmi3ValueReference[], size_t, const fmi3UInt64[],
                                const fmi3UInt64[]) {
  return Refuse(instance, __func__, kNoClocks);
}
fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference, fmi3Float64) {
  return Refuse(instance, __func__, kNoClocks);
}

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance) { return Refuse(instance, __func__, kNoEvents); }
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean*, fmi3Boolean*, fmi3Boolean*,
                                    fmi3Boolean*, fmi3Boolean*, fmi3Float64*) {
  return Refuse(instance, __func__, kNoEvents);
}
fmi3Status fmi3EnterStepMode(fmi3Instance instance) { return Refuse(instance, __func__, kNoEvents); }

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance) {
  return Refuse(instance, __func__, kNoContinuous);
}
fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean, fmi3Boolean*, fmi3Boolean*) {
  return Refuse(instance, __func__, kNoContinuous);
}
fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64) {
  return Refuse(instance, __func__, kNoContinuous);
}
fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64[], size_t) {
  return Refuse(instance, __func__, kNoContinuous);
}
fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64[], size_t) {
  return Refuse(instance, __func__, kNoContinuous);
}
fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64[], size_t) {
  return Refuse(instance, __func__, kNoContinuous);
}
fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64[], size_t) {
  return Refuse(instance, __func__, kNoContinuous);
}
fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64[], size_t) {
  return Refuse(instance, __func__, kNoContinuous);
}
fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t*) {
  return Refuse(instance, __func__, kNoContinuous);
}
fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t*) {
  return Refuse(instance, __func__, kNoContinuous);
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint,
                      fmi3Float64 communicationStepSize, fmi3Boolean, fmi3Boolean* eventHandlingNeeded,
                      fmi3Boolean* terminateSimulation, fmi3Boolean* earlyReturn,
                      fmi3Float64* lastSuccessfulTime) {
  const fmi3Status status = Call(instance, __func__, [&](Instance& unit) {
    RequireGiven(eventHandlingNeeded, "eventHandlingNeeded");
    RequireGiven(terminateSimulation, "terminateSimulation");
    RequireGiven(earlyReturn, "earlyReturn");
    RequireGiven(lastSuccessfulTime, "lastSuccessfulTime");
    *eventHandlingNeeded = *terminateSimulation = *earlyReturn = fmi3False;
    unit.Step(currentCommunicationPoint, communicationStepSize);
  });
  if (instance && lastSuccessfulTime) *lastSuccessfulTime = UnitOf(instance)->instance->time();
  return status;
}

}  // extern "C"
