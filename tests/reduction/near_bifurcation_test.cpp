// Equilibria of columns that are loaded past their buckling load and slightly aside, against closed forms, a
// relaxation with the load, and the symmetry of perfect columns.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "linalg/spectrum.hpp"
#include "mechanisms.hpp"
#include "reduction/tangent_stiffness.hpp"

namespace fork1s {
namespace {

using testing::Ball;
using testing::Share;

constexpr double kDown = 9.81;

StaticsOptions Gravity(double down, const Vector3& aside) {
  StaticsOptions options;
  options.gravity_R = Vector3(0, 0, -down) + aside;
  return options;
}

BodyIndex AddAt(MechanismBuilder& builder, const std::string& name, BodyIndex parent, const Vector3& at,
                const SpatialInertia& inertia) {
  BodyDef body;
  body.name = name;
  body.parent = parent;
  body.X_PB = RigidTransform(at);
  body.inertia = inertia;
  return builder.AddBody(body);
}

SpatialInertia MassAbove(double mass, double height) {
  SpatialInertia I = Ball(mass, 0.02);
  I.center = Vector3(0, 0, height);
  return I;
}

// A mass m at height l on a hinge with a spring of k = ratio · m g l.
std::shared_ptr<const Mechanism> Mast(double mass, double height, double ratio) {
  MechanismBuilder builder("mast");
  const BodyIndex mast = AddAt(builder, "mast", builder.base(), Vector3::Zero(), MassAbove(mass, height));
  builder.AddJoint(
      JointDef::Hinge("foot", mast, Vector3::UnitY()).WithSpring(ratio * mass * kDown * height, 0));
  builder.SetInterfaces({"mast"});
  return Share(builder.definition());
}

// The same on two hinges of the same stiffness: it buckles in two directions at once.
std::shared_ptr<const Mechanism> MastOnTwoHinges(double mass, double height, double ratio) {
  MechanismBuilder builder("universal");
  const double k = ratio * mass * kDown * height;
  const BodyIndex cross = AddAt(builder, "cross", builder.base(), Vector3::Zero(), Ball(0.001, 0.001)),
                  mast = AddAt(builder, "mast", cross, Vector3::Zero(), MassAbove(mass, height));
  builder.AddJoint(JointDef::Hinge("y", cross, Vector3::UnitY()).WithSpring(k, 0));
  builder.AddJoint(JointDef::Hinge("x", mast, Vector3::UnitX()).WithSpring(k, 0));
  builder.SetInterfaces({"mast"});
  return Share(builder.definition());
}

// A parallelogram of two upright cranks of length l, balanced, under a coupler of mass m, sprung at one foot.
// The coupler moves without turning, as the mass of the mast does.
std::shared_ptr<const Mechanism> Parallelogram(double mass, double length, double ratio) {
  MechanismBuilder builder("parallelogram");
  const double span = 1.5 * length;
  const BodyIndex left = AddAt(builder, "left", builder.base(), Vector3::Zero(), Ball(0.1, 0.05)),
                  coupler = AddAt(builder, "coupler", left, Vector3(0, 0, length), Ball(mass, 0.02)),
                  right = AddAt(builder, "right", builder.base(), Vector3(span, 0, 0), Ball(0.1, 0.05));
  builder.AddJoint(
      JointDef::Hinge("foot", left, Vector3::UnitY()).WithSpring(ratio * mass * kDown * length, 0));
  builder.AddJoint(JointDef::Hinge("top", coupler, Vector3::UnitY()));
  builder.AddJoint(JointDef::Hinge("right", right, Vector3::UnitY()));
  builder.AddClosure(ClosureDef::Connect("pin", coupler, right, Vector3(span, 0, 0), Vector3(0, 0, length)));
  builder.SetInterfaces({"coupler"});
  return Share(builder.definition());
}

// ratio θ = sin θ + aside/g cos θ on the side of the load: there is one root between 0 and π.
double LeanOf(double ratio, double aside) {
  const double a = std::abs(aside) / kDown;
  double low = 0, high = std::numbers::pi;
  for (int i = 0; i < 200; ++i) {
    const double turn = 0.5 * (low + high);
    (ratio * turn < std::sin(turn) + a * std::cos(turn) ? low : high) = turn;
  }
  return std::copysign(low, aside);
}

constexpr double kRatios[] = {0.6, 0.8, 0.9, 0.95, 0.99, 0.999, 1, 1.01};
constexpr double kSideLoads[] = {2, 0.5, 0.05, 0.01, 1e-3, 1e-5, -1e-4, -0.02, -0.05, -1};  // m/s²

// The stiffness that is left, m g l (ratio - cos θ + aside/g sin θ), sets how exactly a residual determines θ.
double Accuracy(double ratio, double aside, double turn) {
  return 1e-10 + 1e-10 / std::abs(ratio - std::cos(turn) + aside / kDown * std::sin(turn));
}

TEST(NearBifurcation, MastLeansToTheSideOfItsLoad) {
  for (const double ratio : kRatios)
    for (const double aside : kSideLoads)
      for (const int load_steps : {1, 3, 8, 20})
        for (const double height : {0.02, 0.5, 8.0}) {
          SCOPED_TRACE(::testing::Message()
                       << ratio << " aside " << aside << " steps " << load_steps << " height " << height);
          const auto m = Mast(1.3, height, ratio);
          StaticsOptions options = Gravity(kDown, Vector3(aside, 0, 0));
          options.load_steps = load_steps;
          const auto rest = SolveStatics(*m, VectorX::Zero(1), {}, options);
          ASSERT_TRUE(rest.converged) << rest.share;
          const double turn = LeanOf(ratio, aside);
          EXPECT_NEAR(rest.q(0), turn, Accuracy(ratio, aside, turn));
          EXPECT_TRUE(rest.tangent.IsStable());
          EXPECT_TRUE(rest.limit_shares.empty());
        }
}

// Weight and a force aside as dead loads in place of gravity.
TEST(NearBifurcation, MastLeansUnderDeadLoadsAsUnderGravity) {
  for (const double ratio : kRatios)
    for (const double aside : kSideLoads) {
      SCOPED_TRACE(::testing::Message() << ratio << " aside " << aside);
      const auto m = Mast(2, 0.4, ratio);
      const std::vector<DeadLoad> loads{
          {m->FindBody("mast"), 2 * Vector3(aside, 0, -kDown), Vector3::Zero(), Vector3(0, 0, 0.4)}};
      const auto rest = SolveStatics(*m, VectorX::Zero(1), loads);
      ASSERT_TRUE(rest.converged);
      const double turn = LeanOf(ratio, aside);
      EXPECT_NEAR(rest.q(0), turn, Accuracy(ratio, aside, turn));
      EXPECT_TRUE(rest.tangent.IsStable());
    }
}

// Two eigenvalues change sign together beside the path, and their product does not.
TEST(NearBifurcation, MastOnTwoHingesLeansToTheSideOfItsLoad) {
  for (const double ratio : kRatios)
    for (const double aside : kSideLoads) {
      SCOPED_TRACE(::testing::Message() << ratio << " aside " << aside);
      const auto m = MastOnTwoHinges(1.3, 0.5, ratio);
      // The cross has no mass to speak of and is at the hinges: its weight does no work.
      const auto rest = SolveStatics(*m, VectorX::Zero(2), {}, Gravity(kDown, Vector3(aside, 0, 0)));
      ASSERT_TRUE(rest.converged);
      const double turn = LeanOf(ratio, aside);
      EXPECT_NEAR(rest.q(0), turn, Accuracy(ratio, aside, turn));
      EXPECT_NEAR(rest.q(1), 0, 1e-9);
      EXPECT_TRUE(rest.tangent.IsStable());
    }
}

TEST(NearBifurcation, ParallelogramLeansToTheSideOfItsLoad) {
  for (const double ratio : kRatios)
    for (const double aside : kSideLoads) {
      SCOPED_TRACE(::testing::Message() << ratio << " aside " << aside);
      const auto m = Parallelogram(0.7, 0.3, ratio);
      const auto rest = SolveStatics(*m, VectorX::Zero(3), {}, Gravity(kDown, Vector3(aside, 0, 0)));
      ASSERT_TRUE(rest.converged);
      const double turn = LeanOf(ratio, aside);
      const double accuracy = Accuracy(ratio, aside, turn);
      EXPECT_NEAR(rest.q(0), turn, accuracy);
      EXPECT_NEAR(rest.q(1), -turn, accuracy);
      EXPECT_NEAR(rest.q(2), turn, accuracy);
      EXPECT_TRUE(rest.tangent.IsStable());
    }
}

// Nothing chooses a side: the path stays upright, and is unstable past the buckling load.
TEST(NearBifurcation, PerfectColumnsStayUpright) {
  for (const double ratio : {0.3, 0.6, 0.9, 0.99, 1.01}) {
    SCOPED_TRACE(ratio);
    for (const auto& m :
         {Mast(1.3, 0.5, ratio), MastOnTwoHinges(1.3, 0.5, ratio), Parallelogram(1.3, 0.5, ratio)}) {
      const int n = m->num_coordinates();
      const auto rest = SolveStatics(*m, VectorX::Zero(n), {}, Gravity(kDown, Vector3::Zero()));
      ASSERT_TRUE(rest.converged);
      EXPECT_LT(rest.q.cwiseAbs().maxCoeff(), 1e-9);
      EXPECT_EQ(rest.tangent.IsStable(), ratio > 1);
      EXPECT_TRUE(rest.limit_shares.empty());
    }
  }
}

// A column of rods of length l with masses on their ends and springs of stiffness k in their hinges.
struct Column {
  int links;
  double mass, length, stiffness;

  std::shared_ptr<const Mechanism> Build() const {
    MechanismBuilder builder("column");
    BodyIndex parent = builder.base();
    for (int i = 0; i < links; ++i) {
      parent = AddAt(builder, "link" + std::to_string(i + 1), parent, Vector3(0, 0, i == 0 ? 0 : length),
                     MassAbove(mass, length));
      builder.AddJoint(JointDef::Hinge("joint" + std::to_string(i + 1), parent, Vector3::UnitY())
                           .WithSpring(stiffness, 0));
    }
    builder.SetInterfaces({"link" + std::to_string(links)});
    return Share(builder.definition());
  }

  // Number of masses that rod i lifts.
  int Above(int i) const { return links - i; }

  // -∂V/∂φ_i of V = Σ k/2 (φ_i - φ_{i-1})² + s Σ m l Above(i) (g cos φ_i - aside sin φ_i), φ from upright.
  double Force(const std::vector<double>& phi, int i, double share, double aside) const {
    const std::size_t at = static_cast<std::size_t>(i);
    double f = share * mass * length * Above(i) * (kDown * std::sin(phi[at]) + aside * std::cos(phi[at]));
    f -= stiffness * (phi[at] - (i > 0 ? phi[at - 1] : 0));
    if (i + 1 < links) f += stiffness * (phi[at + 1] - phi[at]);
    return f;
  }

  // Share of gravity at which the upright column buckles: k K x = s G x.
  double BucklingShare() const {
    MatrixX K = MatrixX::Zero(links, links), G = K;
    for (int i = 0; i < links; ++i) {
      K(i, i) = stiffness * (i + 1 < links ? 2 : 1);
      if (i > 0) K(i, i - 1) = K(i - 1, i) = -stiffness;
      G(i, i) = mass * length * kDown * Above(i);
    }
    return EigenvaluesOf(K, G)(0);
  }

  // Rest under a load that grows slowly, by dynamic relaxation with kinetic damping (Barnes 1988): inertia 1,
  // and motion stops where it loses kinetic energy. It stays where it is stable.
  std::vector<double> Relax(double aside) const {
    std::vector<double> phi(static_cast<std::size_t>(links)), rate = phi, force = phi;
    const double largest = 4 * stiffness + mass * length * (kDown + std::abs(aside)) * links,
                 h = 0.5 / std::sqrt(largest);
    constexpr int kShares = 100;
    for (int s = 1; s <= kShares; ++s) {
      const double rest = (s < kShares ? 1e-6 : 1e-11) * stiffness;
      for (int round = 0; round < 100'000; ++round) {
        double power = 0, size = 0;
        for (std::size_t i = 0; i < phi.size(); ++i) {
          force[i] = Force(phi, static_cast<int>(i), s / static_cast<double>(kShares), aside);
          power += force[i] * rate[i];
          size = std::max(size, std::abs(force[i]));
        }
        if (size < rest) break;
        for (std::size_t i = 0; i < phi.size(); ++i) {
          rate[i] = (power < 0 ? 0 : rate[i]) + h * force[i];
          phi[i] += h * rate[i];
        }
      }
    }
    return phi;
  }
};

TEST(NearBifurcation, ColumnsEndWhereRelaxationUnderAGrowingLoadDoes) {
  for (const int links : {2, 3, 5})
    for (const double at : {0.8, 0.9, 0.97})
      for (const double aside : {0.5, 0.05, -0.01}) {
        SCOPED_TRACE(::testing::Message() << links << " links, buckles at " << at << ", aside " << aside);
        Column column{links, 0.4, 0.2, 1};
        column.stiffness = at / column.BucklingShare();
        ASSERT_NEAR(column.BucklingShare(), at, 1e-12);
        const auto m = column.Build();
        const auto rest = SolveStatics(*m, VectorX::Zero(links), {}, Gravity(kDown, Vector3(aside, 0, 0)));
        ASSERT_TRUE(rest.converged);
        EXPECT_TRUE(rest.tangent.IsStable());
        const std::vector<double> phi = column.Relax(aside);
        double turn = 0;
        for (int i = 0; i < links; ++i) {
          turn += rest.q(i);
          EXPECT_NEAR(turn, phi[static_cast<std::size_t>(i)], 1e-8);  // 1e-11 k over a stiffness of 1e-3 k
        }
      }
}

}  // namespace
}  // namespace fork1s
