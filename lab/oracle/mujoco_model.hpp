// What MuJoCo computes of a model file at its reference pose, for comparison.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/spatial/rigid_transform.hpp>
#include <memory>
#include <string>
#include <vector>

#include "../equilibrium.hpp"

namespace fork1s::internal {

class MuJoCoModel {
 public:
  static Expected<MuJoCoModel> Load(const std::string& path);
  ~MuJoCoModel();
  MuJoCoModel(MuJoCoModel&&) noexcept;

  /// First velocity of a joint; -1 where there is none of this name.
  int JointVelocity(const std::string& joint) const;
  MatrixX MassMatrix() const;
  /// Natural frequencies [Hz] of springs and masses on the motions that equality constraints leave, free
  /// motions left out.
  std::vector<double> Frequencies(int count) const;
  /// As in WalkCompliance, the base held.
  MatrixX Compliance(const std::vector<std::string>& bodies) const;
  /// World poses of the named bodies at rest under a load, the base held: Newton on MuJoCo's forces and
  /// constraint residuals, the load raised in steps. kNumerics where it does not converge.
  Expected<std::vector<RigidTransform>> Rest(const RestLoad& load,
                                             const std::vector<std::string>& bodies) const;

 private:
  MuJoCoModel();
  struct Detail;
  std::unique_ptr<Detail> detail_;
};

}  // namespace fork1s::internal
