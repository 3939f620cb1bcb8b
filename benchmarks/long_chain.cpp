// A chain of many joints built by hand: how long its reduction and its steps take, and what it holds in
// memory.
//
//     build/release/benchmarks/long_chain [JOINTS ...]     default: 100 200 500 1000 2000 5000
#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fork1s/base/percentile.hpp>
#include <fork1s/dynamics/mechanism_dynamics.hpp>
#include <fork1s/mechanism/builder.hpp>
#include <fork1s/recovery/recover.hpp>
#include <vector>

#include "benchmarks.hpp"

namespace fork1s::benchmarks::long_chain {
namespace {
using Clock = std::chrono::steady_clock;

double Microseconds(Clock::time_point from) {
  return std::chrono::duration<double, std::micro>(Clock::now() - from).count();
}

// Bytes in use, large blocks included.
std::size_t HeapBytes() {
  const struct mallinfo2 info = mallinfo2();
  return info.uordblks + info.hblkhd;
}

Mechanism Chain(int joints) {
  MechanismBuilder builder("chain");
  BodyIndex parent = builder.base();
  const double length = 0.05, mass = 0.02;
  for (int i = 0; i < joints; ++i) {
    BodyDef link;
    link.name = fmt::format("link{}", i);
    link.parent = parent;
    if (i > 0) link.X_PB = RigidTransform(Vector3(length, 0, 0));
    link.inertia = {mass, Vector3(length / 2, 0, 0), Vector3(1e-6, 5e-6, 5e-6).asDiagonal()};
    parent = builder.AddBody(link);
    builder.AddJoint(
        JointDef::Hinge(fmt::format("joint{}", i), parent, i % 2 ? Vector3::UnitY() : Vector3::UnitZ())
            .WithSpring(100, 1));
  }
  builder.SetInterfaces({fmt::format("link{}", joints - 1)});
  return std::move(builder.Build().value());
}

void Measure(int joints) {
  auto mechanism = std::make_shared<const Mechanism>(Chain(joints));
  const VectorX q = VectorX::Zero(joints);
  std::vector<double> reduce;
  for (int i = 0; i < 9; ++i) {
    const auto start = Clock::now();
    auto model = Reduce(mechanism, q);
    reduce.push_back(Microseconds(start));
  }
  double step_us[2], hold_bytes = 0;
  for (Recovery recovery : {Recovery::kExact, Recovery::kTwist}) {
    MechanismDynamics::Options options;
    options.recovery = recovery;
    const std::size_t before = HeapBytes();
    auto dynamics =
        MechanismDynamics::Create(mechanism, q, VectorX(), RigidTransform(), Vector6::Zero(), options);
    if (recovery == Recovery::kTwist) hold_bytes = static_cast<double>(HeapBytes() - before);
    std::vector<double> steps;
    std::vector<RigidTransform> X_RB;
    for (int i = 0; i < 300; ++i) {
      const auto start = Clock::now();
      dynamics->Predict(1.0 / 60, Vector3(0, 0, -0.1));
      dynamics->Integrate(1.0 / 60);
      if (recovery == Recovery::kTwist) RecoverPosesTwist(dynamics->model(), dynamics->state(), X_RB);
      steps.push_back(Microseconds(start));
    }
    step_us[recovery == Recovery::kTwist] = Median(steps);
  }
  fmt::print("{},{:.3f},{:.2f},{:.2f},{:.3f}\n", joints, 1e-3 * Median(reduce), step_us[0], step_us[1],
             hold_bytes / 1e6);
}

}  // namespace

int Main(int argc, char** argv) {
  std::vector<int> sizes;
  for (int i = 1; i < argc; ++i) sizes.push_back(std::atoi(argv[i]));
  if (sizes.empty()) sizes = {100, 200, 500, 1000, 2000, 5000};
  fmt::print("joints,reduce_ms,step_exact_us,step_twist_us,heap_MB\n");
  for (int joints : sizes) Measure(joints);
  return 0;
}

}  // namespace fork1s::benchmarks::long_chain
