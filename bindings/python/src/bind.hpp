// The parts of the module, one subject each.
#pragma once

#include <nanobind/nanobind.h>

namespace fork1s::python {

void BindLoad(nanobind::module_& m);
void BindModel(nanobind::module_& m);
void BindReduction(nanobind::module_& m);
void BindRecovery(nanobind::module_& m);
class Runner;
/// What bind_simulation.cpp leaves to bind_state.cpp.
void BindState(nanobind::class_<Runner>& simulation);
void BindLinearize(nanobind::module_& m, nanobind::class_<Runner>& simulation);
void BindDynamics(nanobind::class_<Runner>& simulation);
void BindSnapshot(nanobind::module_& m);
void BindSimulation(nanobind::module_& m);
void BindControls(nanobind::module_& m);
void BindSensors(nanobind::module_& m);
void BindBatch(nanobind::module_& m);
void BindCompare(nanobind::module_& m);
void BindRecording(nanobind::module_& m);
void BindShow(nanobind::module_& m);
void BindStatics(nanobind::module_& m);
/// After all classes that have pickles.
void BindPickles(nanobind::module_& m);

}  // namespace fork1s::python
