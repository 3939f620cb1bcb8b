#include "sim/run_watch.hpp"

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
