#include <algorithm>
#include <fork1s/importer/importer.hpp>
#include <fork1s/record/csv.hpp>

#include <fmt/format.h>

#include "instructions.hpp"
#include "outside.hpp"
#include "parallel/parallel_for.hpp"
#include "phases.hpp"
#include "study/bench.hpp"

namespace fork1s {

const PeerRow* BenchScene::At(const std::string& simulator) const {
  const auto at = std::find_if(rows.begin(), rows.end(), [&](const PeerRow& row) {
    return row.simulator == simulator && row.dt_s == rows.front().dt_s;
  });
  return at == rows.end() ? nullptr : &*at;
}

std::optional<double> BenchScene::Instructions(const std::string& simulator) const {
  for (const PeerInstructions& i : instructions)
    if (i.simulator == simulator) return i.per_step;
  return {};
}

Expected<BenchScene> MeasureBench(const BenchOptions& options) {
  PeerOptions peers;
  peers.scene = options.name;
  peers.model_path = options.model_path;
  peers.time = options.time;
  peers.rounds = options.rounds;
  peers.truth_substeps = options.truth_substeps;
  peers.progress = options.progress;
  if (!options.controls_path.empty()) {
    auto controls = ReadControls(options.controls_path);
    if (!controls) return tl::unexpected(controls.error());
    peers.controls = std::move(*controls);
  }
  auto imported = LoadMechanism(options.model_path);
  if (!imported) return tl::unexpected(imported.error());
  SimulationOptions at;
  at.dt = options.dt;
  auto probe = Simulation::Create(imported->scene, at);
  if (!probe) return tl::unexpected(probe.error());
  peers.dt = probe->dt();
  const Integrator by_default = probe->step_options().integrator;
  constexpr double kMostSteps = 1e6;
  if (options.time / peers.dt > kMostSteps)
    return Fail(
        ErrorCode::kUsage, options.name,
        fmt::format(
            "would take {:.3g} steps, a million at most; simulate less time or take a longer time step",
            options.time / peers.dt));
  for (const int substeps : options.substeps) {
    for (const Integrator own : {by_default, Integrator::kEuler})
      peers.entrants.push_back({own == by_default ? "fork1s" : "fork1s " + NameOf(own),
                                false,
                                MuJoCoIntegrator::kOfFile,
                                false,
                                substeps,
                                {},
                                own});
    if (!options.mujoco) continue;
    peers.entrants.push_back({"MuJoCo discrete", true, MuJoCoIntegrator::kDiscrete, false, substeps});
    peers.entrants.push_back({"MuJoCo implicitfast", true, MuJoCoIntegrator::kImplicitFast, false, substeps});
  }
  for (const int substeps : options.substeps)
    for (const OutsidePeer& peer : options.outside) {
      PeerEntrant entrant{peer.name};
      entrant.substeps = substeps;
      entrant.outside = [&peer](const Scene& s, const std::vector<std::string>& bodies, double dt,
                                int samples, int per_sample) {
        return internal::RunOutside(peer, s, bodies, dt, samples, per_sample);
      };
      peers.entrants.push_back(std::move(entrant));
    }
  std::stable_sort(peers.entrants.begin(), peers.entrants.end(),
                   [](const auto& a, const auto& b) { return a.substeps < b.substeps; });
  BenchScene scene;
  scene.name = options.name;
  scene.integrator = by_default;
  Expected<std::vector<PeerRow>> rows;
  // MuJoCo steps on one thread, so that we do as well.
  WithThreads(1, [&] { rows = MeasurePeers(peers); });
  if (!rows) return tl::unexpected(rows.error());
  scene.rows = std::move(*rows);
  if (options.phases) {
    Expected<void> timed;
    WithThreads(1, [&] { timed = internal::TimePhases(options, peers.controls, peers.dt, scene); });
    if (!timed) return tl::unexpected(timed.error());
  }
  internal::CountInstructions(options, scene);
  return scene;
}

}  // namespace fork1s
