#include <lab/chain_cost.hpp>

#include <malloc.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fork1s/recovery/recover.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>

#include <fmt/format.h>

#include "base/percentile.hpp"
#include "chains.hpp"
#include "parallel/parallel_for.hpp"
#include "stepping/step_context.hpp"
#include "study/figure.hpp"

namespace fork1s {
namespace {

// Bytes in use, large blocks included.
std::size_t HeapBytes() {
  const struct mallinfo2 info = mallinfo2();
  return info.uordblks + info.hblkhd;
}

template <class Work>
double MicrosecondsOf(Work work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count();
}

Expected<ChainCost> MeasureOnOneThread(int joints) {
  const auto mechanism = internal::MakeChain(joints);
  const VectorX q = VectorX::Zero(joints);
  ChainCost cost;
  cost.joints = joints;
  std::vector<double> reduce_us;
  for (int i = 0; i < 9; ++i) {
    Error error;
    reduce_us.push_back(MicrosecondsOf([&] {
      if (auto model = Reduce(mechanism, q); !model) error = model.error();
    }));
    if (!error.message.empty()) return tl::unexpected(error);
  }
  cost.reduce_ms = 1e-3 * Median(reduce_us);
  const std::size_t before = HeapBytes();
  auto dynamics = MechanismDynamics::Create(mechanism, q, VectorX(), RigidTransform(), Vector6::Zero(), {});
  if (!dynamics) return tl::unexpected(dynamics.error());
  cost.heap_MB = 1e-6 * static_cast<double>(HeapBytes() - before);
  std::vector<double> steps_us;
  constexpr double kStep = 1.0 / 60;
  for (int i = 0; i < 300; ++i)
    steps_us.push_back(MicrosecondsOf([&] {  // backward Euler by one Newton iteration
      BeginStep(*dynamics, kStep, kStep, true, Vector3(0, 0, -0.1));
      MoveToStagePose(*dynamics, kStep, kStep);
      SolveFreeStage(*dynamics, kStep);
      AcceptStage(*dynamics, kStep, kStep, true);
      EndStep(*dynamics, 0);
    }));
  cost.step_us = Median(steps_us);
  std::vector<double> refresh_us;
  for (int i = 0; i < 9; ++i) refresh_us.push_back(MicrosecondsOf([&] { dynamics->Refresh(); }));
  cost.refresh_ms = 1e-3 * Median(refresh_us);
  return cost;
}

}  // namespace

// A second thread that waits for its core would be most of what is measured on a machine that does other
// work.
Expected<ChainCost> MeasureChain(int joints) {
  FORK1S_REQUIRE(joints > 0);
  Expected<ChainCost> cost;
  WithThreads(1, [&] { cost = MeasureOnOneThread(joints); });
  return cost;
}

std::string ChainsCsv(const std::vector<ChainCost>& rows) {
  std::string out = "joints,reduce_ms,refresh_ms,step_us,heap_MB\n";
  for (const ChainCost& c : rows)
    out += fmt::format("{},{:.4g},{:.4g},{:.4g},{:.3f}\n", c.joints, c.reduce_ms, c.refresh_ms, c.step_us,
                       c.heap_MB);
  return out;
}

std::string DrawChains(const std::vector<ChainCost>& rows) {
  FORK1S_REQUIRE(rows.size() > 1);
  std::vector<double> all_ms;
  internal::FigureSeries reduce{"reducing", 0, {}}, refresh{"a refresh", 1, {}}, step{"a step", 2, {}};
  for (const ChainCost& c : rows) {
    reduce.points.emplace_back(c.joints, c.reduce_ms);
    refresh.points.emplace_back(c.joints, c.refresh_ms);
    step.points.emplace_back(c.joints, 1e-3 * c.step_us);
    all_ms.insert(all_ms.end(), {c.reduce_ms, c.refresh_ms, 1e-3 * c.step_us});
  }
  const auto [low, high] = std::minmax_element(all_ms.begin(), all_ms.end());
  internal::Figure f;
  f.title = "A chain of hinges, by number of joints";
  f.x_label = "joints";
  f.y_label = "ms";
  f.x_ticks = internal::DecadeTicks(rows.front().joints, rows.back().joints);
  f.low_decade = static_cast<int>(std::floor(std::log10(*low)));
  f.high_decade = static_cast<int>(std::ceil(std::log10(*high)));
  f.panels = {{"chain", "springs of 100 N m/rad", {reduce, refresh, step}}};
  return internal::DrawFigure(f);
}

}  // namespace fork1s
