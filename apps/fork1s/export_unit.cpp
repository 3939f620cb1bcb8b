#include "export_unit.hpp"

#include <filesystem>

#include "checks.hpp"
#include "fmi/export.hpp"
#include "output.hpp"
#include "print.hpp"

namespace fork1s::app {

void UnitArguments::AddTo(CLI::App& command) {
  command.option_defaults()->group(kUnitOptions);
  command.add_option("--fmi", fmi, "version of FMI: 3 (default) for 3.0, 2 for 2.0")->check(CLI::Range(2, 3));
  command.add_option("--dt", dt, "internal time step in s (default: the model's)")
      ->transform(PositiveSecondsUpTo(kMostStep));
  AddIntegratorTo(command, integrator);
  AddRecoveryTo(command, recovery);
  command
      .add_option(
          "--bodies", bodies,
          "bodies with poses and velocities to read, and forces and torques to set (a,b,...; default: "
          "interface bodies and free bodies)")
      ->delimiter(',')
      ->allow_extra_args(false);
  command.option_defaults()->group("Options");
}

int ExportUnit(const ModelArguments& model, const UnitArguments& unit, const std::string& out) {
  const auto imported = model.Load();
  if (!imported) return Report(imported.error(), model.json);
  SimulationOptions simulation;
  simulation.dt = unit.dt;
  simulation.recovery = unit.recovery;
  simulation.step.integrator = unit.integrator.value_or(Integrator::kTwoStage);
  fmi::ExportOptions options;
  options.version = unit.fmi;
  options.bodies = unit.bodies;
  options.tool = std::string("fork1s ") + FORK1S_VERSION;
  std::error_code failed;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", failed);
  options.program = (program.parent_path().parent_path() / FORK1S_FMU_FOLDER).string();
  const auto made = fmi::WriteUnit(*imported, simulation, options, out);
  if (!made) {
    Error error = made.error();
    if (error.code == ErrorCode::kUsage && !unit.bodies.empty()) error.where = "--bodies";
    return Report(error, model.json);
  }
  if (model.json) {
    Json json;
    json["written"] = out;
    json["fmi"] = unit.fmi;
    json["dt"] = made->dt;
    json["inputs"] = made->inputs;
    json["outputs"] = made->outputs;
    json["warnings"] = made->warnings;
    json["notes"] = NotesJson(imported->report);
    PrintText("{}\n", ToText(json, 2));
    return kDone;
  }
  PrintNotes(imported->report);
  for (const std::string& warning : made->warnings) PrintText(stderr, "warning: {}\n", warning);
  PrintText("wrote {}: FMI {}.0 co-simulation, {} inputs, {} outputs, steps of {:.6g} s\n", out, unit.fmi,
            made->inputs, made->outputs, made->dt);
  return kDone;
}

}  // namespace fork1s::app
