#include "chain.hpp"

#include <malloc.h>

#include <chrono>
#include <fork1s/base/percentile.hpp>
#include <fork1s/mechanism/builder.hpp>
#include <fork1s/parallel/parallel_for.hpp>
#include <fork1s/recovery/recover.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <fork1s/study/bench.hpp>

#include <fmt/format.h>

namespace fork1s {
namespace internal {

std::shared_ptr<const Mechanism> MakeChain(int joints, int interfaces) {
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
  std::vector<std::string> names;
  for (int i = 1; i <= interfaces; ++i) names.push_back(fmt::format("link{}", joints * i / interfaces - 1));
  builder.SetInterfaces(names);
  return std::make_shared<const Mechanism>(std::move(builder.Build().value()));
}

std::shared_ptr<const Mechanism> MakeFourBars(int count) {
  MechanismBuilder builder("four-bars");
  // Hinges of one, where they stand at the reference: crank on the base, coupler on it, rocker on the base,
  // closed to the coupler.
  const Vector3 A(0, 0, 0), B(0, 0.1, 0), C(0.15, 0.15, 0), D(0.2, 0, 0);
  std::vector<std::string> names;
  for (int i = 0; i < count; ++i) {
    const RigidTransform X(ExpRotation(Vector3(0.1 * i, 0, 0)), Vector3(0, 0, 0.05 * i));
    const auto bar = [&](const char* what, BodyIndex parent, const RigidTransform& X_PB, double stiffness) {
      BodyDef body;
      body.name = fmt::format("{}{}", what, i);
      body.parent = parent;
      body.X_PB = X_PB;
      body.inertia = {0.1, Vector3(0.05, 0.05, 0), Vector3(1e-5, 1e-5, 2e-5).asDiagonal()};
      const BodyIndex b = builder.AddBody(body);
      builder.AddJoint(JointDef::Hinge(fmt::format("{}_hinge{}", what, i), b, Vector3::UnitZ())
                           .WithSpring(stiffness, 0.02 * stiffness));
      return b;
    };
    const BodyIndex crank = bar("crank", builder.base(), X, 2);
    const BodyIndex coupler = bar("coupler", crank, RigidTransform(B), 0.1);
    const BodyIndex rocker = bar("rocker", builder.base(), X * RigidTransform(D), 0.5);
    builder.AddClosure(ClosureDef::Connect(fmt::format("C{}", i), coupler, rocker, C - B, C - D));
    names.push_back(fmt::format("coupler{}", i));
  }
  builder.SetInterfaces(names);
  return std::make_shared<const Mechanism>(std::move(builder.Build().value()));
}

}  // namespace internal

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
      BeginStep(*dynamics, kStep, kStep, Vector3(0, 0, -0.1));
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

}  // namespace fork1s
