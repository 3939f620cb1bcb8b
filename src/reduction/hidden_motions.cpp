#include "hidden_motions.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "linalg/null_space.hpp"
#include "linalg/products.hpp"
#include "linalg/select.hpp"
#include "printed_axis.hpp"

namespace fork1s::internal {
namespace {

// The body that shows motions q = directions (n x k): that of the joint if it moves, since its name says
// where to look, else the one that moves most; none where freedoms of one body cancel each other.
BodyIndex MovingBody(const Mechanism& mechanism, const Matrix6X& S, const MatrixX& directions,
                     JointIndex joint) {
  std::vector<Matrix6X> T(static_cast<std::size_t>(mechanism.num_bodies()),
                          Matrix6X::Zero(6, directions.cols()));
  std::vector<double> motion(T.size(), 0);
  std::size_t j = 0;
  const auto& joints = mechanism.joints();
  for (std::size_t b = 0; b < T.size(); ++b) {
    const Mechanism::Body& body = mechanism.bodies()[b];
    if (body.parent.valid()) T[b] = T[body.parent.u()];
    for (; j < joints.size() && joints[j].body.u() == b; ++j)
      T[b] += Times(S.middleCols(joints[j].offset, joints[j].size),
                    directions.middleRows(joints[j].offset, joints[j].size));
    // About the body's own origin: far from R's a turn would count as a long way.
    const Vector3 origin = body.X_RB0.translation();
    motion[b] = T[b].topRows<3>().norm() +
                (T[b].bottomRows<3>() - Skew(origin) * T[b].topRows<3>()).norm() / mechanism.length_scale();
  }
  const std::size_t own = mechanism.joint(joint).body.u();
  const auto most = std::max_element(motion.begin(), motion.end());
  if (*most < kRankThreshold) return {};
  if (motion[own] > kRankThreshold) return BodyIndex(static_cast<int>(own));
  return BodyIndex(static_cast<int>(most - motion.begin()));
}

std::string AxisText(const Vector6& screw) {
  const bool turns = screw.head<3>().norm() > 1e-9 * screw.tail<3>().norm();
  const Vector3 axis = PrintedAxis(turns ? screw.head<3>() : screw.tail<3>());
  return fmt::format("{} ({:.3f}, {:.3f}, {:.3f})", turns ? "turning about" : "sliding along", axis.x(),
                     axis.y(), axis.z());
}

}  // namespace

Hidden FindHidden(const Mechanism& mechanism, const Matrix6X& S, const ElasticBasis& basis, const MatrixX& J,
                  std::vector<RankDoubt>& doubts) {
  Hidden hidden;
  if (basis.num_free() == 0) return hidden;
  const MatrixX N_x = basis.ScaledFreeDirections(mechanism.num_coordinates());
  const MatrixX N = ScaledRows(basis.scale, N_x);
  const NullSpace seen = ComputeNullSpace(Times(J, N) / mechanism.length_scale());
  if (seen.doubtful.size() > 0)
    doubts.push_back(Doubt(mechanism, "interface bodies see of free motions", seen.rank.kept,
                           seen.rank.dropped, Times(N_x, seen.doubtful)));
  hidden.count = static_cast<int>(seen.unseen.cols());
  if (hidden.count == 0) return hidden;
  const MatrixX x = Times(N_x, seen.unseen), q = Times(N, seen.unseen);
  double largest = 0;
  for (int j = 0; j < mechanism.num_joints(); ++j) {
    const Mechanism::Joint& joint = mechanism.joint(JointIndex(j));
    const double share = x.middleRows(joint.offset, joint.size).norm();
    // Of equals the first, whatever the last digits say.
    if (share < (1 + 1e-6) * largest + kRankThreshold) continue;
    largest = share;
    hidden.joint = JointIndex(j);
    Eigen::Index most;
    const auto own = x.middleRows(joint.offset, joint.size);
    own.colwise().norm().maxCoeff(&most);
    hidden.screw =
        Times(S.middleCols(joint.offset, joint.size), q.middleRows(joint.offset, joint.size).col(most))
            .col(0);
  }
  hidden.body = MovingBody(mechanism, S, q, hidden.joint);
  return hidden;
}

Error HiddenError(const Mechanism& mechanism, const Hidden& hidden) {
  const auto& joint = mechanism.joint(hidden.joint);
  return {
      ErrorCode::kUnderdetermined, fmt::format("joint '{}'", joint.name),
      fmt::format(
          "has no spring and moves ({}) while every interface body stands still, so nothing determines it; "
          "give the joint a stiffness, hold it by PD control{}",
          AxisText(hidden.screw),
          hidden.body.valid()
              ? fmt::format(", or make body '{}' an interface", mechanism.body(hidden.body).name)
              : std::string(", or remove it: another freedom undoes what it does"))};
}

Error TooManyHidden(const Mechanism& mechanism, const Hidden& hidden) {
  return {
      ErrorCode::kUnderdetermined, fmt::format("mechanism '{}'", mechanism.name()),
      fmt::format(
          "has {} motions of joints without spring while every interface body stands still, that of joint "
          "'{}' for one, and {} at most are made visible by more interface bodies; give joints a "
          "stiffness, hold them by PD gains, or name the bodies that touch",
          hidden.count, mechanism.joint(hidden.joint).name, kMostHidden)};
}

}  // namespace fork1s::internal
