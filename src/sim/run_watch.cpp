#include "sim/run_watch.hpp"

#include <fmt/format.h>

#include <utility>

namespace fork1s::internal {

RunWatch::RunWatch(const Simulation& simulation) : monitor_(simulation) { WatchInterior(simulation); }

void RunWatch::WatchInterior(const Simulation& simulation) {
  interior_.reset();
  if (auto watch = InterpenetrationMonitor::Create(simulation)) interior_.emplace(std::move(*watch));
}

void RunWatch::Update(const Simulation& simulation, const SanityMonitor::Seen& seen) {
  monitor_.Update(simulation, seen);
  if (interior_) interior_->Update(simulation);
}

void RunWatch::NoteUndone(const Simulation& simulation, const StepReport& report) {
  if (++undone_ > 1) return;
  const std::string unsolved = simulation.world().NameOf(report.halving_of);
  undone_first_ = fmt::format("the step from {:.4g} s was undone: ", simulation.time()) +
                  (report.stages_converged || unsolved.empty()
                       ? "it gave numbers that are not finite"
                       : unsolved + " could not be solved even in parts of 1/64 of the step");
}

std::vector<std::string> RunWatch::Implausible() const {
  std::vector<std::string> all = monitor_.Sentences();
  if (undone_ == 0) return all;
  const std::string others =
      undone_ == 1 ? ""
                   : fmt::format("; {} more step{} undone", undone_ - 1, undone_ == 2 ? " was" : "s were");
  all.insert(all.begin(),
             undone_first_ + others + "; try a smaller time step, or softer gains, pushes and springs");
  return all;
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

}  // namespace fork1s::internal
