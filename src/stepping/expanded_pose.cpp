#include "expanded_pose.hpp"

#include <algorithm>
#include <set>

#include "mechanism_detail.hpp"

namespace fork1s {
namespace {

// Those whose displacement or rate a step asks for by name.
std::vector<int> AskedCoordinates(const Mechanism& m) {
  std::set<int> out;
  const auto add = [&](const auto& elements) {
    for (const auto& element : elements) {
      const std::vector<int> own = m.CoordinatesOf(element.length);
      out.insert(own.begin(), own.end());
    }
  };
  add(m.controls());
  add(m.length_limits());
  add(m.frictions());
  add(m.force_limits());
  return {out.begin(), out.end()};
}

// A pose where loops are closed exactly, from where the last exact one left them: the same bits whatever came
// between.
Configuration ConfigureExactly(const ConstStepContext& ctx) {
  Configuration c(*ctx.model.reduced);
  c.mu = ctx.state.mu;
  Configure(*ctx.model.reduced, ctx.state.reduced, c);
  return c;
}

// out = Σ_i δ_i (column i of the stack as an r x r matrix)
void Contract(const MatrixX& stack, const VectorX& delta, MatrixX& out) {
  Eigen::Map<VectorX>(out.data(), out.size()).noalias() = stack * delta;
}

}  // namespace

std::string WhatForbidsExpansion(const Mechanism& mechanism) {
  if (mechanism.base() != BaseKind::kFixed) return "its base moves";
  if (!mechanism.paths().empty()) return "path '" + mechanism.paths().front().name + "' bends with the pose";
  if (!mechanism.muscles().empty()) return "muscle '" + mechanism.muscles().front().name + "' is not linear";
  for (const Mechanism::Spring& s : mechanism.springs())
    if (!s.is_linear()) return "spring '" + s.name + "' is not linear";
  return {};
}

namespace {

// Servos with bounds give force and stiffness along their lengths at every pose (LoadExpandedForces); what the sums over
// all springs have of them leaves those sums.
void SubtractServos(const Mechanism& m, ExpandedMechanism& out) {
  Expansion& e = out.expansion;
  const auto r = e.z.size();
  VectorX row(r);
  MatrixX bend(r, r);
  for (const Mechanism::ForceLimit& limit : m.force_limits()) {
    row.setZero();
    bend.setZero();
    double length = 0;
    for (const auto& [i, c] : limit.length.terms) {
      const auto at =
          std::lower_bound(out.coordinates.begin(), out.coordinates.end(), i) - out.coordinates.begin();
      length += c * e.q(i);
      row += c * e.Q.row(i).transpose();
      bend += c * out.curvatures[static_cast<std::size_t>(at)];
    }
    const double force = limit.stiffness * (limit.rest - length);
    const MatrixX K = limit.stiffness * row * row.transpose();
    e.spring_force -= force * row;
    e.spring_slope -= force * bend - K;
    e.K -= K;
    e.D -= limit.damping * row * row.transpose();
    for (Eigen::Index i = 0; i < r; ++i)
      Eigen::Map<MatrixX>(e.D_slope.col(i).data(), r, r) -= limit.damping * row * bend.col(i).transpose();
  }
}

}  // namespace

void Expand(const StepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  const Configuration at = ConfigureExactly(ctx);
  state.mu = at.mu;
  state.expanded_at = state.reduced.z;
  ExpandAt(ctx, at);
}

void ExpandAt(const StepContext& ctx, const Configuration& at) {
  const auto& [model, state, ws] = ctx;
  auto out = std::make_shared<ExpandedMechanism>();
  out->of = model.reduced;
  out->expansion = Expand(*model.reduced, state.expanded_at, at);
  out->M_inverse = SolveSymmetric(out->expansion.M, MatrixX(MatrixX::Identity(model.size(), model.size())));
  for (const ContactGroup& group : model.groups)
    out->groups.push_back(ExpandBody(*model.reduced, out->expansion, group.body));
  out->coordinates = AskedCoordinates(model.mechanism());
  for (const int i : out->coordinates)
    out->curvatures.push_back(
        SecondDerivative(*model.reduced, out->expansion, VectorX::Unit(model.reduced->num_coordinates(), i)));
  SubtractServos(model.mechanism(), *out);
  ExpandedPose& pose = ws.expansion.pose;
  const int r = model.size();
  pose.G.resize(r, r);
  pose.D.resize(r, r);
  pose.X_RG.resize(out->groups.size());
  pose.J.assign(out->groups.size(), Matrix6X::Zero(6, r));
  pose.q = out->expansion.q;
  pose.Q = out->expansion.Q;
  pose.rates.resize(r);
  pose.loop_rates.resize(model.reduced->loop_rank());
  pose.servo_rows.resize(r, static_cast<Eigen::Index>(model.mechanism().force_limits().size()));
  ws.expansion.of = std::move(out);
}

void MoveExpanded(const StepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  const Expansion& expansion = ws.expansion.of->expansion;
  ExpandedPose& pose = ws.expansion.pose;
  ws.has_exact_pose.store(false);
  pose.delta = state.reduced.z - expansion.z;
  Contract(expansion.G, pose.delta, pose.G);
  Contract(expansion.D_slope, pose.delta, pose.D);
  for (std::size_t g = 0; g < ws.expansion.of->groups.size(); ++g)
    EvaluateBody(ws.expansion.of->groups[g], pose.delta, pose.X_RG[g], pose.J[g]);
  for (std::size_t k = 0; k < ws.expansion.of->coordinates.size(); ++k) {
    const int i = ws.expansion.of->coordinates[k];
    pose.rates.noalias() = ws.expansion.of->curvatures[k] * pose.delta;
    pose.Q.row(i) = expansion.Q.row(i) + pose.rates.transpose();
    pose.q(i) = expansion.q(i) + expansion.Q.row(i).dot(pose.delta) + 0.5 * pose.rates.dot(pose.delta);
  }
  const auto& servos = model.mechanism().force_limits();
  for (std::size_t k = 0; k < servos.size(); ++k) {
    ReducedRow(servos[k].length, ws.paths(), pose.Q, ws.scratch.length_row);
    pose.servo_rows.col(static_cast<Eigen::Index>(k)) = ws.scratch.length_row;
  }
}

void ComputeExpandedJointRates(const StepContext& ctx, const VectorX& w, VectorX& q_dot) {
  const auto& [model, state, ws] = ctx;
  const Expansion& expansion = ws.expansion.of->expansion;
  ExpandedPose& pose = ws.expansion.pose;
  q_dot.noalias() = expansion.Q * w;
  if (model.reduced->loop_rank() == 0) return;
  // q'' = -Bᵀ N
  pose.scratch.noalias() = w * pose.delta.transpose();
  pose.loop_rates.noalias() =
      expansion.N * Eigen::Map<const VectorX>(pose.scratch.data(), pose.scratch.size());
  model.reduced->loops.SubtractTransposed(model.reduced->B, pose.loop_rates, q_dot);
}

void ComputeExpandedMass(const StepContext& ctx) {
  MechanismWorkspace& ws = ctx.work;
  ws.mass.M = ws.expansion.of->expansion.M + ws.expansion.pose.G + ws.expansion.pose.G.transpose();
}

void ComputeExpandedMomenta(const StepContext& ctx, StageBase& out) {
  MechanismWorkspace& ws = ctx.work;
  out.rates = ws.x;
  out.turned_rates.noalias() = ws.expansion.pose.G * ws.x;
}

void ComputeExpandedMomentumChange(const StepContext& ctx, const StageBase& base, const VectorX& v,
                                   double b) {
  MechanismWorkspace& ws = ctx.work;
  ExpandedPose& pose = ws.expansion.pose;
  const Expansion& expansion = ws.expansion.of->expansion;
  VectorX& change = ws.momentum_change.reduced;
  pose.rates = base.rates - v;
  change = base.turned_rates;
  change.noalias() += expansion.M * pose.rates;
  change.noalias() += pose.G.transpose() * pose.rates;
  change.noalias() -= pose.G * v;
  if (b > 0) {
    change.noalias() -= b * (expansion.D * v);
    change.noalias() -= b * (pose.D * v);
    change.noalias() -= b * (pose.D.transpose() * v);
    const auto& servos = ctx.model.mechanism().force_limits();
    for (std::size_t k = 0; k < servos.size(); ++k) {
      if (servos[k].damping == 0) continue;
      const auto row = pose.servo_rows.col(static_cast<Eigen::Index>(k));
      change -= b * servos[k].damping * row.dot(v) * row;
    }
  }
  ws.momentum_change.all = change;
}

void LoadExpandedForces(const StepContext& ctx, const Vector3& gravity_R) {
  const auto& [model, state, ws] = ctx;
  const Expansion& expansion = ws.expansion.of->expansion;
  const ExpandedPose& pose = ws.expansion.pose;
  VectorX& f = ws.forces.f_z;
  f = expansion.spring_force;
  f.noalias() += expansion.spring_slope * pose.delta;
  f.noalias() += expansion.weight_force * gravity_R;
  const auto r = pose.delta.size();
  for (int axis = 0; axis < 3; ++axis)
    if (gravity_R(axis) != 0)
      f.noalias() += gravity_R(axis) *
                     (Eigen::Map<const MatrixX>(expansion.weight_slope.col(axis).data(), r, r) * pose.delta);
  const auto& controls = model.mechanism().controls();
  for (std::size_t k = 0; k < controls.size(); ++k) {
    const double force = controls[k].gain * ActivationOf(state, static_cast<Eigen::Index>(k));
    if (force == 0) continue;
    for (const auto& [i, c] : controls[k].length.terms) f += c * force * pose.Q.row(i).transpose();
  }
  const auto& servos = model.mechanism().force_limits();
  for (std::size_t k = 0; k < servos.size(); ++k)
    f += servos[k].stiffness * (servos[k].rest - Length(ctx, servos[k].length)) *
         pose.servo_rows.col(static_cast<Eigen::Index>(k));
}

void AddExpandedOperator(const StepContext& ctx, double b) {
  MechanismWorkspace& ws = ctx.work;
  MatrixX& A = ws.matrix.A;
  const Expansion& expansion = ws.expansion.of->expansion;
  const MatrixX& D = ws.expansion.pose.D;
  A += b * (expansion.D + D + D.transpose()) + b * b * expansion.K;
  const auto& servos = ctx.model.mechanism().force_limits();
  for (std::size_t k = 0; k < servos.size(); ++k)
    if (ctx.state.at_bound[k] == 0)
      AddRankOneStiffness(ctx, servos[k].length, b * servos[k].damping + b * b * servos[k].stiffness, true);
}

}  // namespace fork1s
