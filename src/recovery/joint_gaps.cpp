#include <algorithm>
#include <cmath>
#include <fork1s/recovery/recover.hpp>

#include "linalg/rank.hpp"
#include "linalg/solve.hpp"

namespace fork1s {
namespace {

// The joints that move one body relative to its parent, first to last.
struct Stack {
  int first = 0, count = 0;  // joints
  int offset = 0, size = 0;  // coordinates
};

// A point that every turning freedom of the stack keeps still, in R at q = 0: the least-squares common point
// of the axes, the one nearest the moved body's origin. `apart` tells how far [m] the axes miss it: hinges
// about axes that do not meet have no common point.
Vector3 Anchor(const Mechanism& mechanism, const Stack& stack, BodyIndex body, double& apart) {
  const Vector3 origin = mechanism.body(body).X_RB0.translation();
  MatrixX A = MatrixX::Zero(3 * stack.size, 3);
  VectorX b = VectorX::Zero(3 * stack.size);
  apart = 0;
  int rows = 0;
  for (int i = stack.offset; i < stack.offset + stack.size; ++i) {
    const Vector6 s = mechanism.screws().col(i);
    if (s.head<3>().squaredNorm() == 0) continue;
    // v + ω x p is along ω where p is on the axis; the part across it must vanish.
    const Vector3 w = s.head<3>().normalized();
    const Vector3 v = s.tail<3>() / s.head<3>().norm();
    A.middleRows(rows, 3) = Skew(w);
    b.segment<3>(rows) = -(v - w * w.dot(v)) - w.cross(origin);
    rows += 3;
  }
  if (rows == 0) return origin;
  const Vector3 from_origin = LeastNormSolve(A.topRows(rows), b.head(rows), kRankThreshold);
  apart = (A.topRows(rows) * from_origin - b.head(rows)).cwiseAbs().maxCoeff();
  return origin + from_origin;
}

// Where a joint is more than turns about one point or slides along fixed directions: displacements that bring the
// moved body nearest to its pose, and how far its anchor is left apart.
double FittedGap(const Mechanism& mechanism, const Stack& stack, const Vector3& anchor,
                 const RigidTransform& X_wanted) {
  VectorX q = VectorX::Zero(stack.size);
  double gap = 0;
  for (int iteration = 0; iteration < 50; ++iteration) {
    RigidTransform P;
    Matrix6X J(6, stack.size);
    for (int j = stack.first; j < stack.first + stack.count; ++j) {
      const auto& joint = mechanism.joint(JointIndex(j));
      const auto S = mechanism.screws().middleCols(joint.offset, joint.size);
      const Vector6 x = S * q.segment(joint.offset - stack.offset, joint.size);
      J.middleCols(joint.offset - stack.offset, joint.size) = Adjoint(P) * Dexp(x) * S;
      P = P * Exp(x);
    }
    // About the anchor, turns in lengths of the mechanism.
    const Vector3 at = P * anchor;
    Vector6 error;
    error << mechanism.length_scale() * LogRotation(X_wanted.rotation() * P.rotation().transpose()),
        X_wanted * anchor - at;
    J.bottomRows<3>() -= Skew(at) * J.topRows<3>();
    J.topRows<3>() *= mechanism.length_scale();
    gap = error.tail<3>().norm();
    VectorX step = LeastNormSolve(J, error, kRankThreshold);
    if (const double largest = step.cwiseAbs().maxCoeff(); largest > 1) step /= largest;
    q += step;
    if (step.norm() < 1e-13) break;
  }
  return gap;
}

// Turns about one point, or slides alone: what they leave of a displacement of the anchor is plain geometry.
// Turns about and slides along or all across the same axis are so as well.
bool IsSimple(const Mechanism& mechanism, const Stack& stack) {
  if (stack.count == 1) {
    const JointKind kind = mechanism.joint(JointIndex(stack.first)).kind;
    if (kind == JointKind::kCylindrical || kind == JointKind::kPlanar || kind == JointKind::kFree)
      return true;
  }
  int turns = 0;
  for (int i = stack.offset; i < stack.offset + stack.size; ++i) {
    const Vector6 s = mechanism.screws().col(i);
    const double w = s.head<3>().norm();
    if (w == 0) continue;
    ++turns;
    if (std::abs(s.head<3>().dot(s.tail<3>())) > 1e-9 * w * (w + s.tail<3>().norm()))
      return false;  // a pitch
  }
  return turns == 0 || turns == stack.size;
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
  // Bodies moved by several joints in a row have no body in between; the joints' anchors coincide there in
  // all but the first, whose parent side is compared with the body's own.
  for (const Mechanism::Joint& joint : mechanism.joints()) {
    const Mechanism::Body& child = mechanism.body(joint.body);
    const Mechanism::Body& parent = mechanism.body(child.parent);
    const bool first_of_body =
        joint.previous < 0 || mechanism.joint(JointIndex(joint.previous)).body != joint.body;
    if (!first_of_body) continue;
    Stack stack{static_cast<int>(&joint - mechanism.joints().data()), 0, joint.offset, 0};
    for (int j = stack.first; j < mechanism.num_joints() && mechanism.joint(JointIndex(j)).body == joint.body;
         ++j) {
      ++stack.count;
      stack.size += mechanism.joint(JointIndex(j)).size;
    }
    double apart = 0;
    const Vector3 anchor = Anchor(mechanism, stack, joint.body, apart);
    if (apart > 1e-9 || !IsSimple(mechanism, stack)) {
      const RigidTransform X_wanted =
          parent.X_RB0 * X_RB[child.parent.u()].inverse() * X_RB[joint.body.u()] * child.X_RB0.inverse();
      gaps.push_back({joint.name, FittedGap(mechanism, stack, anchor, X_wanted)});
      continue;
    }
    // Every direction that one of the joints slides in.
    Matrix3X slides(3, 0);
    for (int j = stack.first; j < stack.first + stack.count; ++j) {
      const Matrix3X s = Slides(mechanism, mechanism.joint(JointIndex(j)));
      Matrix3X joined(3, slides.cols() + s.cols());
      joined << slides, s;
      slides = joined;
    }
    const RigidTransform& X_RP = X_RB[child.parent.u()];
    const Vector3 parent_side = X_RP * (parent.X_RB0.inverse() * anchor);
    const Vector3 child_side = X_RB[joint.body.u()] * (child.X_RB0.inverse() * anchor);
    Vector3 d = child_side - parent_side;
    if (slides.cols() > 0) {
      // Slide directions as the parent carries them.
      const Matrix3X carried = X_RP.rotation() * parent.X_RB0.rotation().transpose() * slides;
      d -= carried * LeastNormSolve(carried, d, kRankThreshold);
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
  std::stable_sort(gaps.begin(), gaps.end(),
                   [](const JointGap& a, const JointGap& b) { return a.gap > b.gap; });
  return gaps;
}

}  // namespace fork1s
