#include "study/same_steps.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fork1s/importer/importer.hpp>
#include <stdexcept>

#include <fmt/format.h>

#include "mujoco_copier.hpp"
#include "mujoco_handles.hpp"
#include "parallel/parallel_for.hpp"

namespace fork1s {
namespace {

int MuJoCoIntegratorOf(const mjModel* m, MuJoCoIntegrator integrator) {
  switch (integrator) {
    case MuJoCoIntegrator::kEuler:
      return mjINT_EULER;
    case MuJoCoIntegrator::kImplicitFast:
      return mjINT_IMPLICITFAST;
    case MuJoCoIntegrator::kDiscrete:
      return mjINT_DISCRETE;
    case MuJoCoIntegrator::kOfFile:
      break;
  }
  return m->opt.integrator;
}

template <class Step>
double TimeOfStep(Step step) {
  const auto start = std::chrono::steady_clock::now();
  step();
  return std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count();
}

SameSteps StepInTurn(const SameStepsOptions& options, mjModel* m, Simulation& simulation) {
  const internal::MuJoCoDataPointer data(mj_makeData(m));
  mjData* d = data.get();
  const internal::MuJoCoCopier copier(simulation, m);
  SameSteps out;
  out.dt_s = simulation.dt();
  const int steps = std::max(1, static_cast<int>(std::lround(options.time / out.dt_s)));
  for (int i = 0; i < steps; ++i) {
    const bool counts = i * out.dt_s >= options.from;
    options.controls.Apply((i + 1) * out.dt_s, simulation);
    mju_zero(d->qvel, static_cast<int>(m->nv));
    copier.Copy(d);
    const double theirs = TimeOfStep([&] { mj_step(m, d); });
    StepReport report;
    const double ours = TimeOfStep([&] { report = simulation.Step(); });
    if (!counts) continue;
    ++out.steps;
    out.step_us_mujoco.push_back(theirs);
    out.step_us_ours.push_back(ours);
    out.contacts_ours += report.contacts;
    out.contacts_mujoco += d->ncon;
  }
  if (out.steps > 0) {
    out.contacts_ours /= out.steps;
    out.contacts_mujoco /= out.steps;
  }
  return out;
}

}  // namespace

Expected<SameSteps> StepFromSamePoses(const SameStepsOptions& options) {
  auto imported = LoadMechanism(options.model_path);
  if (!imported) return tl::unexpected(imported.error());
  SimulationOptions s;
  s.dt = options.dt;
  s.recovery = options.recovery;
  s.step.integrator = options.own_integrator;
  s.step.controls_move = options.controls.times.size() > 1;
  auto simulation = Simulation::Create(imported->scene, s);
  if (!simulation) return tl::unexpected(simulation.error());
  if (const auto missing = options.controls.FindMissing(*simulation); !missing.empty())
    return Fail(ErrorCode::kModel, options.model_path, "has no control '" + missing.front() + "'");
  const internal::MuJoCoHandlers handlers;
  try {
    char message[1000] = "";
    const internal::MuJoCoModelPointer model(
        mj_loadXML(options.model_path.c_str(), nullptr, message, static_cast<int>(sizeof message)));
    if (!model)
      return Fail(ErrorCode::kModel, options.model_path, fmt::format("MuJoCo refuses it: {}", message));
    model->opt.timestep = simulation->dt();
    model->opt.integrator = MuJoCoIntegratorOf(model.get(), options.integrator);
    SameSteps out;
    // MuJoCo steps on one thread, and work that other threads do would be counted in none of the steps.
    WithThreads(1, [&] { out = StepInTurn(options, model.get(), *simulation); });
    return out;
  } catch (const std::runtime_error& fault) {
    return Fail(ErrorCode::kModel, options.model_path, fmt::format("MuJoCo stopped: {}", fault.what()));
  }
}

}  // namespace fork1s
