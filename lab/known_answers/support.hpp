// What the cases share: building scenes, running either simulator, writing rows.
#pragma once

#include <fork1s/mechanism/builder.hpp>
#include <fork1s/reference/full_simulation.hpp>
#include <fork1s/sim/simulation.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <lab/known_answers.hpp>
#include <optional>
#include <stdexcept>
#include <tests/mechanisms.hpp>

namespace fork1s::internal {

/// A case that cannot be run: becomes the Error of KnownAnswerCase::run.
struct CaseFailure : std::runtime_error {
  using std::runtime_error::runtime_error;
};

template <class T>
T OrFail(Expected<T> value) {
  if (!value) throw CaseFailure(value.error().Text());
  return std::move(*value);
}

/// Where a row's expected number comes from, and how near it must be reached.
struct Known {
  std::string quantity, unit;
  double expected = 0;
  double tolerance = 0;
  std::string why_tolerance, source;
};

class Rows {
 public:
  explicit Rows(std::string case_name) : case_name_(std::move(case_name)) {}
  void Add(const Known& known, std::optional<double> reduced, std::optional<double> full);
  std::vector<KnownAnswer> Release() { return std::move(rows_); }

 private:
  std::string case_name_;
  std::vector<KnownAnswer> rows_;
};

Scene SceneOf(MechanismDef definition, const Vector3& gravity = Vector3::Zero());
/// A keyframe that starts the scene's first mechanism at q, q̇.
void StartAt(Scene& scene, const VectorX& q, const VectorX& q_dot);
/// A free body on the plane z = 0 under gravity of 9.81 m/s² that is turned by `slope` [rad] about y, so that
/// +x is downhill.
Scene OnPlane(const Shape& shape, const SpatialInertia& inertia, double height, double slope,
              double friction);

constexpr double kDegree = 0.017453292519943295;  // rad

/// Both start from the scene's first keyframe, where it has one.
Simulation StartReduced(Scene scene, double h, double refresh_angle = 15 * kDegree,
                        Integrator integrator = Integrator::kEuler);
FullSimulation StartFull(Scene scene, double h);

/// The names by which a case asks for either simulator.
struct ReducedMethod {
  static Simulation Start(Scene scene, double h) { return StartReduced(std::move(scene), h); }
};
/// Moves its reference with every degree that a joint turns: what is of second order in the distance from the
/// reference then lies below the errors of the time step.
struct ReducedMethodByDegrees {
  static Simulation Start(Scene scene, double h) { return StartReduced(std::move(scene), h, kDegree); }
};
struct SecondOrderMethod {
  static Simulation Start(Scene scene, double h) {
    return StartReduced(std::move(scene), h, 15 * kDegree, Integrator::kTwoStage);
  }
};
struct FullMethod {
  static FullSimulation Start(Scene scene, double h) { return StartFull(std::move(scene), h); }
};

/// One step; CaseFailure where it ended in numbers that are not finite (full: or did not converge).
void StepOnce(Simulation& simulation);
void StepOnce(FullSimulation& simulation);
template <class Simulator>
void Advance(Simulator& simulation, double seconds) {
  const auto steps = static_cast<int>(seconds / simulation.dt() + 0.5);
  for (int i = 0; i < steps; ++i) StepOnce(simulation);
}

inline const VectorX& Displacements(const Simulation& s) {
  return s.world().mechanisms()[0].configuration().q;
}
inline const VectorX& Displacements(const FullSimulation& s) { return s.Displacements(0); }

/// Value at h = 0 of a smooth function known at h, h/2, h/4, ...: Richardson's table for errors in h, h², ...
VectorX ExtrapolateToZero(std::vector<VectorX> values);

}  // namespace fork1s::internal
