// Poses of all bodies from the reduced state: nanoseconds a body, and how near that is to what the machine
// can.
#include <algorithm>
#include <chrono>
#include <fork1s/base/percentile.hpp>
#include <fork1s/parallel/parallel_for.hpp>
#include <fork1s/recovery/pose_arrays.hpp>
#include <fork1s/recovery/recover.hpp>
#include <fork1s/recovery/second_order.hpp>
#include <fork1s/study/bench.hpp>

#include "chain.hpp"

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
void MeasureArrays(const ReducedModel& model, RecoveryCost cost, std::vector<RecoveryCost>& out) {
  constexpr bool single = sizeof(Real) == 4;
  const PoseRecovery<Real> recovery(model, Recovery::kTwist);
  const auto r = static_cast<std::size_t>(recovery.coordinates());
  const double bodies = cost.bodies;
  cost.type = single ? "f32" : "f64";
  cost.mode = "arrays";
  std::vector<Real> z(r, Real(1e-3));
  PoseArrays<Real> poses;
  WithThreads(cost.threads, [&] {
    cost.ns_per_body = 1e9 * CallSeconds([&] { recovery.Recover(z.data(), poses); }) / bodies;
  });
  const auto bytes = static_cast<double>(recovery.BytesMoved());
  const double operations = static_cast<double>(recovery.Operations()) / bodies;
  HoldAgainst(MeasureCeilings(bytes, cost.threads, single), bytes / bodies, operations, cost);
  out.push_back(cost);
  constexpr std::size_t kStates = 1024;
  if (cost.bodies > 1000 || cost.threads > 1) return;
  cost.mode = "arrays, 1024 states";
  z.assign(r * kStates, Real(1e-3));
  std::vector<PoseArrays<Real>> all(static_cast<std::size_t>(recovery.bodies()));
  cost.ns_per_body = 1e9 *
                     CallSeconds([&] { recovery.RecoverMany(z.data(), kStates, kStates, all.data()); }) /
                     bodies / kStates;
  const double written = 12 * sizeof(Real);
  HoldAgainst(MeasureCeilings(written * bodies * kStates, cost.threads, single), written, operations, cost);
  out.push_back(cost);
}

}  // namespace

Expected<std::vector<RecoveryCost>> MeasureRecovery(const std::vector<int>& bodies) {
  std::vector<RecoveryCost> out;
  for (const int count : bodies)
    for (const int interfaces : {1, 6}) {
      FORK1S_REQUIRE(count >= interfaces, count);
      auto reduced = Reduce(internal::MakeChain(count, interfaces), VectorX::Zero(count));
      if (!reduced) return tl::unexpected(reduced.error());
      const ReducedModel& model = *reduced;
      const int r = model.size();
      ReducedState state;
      state.z = VectorX::Constant(r, 1e-3);
      state.w = VectorX::Zero(r);
      if (model.has_complement) state.q_perp = VectorX::Zero(count);
      Configuration scratch(model);
      std::vector<RigidTransform> X_RB;
      for (const int threads : {1, 2}) {
        if (threads > 1 && count < kWorthThreads) continue;
        const auto cost = [&](const char* mode, auto work) {
          RecoveryCost c{mode, "f64", interfaces, r, count, threads, 0, {}, ""};
          WithThreads(threads, [&] { c.ns_per_body = 1e9 * CallSeconds(work) / count; });
          out.push_back(c);
        };
        cost("twist", [&] { RecoverPosesTwist(model, state, X_RB); });
        RecoveryCost& twist = out.back();
        HoldAgainst(MeasureCeilings(TwistBytes(r) * count, threads), TwistBytes(r), TwistOperations(r),
                    twist);
        const RecoveryCost like{"", "", interfaces, r, count, threads, 0, {}, ""};
        MeasureArrays<float>(model, like, out);
        MeasureArrays<double>(model, like, out);
        if (threads > 1) continue;  // the others walk along paths, on one thread
        cost("second order", [&] { RecoverPosesTwistSecondOrder(model, state, X_RB); });
        cost("exact", [&] { RecoverPosesExact(model, state, scratch, X_RB); });
      }
    }
  return out;
}

}  // namespace fork1s
