#include <fmt/format.h>

#include <fork1s/mechanism/kinematics.hpp>
#include <fork1s/reduction/frequencies.hpp>
#include <fork1s/reduction/statics.hpp>

#include "mechanism/activation.hpp"
#include "study/deflection.hpp"

namespace fork1s {
namespace {

tl::unexpected<Error> NoEquilibrium(const Mechanism& m, const char* load, const StaticsResult& result) {
  return Fail(
      ErrorCode::kNumerics, fmt::format("mechanism '{}'", m.name()),
      fmt::format(
          "found no equilibrium under {}: its path was followed to {:.3g} of the load{} (residual {:.2g} of "
          "the forces after {} Newton steps); lower the load or stiffen the joints",
          load, result.share,
          result.limit_shares.empty()
              ? std::string()
              : fmt::format(", beyond a limit point at {:.3g} of it", result.limit_shares.front()),
          result.residual, result.iterations));
}

}  // namespace

StaticsOptions WeightAndControls(const PosedMechanism& posed, const Vector3& gravity_W) {
  const Mechanism& m = *posed.mechanism;
  StaticsOptions options;
  options.gravity_R = m.definition().X_WR.rotation().transpose() * gravity_W;
  options.controls.resize(static_cast<Eigen::Index>(m.controls().size()));
  for (std::size_t i = 0; i < m.controls().size(); ++i)
    options.controls(static_cast<Eigen::Index>(i)) = internal::RestingActivation(m.definition().controls[i]);
  return options;
}

Expected<LoadedState> ComputeLoadedState(const PosedMechanism& posed, const std::vector<BodyIndex>& bodies,
                                         const Vector3& gravity_W, const std::vector<int>& locked,
                                         int num_frequencies) {
  const Mechanism& m = *posed.mechanism;
  StaticsOptions options = WeightAndControls(posed, gravity_W);
  options.locked = locked;
  StaticsResult rest = SolveStatics(m, posed.q, {}, options);
  if (!rest.converged) return NoEquilibrium(m, "gravity, controls and preload", rest);
  LoadedState out;
  out.q = rest.q;
  out.tangent = std::move(rest.tangent);
  out.modes = ComputeTangentModes(m, out.q, out.tangent, num_frequencies);
  out.pairs = PairModesByShape(m, posed.q, ComputeSpringModes(m, posed.q, num_frequencies), out.modes);
  std::vector<BodyPoint> origins;
  for (const BodyIndex body : bodies) origins.push_back({body, Vector3::Zero()});
  out.compliance = TangentCompliance(m, out.q, out.tangent, origins);
  return out;
}

MeasuredPoint MeasurePoint(const PosedMechanism& posed, const NamedPoint& point,
                           const std::vector<int>& locked, const LoadedState* loaded) {
  const Mechanism& m = *posed.mechanism;
  const BodyPoint at{m.FindBody(point.body), point.p_B};
  Kinematics kinematics(m);
  ComputeKinematics(m, posed.q, kinematics);
  MeasuredPoint out{point,
                    m.definition().X_WR * (kinematics.X_RB[at.body.u()] * point.p_B),
                    ComputeSpringStiffness(m, posed.q, at, locked),
                    {}};
  if (loaded) out.loaded = ComputePointStiffness(m, loaded->q, loaded->tangent, at);
  return out;
}

Expected<LoadedBody> Deflect(const std::vector<PosedMechanism>& mechanisms, const BodyLoad& load,
                             const Vector3& gravity_W, const DeflectionOptions& asked) {
  const PosedMechanism* at = FindMechanism(mechanisms, load.body);
  if (!at) {
    std::string names;
    for (const PosedMechanism& p : mechanisms)
      for (const auto& b : p.mechanism->bodies()) names += (names.empty() ? "" : ", ") + b.name;
    return Fail(ErrorCode::kModel, "",
                fmt::format("no mechanism has a body '{}'; there are: {}", load.body, names));
  }
  const Mechanism& m = *at->mechanism;
  for (const NamedPoint& point : asked.points)
    if (!m.FindBody(point.body).valid())
      return Fail(ErrorCode::kModel, "",
                  fmt::format("body '{}' is not of mechanism '{}', which is loaded", point.body, m.name()));
  const BodyIndex body = m.FindBody(load.body);
  const RigidTransform X_WR = m.definition().X_WR;
  const Matrix3 R_RW = X_WR.rotation().transpose();
  StaticsOptions options = WeightAndControls(*at, gravity_W);
  if (asked.on_free == OnFreeMotion::kLock) options.locked = *CoordinatesToLock(m, at->q, {}, asked.on_free);
  const std::vector<DeadLoad> loads{{body, R_RW * load.force_W, R_RW * load.moment_W, load.point_B}};

  Kinematics reference(m);
  ComputeKinematics(m, at->q, reference);
  const RigidTransform X_ref = X_WR * reference.X_RB[body.u()];
  LoadedBody out;
  for (const int i : options.locked) out.locked.push_back(m.CoordinateName(i));
  out.reference_position_W = X_ref * load.point_B;

  auto linear_q = LinearDeflection(m, at->q, loads, options);
  if (!linear_q) return tl::unexpected(linear_q.error());
  const Vector6 V = BodyJacobian(m, reference, body) * (*linear_q - at->q);
  out.linear.rotation_W = X_WR.rotation() * V.head<3>();
  out.linear.position_W =
      out.reference_position_W +
      X_WR.rotation() * (V.tail<3>() + V.head<3>().cross(reference.X_RB[body.u()] * load.point_B));
  out.linear.max_joint_rotation = MaxJointRotation(m, at->q, *linear_q);

  StaticsResult result = SolveStatics(m, at->q, loads, options);
  if (!result.converged) return NoEquilibrium(m, "this load", result);
  Kinematics loaded(m);
  ComputeKinematics(m, result.q, loaded);
  const RigidTransform X = X_WR * loaded.X_RB[body.u()];
  out.nonlinear.position_W = X * load.point_B;
  out.nonlinear.rotation_W = LogRotation(X.rotation() * X_ref.rotation().transpose());
  out.nonlinear.max_joint_rotation = MaxJointRotation(m, at->q, result.q);
  out.floats = m.base() == BaseKind::kFloating;
  out.iterations = result.iterations;
  out.residual = result.residual;
  out.stable = result.tangent.IsStable();
  out.lowest_stiffness = result.tangent.lowest();
  out.limit_shares = result.limit_shares;
  out.spring_frequencies_hz = FullFrequencies(m, at->q, 8);
  out.frequencies_hz = TangentFrequencies(m, result.q, result.tangent);
  LoadedState state;
  state.q = result.q;
  state.tangent = std::move(result.tangent);
  out.points.push_back(MeasurePoint(*at, {load.body, load.point_B}, options.locked, &state));
  for (const NamedPoint& point : asked.points)
    out.points.push_back(MeasurePoint(*at, point, options.locked, &state));
  if (asked.buckling_modes > 0) {
    auto modes = ComputeBucklingModes(m, at->q, loads, options, asked.buckling_modes);
    if (!modes) return tl::unexpected(modes.error());
    out.buckling = std::move(*modes);
    for (int i = 0; i < m.num_coordinates(); ++i) out.coordinates.push_back(m.CoordinateName(i));
  }
  for (Eigen::Index i = 0; i < result.q.size(); ++i) {
    const double q = result.q(i), low = m.lower()(i), high = m.upper()(i);
    constexpr double kRounding = 1e-6;
    if (q >= low - kRounding && q <= high + kRounding) continue;
    out.beyond_stops.push_back(fmt::format(
        "joint coordinate '{}' ends at {:.4g}, beyond its stop at {:.4g}, which statics does not know: 'run' "
        "holds it there",
        m.CoordinateName(static_cast<int>(i)), q, q < low ? low : high));
  }
  return out;
}

}  // namespace fork1s
