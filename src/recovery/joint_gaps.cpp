#include <algorithm>
#include <fork1s/recovery/recover.hpp>

#include <Eigen/QR>

namespace fork1s {
namespace {

// A point that every turning freedom of the joint keeps still, in R at q = 0: the least-squares common point of
// the axes. For a hinge any point of its axis would do; the one nearest the moved body's origin is the joint.
Vector3 Anchor(const Mechanism& mechanism, const Mechanism::Joint& joint) {
  const Vector3 origin = mechanism.body(joint.body).X_RB0.translation();
  Eigen::Matrix<double, Eigen::Dynamic, 3> A(3 * joint.size, 3);
  VectorX b(3 * joint.size);
  int rows = 0;
  for (int i = joint.offset; i < joint.offset + joint.size; ++i) {
    const Vector6 s = mechanism.screws().col(i);
    if (s.head<3>().squaredNorm() == 0) continue;
    // v + ω x p is along ω where p is on the axis; the part across it must vanish.
    const Vector3 w = s.head<3>().normalized();
    const Vector3 v = s.tail<3>() / s.head<3>().norm();
    A.middleRows(3 * rows, 3) = Skew(w);
    b.segment<3>(3 * rows) = -(v - w * w.dot(v)) - w.cross(origin);
    ++rows;
  }
  if (rows == 0) return origin;
  return origin + A.topRows(3 * rows).completeOrthogonalDecomposition().solve(b.head(3 * rows));
}

// Directions in which the joint slides, in R at q = 0.
Matrix3X Slides(const Mechanism& mechanism, const Mechanism::Joint& joint) {
  Matrix3X slides(3, joint.size);
  int count = 0;
  for (int i = joint.offset; i < joint.offset + joint.size; ++i)
    if (mechanism.screws().col(i).head<3>().squaredNorm() == 0)
      slides.col(count++) = mechanism.screws().col(i).tail<3>().normalized();
  return slides.leftCols(count);
}

}  // namespace

std::vector<JointGap> MeasureJointGaps(const Mechanism& mechanism, const std::vector<RigidTransform>& X_RB) {
  std::vector<JointGap> gaps;
  // Bodies moved by several joints in a row have no body in between; the joints' anchors coincide there in all
  // but the first, whose parent side is compared with the body's own.
  for (const Mechanism::Joint& joint : mechanism.joints()) {
    const Mechanism::Body& child = mechanism.body(joint.body);
    const Mechanism::Body& parent = mechanism.body(child.parent);
    const bool first_of_body = joint.previous < 0 || mechanism.joint(JointIndex(joint.previous)).body != joint.body;
    if (!first_of_body) continue;
    // All joints of this body together: a point that they share, and every direction that one of them slides in.
    Matrix3X slides(3, 0);
    for (const Mechanism::Joint& other : mechanism.joints())
      if (other.body == joint.body) {
        const Matrix3X s = Slides(mechanism, other);
        Matrix3X joined(3, slides.cols() + s.cols());
        joined << slides, s;
        slides = joined;
      }
    const Vector3 anchor = Anchor(mechanism, joint);
    const RigidTransform& X_RP = X_RB[child.parent.u()];
    const Vector3 parent_side = X_RP * (parent.X_RB0.inverse() * anchor);
    const Vector3 child_side = X_RB[joint.body.u()] * (child.X_RB0.inverse() * anchor);
    Vector3 d = child_side - parent_side;
    if (slides.cols() > 0) {
      // Slide directions as the parent carries them.
      const Matrix3X carried = X_RP.rotation() * parent.X_RB0.rotation().transpose() * slides;
      d -= carried * carried.completeOrthogonalDecomposition().solve(d);
    }
    gaps.push_back({joint.name, d.norm()});
  }
  for (const ClosureDef& c : mechanism.closures()) {
    const RigidTransform X_aJ = X_RB[c.body_a.u()] * c.X_AJ, X_bJ = X_RB[c.body_b.u()] * c.X_BJ;
    Vector3 d = X_aJ.rotation().transpose() * (X_bJ.translation() - X_aJ.translation());
    for (int i = 0; i < 3; ++i)
      if (!c.rigid(3 + i)) d(i) = 0;
    gaps.push_back({c.name, d.norm()});
  }
  std::stable_sort(gaps.begin(), gaps.end(), [](const JointGap& a, const JointGap& b) { return a.gap > b.gap; });
  return gaps;
}

}  // namespace fork1s
