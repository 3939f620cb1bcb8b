#include <fork1s/spatial/screw_motion.hpp>

#include <cmath>
#include <fork1s/base/quad.hpp>

namespace fork1s {

ScrewMotion::ScrewMotion(const Vector6& s) : screw_(s) {
  const Vector3 w = s.head<3>(), v = s.tail<3>();
  const double w2 = w.squaredNorm();
  if (w2 == 0) {
    kind_ = Kind::kSlide;
    return;
  }
  if (std::abs(w2 - 1) > 1e-14) return;
  kind_ = Kind::kTurn;
  const Matrix3 W = Skew(w);
  const Vector3 wv = w.cross(v);
  Eigen::Map<Matrix3>(sine_.data()) = W;
  Eigen::Map<Vector3>(sine_.data() + 9) = -w.cross(wv);
  Eigen::Map<Matrix3>(versine_.data()) = W * W;
  Eigen::Map<Vector3>(versine_.data() + 9) = wv;
  Eigen::Map<Vector3>(along_.data() + 1) = w.dot(v) * w;
}

void ScrewMotion::At(double q, RigidTransform& X) const {
  if (kind_ == Kind::kSlide) {
    X = RigidTransform(Vector3(screw_.tail<3>() * q));
    return;
  }
  if (kind_ == Kind::kGeneral) {
    X = Exp(screw_ * q);
    return;
  }
  // By the half angle, as 1 - cos needs it; one sine and cosine serve both.
  const double half = std::sin(0.5 * q), sine = 2 * half * std::cos(0.5 * q), versine = 2 * half * half;
  const auto part = [&](int k) {
    // Of the identity every fourth number is 1.
    return Quad(Quad::UnitX() + sine * QuadAt(sine_.data() + k) + versine * QuadAt(versine_.data() + k));
  };
  double* out = X.data();
  QuadAt(out) = part(0);
  QuadAt(out + 4) = part(4);
  QuadAt(out + 8) = part(8) + q * QuadAt(along_.data());
}

}  // namespace fork1s
