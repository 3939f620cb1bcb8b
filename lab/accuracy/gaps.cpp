#include <cmath>
#include <fork1s/recovery/recover.hpp>
#include <fork1s/recovery/second_order.hpp>
#include <fork1s/reduction/statics.hpp>
#include <lab/accuracy.hpp>
#include <numbers>

namespace fork1s {

Expected<GapCurve> MeasureGaps(const StaticCase& c, const std::vector<double>& angles_deg) {
  const Mechanism& m = *c.mechanism;
  auto model = Reduce(c.mechanism, c.q0);
  if (!model) return tl::unexpected(model.error());
  // The linear response to a unit force, in reduced coordinates: K_r is 1 on all that has springs.
  Vector6 wrench;
  wrench << model->X_RB_ref[c.body.u()].translation().cross(c.direction_R), c.direction_R;
  const VectorX z = (model->T_of(c.body).transpose() * wrench).cwiseProduct(model->K_r);
  const double turn = MaxJointRotation(m, c.q0, c.q0 + model->Q * z);
  Configuration scratch(*model);
  std::vector<RigidTransform> X_RB;
  auto percent = [&] { return 100 * MeasureJointGaps(m, X_RB).front().gap / m.length_scale(); };
  ReducedModel bent = *model;
  bent.curvature = LoopCurvature(bent);
  GapCurve curve{c.name, angles_deg, {}, {}, {}, {}, {}};
  for (double angle : angles_deg) {
    ReducedState state;
    state.z = angle * std::numbers::pi / 180 / turn * z;
    RecoverPosesTwist(*model, state, X_RB);
    curve.twist.push_back(percent());
    RecoverPosesTwistSecondOrder(*model, state, X_RB);
    curve.second_order.push_back(percent());
    Configure(*model, state, scratch, 0);
    X_RB = scratch.kinematics.X_RB;
    curve.open.push_back(percent());
    RecoverPosesExact(bent, state, scratch, X_RB);
    curve.curved.push_back(percent());
    RecoverPosesExact(*model, state, scratch, X_RB);
    curve.exact.push_back(percent());
  }
  return curve;
}

double LogSlope(const std::vector<double>& x, const std::vector<double>& y, double low, double high) {
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (x[i] < low || x[i] > high || !(y[i] > 0)) continue;
    const double u = std::log(x[i]), v = std::log(y[i]);
    n += 1;
    sx += u;
    sy += v;
    sxx += u * u;
    sxy += u * v;
  }
  return (n * sxy - sx * sy) / (n * sxx - sx * sx);
}

}  // namespace fork1s
