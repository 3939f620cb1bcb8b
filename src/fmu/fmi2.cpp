// The functions of FMI 2.0 for co-simulation. Those for other kinds of units and of variables are refused with a sentence.
#include <fmi2Functions.h>

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

struct Unit2 {
  fmi2CallbackFunctions callbacks{};
  std::string name;
  bool logs_warnings = false;
  std::unique_ptr<Instance> instance;
  double start_time = 0;          // s, of fmi2SetupExperiment
  fmi2Status last_step = fmi2OK;  // fmi2GetStatus

  // The message is a format: its percent signs, and FMI's references to variables, are none.
  void LogMessage(Status status, const std::string& message) const {
    if (!callbacks.logger || (status == Status::kWarning && !logs_warnings)) return;
    std::string format;
    for (const char c : message) format += c == '%' ? "%%" : c == '#' ? "##" : std::string(1, c);
    callbacks.logger(callbacks.componentEnvironment, name.c_str(), static_cast<fmi2Status>(status),
                     status == Status::kWarning ? "logStatusWarning" : "logStatusError", format.c_str());
  }
};

Unit2* UnitOf(fmi2Component component) { return static_cast<Unit2*>(component); }

// f(Instance&), which throws what goes wrong. Without an instance there is nobody to tell.
template <class F>
fmi2Status Call(fmi2Component component, const char* function, const F& f) noexcept {
  if (!component) return fmi2Error;
  const Unit2& unit = *UnitOf(component);
  return static_cast<fmi2Status>(GuardCall(
      function, [&](Status status, const std::string& message) { unit.LogMessage(status, message); },
      [&] { f(*unit.instance); }));
}

fmi2Status Refuse(fmi2Component component, const char* function, const char* message) noexcept {
  return Call(component, function, [&](Instance&) { Misuse(message); });
}

void RequireArrays(const void* references, size_t count, const void* values) {
  if (count == 0) return;
  RequireGiven(references, "vr");
  RequireGiven(values, "value");
}

fmi2Status RefuseType(fmi2Component component, const char* function, size_t count) noexcept {
  return Call(component, function, [&](Instance&) {
    if (count > 0) Misuse("all variables are of the type Real; get and set them as that");
  });
}

// A folder of a URI, file:///FOLDER or file:/FOLDER, whose bytes may be written as %XX; or a path.
std::string FolderOf(const std::string& location) {
  std::string path = location;
  if (path.rfind("file:", 0) == 0) {
    path = path.substr(5);
    if (path.rfind("//", 0) == 0) {
      const auto slash = path.find('/', 2);
      const std::string host = path.substr(2, slash == std::string::npos ? slash : slash - 2);
      if (slash == std::string::npos || (!host.empty() && host != "localhost"))
        Misuse("the location of the resources '" + location +
               "' is no folder of this machine; give file:///FOLDER");
      path = path.substr(slash);
    }
    std::string plain;
    const auto digit = [](char c) {
      return c >= '0' && c <= '9'   ? c - '0'
             : c >= 'a' && c <= 'f' ? c - 'a' + 10
             : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                    : -1;
    };
    for (std::size_t i = 0; i < path.size(); ++i) {
      if (path[i] == '%' && i + 2 < path.size() && digit(path[i + 1]) >= 0 && digit(path[i + 2]) >= 0) {
        plain += static_cast<char>(digit(path[i + 1]) * 16 + digit(path[i + 2]));
        i += 2;
      } else {
        plain += path[i];
      }
    }
    path = plain;
  }
  return path;
}

constexpr const char* kNoDerivatives = "the unit gives no derivatives; its description says so";

}  // namespace

extern "C" {

const char* fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char* fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[]) {
  return Call(c, __func__, [&](Instance&) {
    if (nCategories > 0) RequireGiven(categories, "categories");
    bool warnings = nCategories == 0;
    for (size_t i = 0; i < nCategories; ++i) {
      RequireGiven(categories[i], "a category");
      const std::string category = categories[i];
      warnings = warnings || category == "logStatusWarning";
      if (category != "logStatusWarning" && category != "logStatusError")
        Misuse("there is no category '" + category + "'; there are: logStatusError, logStatusWarning");
    }
    if (warnings) UnitOf(c)->logs_warnings = loggingOn != fmi2False;
  });
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation, const fmi2CallbackFunctions* functions,
                              fmi2Boolean, fmi2Boolean loggingOn) {
  auto unit = std::unique_ptr<Unit2>(new (std::nothrow) Unit2);
  if (!unit) return nullptr;
  if (functions) unit->callbacks = *functions;
  unit->logs_warnings = loggingOn != fmi2False;
  const auto log = [of = unit.get()](Status status, const std::string& message) {
    of->LogMessage(status, message);
  };
  const Status status = GuardCall(__func__, log, [&] {
    if (instanceName) unit->name = instanceName;
    RequireGiven(functions, "functions");
    RequireGiven(fmuGUID, "fmuGUID");
    RequireGiven(fmuResourceLocation, "fmuResourceLocation");
    if (fmuType != fmi2CoSimulation) Misuse("the unit is for co-simulation; instantiate it as that");
    unit->instance = std::make_unique<Instance>(FolderOf(fmuResourceLocation), fmuGUID, log);
  });
  return status == Status::kOk ? unit.release() : nullptr;
}

void fmi2FreeInstance(fmi2Component c) { delete UnitOf(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean, fmi2Real, fmi2Real startTime, fmi2Boolean,
                               fmi2Real) {
  return Call(c, __func__, [&](Instance& unit) {
    if (unit.phase() != fork1s::fmu::Phase::kInstantiated)
      Misuse("the unit is initialized already; reset it or make another instance");
    UnitOf(c)->start_time = startTime;
  });
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
  return Call(c, __func__, [&](Instance& unit) { unit.EnterInitialization(UnitOf(c)->start_time); });
}
fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
  return Call(c, __func__, [&](Instance& unit) { unit.ExitInitialization(); });
}
fmi2Status fmi2Terminate(fmi2Component c) {
  return Call(c, __func__, [&](Instance& unit) { unit.Terminate(); });
}
fmi2Status fmi2Reset(fmi2Component c) {
  return Call(c, __func__, [&](Instance& unit) {
    unit.Reset();
    UnitOf(c)->start_time = 0;
  });
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[]) {
  return Call(c, __func__, [&](Instance& unit) {
    RequireArrays(vr, nvr, value);
    for (size_t i = 0; i < nvr; ++i) value[i] = unit.Get(vr[i]);
  });
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[]) {
  return Call(c, __func__, [&](Instance& unit) {
    RequireArrays(vr, nvr, value);
    for (size_t i = 0; i < nvr; ++i) unit.Set(vr[i], value[i]);
  });
}

#define FORK1S_NO_VARIABLES(TYPE)                                                                         \
  fmi2Status fmi2Get##TYPE(fmi2Component c, const fmi2ValueReference[], size_t nvr, fmi2##TYPE[]) {       \
    return RefuseType(c, __func__, nvr);                                                                  \
  }                                                                                                       \
  fmi2Status fmi2Set##TYPE(fmi2Component c, const fmi2ValueReference[], size_t nvr, const fmi2##TYPE[]) { \
    return RefuseType(c, __func__, nvr);                                                                  \
  }
FORK1S_NO_VARIABLES(Integer)
FORK1S_NO_VARIABLES(Boolean)
FORK1S_NO_VARIABLES(String)
#undef FORK1S_NO_VARIABLES

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate* state) {
  return Call(c, __func__, [&](Instance& unit) { SaveState(unit, state); });
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
  return Call(c, __func__, [&](Instance& unit) { RestoreState(unit, state); });
}
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate* state) {
  return Call(c, __func__, [&](Instance&) { FreeState(state); });
}
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t* size) {
  return Call(c, __func__, [&](Instance& unit) {
    RequireGiven(size, "size");
    *size = CountStateBytes(unit, state);
  });
}
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte serialized[], size_t size) {
  return Call(c, __func__, [&](Instance& unit) { WriteStateBytes(unit, state, serialized, size); });
}
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serialized[], size_t size,
                                   fmi2FMUstate* state) {
  return Call(c, __func__, [&](Instance& unit) { ReadStateBytes(unit, serialized, size, state); });
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference[], size_t,
                                        const fmi2ValueReference[], size_t, const fmi2Real[], fmi2Real[]) {
  return Refuse(c, __func__, kNoDerivatives);
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[]) {
  return Call(c, __func__, [&](Instance& unit) {
    RequireArrays(vr, nvr, value);
    if (nvr > 0) RequireGiven(order, "order");
    for (size_t i = 0; i < nvr; ++i) unit.SetDerivative(vr[i], order[i], value[i]);
  });
}
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference[], size_t,
                                        const fmi2Integer[], fmi2Real[]) {
  return Refuse(c, __func__, kNoDerivatives);
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                      fmi2Boolean) {
  const fmi2Status status =
      Call(c, __func__, [&](Instance& unit) { unit.Step(currentCommunicationPoint, communicationStepSize); });
  if (c) UnitOf(c)->last_step = status;
  return status;
}
fmi2Status fmi2CancelStep(fmi2Component c) {
  return Refuse(c, __func__, "steps end before fmi2DoStep returns; there is none to cancel");
}

// What a master asks after fmi2Discard.
fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status* value) {
  return Call(c, __func__, [&](Instance&) {
    RequireGiven(value, "value");
    if (s != fmi2DoStepStatus)
      Misuse("this kind of status is none of fmi2GetStatus; ask for fmi2DoStepStatus");
    *value = UnitOf(c)->last_step;
  });
}
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real* value) {
  return Call(c, __func__, [&](Instance& unit) {
    RequireGiven(value, "value");
    if (s != fmi2LastSuccessfulTime)
      Misuse("this kind of status is none of fmi2GetRealStatus; ask for fmi2LastSuccessfulTime");
    *value = unit.time();
  });
}
fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind, fmi2Integer*) {
  return Refuse(c, __func__, "there is no status of the type Integer");
}
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean* value) {
  return Call(c, __func__, [&](Instance&) {
    RequireGiven(value, "value");
    if (s != fmi2Terminated)
      Misuse("this kind of status is none of fmi2GetBooleanStatus; ask for fmi2Terminated");
    *value = fmi2False;  // a unit goes on as long as its master does
  });
}
fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind, fmi2String*) {
  return Refuse(c, __func__, "steps end before fmi2DoStep returns; none is pending");
}

}  // extern "C"
