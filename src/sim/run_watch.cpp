#include "sim/run_watch.hpp"

#include <utility>

namespace fork1s::internal {

RunWatch::RunWatch(const Simulation& simulation) : monitor_(simulation) { WatchInterior(simulation); }

void RunWatch::WatchInterior(const Simulation& simulation) {
  interior_.reset();
  if (auto watch = InterpenetrationMonitor::Create(simulation)) interior_.emplace(std::move(*watch));
}

void RunWatch::Update(const Simulation& simulation, const StepReport& report, bool pushed) {
  if (!report.finite) return;
  // The energy leaves springs to targets out: what they do comes from outside.
  pushed |= !simulation.last_step().point_springs.empty();
  monitor_.Update(simulation, {simulation.Energy(), simulation.KineticEnergy(), simulation.JointGap(), pushed,
                               report.IsSolved(), report.stages_converged ? 0 : report.stage_residual});
  if (interior_) interior_->Update(simulation);
}

void RunWatch::Changed(const Simulation& simulation) {
  monitor_.Changed(simulation);
  passed_ = Passed();
  WatchInterior(simulation);
}

std::vector<Interpenetration> RunWatch::Passed() const {
  std::vector<Interpenetration> all = passed_;
  if (!interior_) return all;
  for (Interpenetration& p : interior_->Found()) all.push_back(std::move(p));
  return all;
}

std::vector<std::string> RunWatch::Sentences(const std::string& remedy) const {
  std::vector<std::string> sentences = monitor_.Sentences();
  for (std::string& sentence : fork1s::Sentences(Passed(), remedy)) sentences.push_back(std::move(sentence));
  return sentences;
}

}  // namespace fork1s::internal
