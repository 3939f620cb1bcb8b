#include <lab/recovery_cost.hpp>

#include <algorithm>
#include <chrono>
#include <fork1s/recovery/pose_arrays.hpp>
#include <fork1s/recovery/recover.hpp>
#include <fork1s/recovery/second_order.hpp>

#include <fmt/format.h>

#include "base/percentile.hpp"
#include "ceilings.hpp"
#include "chains.hpp"
#include "parallel/parallel_for.hpp"

namespace fork1s {
namespace {

// Of a call of `work`, the quickest tenth of as many as fit into 30 ms: ceilings are the best of some tries
// too, and what disturbs only takes time.
template <class Work>
double CallSeconds(Work work) {
  using SteadyClock = std::chrono::steady_clock;
  std::vector<double> times;
  const auto begin = SteadyClock::now();
  for (auto now = begin; times.size() < 5 || now - begin < std::chrono::milliseconds(30);) {
    work();
    const auto after = SteadyClock::now();
    times.push_back(std::chrono::duration<double>(after - now).count());
    now = after;
  }
  times.erase(times.begin());  // it filled the caches
  return Percentile(times, 0.1);
}

// A body by twist reads T_B (6 r numbers) and its pose at the reference, and writes its pose.
double TwistBytes(int r) { return 8.0 * (6 * r + 12 + 12); }
// 6 r fused operations; the exponential takes some 80 (a rotation by Rodrigues' formula, its left Jacobian
// times the velocity) and the product of two poses 63.
double TwistOperations(int r) { return 12.0 * r + 80 + 63; }

constexpr int kWorthThreads = 4096;  // fewer bodies are one thread's work (src/recovery/recover.cpp)

void HoldAgainst(const Ceilings& most, double bytes, double operations, RecoveryCost& cost) {
  const double memory_ns = bytes / most.gigabytes_per_s, arithmetic_ns = operations / most.gigaflops;
  cost.percent_of_ceiling = 100 * std::max(memory_ns, arithmetic_ns) / cost.ns_per_body;
  cost.bound = memory_ns > arithmetic_ns ? "memory" : "arithmetic";
}

// All bodies of one state, and, where these fit into caches, of many.
template <class Real>
void MeasureArrays(const ReducedModel& model, Recovery mode, const VectorX& z_one, RecoveryCost cost,
                   std::vector<RecoveryCost>& out) {
  constexpr bool single = sizeof(Real) == 4;
  const PoseRecovery<Real> recovery(model, mode);
  const auto r = static_cast<std::size_t>(recovery.coordinates());
  const double bodies = cost.bodies;
  cost.type = single ? "f32" : "f64";
  cost.mode = std::string(Name(mode)) + ", arrays";
  std::vector<Real> z(r);
  for (std::size_t k = 0; k < r; ++k) z[k] = static_cast<Real>(z_one(static_cast<Eigen::Index>(k)));
  PoseArrays<Real> poses;
  WithThreads(cost.threads, [&] {
    cost.ns_per_body = 1e9 * CallSeconds([&] { recovery.Recover(z.data(), poses); }) / bodies;
  });
  const auto bytes = static_cast<double>(recovery.BytesMoved());
  const double operations = static_cast<double>(recovery.Operations()) / bodies;
  // Closing loops takes operations that are not counted, and one state a register of them.
  const bool counts = mode == Recovery::kTwist || model.loop_rank() == 0;
  if (counts) HoldAgainst(MeasureCeilings(bytes, cost.threads, single), bytes / bodies, operations, cost);
  out.push_back(cost);
  constexpr std::size_t kStates = 1024;
  if (cost.bodies > 1000 || cost.threads > 1) return;
  cost.mode += ", 1024 states";
  std::vector<Real> many(r * kStates);
  for (std::size_t k = 0; k < r; ++k)
    std::fill_n(many.begin() + static_cast<std::ptrdiff_t>(k * kStates), kStates, z[k]);
  std::vector<PoseArrays<Real>> all(static_cast<std::size_t>(recovery.bodies()));
  WithThreads(cost.threads, [&] {
    const double call = CallSeconds([&] { recovery.RecoverMany(many.data(), kStates, kStates, all.data()); });
    cost.ns_per_body = 1e9 * call / bodies / kStates;
  });
  const double written = 12 * sizeof(Real);
  if (counts || mode == Recovery::kCurved)
    HoldAgainst(MeasureCeilings(written * bodies * kStates, cost.threads, single), written, operations, cost);
  out.push_back(cost);
}

template <class Work>
RecoveryCost Measured(RecoveryCost cost, const std::string& mode, Work work) {
  cost.mode = mode;
  cost.type = "f64";
  WithThreads(cost.threads, [&] { cost.ns_per_body = 1e9 * CallSeconds(work) / cost.bodies; });
  return cost;
}

Expected<void> MeasureChainRecovery(int count, int interfaces, std::vector<RecoveryCost>& out) {
  FORK1S_REQUIRE(count >= interfaces, count);
  auto reduced = Reduce(internal::MakeChain(count, interfaces), VectorX::Zero(count));
  if (!reduced) return tl::unexpected(reduced.error());
  const ReducedModel& model = *reduced;
  const int r = model.size();
  ReducedState state;
  state.z = VectorX::Constant(r, 1e-3);
  state.w = VectorX::Zero(r);
  Configuration scratch(model);
  std::vector<RigidTransform> X_RB;
  for (const int threads : {1, 2}) {
    if (threads > 1 && count < kWorthThreads) continue;
    const RecoveryCost like{"chain", "", "", interfaces, r, count, threads, 0, {}, ""};
    RecoveryCost twist = Measured(like, "twist", [&] { RecoverPosesTwist(model, state, X_RB); });
    HoldAgainst(MeasureCeilings(TwistBytes(r) * count, threads), TwistBytes(r), TwistOperations(r), twist);
    out.push_back(twist);
    for (const Recovery mode : {Recovery::kTwist, Recovery::kExact}) {
      MeasureArrays<float>(model, mode, state.z, like, out);
      MeasureArrays<double>(model, mode, state.z, like, out);
    }
    if (threads > 1) continue;  // the others walk along paths, on one thread
    out.push_back(Measured(like, "second order", [&] { RecoverPosesTwistSecondOrder(model, state, X_RB); }));
    out.push_back(Measured(like, "exact", [&] { RecoverPosesExact(model, state, scratch, X_RB); }));
  }
  return {};
}

// Loops: four-bars side by side, each turned by a tenth of a radian.
Expected<void> MeasureLoopRecovery(int four_bars, std::vector<RecoveryCost>& out) {
  const auto mechanism = internal::MakeFourBars(four_bars);
  auto reduced = Reduce(mechanism, VectorX::Zero(mechanism->num_coordinates()));
  if (!reduced) return tl::unexpected(reduced.error());
  const ReducedModel& model = *reduced;
  ReducedModel curved = model;
  curved.curvature = LoopCurvature(model);
  ReducedState state;
  state.z = VectorX::Zero(model.size());
  for (int k = 0; k < model.size(); ++k) state.z(k) = 0.1 / model.Q.col(k).cwiseAbs().maxCoeff();
  state.w = VectorX::Zero(model.size());
  std::vector<RigidTransform> X_RB;
  const RecoveryCost like{"four-bars", "", "", four_bars, model.size(), 3 * four_bars, 1, 0, {}, ""};
  for (const Recovery mode : {Recovery::kExact, Recovery::kCurved}) {
    const ReducedModel& own = mode == Recovery::kCurved ? curved : model;
    Configuration scratch(own);
    // Exact loops start from where they ended before: there and back, as a motion would have it.
    ReducedState there = state, back = state;
    back.z *= 0.9;
    out.push_back(Measured(like, Name(mode), [&] {
      std::swap(there, back);
      RecoverPosesExact(own, there, scratch, X_RB);
    }));
    MeasureArrays<float>(own, mode, state.z, like, out);
    MeasureArrays<double>(own, mode, state.z, like, out);
  }
  return {};
}

}  // namespace

Expected<std::vector<RecoveryCost>> MeasureRecovery(const std::vector<int>& bodies) {
  std::vector<RecoveryCost> out;
  for (const int count : bodies)
    for (const int interfaces : {1, 6})
      if (auto done = MeasureChainRecovery(count, interfaces, out); !done)
        return tl::unexpected(done.error());
  constexpr int kFourBars = 32;
  if (auto done = MeasureLoopRecovery(kFourBars, out); !done) return tl::unexpected(done.error());
  return out;
}

std::string RecoveryCsv(const std::vector<RecoveryCost>& rows) {
  std::string out =
      "mechanism,mode,type,interfaces,coordinates,bodies,threads,ns_per_body,percent_of_ceiling,bound\n";
  for (const RecoveryCost& r : rows)
    out += fmt::format("{},\"{}\",{},{},{},{},{},{:.4g},{},{}\n", r.mechanism, r.mode, r.type, r.interfaces,
                       r.coordinates, r.bodies, r.threads, r.ns_per_body,
                       r.percent_of_ceiling ? fmt::format("{:.4g}", *r.percent_of_ceiling) : "", r.bound);
  return out;
}

}  // namespace fork1s
