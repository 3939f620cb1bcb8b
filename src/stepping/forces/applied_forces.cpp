// Forces at points fixed in bodies: wrenches at the pose at hand, and their stiffness in a stage.
//
// A force that is constant in world axes has the potential -F·x. Along the joints of a path, with u_j the
// motion of the point x by joint j alone and Ω_j the turn of what joint j carries,
//     x'' = Σ_j (Ω_{j-1} + Ω_j) × u_j
// is its second derivative at constant joint rates, the base being a joint before the first. So
//     wᵀ K w = -Σ_j (Ω_{j-1} + Ω_j)ᵀ P_j D_j w,   P_j D = Σ u × F = [TurnedLever(G_j) | -[F_j]x] D
// with D_j the twist of joint j per rate of the reduced coordinates, and F_j, G_j = Σ x Fᵀ sums over all that
// joint j carries, about R's origin. Translations of the base turn no lever.
//
// K is the symmetric part of -∂f/∂x. On a fixed base forces have no other; on a floating one the rest is the
// moment about the base, in which rotations do not commute, and A stays symmetric without it. Left out are
// the turn of a pure moment, which has no potential, and the curvature of loops, the change of Q with the
// pose: by O(b²) the iteration contracts without them. A compressed chain has K < 0. Where A = M + b² K is
// not positive definite, the chain buckles faster than by a factor e in b; the factorization fails, and the
// step is halved.
#include <algorithm>

#include "../mechanism_detail.hpp"
#include "forces.hpp"

namespace fork1s {
namespace {

std::size_t At(int index) { return static_cast<std::size_t>(index); }

// Of a load about its body's origin: force and Σ x Fᵀ in R about R's origin.
struct LoadInBase {
  Vector3 force;
  Matrix3 force_moments;
};
LoadInBase ExpressInBase(const ConstStepContext& ctx, const AppliedForces& load, const RigidTransform& X_RB) {
  const Matrix3& R_WR = ctx.state.reduced.X_WR.rotation();
  const Vector3 force = R_WR.transpose() * load.force_W;
  return {force, X_RB.rotation() * load.force_moments * R_WR + X_RB.translation() * force.transpose()};
}

}  // namespace

void AddWrench(const StepContext& ctx, BodyIndex body, const Vector3& force_W, const Vector3& moment_W,
               const Vector3& point_W) {
  MechanismState& state = ctx.state;
  FORK1S_REQUIRE(body.valid() && body.u() < state.loads.size(), body.value());
  state.loads[body.u()].Add(force_W, moment_W, BodyPose(ctx, body).inverse() * point_W);
  state.has_loads = true;
}

void ClearLoads(MechanismState& state) {
  if (!state.has_loads) return;
  std::fill(state.loads.begin(), state.loads.end(), AppliedForces());
  state.has_loads = false;
}

void AddLoadWrenches(const ConstStepContext& ctx, Matrix6X& F) {
  const auto& [model, state, ws] = ctx;
  if (!state.has_loads) return;
  const Matrix3 R_RW = state.reduced.X_WR.rotation().transpose();
  for (int b = 0; b < model.mechanism().num_bodies(); ++b) {
    const AppliedForces& load = state.loads[At(b)];
    if (load.IsZero()) continue;
    const RigidTransform X_WB = BodyPose(ctx, BodyIndex(b));
    const Vector3 arm_W = X_WB.translation() - state.reduced.X_WR.translation();
    F.col(b).head<3>() += R_RW * (load.MomentAt(X_WB.rotation()) + arm_W.cross(load.force_W));
    F.col(b).tail<3>() += R_RW * load.force_W;
  }
}

void AddAppliedWrenches(const ConstStepContext& ctx, Matrix6X& F) {
  const auto& [model, state, ws] = ctx;
  AddLoadWrenches(ctx, F);
  if (!state.point_spring.IsActive()) return;
  const RigidTransform& X_WR = state.reduced.X_WR;
  const Vector3 point_W = BodyPose(ctx, state.point_spring_body) * state.point_spring.point_B;
  const Vector3 force_R = X_WR.rotation().transpose() * state.point_spring.SpringForce(point_W);
  auto wrench = F.col(state.point_spring_body.value());
  wrench.head<3>() += (X_WR.inverse() * point_W).cross(force_R);
  wrench.tail<3>() += force_R;
}

namespace {

// Forces at points, summed over all that each joint carries.
class CarriedForces {
 public:
  explicit CarriedForces(const StepContext& ctx) : here_(ctx) {
    ctx.work.loads.carried_force.setZero();
    ctx.work.loads.carried_moments.setZero();
  }
  // On what joint j carries; j = -1: on the base.
  void Add(int j, const LoadInBase& load) {
    total_moments_ += load.force_moments;
    if (j < 0) return;
    here_.work.loads.carried_force.col(j) += load.force;
    here_.work.loads.carried_moments.middleCols<3>(3 * j) += load.force_moments;
  }
  // K += their stiffness, in the lower triangle; once. On a base that turns they stay in the world's axes, or
  // with `turn_with_base` in its own.
  void AddStiffness(MatrixX& K_out, bool turn_with_base = false);

 private:
  const StepContext& here_;
  Matrix3 total_moments_ = Matrix3::Zero();
};

void CarriedForces::AddStiffness(MatrixX& K_out, bool turn_with_base) {
  const auto& [model, state, ws] = here_;
  const Mechanism& m = model.mechanism();
  const int base = model.base_size;
  const bool has_base = base > 0 && !turn_with_base;
  if (has_base) {
    const Matrix3 turned = AppliedForces::TurnedLever(total_moments_);
    K_out.topLeftCorner<3, 3>() -= 0.5 * (turned + turned.transpose());
  }
  for (int j = m.num_joints() - 1; j >= 0; --j) {
    const Vector3 force = ws.loads.carried_force.col(j);
    const Matrix3 moments = ws.loads.carried_moments.middleCols<3>(3 * j);
    if (force.isZero(0) && moments.isZero(0)) continue;
    const int previous = m.joints()[At(j)].previous;
    const auto T = ws.jacobian.T(j);
    const auto size = T.cols();
    const int begin = ws.jacobian.begin(j);
    // D_j and Ω_{j-1} + Ω_j on the columns that move joint j.
    auto D = ws.loads.joint_twist.leftCols(size);
    auto turn = ws.loads.joint_turn.leftCols(size);
    D = T;
    turn = T.topRows<3>();
    if (previous >= 0) {
      ws.loads.carried_force.col(previous) += force;
      ws.loads.carried_moments.middleCols<3>(3 * previous) += moments;
      const auto T_previous = ws.jacobian.T(previous);
      const int offset = ws.jacobian.begin(previous) - begin;
      if (T_previous.cols() > 0) {
        D.middleCols(offset, T_previous.cols()) -= T_previous;
        turn.middleCols(offset, T_previous.cols()) += T_previous.topRows<3>();
      }
    }
    auto lever = ws.loads.turned_lever.leftCols(size);
    lever.noalias() = AppliedForces::TurnedLever(moments).lazyProduct(D.topRows<3>());
    lever.noalias() -= Skew(force).lazyProduct(D.bottomRows<3>());
    auto K = K_out.block(base + begin, base + begin, size, size);
    K.noalias() -= 0.5 * turn.transpose().lazyProduct(lever);
    K.noalias() -= 0.5 * lever.transpose().lazyProduct(turn);
    if (has_base) K_out.block(base + begin, 0, size, 3) -= lever.transpose();
  }
}

// ws.loads.path_forces <- of springs, inputs, bounded servos and muscles on paths at the pose at hand; without dampers
// and stops. Whether any is not 0.
bool ComputePathForces(const StepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  const Mechanism& m = model.mechanism();
  std::vector<double>& forces = ws.loads.path_forces;
  forces.assign(m.paths().size(), 0.0);
  if (forces.empty()) return false;
  const auto add = [&](const Mechanism::Length& length, auto force) {
    if (length.path >= 0) forces[At(length.path)] += length.gear * force();
  };
  for (const Mechanism::Spring& s : m.springs())
    add(s.length, [&] { return s.Force(Length(ctx, s.length)); });
  if (state.controls.size() > 0) {
    const VectorX& activation = UpdateActivations(ctx);
    for (std::size_t k = 0; k < m.controls().size(); ++k)
      add(m.controls()[k].length,
          [&] { return m.controls()[k].gain * activation(static_cast<Eigen::Index>(k)); });
    for (const Mechanism::Muscle& muscle : m.muscles())
      add(muscle.length, [&] {
        return activation(muscle.control) *
               muscle.Force(Length(ctx, muscle.length), LengthRate(ctx, muscle.length));
      });
  }
  for (const Mechanism::ForceLimit& limit : m.force_limits())
    add(limit.length, [&] {
      const double force = UnboundedForce(ctx, limit);
      return std::clamp(force, limit.lower, limit.upper) - force;
    });
  return std::any_of(forces.begin(), forces.end(), [](double force) { return force != 0; });
}

// A -= b² Σ f ∂²ℓ/∂q² of a tendon with the force f along its length ℓ: what its forces at their points are stiff by as
// constant ones, and for each straight part of length L, with the relative velocity J w of its ends and e across it,
//     -f/L Σ (eᵀ J)ᵀ (eᵀ J)
// Points of touch count as fixed to their obstacle.
void AddTensionStiffness(const StepContext& ctx, double b) {
  const auto& [model, state, ws] = ctx;
  if (!ComputePathForces(ctx)) return;
  const Mechanism& m = model.mechanism();
  CarriedForces forces(ctx);
  auto A_z = ws.matrix.A.bottomRightCorner(model.size(), model.size());
  for (std::size_t k = 0; k < m.paths().size(); ++k) {
    if (!(ws.loads.path_forces[k] < 0)) continue;
    internal::FindStraightParts(m.paths()[k], ws.configuration.kinematics, ws.loads.straight_parts);
    for (const internal::StraightPart& part : ws.loads.straight_parts) {
      const Vector3 way = part.to_R - part.from_R;
      const double length = way.norm(), force = b * b * ws.loads.path_forces[k] / part.divisor;
      if (part.from_body == part.to_body || !(length > 0)) continue;
      const Vector3 u = way / length, pull = force * u;
      const int to = m.body(part.to_body).last_joint, from = m.body(part.from_body).last_joint;
      forces.Add(to, {pull, part.to_R * pull.transpose()});
      forces.Add(from, {-pull, -part.from_R * pull.transpose()});
      const Vector3 first = u.unitOrthogonal();
      for (const Vector3& across : {first, Vector3(u.cross(first))}) {
        VectorX& row = ws.scratch.length_row;
        row.setZero();
        const auto add = [&](int joint, const Vector3& point, double sign) {
          if (joint < 0) return;
          const auto T = ws.jacobian.T(joint);
          row.segment(ws.jacobian.begin(joint), T.cols()) +=
              sign *
              (T.topRows<3>().transpose() * point.cross(across) + T.bottomRows<3>().transpose() * across);
        };
        add(to, part.to_R, 1);
        add(from, part.from_R, -1);
        A_z.noalias() -= force / length * row * row.transpose();
      }
    }
  }
  forces.AddStiffness(ws.matrix.A, true);
}

}  // namespace

void ComputeLoadStiffness(const StepContext& ctx) {
  const auto& [model, state, ws] = ctx;
  const Mechanism& m = model.mechanism();
  CarriedForces forces(ctx);
  if (state.has_loads)
    for (int b = 0; b < m.num_bodies(); ++b)
      if (const AppliedForces& load = state.loads[At(b)]; !load.IsZero())
        forces.Add(m.body(BodyIndex(b)).last_joint,
                   ExpressInBase(ctx, load, ws.configuration.kinematics.X_RB[At(b)]));
  if (state.point_spring.IsActive()) {
    const Vector3 force = PointSpringForce(ctx);
    forces.Add(m.body(state.point_spring_body).last_joint,
               {force, ws.point_spring.point_R * force.transpose()});
  }
  ws.loads.K.setZero();
  forces.AddStiffness(ws.loads.K);
}

void AddGeometricStiffness(const StepContext& ctx, double b, GeometricStiffness of_parts) {
  const auto& [model, state, ws] = ctx;
  CarriedForces forces(ctx);
  const Vector3 gravity_R = state.reduced.X_WR.rotation().transpose() * ws.forces.gravity_W;
  for (int i = 0; i < model.rigid_parts.size(); ++i) {
    const SpatialInertia& inertia = model.rigid_parts.parts[At(i)].inertia_R0;
    if (inertia.mass == 0) continue;
    const Vector3 center =
        i == 0 ? inertia.center : Vector3(ws.configuration.kinematics.P[At(i - 1)] * inertia.center);
    Vector3 impulse = b * inertia.mass * gravity_R;
    if (of_parts == GeometricStiffness::kOfWeightAndInertia)
      impulse += ws.momentum_change.part_impulses.col(i);
    const Vector3 force = b * impulse;  // times b²
    forces.Add(i - 1, {force, center * force.transpose()});
  }
  forces.AddStiffness(ws.matrix.A);
  if (of_parts == GeometricStiffness::kOfWeightAndTension) AddTensionStiffness(ctx, b);
}

}  // namespace fork1s
