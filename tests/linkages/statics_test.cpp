// Compliance as the slope of nonlinear statics.
#include <gtest/gtest.h>

#include <cmath>
#include <fork1s/mechanism/kinematics.hpp>
#include <fork1s/reduction/statics.hpp>
#include <iostream>

#include "compare.hpp"
#include "random_linkage.hpp"

namespace fork1s::linkages {
namespace {

// Displacement of the interface bodies in world axes under `share` of a load [moment; force] on each.
bool Displacement(const Written& linkage, const VectorX& load_W, double share, VectorX& d_W) {
  const Mechanism& m = *linkage.mechanism;
  const Matrix3 R_WR = m.definition().X_WR.rotation();
  std::vector<DeadLoad> loads;
  for (std::size_t i = 0; i < linkage.interfaces.size(); ++i) {
    const Vector6 f = share * load_W.segment<6>(6 * static_cast<Eigen::Index>(i));
    loads.push_back({linkage.interfaces[i], R_WR.transpose() * f.tail<3>(), R_WR.transpose() * f.head<3>()});
  }
  StaticsOptions options;
  options.load_steps = 1;
  options.max_iterations = 20;
  const StaticsResult result = SolveStatics(m, VectorX::Zero(m.num_coordinates()), loads, options);
  Kinematics k(m);
  ComputeKinematics(m, result.q, k);
  d_W.resize(load_W.size());
  for (std::size_t i = 0; i < linkage.interfaces.size(); ++i) {
    const BodyIndex b = linkage.interfaces[i];
    const RigidTransform& X_0 = m.body(b).X_RB0;
    d_W.segment<3>(6 * static_cast<Eigen::Index>(i)) =
        R_WR * LogRotation(k.X_RB[b.u()].rotation() * X_0.rotation().transpose());
    d_W.segment<3>(6 * static_cast<Eigen::Index>(i) + 3) =
        R_WR * (k.X_RB[b.u()].translation() - X_0.translation());
  }
  return result.converged;
}

// All springs between 1 and 3: a load that moves a stiff spring visibly would buckle a motion a million times
// softer that loops press upon.
Sketch WithSpringsAlike(Sketch s, unsigned seed) {
  const std::vector<double> x = RandomNumbers(seed, static_cast<int>(2 * s.pairs.size() + s.tendons.size()));
  std::size_t next = 0;
  for (Pair& p : s.pairs) {
    p.k_turn *= p.k_turn > 0 ? (1 + 2 * x[next]) / p.k_turn : 0;
    p.k_slide *= p.k_slide > 0 ? (1 + 2 * x[next + 1]) / p.k_slide : 0;
    next += 2;
  }
  for (Tendon& t : s.tendons) t.stiffness = 1 + 2 * x[next++];
  return s;
}

// Springs on joints only: closures that springs act on stand open by rounding (see the last test).
Sketch WithSpringsOnJoints(Sketch s, const Writing& writing) {
  std::erase_if(s.pairs, [](const Pair& p) { return p.kind == PairKind::kBushing; });
  const MechanismDef def = Write(s, writing);
  for (const ClosureDef& c : def.closures) {
    Pair& p = s.pairs[std::stoul(c.name.substr(1))];
    p.k_turn = p.k_slide = 0;
  }
  return s;
}

struct Slope {
  bool converged = true;
  VectorX value;
  double change = 0;  // of the last extrapolation
};

// Slopes at 1, 1/2, 1/4 of the load, extrapolated to none: the sixth order is left.
Slope SlopeUnder(const Written& linkage, const VectorX& load) {
  Slope out;
  VectorX slope[3];
  for (int level = 0; level < 3; ++level) {
    VectorX up, down;
    const double share = std::pow(0.5, level);
    out.converged &= Displacement(linkage, load, share, up);
    out.converged &= Displacement(linkage, load, -share, down);
    slope[level] = (up - down) / (2 * share);
  }
  const VectorX first = (4 * slope[1] - slope[0]) / 3, second = (4 * slope[2] - slope[1]) / 3;
  out.value = (16 * second - first) / 15;
  out.change = out.converged ? (out.value - second).norm() / second.norm() : 1;
  return out;
}

TEST(Statics, SlopeIsTheCompliance) {
  // The last extrapolation takes away the fourth order; the sixth is smaller by the same factor again.
  constexpr double kStraight = 3e-7;
  int compared = 0, refused = 0, curved = 0;
  double worst = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    Sketch s = RandomLinkage(seed);
    // Differences of poses far from R round by their distance: the root is kept near.
    s = WithSpringsAlike(Scaled(WithRoot(s, RandomPose(seed, s.size)), 1 / s.size), seed);
    s = WithSpringsOnJoints(std::move(s), {.seed = seed, .sprung_joints = true});
    const Written linkage = Build(s, {.seed = seed, .sprung_joints = true});
    const PlainAnswer plain = PlainMethod(*linkage.mechanism, linkage.interfaces, s.size);
    // A free motion anywhere leaves the Newton steps without a unique answer.
    if (!plain.well_posed || plain.free > 0 || plain.interface_rank == 0 || plain.smallest_kept < 1e-2)
      continue;
    const std::vector<double> x = RandomNumbers(seed, static_cast<int>(plain.C.rows()));
    VectorX load(plain.C.rows());
    for (Eigen::Index i = 0; i < load.size(); ++i) load(i) = x[static_cast<std::size_t>(i)] - 0.5;
    // A load that moves the interface by a hundredth of its size, less where the linkage is bent more
    // elsewhere.
    load *= 1e-2 / (plain.C * load).cwiseAbs().maxCoeff();
    Slope slope = SlopeUnder(linkage, load);
    for (int i = 0; i < 4 && slope.change >= kStraight && (slope.converged || i == 0); ++i) {
      load *= 0.2;
      slope = SlopeUnder(linkage, load);
    }
    const double difference = (slope.value - plain.C * load).norm() / (plain.C * load).norm();
    if (!slope.converged) {
      ++refused;
    } else if (slope.change >= kStraight) {
      ++curved;
    } else {
      worst = std::max(worst, difference);
      EXPECT_LT(difference, kSame) << "seed " << seed << " " << s.family << ", last change " << slope.change;
      ++compared;
    }
  }
  std::cout << compared << " compared, worst " << worst << ", " << curved << " too curved, " << refused
            << " without equilibrium\n";
  EXPECT_GT(compared, 50);
  EXPECT_LE(refused + curved, compared / 10);
}

// Closures that springs act on stand open by rounding, and push with 1e-16 of their stiffness.
TEST(Statics, ReferenceIsAnEquilibriumToRounding) {
  int tried = 0, failed = 0;
  unsigned first = 0;
  for (unsigned seed = 0; seed < 150; ++seed) {
    const Sketch s = RandomLinkage(seed);
    const Written linkage = Build(s, {.seed = seed});
    const PlainAnswer plain = PlainMethod(*linkage.mechanism, linkage.interfaces, s.size);
    if (!plain.well_posed || plain.free > 0 || plain.elastic == 0) continue;
    ++tried;
    const StaticsResult result =
        SolveStatics(*linkage.mechanism, VectorX::Zero(linkage.mechanism->num_coordinates()), {});
    if (!result.converged && failed++ == 0) first = seed;
  }
  EXPECT_EQ(failed, 0) << "of " << tried << ", the first is seed " << first;
  EXPECT_GT(tried, 75);
}

// In a process of its own, since a fault there would take the other tests with it.
TEST(StaticsDeathTest, OfAStructureThatLoopsHoldStill) {
  Sketch s;
  s.family = "triangle";
  const SpatialInertia bar{0.1, Vector3(0.05, 0, 0), Vector3(1e-4, 2e-4, 2e-4).asDiagonal()};
  const Vector3 corner[] = {{0, 0, 0}, {0.2, 0.1, 0}, {0.1, -0.05, 0}};
  for (int i = 0; i < 3; ++i) s.AddBody(i == 0 ? RigidTransform() : RigidTransform(corner[i - 1]), bar);
  for (int i = 0; i < 3; ++i)
    s.AddPair(i, (i + 1) % 3, PairKind::kHinge, corner[i], Matrix3::Identity()).k_turn = i == 0 ? 5 : 0;
  s.interfaces = {2};
  const Written linkage = Build(s, {.keep_order = true});
  EXPECT_EXIT(
      {
        const StaticsResult result =
            SolveStatics(*linkage.mechanism, VectorX::Zero(2), {{linkage.interfaces[0], Vector3(1, 0, 0)}});
        std::exit(result.converged && result.q.norm() < 1e-9 ? 0 : 1);
      },
      ::testing::ExitedWithCode(0), "");
}

}  // namespace
}  // namespace fork1s::linkages
