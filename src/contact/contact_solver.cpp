#include <fork1s/contact/contact_solver.hpp>

#include <algorithm>

#include "contact_rows.hpp"
#include "newton.hpp"
#include "splitting.hpp"

// Projected Gauss-Seidel on 3 x 3 blocks: each contact in turn solves Coulomb's law exactly with all others
// held, and its change goes into the velocities through the cached columns K = W Jᵀ (docs/method.md,
// contact). A chain of contacts with a heavy body at its end converges slowly; Newton then takes over,
// and alternating directions where Newton stalls.
namespace fork1s {
namespace {

// Sweeps stop below this fraction of the tolerance, so that what is reported stands clear of it and the
// next step starts from a good warm start.
constexpr double kStopFraction = 0.1;

// A result that misses the law by this much, or by less with impulses this far above the momentum at hand,
// would throw bodies about: a wedge that no impulse can open, for instance.
constexpr double kGross = 0.1, kBlownUp = 1e3;

}  // namespace

struct ContactSolver::Workspace {
  internal::RowSet rows;
  internal::NewtonSolver newton;
  internal::SplittingSolver splitting;
};

ContactSolver::ContactSolver() : work_(std::make_unique<Workspace>()) {}
ContactSolver::~ContactSolver() = default;
ContactSolver::ContactSolver(ContactSolver&&) noexcept = default;
ContactSolver& ContactSolver::operator=(ContactSolver&&) noexcept = default;

void ContactSolver::Reserve(int num_contacts, int num_limits, int num_velocities, int num_moments) {
  const std::size_t contacts = static_cast<std::size_t>(std::max(0, num_contacts));
  const std::size_t limits = static_cast<std::size_t>(std::max(0, num_limits));
  const std::size_t moments = static_cast<std::size_t>(std::max(0, num_moments));
  const std::size_t velocities = static_cast<std::size_t>(std::max(0, num_velocities));
  // A contact's response covers at most two blocks, which together are no longer than the velocities.
  const std::size_t longest = velocities + 8;
  internal::RowSet& rows = work_->rows;
  rows.contacts.reserve(contacts);
  rows.limits.reserve(limits);
  rows.moments.reserve(moments);
  rows.storage.reserve(longest * (3 * contacts + limits + moments));
  rows.block_of.reserve(velocities);
  rows.start.reserve(velocities + 4);
  rows.velocity.reserve(velocities + 4);
  const std::size_t all = 3 * contacts + limits + moments;
  rows.kept.reserve(all);
  const int dense = std::min(static_cast<int>(all), ContactSolverOptions{}.max_newton_rows);
  work_->newton.Reserve(dense);
  work_->splitting.Reserve(dense);
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
  internal::RowSet& rows = work_->rows;
  const auto give_up = [&] {
    for (ContactConstraint& contact : contacts) {
      contact.impulse.setZero();
      contact.moment.setZero();
    }
    for (LimitConstraint& limit : limits) limit.impulse = 0;
    report.converged = false;
    return report;
  };
  if (!rows.Prepare(blocks, contacts, limits, velocities)) return give_up();
  rows.ResetVelocity();

  const double goal = kStopFraction * options.tolerance;
  report.residual = rows.Residual();
  while (report.residual > goal && report.sweeps < options.max_sweeps) {
    const double change = rows.Sweep();
    ++report.sweeps;
    // The change of a sweep is a cheap hint; the residual itself is asked only when the hint is good.
    if (change <= goal * rows.ResidualScale()) report.residual = rows.Residual();
  }
  rows.ResetVelocity();
  report.residual = rows.Residual();
  const int num_rows = static_cast<int>(3 * contacts.size() + limits.size() + rows.moments.size());
  if (!(report.residual <= options.tolerance) && num_rows <= options.max_newton_rows) {
    report.newton_iterations = work_->newton.Solve(rows, options.tolerance, options.max_newton_iterations);
    report.residual = rows.Residual();
    if (!(report.residual <= options.tolerance)) {
      const double before = report.residual;
      rows.KeepImpulses();
      report.splitting_iterations =
          work_->splitting.Solve(rows, work_->newton.A(), work_->newton.b(),
                                 kStopFraction * options.tolerance, options.max_splitting_iterations);
      report.newton_iterations += work_->newton.Solve(rows, options.tolerance, options.max_newton_iterations);
      report.residual = rows.Residual();
      if (!(report.residual < before)) {
        rows.RestoreImpulses();
        report.residual = before;
      }
      if (report.residual > kGross ||
          (!(report.residual <= options.tolerance) && rows.LargestImpulse() > kBlownUp * rows.momentum)) {
        report.splitting_iterations +=
            work_->splitting.SolveSafely(rows, work_->newton.A(), work_->newton.b(),
                                         kStopFraction * options.tolerance, options.max_splitting_iterations);
        report.residual = rows.Residual();
        report.fallback = true;
      }
    }
  }
  report.converged = report.residual <= options.tolerance && !report.fallback;

  const Eigen::Map<const VectorX> solved(rows.velocity.data(), velocities.size());
  if (!solved.allFinite()) return give_up();
  velocities = solved;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const internal::ContactRow& row = rows.contacts[i];
    const double* l = row.impulse;
    contacts[i].impulse = Vector3(l[0], row.c * l[1] - row.s * l[2], row.s * l[1] + row.c * l[2]);
    contacts[i].moment.setZero();
  }
  for (const internal::MomentRow& row : rows.moments)
    contacts[static_cast<std::size_t>(row.contact)].moment[row.axis] = row.impulse;
  for (std::size_t i = 0; i < limits.size(); ++i) limits[i].impulse = rows.limits[i].impulse;
  return report;
}

}  // namespace fork1s
