#include "one_by_one.hpp"

#include <algorithm>

namespace fork1s::internal {

OneByOne::OneByOne(const ReducedModel& model, double closed) {
  auto own = std::make_shared<ReducedModel>(model);
  own->curvature = {};
  model_ = std::move(own);
  closed_ = closed;
}

std::vector<RigidTransform> OneByOne::Recover(const VectorX& z, LoopClosing& closing) const {
  Configuration at(*model_);
  at.closing_tolerance = std::min(at.closing_tolerance, closed_);
  ConfigurePose(*model_, {z, {}, {}}, at);
  ++closing.one_by_one;
  if (!(at.c.cwiseAbs().maxCoeff() < at.closing_tolerance)) ++closing.open;
  return at.kinematics.X_RB;
}

}  // namespace fork1s::internal
