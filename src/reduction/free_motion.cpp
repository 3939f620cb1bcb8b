#include <fork1s/reduction/free_motion.hpp>

#include <algorithm>

#include <fmt/format.h>

#include "elastic_basis.hpp"
#include "linalg/null_space.hpp"
#include "linalg/products.hpp"
#include "linalg/select.hpp"
#include "linalg/spectrum.hpp"
#include "loaded_mechanism.hpp"
#include "printed_axis.hpp"
#include "reduction/tangent_stiffness.hpp"
#include "world_axes.hpp"

namespace fork1s {
namespace {

constexpr double kStill = 1e-6;  // rounding of a null space at its worst, beside motions near 1

bool Moves(const VectorX& x, int coordinate) { return std::abs(x(coordinate)) > kStill; }

// What acts on joints that move in x and on no others that would resist it.
std::vector<std::string> TiesOf(const Mechanism& m, const VectorX& x) {
  std::vector<std::string> ties;
  const auto any_moves = [&](const std::vector<int>& on) {
    return std::any_of(on.begin(), on.end(), [&](int i) { return Moves(x, i); });
  };
  for (const Mechanism::Spring& s : m.springs())
    if (any_moves(m.CoordinatesOf(s.length))) ties.push_back(fmt::format("tendon '{}'", s.name));
  for (const Mechanism::Coupling& c : m.couplings())
    if (any_moves(c.Coordinates())) ties.push_back(fmt::format("coupling '{}'", c.name));
  for (const ClosureDef& c : m.closures()) {
    bool on_path = false;
    for (const BodyIndex body : {c.body_a, c.body_b})
      for (int j = m.body(body).last_joint; j >= 0; j = m.joint(JointIndex(j)).previous)
        for (int i = 0; i < m.joint(JointIndex(j)).size; ++i)
          on_path = on_path || Moves(x, m.joint(JointIndex(j)).offset + i);
    if (on_path) ties.push_back(fmt::format("closure '{}'", c.name));
  }
  return ties;
}

std::string List(const std::vector<std::string>& names, std::size_t most) {
  std::string text;
  for (std::size_t i = 0; i < names.size() && i < most; ++i) {
    if (i > 0) text += i + 1 == names.size() ? " and " : ", ";
    text += names[i];
  }
  if (names.size() > most) text += fmt::format(" and {} more", names.size() - most);
  return text;
}

std::string MotionText(const Vector6& twist, double length) {
  const double turn = twist.head<3>().norm(), shift = twist.tail<3>().norm() / length;
  const auto along = [](Vector3 axis) {
    axis = internal::PrintedAxis(axis);
    return fmt::format("({:.3g}, {:.3g}, {:.3g})", axis.x(), axis.y(), axis.z());
  };
  std::string text;
  if (turn > kStill) text = "turn about " + along(twist.head<3>());
  if (shift > kStill && (turn <= kStill || shift > 1e-3 * turn))
    text += (text.empty() ? "move along " : " and move along ") + along(twist.tail<3>());
  return text;
}

// Of the motions N in one unit those that forces set going, and those on which K_t is not positive.
MatrixX MotionsWithoutStiffness(const Mechanism& mechanism, const VectorX& q, const StaticsOptions& loads,
                                const VectorX& unit, const MatrixX& N) {
  const std::vector<DeadLoad> none;
  internal::LoadedMechanism loaded(mechanism, q, none, loads);
  const VectorX work = TransposedTimes(N, unit.cwiseProduct(loaded.Residual(q, loaded.Reactions(q, 1), 1)));
  const double rounding = 1e-9 * loaded.Scale(q, 1);
  std::vector<int> moving, resting;
  for (int k = 0; k < static_cast<int>(N.cols()); ++k)
    (std::abs(work(k)) > rounding ? moving : resting).push_back(k);
  const MatrixX rest = RangeBasis(Columns(N, resting));
  const TangentStiffness tangent = ComputeTangentStiffness(mechanism, q, {}, loads);
  const MatrixX along = TransposedTimes(ScaledRows(unit.cwiseInverse(), tangent.eigenvectors), rest);
  const SymmetricSpectrum spectrum = SpectrumOf(DiagonalCongruence(tangent.eigenvalues, along));
  const auto num_not_positive = (spectrum.values.array() <= tangent.zero).count();
  MatrixX out(N.rows(), static_cast<Eigen::Index>(moving.size()) + num_not_positive);
  out << Columns(N, moving), Times(rest, spectrum.vectors.leftCols(num_not_positive));
  return EchelonBasis(out);
}

// The motions N (n x k in one unit, an echelon basis), as they move the bodies; all where none is named.
std::vector<FreeMotion> DescribeMotions(const Mechanism& mechanism, const Kinematics& kinematics,
                                        const VectorX& unit, const MatrixX& N,
                                        std::vector<BodyIndex> bodies) {
  if (N.cols() == 0) return {};
  if (bodies.empty())
    for (int b = 0; b < mechanism.num_bodies(); ++b) bodies.push_back(BodyIndex(b));
  const double L = mechanism.length_scale();
  const Matrix6 to_world = internal::WorldAxes(mechanism, 1);
  const MatrixX J = internal::ScaledInterfaceJacobian(mechanism, kinematics, bodies, 1.0);
  std::vector<FreeMotion> motions;
  for (Eigen::Index k = 0; k < N.cols(); ++k) {
    const VectorX x = N.col(k);
    FreeMotion motion;
    motion.q = unit.cwiseProduct(x);
    double largest = 0;
    for (int i = 0; i < mechanism.num_coordinates(); ++i)
      if (std::abs(x(i)) > largest && (N.row(i).array() != 0).count() == 1) {
        largest = std::abs(x(i));
        motion.pivot = i;
      }
    for (int j = 0; j < mechanism.num_joints(); ++j) {
      const Mechanism::Joint& joint = mechanism.joint(JointIndex(j));
      if (x.segment(joint.offset, joint.size).cwiseAbs().maxCoeff() > kStill)
        motion.joints.push_back(JointIndex(j));
    }
    const auto share = [&](JointIndex j) {
      return x.segment(mechanism.joint(j).offset, mechanism.joint(j).size).norm();
    };
    std::stable_sort(motion.joints.begin(), motion.joints.end(),
                     [&](JointIndex a, JointIndex b) { return share(a) > (1 + 1e-6) * share(b); });
    motion.ties = TiesOf(mechanism, x);
    const VectorX moved = Times(J, motion.q);
    double most = kStill;
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      const Vector6 twist = to_world * moved.segment<6>(6 * static_cast<Eigen::Index>(b));
      const double size = twist.head<3>().norm() + twist.tail<3>().norm() / L;
      if (size < (1 + 1e-6) * most) continue;
      most = size;
      motion.body = bodies[b];
      motion.twist = twist;
    }
    motions.push_back(std::move(motion));
  }
  return motions;
}

}  // namespace

std::string FreeMotion::Text(const Mechanism& mechanism) const {
  std::vector<std::string> names;
  for (const JointIndex j : joints) names.push_back("'" + mechanism.joint(j).name + "'");
  const std::string first = mechanism.joint(joints.front()).name;
  std::string text = body.valid() ? fmt::format("body '{}' is free to {}: ", mechanism.body(body).name,
                                                MotionText(twist, mechanism.length_scale()))
                                  : std::string("no body that touches moves, but ");
  text += joints.size() == 1
              ? fmt::format("no spring or servo holds joint {}", names[0])
              : fmt::format("no spring or servo resists joints {} moving together", List(names, 5));
  if (!ties.empty() && joints.size() > 1) text += fmt::format(", which {} leaves free", List(ties, 3));
  return text + fmt::format("; give {} a stiffness or hold it by PD gains, {}=KP,KV",
                            joints.size() == 1 ? "it" : "one of them", first);
}

std::vector<FreeMotion> FindFreeMotions(const Mechanism& mechanism, const VectorX& q,
                                        const std::vector<BodyIndex>& bodies, const StaticsOptions* loads) {
  Kinematics kinematics(mechanism);
  ComputeKinematics(mechanism, q, kinematics);
  const internal::ElasticBasis basis = internal::ComputeElasticBasis(mechanism, kinematics, q);
  MatrixX N = EchelonBasis(basis.ScaledFreeDirections(mechanism.num_coordinates()));
  if (loads && N.cols() > 0) N = MotionsWithoutStiffness(mechanism, q, *loads, basis.scale, N);
  return DescribeMotions(mechanism, kinematics, basis.scale, N, bodies);
}

std::vector<FreeMotion> FindSingularMotions(const Mechanism& mechanism, const VectorX& q,
                                            const TangentStiffness& tangent,
                                            const std::vector<BodyIndex>& bodies) {
  Kinematics kinematics(mechanism);
  ComputeKinematics(mechanism, q, kinematics);
  const VectorX unit = ComputeCoordinateScaling(mechanism, kinematics).coordinate;
  const MatrixX N = EchelonBasis(ScaledRows(unit.cwiseInverse(), tangent.SingularMotions()));
  return DescribeMotions(mechanism, kinematics, unit, N, bodies);
}

}  // namespace fork1s
