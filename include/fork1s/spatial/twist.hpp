// Twists and wrenches as types of their own, so that adding one to the other does not compile.
#pragma once

#include <fork1s/base/types.hpp>

namespace fork1s {

/// A six-vector of one physical kind, angular part first.
template <class Tag>
class SpatialVector {
 public:
  SpatialVector() : value_(Vector6::Zero()) {}
  explicit SpatialVector(const Vector6& value) : value_(value) {}
  SpatialVector(const Vector3& angular, const Vector3& linear) { value_ << angular, linear; }

  const Vector6& vector() const { return value_; }
  Vector3 angular() const { return value_.template head<3>(); }
  Vector3 linear() const { return value_.template tail<3>(); }

  SpatialVector& operator+=(const SpatialVector& o) {
    value_ += o.value_;
    return *this;
  }
  friend SpatialVector operator+(SpatialVector a, const SpatialVector& b) { return a += b; }
  friend SpatialVector operator-(const SpatialVector& a, const SpatialVector& b) {
    return SpatialVector(Vector6(a.value_ - b.value_));
  }
  friend SpatialVector operator*(double s, const SpatialVector& a) {
    return SpatialVector(Vector6(s * a.value_));
  }

 private:
  Vector6 value_;
};

using Twist = SpatialVector<struct TwistTag>;    ///< [ω; v] in rad/s, m/s
using Wrench = SpatialVector<struct WrenchTag>;  ///< [τ; f] in N·m, N

/// Power [W] of a wrench on a twist given about the same origin in the same frame.
inline double Power(const Wrench& F, const Twist& V) { return F.vector().dot(V.vector()); }

}  // namespace fork1s
