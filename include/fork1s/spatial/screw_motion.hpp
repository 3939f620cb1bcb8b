// Motions along one screw, made ready once.
#pragma once

#include <array>
#include <fork1s/spatial/rigid_transform.hpp>

namespace fork1s {

/// Exp(s q) of a screw s that stays, for any displacement q [rad, m]. About an axis |ω| = 1 it is
///     1 + sin q [ω] + (1 - cos q) [ω]²,    p = q (ω·v) ω - sin q ω x (ω x v) + (1 - cos q) ω x v
/// twelve sums of three numbers that hang on s alone; along ω = 0 it is a translation by q v.
class ScrewMotion {
 public:
  /// s = [ω; v], of any length.
  explicit ScrewMotion(const Vector6& s);

  /// Whether ω = 0, to the last digit.
  bool is_slide() const { return kind_ == Kind::kSlide; }
  /// X <- Exp(s q)
  void At(double q, RigidTransform& X) const;

 private:
  enum class Kind { kSlide, kTurn, kGeneral };

  Kind kind_ = Kind::kGeneral;
  Vector6 screw_;
  // As RigidTransform::data() has them; `along_` its last four numbers, of which the first is 0.
  std::array<double, 12> sine_ = {}, versine_ = {};
  std::array<double, 4> along_ = {};
};

}  // namespace fork1s
