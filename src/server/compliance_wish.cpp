#include "compliance_wish.hpp"
#include "linalg/cholesky.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/reduction/compliance.hpp>

#include <fmt/format.h>

namespace fork1s::internal {
namespace {

constexpr int kSteps = 40;
constexpr int kMostCoordinates = 200;  // a step takes milliseconds there, and grows with their cube
constexpr double kReached = 1e-4, kLongest = 1.0;  // of a logarithm

// A number that stiffens one joint coordinate, by `per` for each unit of it.
struct Handle {
  std::size_t tunable;
  JointIndex joint;
  int freedom;
  double per;
  double least, most;  // that its number may have
};

std::vector<Handle> HandlesOf(const Scene& scene, const ComplianceWish& wish, const LiveSettings& settings) {
  const int mechanism = wish.mechanism;
  const MechanismDef& def = scene.mechanisms[static_cast<std::size_t>(mechanism)];
  std::vector<Handle> out;
  for (std::size_t i = 0; i < settings.tunables.size(); ++i) {
    const Tunable& t = settings.tunables[i];
    if (t.mechanism != mechanism || t.quantity != Tunable::Quantity::kStiffness || !(t.original > 0))
      continue;
    Handle handle{i,
                  JointIndex(t.item),
                  t.freedom,
                  1,
                  std::min(t.value, t.original / wish.factor),
                  std::max(t.value, t.original * wish.factor)};
    if (t.of == Tunable::Of::kActuator) {
      const ControlDef& c = def.controls[static_cast<std::size_t>(t.item)];
      if (c.terms.size() != 1 || c.along.path >= 0) continue;  // over several joints
      handle.joint = c.terms[0].first.joint;
      handle.freedom = c.terms[0].first.freedom;
      handle.per = c.terms[0].second * c.terms[0].second;
    } else if (t.of != Tunable::Of::kJoint) {
      continue;
    }
    for (const JointGroup& group : settings.groups)
      if (group.mechanism == mechanism &&
          std::find(group.joints.begin(), group.joints.end(), handle.joint.value()) != group.joints.end())
        handle.per *= group.scale;
    out.push_back(handle);
  }
  return out;
}

// The six entries of a symmetric matrix, those beside the diagonal weighed so that lengths are those of the
// matrix.
Vector6 Entries(const Matrix3& C) {
  const double w = std::sqrt(2.0);
  Vector6 out;
  out << C(0, 0), C(1, 1), C(2, 2), w * C(0, 1), w * C(0, 2), w * C(1, 2);
  return out;
}

struct Answer {
  Matrix3 C_R;
  Eigen::Matrix3Xd y_R;  // how the body moves per force along each coordinate
  std::vector<int> offset;
};

Expected<Answer> AnswerOf(const Scene& scene, const ComplianceWish& wish, const LiveSettings& settings) {
  auto built =
      BuildMechanism(ApplySettings(scene, settings).mechanisms[static_cast<std::size_t>(wish.mechanism)]);
  if (!built) return tl::unexpected(built.error());
  const Matrix3 to_root = built->definition().X_WR.rotation().transpose();
  Answer out;
  const auto locked = CoordinatesToLock(*built, wish.q, {wish.body}, OnFreeMotion::kRefuse);
  if (!locked) return tl::unexpected(locked.error());
  const MatrixX C = DenseCompliance(*built, wish.q, {wish.body}).C;
  out.C_R = to_root * C.bottomRightCorner<3, 3>() * to_root.transpose();
  out.y_R = to_root * InterfaceResponse(*built, wish.q, {wish.body}).bottomRows<3>();
  for (int j = 0; j < built->num_joints(); ++j) out.offset.push_back(built->joint(JointIndex(j)).offset);
  return out;
}

double FourDigits(double x) {
  const double unit = std::pow(10, std::floor(std::log10(x)) - 3);
  return std::round(x / unit) * unit;
}

double Missed(const Matrix3& C, const Matrix3& wished) {
  return (C - wished).cwiseAbs().maxCoeff() / wished.cwiseAbs().maxCoeff();
}

}  // namespace

Expected<FollowedWish> FollowWish(const Scene& scene, const ComplianceWish& wish, LiveSettings& settings) {
  if (wish.q.size() > kMostCoordinates)
    return Fail(
        ErrorCode::kUsage, "compliance",
        fmt::format(
            "can be asked for of mechanisms of up to {} joint coordinates, and this one has {}; tune its "
            "stiffnesses one by one",
            kMostCoordinates, wish.q.size()));
  const std::vector<Handle> handles = HandlesOf(scene, wish, settings);
  const auto count = static_cast<Eigen::Index>(handles.size());
  auto here = AnswerOf(scene, wish, settings);
  if (!here) return tl::unexpected(here.error());
  const double scale = wish.C_R.cwiseAbs().maxCoeff();
  const std::vector<Tunable> before = settings.tunables;
  double missed = Missed(here->C_R, wish.C_R), damping = 1e-6;
  for (int step = 0; step < kSteps && missed > kReached && damping < 1e6; ++step) {
    MatrixX J = MatrixX::Zero(6, count);  // by logarithms of the numbers
    for (Eigen::Index i = 0; i < count; ++i) {
      const Handle& h = handles[static_cast<std::size_t>(i)];
      const Vector3 y = here->y_R.col(here->offset[h.joint.u()] + h.freedom);
      J.col(i) = -settings.tunables[h.tunable].value * h.per / scale * Entries(y * y.transpose());
    }
    if (!(J.norm() > 1e-9))
      return Fail(ErrorCode::kUsage, "compliance",
                  "no stiffness of a joint or servo moves this body; take another body");
    const Vector6 r = Entries(here->C_R - wish.C_R) / scale;
    // The active set: at a bound, and downhill lies beyond it.
    for (Eigen::Index i = 0; i < count; ++i) {
      const Handle& h = handles[static_cast<std::size_t>(i)];
      const double value = settings.tunables[h.tunable].value, slope = J.col(i).dot(r);
      if ((value <= h.least && slope > 0) || (value >= h.most && slope < 0)) J.col(i).setZero();
    }
    if (J.isZero(0)) break;
    const double size = J.squaredNorm() / 6;
    const Matrix6 N = J * J.transpose() + damping * size * Matrix6::Identity();
    VectorX change = -J.transpose() * SolvePositive(N, r);
    change *= std::min(1.0, kLongest / std::max(1e-300, change.cwiseAbs().maxCoeff()));
    LiveSettings tried = settings;
    for (Eigen::Index i = 0; i < count; ++i) {
      const Handle& h = handles[static_cast<std::size_t>(i)];
      double& value = tried.tunables[h.tunable].value;
      value = std::clamp(value * std::exp(change[i]), h.least, h.most);
    }
    auto there = AnswerOf(scene, wish, tried);
    const double nearer = there ? Missed(there->C_R, wish.C_R) : missed;
    if (nearer < missed) {
      settings = std::move(tried);
      here = std::move(there);
      missed = nearer;
      damping = std::max(1e-9, 0.1 * damping);
    } else {
      damping *= 10;
    }
  }
  // As a person would type them.
  FollowedWish out;
  LiveSettings softest = settings, stiffest = settings;
  for (const Handle& h : handles) {
    Tunable& t = settings.tunables[h.tunable];
    if (t.value != before[h.tunable].value) t.value = std::clamp(FourDigits(t.value), h.least, h.most);
    softest.tunables[h.tunable].value = h.least;
    stiffest.tunables[h.tunable].value = h.most;
    ++out.num_stiffnesses;
    out.num_at_bound += t.value <= h.least || t.value >= h.most;
  }
  for (const auto& [at, C_R] :
       {std::pair{&settings, &out.reached_R}, {&softest, &out.softest_R}, {&stiffest, &out.stiffest_R}}) {
    const auto answer = AnswerOf(scene, wish, *at);
    if (!answer) return tl::unexpected(answer.error());
    *C_R = answer->C_R;
  }
  return out;
}

}  // namespace fork1s::internal
