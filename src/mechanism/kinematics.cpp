#include <fork1s/mechanism/kinematics.hpp>

#include <fork1s/base/quad.hpp>

#include "paths.hpp"
#include "spatial/twist_exponential.hpp"

namespace fork1s {
namespace {

// A pose as the next one needs it, four numbers a column, of which the fourth means nothing. Read back from where they
// stand one behind the other they would have to wait until all that was written over each other is there.
class Axes {
 public:
  void Read(const RigidTransform& X) {
    x_ = QuadAt(X.data());
    y_ = QuadAt(X.data() + 3);
    z_ = QuadAt(X.data() + 6);
    p_ = X.translation();
  }
  void Write(RigidTransform& X) const {
    double* to = X.data();
    QuadAt(to) = x_;
    QuadAt(to + 3) = y_;
    QuadAt(to + 6) = z_;
    X.translation() = p_;
  }
  // out <- the adjoint of this pose times [angular; linear]
  template <class Three>
  void Present(const Three& angular, const Three& linear, double* out) const {
    const Quad turned = Turned(angular), moved = Turned(linear);
    QuadAt(out) = turned;
    Eigen::Map<Vector3>(out + 3) = moved.head<3>() + p_.cross(turned.head<3>());
  }
  // This pose, then Y.
  void Go(const RigidTransform& Y) {
    const double* y = Y.data();
    const Quad first = Turned(y), second = Turned(y + 3), third = Turned(y + 6);
    p_ += Turned(y + 9).head<3>();
    x_ = first;
    y_ = second;
    z_ = third;
  }
  void Slide(double way, const double* along) { p_ += way * Eigen::Map<const Vector3>(along); }

 private:
  template <class Three>
  Quad Turned(const Three& v) const {
    return v[0] * x_ + v[1] * y_ + v[2] * z_;
  }

  Quad x_, y_, z_;
  Vector3 p_;
};

}  // namespace

Kinematics::Kinematics(const Mechanism& mechanism)
    : P(static_cast<std::size_t>(mechanism.num_joints())),
      X_RB(static_cast<std::size_t>(mechanism.num_bodies())),
      S(mechanism.screws()),
      paths(mechanism.paths().size()),
      muscles(mechanism.muscles().size()) {
  for (std::size_t i = 0; i < paths.size(); ++i)
    for (const int coordinate : mechanism.paths()[i].coordinates) paths[i].arms.emplace_back(coordinate, 0.0);
}

void ComputeKinematics(const Mechanism& mechanism, const VectorX& q, Kinematics& out) {
  const Matrix6X& screws = mechanism.screws();
  const auto& joints = mechanism.joints();
  const RigidTransform identity;
  Axes here;  // what joint j stands on, then what is behind it
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const Mechanism::Joint& joint = joints[j];
    if (joint.previous < 0)
      here.Read(identity);
    else if (joint.previous + 1 != static_cast<int>(j))
      here.Read(out.P[static_cast<std::size_t>(joint.previous)]);
    if (joint.size == 1) {
      const ScrewMotion& motion = mechanism.screw_motions()[static_cast<std::size_t>(joint.offset)];
      double* const screw = &out.S(0, joint.offset);
      const double* const at_zero = &screws(0, joint.offset);
      here.Present(at_zero, at_zero + 3, screw);
      if (motion.is_slide()) {
        here.Slide(q(joint.offset), screw + 3);
      } else {
        RigidTransform own{RigidTransform::Unset()};
        motion.At(q(joint.offset), own);
        here.Go(own);
      }
    } else {
      const auto S = screws.middleCols(joint.offset, joint.size);
      Vector6 x = Vector6::Zero();
      for (int i = 0; i < joint.size; ++i) x += S.col(i) * q(joint.offset + i);
      const TwistExponential motion(x);
      for (int i = 0; i < joint.size; ++i) {
        Quad angular, linear;
        motion.Apply(S.col(i).data(), angular, linear);
        here.Present(angular, linear, &out.S(0, joint.offset + i));
      }
      RigidTransform own{RigidTransform::Unset()};
      motion.SetTransform(own);
      here.Go(own);
    }
    here.Write(out.P[j]);
  }
  const auto& bodies = mechanism.bodies();
  for (std::size_t b = 0; b < bodies.size(); ++b)
    if (bodies[b].last_joint < 0)
      out.X_RB[b] = bodies[b].X_RB0;
    else
      SetProduct(out.P[static_cast<std::size_t>(bodies[b].last_joint)], bodies[b].X_RB0, out.X_RB[b]);
  for (std::size_t i = 0; i < out.paths.size(); ++i)
    internal::ComputePath(mechanism, mechanism.paths()[i], out, q, out.paths[i]);
  for (std::size_t i = 0; i < out.muscles.size(); ++i)
    out.muscles[i] = LengthOf(mechanism, mechanism.muscles()[i].length, out, q);
}

Matrix6X BodyJacobian(const Mechanism& mechanism, const Kinematics& kinematics, BodyIndex b) {
  Matrix6X J = Matrix6X::Zero(6, mechanism.num_coordinates());
  for (int j = mechanism.body(b).last_joint; j >= 0; j = mechanism.joint(JointIndex(j)).previous) {
    const auto& joint = mechanism.joint(JointIndex(j));
    J.middleCols(joint.offset, joint.size) = kinematics.S.middleCols(joint.offset, joint.size);
  }
  return J;
}

void AccumulateGeneralizedForce(const Mechanism& mechanism, const Matrix6X& S, Matrix6X& F, VectorX& tau) {
  const auto& bodies = mechanism.bodies();
  const auto& joints = mechanism.joints();
  // Joints are sorted by body, so both tables are walked backwards together.
  std::size_t j = joints.size();
  for (std::size_t b = bodies.size(); b-- > 1;) {
    const auto column = static_cast<Eigen::Index>(b);
    for (; j > 0 && joints[j - 1].body.u() == b; --j) {
      const Mechanism::Joint& joint = joints[j - 1];
      for (int i = 0; i < joint.size; ++i)
        tau(joint.offset + i) += S.col(joint.offset + i).dot(F.col(column));
    }
    F.col(bodies[b].parent.value()) += F.col(column);
  }
}

void AddGravityWrenches(const Mechanism& mechanism, const Kinematics& kinematics, const Vector3& g_R,
                        Matrix6X& F) {
  const auto& bodies = mechanism.bodies();
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    if (bodies[b].weighed_mass == 0) continue;
    const Vector3 weight = bodies[b].weighed_mass * g_R;
    const auto column = static_cast<Eigen::Index>(b);
    F.col(column).head<3>() += (kinematics.X_RB[b] * bodies[b].inertia_B.center).cross(weight);
    F.col(column).tail<3>() += weight;
  }
}

}  // namespace fork1s
