// Compliance, stiffness and frequencies that can be written down.
#include <fmt/format.h>
#include <cmath>
#include <fork1s/reduction/compliance.hpp>
#include <fork1s/reduction/frequencies.hpp>
#include <numbers>

#include "../equilibrium.hpp"
#include "cases.hpp"
#include "linalg/cholesky.hpp"
#include "linalg/spectrum.hpp"
#include "support.hpp"

namespace fork1s::internal {
namespace {

// The full simulator's compliance is a central difference over 3e-5 rad: the cubic term leaves 1e-9 of the
// compliance, and Newton's 1e-13 m of the pose 1e-8.
constexpr double kDifference = 1e-7;
const char* const kWhyDifference =
    "the full method's central difference over 3e-5 rad and m: 1e-8 from the tolerance on poses";

struct Compliances {
  MatrixX reduced, full;
};

std::shared_ptr<const Mechanism> Build(const MechanismDef& definition) {
  return std::make_shared<const Mechanism>(OrFail(BuildMechanism(definition)));
}

Compliances CompliancesOf(const MechanismDef& definition) {
  const auto m = Build(definition);
  const ReducedModel model = OrFail(Reduce(m, VectorX::Zero(m->num_coordinates())));
  Compliances C;
  C.reduced = OrFail(ComplianceOfReduced(model));
  C.full = OrFail(ComplianceOfFull(definition, C.reduced));
  return C;
}

/// Rods along x hinged about z, and a massless tip.
MechanismDef Rods(int links, double length, double mass, double stiffness, double elbow) {
  MechanismBuilder builder("rods");
  BodyIndex parent = builder.base();
  for (int i = 0; i < links; ++i) {
    BodyDef link;
    link.name = fmt::format("link{}", i + 1);
    link.parent = parent;
    if (i > 0) link.X_PB = RigidTransform(ExpRotation(Vector3(0, 0, elbow)), Vector3(length, 0, 0));
    link.inertia = testing::Rod(mass, length);
    parent = builder.AddBody(link);
    builder.AddJoint(
        JointDef::Hinge(fmt::format("joint{}", i + 1), parent, Vector3::UnitZ()).WithSpring(stiffness));
  }
  BodyDef tip;
  tip.name = "tip";
  tip.parent = parent;
  tip.X_PB = RigidTransform(Vector3(length, 0, 0));
  builder.AddBody(tip);
  builder.SetInterfaces({"tip"});
  return builder.definition();
}

/// Six struts of stiffness k on six edges of a cube of side a, universal joints below, balls above; the
/// platform's frame stands at the cube's centre.
MechanismDef Stewart(double a, double k) {
  MechanismBuilder builder("stewart");
  const Vector3 center = Vector3::Constant(a / 2);
  const Matrix3 E = Matrix3::Identity();
  BodyIndex platform;
  std::vector<std::pair<BodyIndex, Vector3>> open;  // strut end, and where it meets the platform
  for (int i = 0; i < 3; ++i)
    for (const int side : {1, 2}) {
      const std::string n = fmt::format("{}", 2 * i + side);
      const Vector3 along = E.col((i + side) % 3), across = E.col((i + 3 - side) % 3), third = E.col(i);
      const Vector3 low = a * third, high = low + a * along;
      BodyDef lower, upper;
      lower.name = "lower" + n;
      lower.parent = builder.base();
      lower.X_PB = RigidTransform(low);
      lower.inertia = testing::Ball(0.1, 0.05);
      upper.name = "upper" + n;
      upper.parent = builder.AddBody(lower);
      upper.X_PB = RigidTransform(Vector3(a * along));
      upper.inertia = testing::Ball(0.1, 0.05);
      builder.AddJoint(UniversalJoint("universal" + n, upper.parent, across, third));
      const BodyIndex end = builder.AddBody(upper);
      builder.AddJoint(JointDef::Slide("slide" + n, end, along).WithSpring(k, 0.02 * k));
      if (platform.valid()) {
        open.emplace_back(end, high - center);
        continue;
      }
      BodyDef top;
      top.name = "platform";
      top.parent = end;
      top.X_PB = RigidTransform(Vector3(center - high));
      top.inertia = testing::Brick(3, Vector3(0.1, 0.1, 0.02));
      platform = builder.AddBody(top);
      builder.AddJoint(JointDef::Ball("ball", platform, high - center));
    }
  for (std::size_t i = 0; i < open.size(); ++i)
    builder.AddClosure(ClosureDef::Connect(fmt::format("top{}", i), open[i].first, platform, Vector3::Zero(),
                                           open[i].second));
  builder.SetInterfaces({"platform"});
  return builder.definition();
}

}  // namespace

std::vector<KnownAnswer> TwoLinkArm(Refinement) {
  Rows rows("two_link_arm");
  const MechanismDef definition = Rods(2, 1, 1, 100, std::numbers::pi / 2);
  const Compliances C = CompliancesOf(definition);
  const MatrixX K_reduced = C.reduced.block<2, 2>(3, 3).inverse(),
                K_full = C.full.block<2, 2>(3, 3).inverse();
  const char* source = "closed form, k/l² [[1, 1], [1, 2]] for l = 1 m, k = 100 N·m/rad";
  for (const auto& [i, j, name, expected] :
       {std::tuple{0, 0, "K_xx", 100.0}, {0, 1, "K_xy", 100.0}, {1, 1, "K_yy", 200.0}})
    rows.Add({fmt::format("tip stiffness {}", name), "N/m", expected, kDifference * expected * 10,
              std::string(kWhyDifference) + ", ten times more by the inversion", source},
             K_reduced(i, j), K_full(i, j));

  const auto m = Build(definition);
  const ReducedModel model = OrFail(Reduce(m, VectorX::Zero(2)));
  const auto reduced = ReducedFrequencies(model);
  const auto full = StartFull(SceneOf(definition), 0.01).Frequencies(0);
  if (reduced.size() != 2 || full.size() != 2) throw CaseFailure("the arm has not two frequencies");
  // det(K - ω² M) = 0 for thin rods with l = m = 1 at a right angle: M = [[5/3, 1/3], [1/3, 1/3]] and K =
  // 100.
  const double a = 4.0 / 9, b = 200.0, c = 1e4;
  const double root = std::sqrt(b * b - 4 * a * c);
  const double known[2] = {std::sqrt((b - root) / (2 * a)), std::sqrt((b + root) / (2 * a))};
  for (std::size_t i = 0; i < 2; ++i)
    rows.Add({fmt::format("frequency {}", i + 1), "rad/s", known[i], 1e-9 * known[i],
              "rounding of two eigenvalues", "closed form: 7.5693 and 19.8168 rad/s"},
             2 * std::numbers::pi * reduced[i], 2 * std::numbers::pi * full[i]);
  return rows.Release();
}

std::vector<KnownAnswer> PlanarChain(Refinement) {
  Rows rows("planar_chain");
  const Compliances C = CompliancesOf(Rods(10, 0.1, 0.1, 100, 0));
  const char* source = "closed form, sums of 1, x and x² over the joints divided by k";
  for (const auto& [i, j, name, unit, expected] :
       {std::tuple{4, 4, "C_yy, force to displacement", "m/N", 0.0385},
        {4, 2, "C_yr, moment to displacement", "rad/N", 0.055},
        {2, 2, "C_rr, moment to rotation", "rad/(N·m)", 0.1}})
    rows.Add({fmt::format("tip compliance {}", name), unit, expected, kDifference * expected, kWhyDifference,
              source},
             C.reduced(i, j), C.full(i, j));
  return rows.Release();
}

std::vector<KnownAnswer> StewartPlatform(Refinement) {
  Rows rows("stewart_platform");
  const double a = 0.3, k = 1000;
  const Compliances C = CompliancesOf(Stewart(a, k));
  const Matrix6 K_reduced = SolveSymmetric(C.reduced, Matrix6::Identity()),
                K_full = SolveSymmetric(C.full, Matrix6::Identity());
  const char* source =
      "closed form at the cube's centre: K_t = 2k I, K_r eigenvalues k a² (½, ½, 2), no coupling";
  auto spread = [](const Matrix6& K) { return (K.block<3, 3>(3, 3) / K(3, 3) - Matrix3::Identity()).norm(); };
  auto turning = [](const Matrix6& K) { return PrincipalValues(K.block<3, 3>(0, 0)); };
  auto coupling = [&](const Matrix6& K) { return K.block<3, 3>(0, 3).norm() / (k * a); };
  const std::string why = std::string(kWhyDifference) + ", ten times more by the inversion";
  rows.Add({"translational stiffness K_xx", "N/m", 2 * k, 10 * kDifference * 2 * k, why, source},
           K_reduced(3, 3), K_full(3, 3));
  rows.Add({"distance of K_t from a multiple of I", "1", 0, 10 * kDifference, why, source}, spread(K_reduced),
           spread(K_full));
  const Vector3 known(0.5, 0.5, 2), r = turning(K_reduced), f = turning(K_full);
  for (int i = 0; i < 3; ++i)
    rows.Add({fmt::format("rotational stiffness, eigenvalue {}", i + 1), "N·m/rad", k * a * a * known(i),
              10 * kDifference * k * a * a * 2, why, source},
             r(i), f(i));
  rows.Add({"coupling of rotation and translation, over k a", "1", 0, 10 * kDifference, why, source},
           coupling(K_reduced), coupling(K_full));
  return rows.Release();
}

}  // namespace fork1s::internal
