// The compiled half of the package fork1s; bindings/python/fork1s is the other.
#include "importer/mujoco_import.hpp"

#include "bind.hpp"
#include "errors.hpp"
#include "released_gil.hpp"

NB_MODULE(_core, m) {
  using namespace fork1s::python;
  m.doc() = "Compiled half of fork1s. Use the names that the package itself offers.";
  m.attr("version") = FORK1S_VERSION;
  m.attr("mujoco_version") = fork1s::MujocoVersion();
  ReleasedGil::RegisterExitAndFork();
  BindErrors(m);
  BindModel(m);
  BindReduction(m);
  BindLoad(m);
  BindControls(m);
  BindSensors(m);
  BindSimulation(m);
  BindRecovery(m);
  BindBatch(m);
  BindStatics(m);
  BindCompare(m);
  BindRecording(m);
  BindShow(m);
  BindPickles(m);
}
