// Stiffness at a point of a body, as Python sees it.
#pragma once

#include <string>
#include <vector>

#include "mechanism_view.hpp"
#include "study/deflection.hpp"

namespace fork1s::python {

/// At one point, of the springs alone or about the equilibrium under load.
struct StiffnessView {
  PointStiffness at;
  std::vector<double> frequencies_hz;  // of the mechanism
  bool stable = true;
};

struct PointView {
  NamedPoint point;
  Vector3 reference_W = Vector3::Zero();  // m, at the start
  StiffnessView springs;
  Expected<StiffnessView> loaded;
  std::string file;
  std::vector<std::string> locked;

  /// Throws NumericsError where no equilibrium was found.
  StiffnessView Loaded() const;
};

/// Of a point on a body of the mechanism. With `lock_free` a joint of each motion that no spring resists and
/// that moves this body or an interface body is locked.
PointView MeasureStiffness(const MechanismView& view, const NamedPoint& point, const Vector3& gravity_W,
                           bool lock_free);

/// The points of an answer of statics.
std::vector<PointView> PointsOf(const LoadedBody& loaded);

}  // namespace fork1s::python
