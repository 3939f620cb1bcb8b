#include "standing_pose.hpp"
#include "linalg/null_space.hpp"
#include "linalg/solve.hpp"
#include "mechanism/coordinate_scaling.hpp"

#include <cmath>
#include <fork1s/mechanism/kinematics.hpp>

#include <fmt/format.h>

namespace fork1s::examples {

Expected<VectorX> PlaceFeet(const MechanismDef& definition, const VectorX& q0,
                            const std::vector<Footing>& footings) {
  // The wanted places are loops through the base while the pose is sought.
  MechanismDef m = definition;
  for (const Footing& f : footings) {
    m.closures.push_back(
        ClosureDef::Weld(f.body + " placed", BodyIndex(0), m.FindBody(f.body), f.X_RS, f.X_BS));
    m.closures.back().rigid(0) = !f.rolls;
  }
  auto start = BuildMechanism(m);
  if (!start) return tl::unexpected(start.error());
  Kinematics kinematics(*start);
  ComputeKinematics(*start, q0, kinematics);
  std::vector<Vector6> opening;
  for (const ClosureDef& c : m.closures)
    opening.push_back(
        Log((kinematics.X_RB[c.body_a.u()] * c.X_AJ).inverse() * kinematics.X_RB[c.body_b.u()] * c.X_BJ));
  // Loops far open close by degrees.
  constexpr int kStages = 50;
  VectorX q = q0;
  double gap = 0;
  for (int i = 1; i <= kStages; ++i) {
    MechanismDef stage = m;
    for (std::size_t c = 0; c < stage.closures.size(); ++c)
      stage.closures[c].X_AJ = m.closures[c].X_AJ * Exp((1 - double(i) / kStages) * opening[c]);
    auto built = BuildMechanism(std::move(stage));
    if (!built) return tl::unexpected(built.error());
    gap = CloseLoops(*built, q);
  }
  if (!(gap < 1e-6))
    return Fail(
        ErrorCode::kModel, definition.name,
        fmt::format("does not reach the footings asked for: {:.2g} mm are left; ask for others", 1e3 * gap));
  return q;
}

Vector3 CenterOfMass(const Mechanism& mechanism, const VectorX& q) {
  Kinematics kinematics(mechanism);
  ComputeKinematics(mechanism, q, kinematics);
  Vector3 moment = Vector3::Zero();
  for (int b = 0; b < mechanism.num_bodies(); ++b) {
    const SpatialInertia& I = mechanism.body(BodyIndex(b)).inertia_B;
    moment += I.mass * (kinematics.X_RB[static_cast<std::size_t>(b)] * I.center);
  }
  return moment / mechanism.total_mass();
}

namespace {

// Generalized force of weight and of equal shares of it under the soles.
VectorX Weight(const Mechanism& mechanism, const Kinematics& kinematics, const std::vector<Footing>& footings,
               double gravity) {
  Matrix6X F = Matrix6X::Zero(6, mechanism.num_bodies());
  AddGravityWrenches(mechanism, kinematics, Vector3(0, 0, -gravity), F);
  const Vector3 share(0, 0, mechanism.total_mass() * gravity / static_cast<double>(footings.size()));
  for (const Footing& f : footings) {
    const std::size_t b = mechanism.FindBody(f.body).u();
    const Vector3 p = kinematics.X_RB[b] * f.X_BS.translation();
    F.col(static_cast<Eigen::Index>(b)).head<3>() += p.cross(share);
    F.col(static_cast<Eigen::Index>(b)).tail<3>() += share;
  }
  VectorX tau = VectorX::Zero(mechanism.num_coordinates());
  AccumulateGeneralizedForce(mechanism, kinematics.S, F, tau);
  return tau;
}

// Motions that the loops allow, as columns.
MatrixX FreeMotions(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q) {
  const CoordinateScaling unit = ComputeCoordinateScaling(mechanism, kinematics);
  return unit.coordinate.asDiagonal() *
         ComputeNullSpace(ScaledClosureRows(mechanism, kinematics, q, unit)).unseen;
}

}  // namespace

Expected<StandingPose> FindStandingPose(const MechanismDef& definition, const VectorX& q0,
                                        std::vector<Footing> footings, double gravity) {
  auto built = BuildMechanism(definition);
  if (!built) return tl::unexpected(built.error());
  const Mechanism& mechanism = *built;
  const auto count = static_cast<Eigen::Index>(mechanism.controls().size());
  // Forces that may act: those of the controls, then of the springs that none of them reaches.
  MatrixX B = MatrixX::Zero(q0.size(), count);
  Kinematics kinematics(mechanism);
  ComputeKinematics(mechanism, q0, kinematics);
  for (Eigen::Index i = 0; i < count; ++i) {
    VectorX column = VectorX::Zero(q0.size());
    AddControlForce(mechanism, kinematics, VectorX::Unit(count, i), column);
    B.col(i) = column;
  }
  std::vector<Eigen::Index> yielding;
  for (Eigen::Index i = 0; i < q0.size(); ++i)
    if (mechanism.stiffness()(i) > 0 && B.row(i).isZero(0)) yielding.push_back(i);
  MechanismDef bent = definition;
  for (Eigen::Index i : yielding) {
    const JointIndex j = mechanism.CoordinateJoint(static_cast<int>(i));
    CouplingDef hold;
    hold.name = mechanism.CoordinateName(static_cast<int>(i)) + " bent";
    hold.a = {j, static_cast<int>(i) - mechanism.joint(j).offset};
    hold.polynomial[0] = q0(i);
    hold.polynomial[1] = 0;
    bent.couplings.push_back(hold);
  }
  const std::size_t first = definition.couplings.size();

  StandingPose pose{q0, VectorX::Zero(count)};
  for (int i = 0; i < 40; ++i) {
    auto placed = PlaceFeet(bent, pose.q, footings);
    if (!placed) return tl::unexpected(placed.error());
    pose.q = *placed;
    ComputeKinematics(mechanism, pose.q, kinematics);
    VectorX tau = Weight(mechanism, kinematics, footings, gravity);
    VectorX servos = mechanism.stiffness().cwiseProduct(mechanism.rest() - pose.q);
    for (Eigen::Index k : yielding) servos(k) = 0;
    tau += servos;
    MatrixX all(q0.size(), count + static_cast<Eigen::Index>(yielding.size()));
    all.leftCols(count) = B;
    for (std::size_t k = 0; k < yielding.size(); ++k)
      all.col(count + static_cast<Eigen::Index>(k)) = VectorX::Unit(q0.size(), yielding[k]);
    // Zᵀ (τ + B u + f) = 0
    const MatrixX Z = FreeMotions(mechanism, kinematics, pose.q);
    const VectorX forces = LeastNormSolve(Z.transpose() * all, -(Z.transpose() * tau), kRankThreshold);
    pose.controls = forces.head(count);
    double change = 0;
    for (std::size_t k = 0; k < yielding.size(); ++k) {
      const double wanted = mechanism.rest()(yielding[k]) -
                            forces(count + static_cast<Eigen::Index>(k)) / mechanism.stiffness()(yielding[k]);
      double& held = bent.couplings[first + k].polynomial[0];
      change = std::max(change, std::abs(wanted - held));
      held = wanted;
    }
    double ahead = CenterOfMass(mechanism, pose.q).x();
    for (const Footing& f : footings)
      ahead -= f.X_RS.translation().x() / static_cast<double>(footings.size());
    for (Footing& f : footings) f.X_RS.translation().x() += ahead;
    if (std::max(change, std::abs(ahead)) < 1e-7) return pose;
  }
  return Fail(ErrorCode::kNumerics, definition.name, "finds no pose in which it stands under its weight");
}

}  // namespace fork1s::examples
