// What contact forces do as they move with their contacts: docs/method.md, section 8.
#include <fork1s/stepping/mechanism_dynamics.hpp>

#include "error_contacts.hpp"
#include "world/contact_curvature.hpp"

namespace fork1s {
namespace {

// Twists in world axes about the world's origin, by coordinates.
using Twists = Eigen::Matrix<double, 6, Eigen::Dynamic>;

Eigen::Matrix<double, 3, Eigen::Dynamic> MotionAt(const Twists& T, const Vector3& p) {
  return T.bottomRows<3>() - Skew(p) * T.topRows<3>();
}

}  // namespace

// The companions' own tangents leave a contact's force where it is. But the contact goes with the material
// that sticks, and rolls beside it by (6.2): beneath a wheel the force goes with the axle, and does not turn
// it.
void ErrorContacts::ComputeStiffness(const World& world, const std::vector<ContactRecord>& contacts,
                                     const std::vector<ErrorCompanion>& mechanisms,
                                     const std::vector<FreeBodyPath>& free_bodies, double h) {
  std::vector<int> at(1, 0);
  for (const ErrorCompanion& m : mechanisms) at.push_back(at.back() + m.full_size());
  const int size = at.back() + 6 * static_cast<int>(free_bodies.size());
  stiffness_.setZero(size, size);
  const auto pose = [&](int number) -> RigidTransform {  // at the node
    const Contactor& c = world.contactors()[static_cast<std::size_t>(number)];
    const auto i = static_cast<std::size_t>(c.index);
    if (c.kind == Contactor::Kind::kGroup)
      return mechanisms[i].Pose(world.mechanisms()[i].groups()[static_cast<std::size_t>(c.group)].body);
    if (c.kind == Contactor::Kind::kWorld) return {};
    const RigidTransform& X = free_bodies[i].X[1];
    return {X.rotation(), X.translation() - X.rotation() * world.free_bodies()[i].inertia().center};
  };
  for (const ContactRecord& c : contacts) {
    if (c.impulse(0) <= 0) continue;
    const ContactPoint& p = c.point;
    const Matrix3 inverse =
        ComputeInverseCurvature(world.geometry(p.body_a, p.geometry_a), pose(p.body_a),
                                world.geometry(p.body_b, p.geometry_b), pose(p.body_b), p, world.PairSize(p));
    const Vector3 f = c.point.frame.transpose() * c.impulse / h;
    Twists T[2] = {Twists::Zero(6, size), Twists::Zero(6, size)};
    for (int side = 0; side < 2; ++side) {
      const Contactor& body =
          world.contactors()[static_cast<std::size_t>(side == 0 ? c.point.body_a : c.point.body_b)];
      const auto index = static_cast<std::size_t>(body.index);
      if (body.kind == Contactor::Kind::kGroup) {
        const MechanismDynamics& m = world.mechanisms()[index];
        const int last_joint = m.groups()[static_cast<std::size_t>(body.group)].last_joint;
        for (int i = 0; i < 6; ++i)
          T[side].row(i).segment(at[index], mechanisms[index].full_size()) =
              mechanisms[index].WrenchRow(m, last_joint, Vector6::Unit(i)).transpose();
      } else if (body.kind == Contactor::Kind::kFreeBody) {
        const int o = at.back() + 6 * body.index;
        T[side].block<3, 3>(0, o) = T[side].block<3, 3>(3, o + 3) = Matrix3::Identity();
        T[side].block<3, 3>(3, o) = Skew(free_bodies[index].X[1].translation());
        // Moments are about a centre that moves.
        stiffness_.block<3, 3>(o, o + 3) -= (side == 0 ? -1 : 1) * Skew(f);
      }
    }
    const Vector3 n = c.point.frame.row(0).transpose();
    const Twists apart = T[1] - T[0];
    const Eigen::Matrix<double, 3, Eigen::Dynamic> moved =
        0.5 * (MotionAt(T[0], c.point.point) + MotionAt(T[1], c.point.point)) -
        inverse * Skew(n) * apart.topRows<3>();
    stiffness_ += apart.topRows<3>().transpose() * (Skew(f) * moved);
  }
}

void ErrorContacts::AddStiffness(const std::vector<ErrorCompanion>& mechanisms,
                                 const std::vector<int>& offset, MatrixX& K) const {
  if (stiffness_.size() == 0 || stiffness_.isZero(0)) return;
  const auto to_basis = [&](const MatrixX& full) {
    MatrixX y(offset.back(), full.cols());
    int from = 0;
    for (std::size_t i = 0; i < mechanisms.size(); ++i) {
      const int n = mechanisms[i].full_size();
      for (Eigen::Index k = 0; k < full.cols(); ++k)
        mechanisms[i].ToBasis(full.col(k).segment(from, n),
                              y.col(k).segment(offset[i], mechanisms[i].size()));
      from += n;
    }
    y.bottomRows(full.rows() - from) = full.bottomRows(full.rows() - from);
    return y;
  };
  K += to_basis(to_basis(stiffness_).transpose()).transpose();
}

}  // namespace fork1s
