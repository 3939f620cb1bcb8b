#include <fork1s/reduction/frequencies.hpp>

#include <cmath>
#include <numbers>

#include "inertia_along.hpp"
#include "linalg/products.hpp"
#include "linalg/select.hpp"
#include "mode_choice.hpp"
#include "modes.hpp"

namespace fork1s {
namespace {

constexpr int kMaxMeasured = 24;  // lowest modes left out whose contribution is computed

// `model` with the columns [free, all other kept, modes left out].
ReducedModel WithModes(const ReducedModel& model, const Kinematics& kinematics, const MatrixX& modes) {
  const Mechanism& mechanism = *model.mechanism;
  ReducedModel all;
  all.mechanism = model.mechanism;
  all.interfaces = model.interfaces;
  all.X_RB_ref = model.X_RB_ref;
  all.num_free = model.num_free;
  all.num_elastic = model.size() - model.num_free;
  all.num_modes = static_cast<int>(modes.cols());
  all.Q.resize(model.num_coordinates(), model.size() + modes.cols());
  all.Q << Columns(model.Q, model.FreeColumns()), Columns(model.Q, model.SprungColumns()), modes;
  internal::InertiaAlong inertia = internal::ComputeInertiaAlong(mechanism, kinematics, all.Q);
  all.M = std::move(inertia.M);
  all.M_0z = std::move(inertia.M_0z);
  all.M_00 = inertia.M_00;
  all.D = Congruence(DampingMatrix(mechanism, kinematics, model.q_ref), all.Q);
  return all;
}

}  // namespace

LeftOutModes ComputeLeftOutModes(const ReducedModel& model) {
  const Mechanism& mechanism = *model.mechanism;
  Kinematics kinematics(mechanism);
  ComputeKinematics(mechanism, model.q_ref, kinematics);
  const auto basis =
      internal::ComputeElasticBasis(mechanism, kinematics, model.q_ref, internal::BasisBy::kQuick);
  LeftOutModes left_out;
  const int e = basis.num_elastic();
  left_out.count = e - (model.size() - model.num_free);
  if (left_out.count <= 0) return left_out;
  // VᵀKV = 1, so that the coordinates of V y are VᵀK V y.
  const MatrixX KQ =
      Times(StiffnessMatrix(mechanism, kinematics, model.q_ref), Columns(model.Q, model.SprungColumns()));
  const MatrixX Y = basis.TimesV(KQ.transpose()).transpose();
  const internal::Modes modes = internal::LowestModes(mechanism, kinematics, basis, Y, MatrixX(e, 0),
                                                      MatrixX(0, 0), std::min(kMaxMeasured, left_out.count));
  if (modes.mu.size() == 0 || !(modes.mu(0) > 0)) return left_out;
  MatrixX columns(model.num_coordinates(), modes.vectors.cols());
  for (Eigen::Index i = 0; i < columns.cols(); ++i)
    columns.col(i) = basis.ApplyV(modes.vectors.col(i), model.num_coordinates());
  const double length = mechanism.length_scale();
  const MatrixX J = internal::ScaledInterfaceJacobian(mechanism, kinematics, model.interfaces, length);
  Eigen::Index largest = 0;
  left_out.contribution_m =
      internal::ModeContributions(WithModes(model, kinematics, columns), J, length).maxCoeff(&largest);
  const auto hertz = [&](Eigen::Index i) { return 1 / (2 * std::numbers::pi * std::sqrt(modes.mu(i))); };
  left_out.lowest_hz = hertz(0);
  left_out.largest_hz = hertz(largest);
  return left_out;
}

}  // namespace fork1s
