// Newton's method for one implicit stage.
#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>
#include <cmath>
#include <fork1s/constraints/contact_solver.hpp>

#include "linearization.hpp"

namespace fork1s::lab {
namespace {

double KineticNorm(const MatrixX& M, const VectorX& r) {
  return std::sqrt(std::max(0., r.dot(M.llt().solve(r))));
}

}  // namespace

void SolveStage(const System& system, const StageInput& input, const StageSettings& settings, State* state,
                Counts* counts) {
  const double b = input.b;
  const int m = system.num_rows();
  const Eigen::Index size = input.p.size();
  const std::size_t num_contacts = system.contacts.size();
  const bool from_start =
      settings.newton == Newton::kStart || settings.newton == Newton::kDisplacementFromStart;
  const bool by_rate = settings.form == ConstraintForm::kRate;
  const auto close = [&](const std::vector<Pose>& poses) {
    return by_rate ? ProjectPoses(system, poses) : poses;
  };

  const bool to_momentum =
      settings.newton == Newton::kMomentum || settings.newton == Newton::kExtrapolatedMomentum;
  const bool once = settings.newton == Newton::kStart || settings.newton == Newton::kPredicted ||
                    settings.newton == Newton::kExtrapolated;
  const VectorX V_last = state->V;
  VectorX V = V_last;
  if ((settings.newton == Newton::kExtrapolated || settings.newton == Newton::kExtrapolatedMomentum) &&
      state->V_before.size() > 0)
    V += input.advance / state->time_between * (V - state->V_before);
  std::vector<Pose> poses;
  if (from_start) {
    V = DifferenceAll(state->poses, input.poses) / b;
    poses = state->poses;
  } else {
    poses = close(ComposeAll(input.poses, b * V));
  }
  ++counts->stages;
  VectorX p = input.p, lambda = state->lambda;
  std::vector<Vector3> phi = state->phi, xi = input.xi;
  double before = 1e300, step_size = 1e300, V_size = 1;
  bool solved = false;
  // Line search: what the last solve asked for, and the share of it that is taken.
  VectorX V_from, V_step, lambda_from, lambda_step;
  double share = 1;
  Eigen::PartialPivLU<MatrixX> last_factor;
  static thread_local ContactSolver solver;
  // Where Newton has not converged after kPatience iterations it begins again without the stiffness that is
  // proportional to forces (Gauss-Newton), which far from the answer are not those of the answer.
  constexpr int kPatience = 15;
  bool gauss_newton = false;
  for (int iteration = 0;; ++iteration) {
    if ((settings.newton == Newton::kResidual || to_momentum) && iteration == kPatience) {
      gauss_newton = true;
      V = V_last;
      lambda = state->lambda;
      phi = state->phi;
      V_step = VectorX();
      poses = close(ComposeAll(input.poses, b * V));
    }
    const Linearization at = Linearize(system, poses, V, lambda, b, true, !gauss_newton);
    ++counts->evaluations;
    std::vector<ContactGeometry> geometry;
    VectorX contact_force = VectorX::Zero(size);
    for (std::size_t i = 0; i < num_contacts; ++i) {
      const ContactPair& c = system.contacts[i];
      geometry.push_back(ComputeContact(c, poses));
      const Vector3 local = geometry[i].frame * phi[i];
      if (c.a >= 0) contact_force.segment<6>(6 * c.a) += geometry[i].J_a.transpose() * local;
      if (c.b >= 0) contact_force.segment<6>(6 * c.b) += geometry[i].J_b.transpose() * local;
    }
    const VectorX reaction = at.J.transpose() * lambda;
    const VectorX r = at.p - input.p - b * (at.f + reaction + contact_force);
    const double merit = KineticNorm(at.M, r);
    const double scale =
        KineticNorm(at.M, at.p.cwiseAbs() + input.p.cwiseAbs() +
                              b * (at.f_abs + reaction.cwiseAbs() + contact_force.cwiseAbs()));
    // Natural monotonicity test (Deuflhard): the next correction by the last factor is no longer than the
    // last one was.
    if ((settings.newton == Newton::kResidual || to_momentum) && V_step.size() > 0 && share > 1. / 64 &&
        merit > 1e-6 * scale && iteration < settings.max_iterations) {
      VectorX next(size + m);
      next.head(size) = -r;
      next.tail(m) = by_rate ? VectorX(-at.J * V) : VectorX(-at.c / b);
      const VectorX correction = last_factor.solve(next).head(size);
      if (correction.dot(at.M * correction) > 2 * V_step.dot(at.M * V_step)) {
        share *= 0.5;
        V = V_from + share * V_step;
        lambda = lambda_from + share * lambda_step;
        poses = close(ComposeAll(input.poses, b * V));
        continue;
      }
    }
    share = 1;
    if (gauss_newton && merit < 1e-3 * scale) gauss_newton = false;
    if (settings.newton == Newton::kResidual && iteration > 0) {
      double residual = merit / std::max(scale, 1e-300);
      if (m > 0)
        residual =
            std::max(residual, (by_rate ? b * (at.J * V) : at.c).lpNorm<Eigen::Infinity>() / system.size);
      const double increment = step_size / std::max(V_size + b * system.gravity.norm(), 1e-12);
      const bool tight = iteration != kPatience && residual <= settings.residual_tolerance &&
                         (num_contacts == 0 || increment <= 1e-9);
      const bool stalled = iteration > 4 && residual < 1e-8 && increment < 1e-8 && residual > 0.5 * before;
      before = residual;
      if (tight || stalled || iteration >= settings.max_iterations) {
        solved = tight || stalled;
        counts->largest_residual = std::max(counts->largest_residual, residual);
        break;
      }
    }
    if (to_momentum && iteration > 0 && iteration != kPatience) {
      const double residual = merit / std::max(scale, 1e-300);
      if (residual <= settings.momentum_tolerance || iteration >= settings.max_iterations) {
        solved = residual <= settings.momentum_tolerance;
        break;
      }
    }
    // A δ − b Jᵀ λ = −r + b Jᵀ λ_old, and rows of the constraints
    const MatrixX A = at.A_p + b * at.D + b * b * (gauss_newton ? at.K : MatrixX(at.K + at.G));
    MatrixX kkt = MatrixX::Zero(size + m, size + m);
    kkt.topLeftCorner(size, size) = A;
    kkt.topRightCorner(size, m) = -at.J.transpose();
    kkt.bottomLeftCorner(m, size) = at.J;
    VectorX rhs(size + m);
    rhs.head(size) = -r - b * reaction;
    rhs.tail(m) = by_rate ? VectorX(-at.J * V) : VectorX(-at.c / b);
    last_factor.compute(kkt);
    const Eigen::PartialPivLU<MatrixX>& lu = last_factor;
    VectorX answer = lu.solve(rhs);
    VectorX contact_impulse = VectorX::Zero(size);
    if (num_contacts > 0) {
      // Response to impulses within what rigid constraints allow: Yᵀ Y = N (Nᵀ A N)⁻¹ Nᵀ
      MatrixX N = MatrixX::Identity(size, size);
      if (m > 0) {
        const Eigen::HouseholderQR<MatrixX> qr(at.J.transpose());
        N = (qr.householderQ() * MatrixX::Identity(size, size)).rightCols(size - m);
      }
      Eigen::LLT<MatrixX> root(N.transpose() * (0.5 * (A + A.transpose())) * N);
      if (root.info() != Eigen::Success)
        root.compute(N.transpose() *
                     (at.M + b * at.D + b * b * MatrixX(at.K.diagonal().cwiseMax(0.).asDiagonal())) * N);
      const MatrixX Y = root.matrixL().solve(MatrixX(N.transpose()));
      VectorX velocities = V + answer.head(size) - Y.transpose() * (Y * (b * contact_force));
      const VelocityBlock block{0, static_cast<int>(size), Y.data(), static_cast<int>(Y.rows()),
                                static_cast<int>(Y.rows())};
      std::vector<ContactConstraint> contacts(num_contacts);
      std::vector<LimitConstraint> limits;
      const double k = system.contact_stiffness;
      for (std::size_t i = 0; i < num_contacts; ++i) {
        const ContactPair& pair = system.contacts[i];
        const ContactGeometry& g = geometry[i];
        ContactConstraint& c = contacts[i];
        c.friction = pair.friction;
        double moved = 0;  // J_n V of the velocity that belongs to the pose at hand
        if (pair.a >= 0) {
          c.port_a = 6 * pair.a;
          c.J_a = g.J_a;
          moved += g.J_a.row(0).dot(V.segment<6>(6 * pair.a));
        }
        if (pair.b >= 0) {
          c.port_b = 6 * pair.b;
          c.J_b = g.J_b;
          moved += g.J_b.row(0).dot(V.segment<6>(6 * pair.b));
        }
        const double reach = b + system.contact_damping_time;
        c.compliance_normal = 1 / (b * reach * k);
        c.compliance_tangent = 1 / (b * b * k);
        c.previous_impulse = -b * k * (g.frame * input.xi[i]);
        c.previous_impulse.x() = 0;
        c.bias.x() = (g.gap - b * moved) / reach;
        if (input.restitution_speed.size() > 0 && input.restitution_speed(static_cast<Eigen::Index>(i)) > 0) {
          c.compliance_normal = c.compliance_tangent = 0;
          c.previous_impulse.setZero();
          c.bias.x() = -input.restitution_speed(static_cast<Eigen::Index>(i));
        }
        c.impulse = b * (g.frame * phi[i]);
      }
      ContactSolverOptions options;
      options.tolerance = 1e-12;
      options.max_relative_regularization = 1e12;
      solver.Solve({block}, contacts, limits, velocities, options);
      for (std::size_t i = 0; i < num_contacts; ++i) {
        const ContactPair& pair = system.contacts[i];
        const Vector3 local = contacts[i].impulse;
        if (pair.a >= 0) contact_impulse.segment<6>(6 * pair.a) += geometry[i].J_a.transpose() * local;
        if (pair.b >= 0) contact_impulse.segment<6>(6 * pair.b) += geometry[i].J_b.transpose() * local;
        const Vector3 impulse = geometry[i].frame.transpose() * local;
        const Vector3 normal = geometry[i].frame.row(0).transpose();
        phi[i] = impulse / b;
        xi[i] = -(impulse - normal * normal.dot(impulse)) / (b * k);
      }
      rhs.head(size) += contact_impulse - b * contact_force;
      answer = lu.solve(rhs);
    }
    ++counts->iterations;
    const VectorX delta = answer.head(size);
    V_from = V;
    V_step = delta;
    lambda_from = lambda;
    lambda_step = answer.tail(m) / b - lambda;
    lambda = answer.tail(m) / b;
    // Momentum by the impulses of this linear solve: internal ones cancel exactly.
    p = input.p + b * (at.f - at.D * delta - b * ((gauss_newton ? at.K : MatrixX(at.K + at.G)) * delta)) +
        at.J.transpose() * answer.tail(m) + contact_impulse;
    V += delta;
    step_size = delta.norm();
    V_size = V.norm();
    const std::vector<Pose> found = close(ComposeAll(input.poses, b * V));
    const VectorX moved = DifferenceAll(found, poses);
    poses = found;
    if (once) {
      solved = true;
      break;
    }
    if (settings.newton != Newton::kResidual && !to_momentum) {
      double largest = 0;
      for (Eigen::Index i = 0; i < size; i += 6)
        largest =
            std::max({largest, moved.segment<3>(i).norm(), moved.segment<3>(i + 3).norm() / system.size});
      if (largest <= settings.displacement_tolerance || iteration + 1 >= settings.max_iterations) {
        solved = largest <= settings.displacement_tolerance;
        break;
      }
    }
    if (!V.allFinite() && iteration >= kPatience) break;
    if (!V.allFinite()) iteration = kPatience - 1;
  }
  if (!solved) ++counts->unconverged;
  state->poses = poses;
  state->V_before = V_last;
  state->time_between = input.advance;
  state->V = V;
  state->p = p;
  state->p_rate = (p - input.p) / b;
  state->lambda = lambda;
  state->phi = phi;
  for (std::size_t i = 0; i < num_contacts; ++i) {
    // What opens has no rate: ξ = 0 is no motion of the surfaces.
    state->xi_rate[i] = phi[i].isZero(0) ? Vector3(Vector3::Zero()) : Vector3((xi[i] - input.xi[i]) / b);
  }
  state->xi = xi;
}

}  // namespace fork1s::lab
