#include <fork1s/contact/contact_solver.hpp>

#include <algorithm>

#include "compliant_newton.hpp"
#include "compliant_rows.hpp"

namespace fork1s {

namespace {

constexpr int kStiffer = 4;  // rounds; what they leave too deep the next step meets with its load known

void Measure(const internal::CompliantRows& rows, ContactSolverReport& report) {
  double impulse = 0, speed = 0;
  for (const internal::PointRows& point : rows.points) {
    if (point.impulse.isZero(0)) continue;
    ++report.active;
    ++(point.state == internal::PointState::kSliding ? report.sliding : report.sticking);
    impulse = std::max(impulse, point.impulse.norm());
    speed = std::max(speed, point.reach);
  }
  report.residual_impulse = report.residual * impulse;
  report.residual_speed = report.residual * speed;
}

}  // namespace

struct ContactSolver::Workspace {
  internal::CompliantRows rows;
  internal::CompliantNewton newton;
};

ContactSolver::ContactSolver() : work_(std::make_unique<Workspace>()) {}
ContactSolver::~ContactSolver() = default;
ContactSolver::ContactSolver(ContactSolver&&) noexcept = default;
ContactSolver& ContactSolver::operator=(ContactSolver&&) noexcept = default;

void ContactSolver::Reserve(int num_contacts, int num_limits, int num_velocities, int num_freedoms) {
  work_->rows.Reserve(std::max(0, num_contacts), std::max(0, num_limits), std::max(0, num_velocities),
                      std::max(0, num_freedoms));
  work_->newton.Reserve(std::max(0, num_velocities));
}

ContactSolverReport ContactSolver::Solve(const std::vector<VelocityBlock>& blocks,
                                         std::vector<ContactConstraint>& contacts,
                                         std::vector<LimitConstraint>& limits, Eigen::Ref<VectorX> velocities,
                                         const ContactSolverOptions& options) {
  ContactSolverReport report;
  if (contacts.empty() && limits.empty()) {
    report.converged = velocities.allFinite();
    return report;
  }
  internal::CompliantRows& rows = work_->rows;
  const auto give_up = [&] {
    for (ContactConstraint& contact : contacts) {
      contact.impulse.setZero();
      contact.moment.setZero();
    }
    for (LimitConstraint& limit : limits) limit.impulse = 0;
    report.converged = false;
    return report;
  };
  if (!velocities.allFinite() || !rows.Prepare(blocks, contacts, limits, velocities, options.most_give))
    return give_up();
  internal::NewtonOutcome outcome =
      work_->newton.Solve(rows, options.tolerance, options.max_newton_iterations);
  // What comes down suddenly presses its material in too deep: once more with a stiffer one.
  for (int round = 0; round < kStiffer && outcome.converged && rows.Stiffen(); ++round) {
    const internal::NewtonOutcome again =
        work_->newton.Solve(rows, options.tolerance, options.max_newton_iterations);
    outcome.iterations += again.iterations;
    outcome.stage = std::max(outcome.stage, again.stage);
    outcome.converged = again.converged;
    outcome.residual = again.residual;
  }
  report.newton_iterations = outcome.iterations;
  report.stage = outcome.stage;
  report.residual = outcome.residual;
  report.converged = outcome.converged;
  if (!std::isfinite(outcome.residual)) return give_up();
  for (std::size_t i = 0; i < rows.points.size(); ++i) {
    ContactConstraint& contact = contacts[static_cast<std::size_t>(rows.place(i))];
    contact.impulse = rows.points[i].impulse;
    contact.moment = rows.points[i].moment;
    contact.use = rows.points[i].use;
  }
  for (std::size_t i = 0; i < limits.size(); ++i) limits[i].impulse = rows.limits[i].impulse;
  Measure(rows, report);
  rows.AddChange(work_->newton.change().data(), velocities);
  return report;
}

}  // namespace fork1s
