#include <fork1s/constraints/contact_solver.hpp>

#include <algorithm>

#include "regularized_contact_problem.hpp"
#include "regularized_newton.hpp"

namespace fork1s {

namespace {

constexpr int kStiffer = 4;  // rounds; what they leave too deep the next step meets with its load known

void Measure(const internal::RegularizedContactProblem& rows, ContactSolverReport& report) {
  double impulse = 0, speed = 0;
  for (const internal::PointRows& point : rows.points) {
    if (point.impulse.isZero(0)) continue;
    ++report.active;
    ++(point.linearization.mode == internal::ContactMode::kSliding ? report.sliding : report.sticking);
    impulse = std::max(impulse, point.impulse.norm());
    speed = std::max(speed, point.reach);
  }
  report.residual_impulse = report.residual * impulse;
  report.residual_speed = report.residual * speed;
}

}  // namespace

struct ContactSolver::Workspace {
  internal::RegularizedContactProblem rows;
  internal::SemismoothNewton semismooth;
  internal::RegularizedNewton fallbacks;
  std::vector<double> guess, change;  // d, in freedoms
  std::vector<int> taken;             // contacts that take part, in order
  std::vector<char> is_taken;
  VectorX start;  // velocities

  bool AddClosingContacts(const std::vector<ContactConstraint>& contacts,
                          const Eigen::Ref<const VectorX>& velocities);
  void StoreImpulses(std::vector<ContactConstraint>& contacts, std::vector<LimitConstraint>& limits) const;
};

// Contacts that were left out and that these velocities close. False where there is none.
bool ContactSolver::Workspace::AddClosingContacts(const std::vector<ContactConstraint>& contacts,
                                                  const Eigen::Ref<const VectorX>& velocities) {
  bool any = false;
  for (std::size_t i = 0; i < contacts.size(); ++i)
    if (!is_taken[i] && contacts[i].NormalSpeed(velocities) < 0) is_taken[i] = any = true;
  return any;
}

void ContactSolver::Workspace::StoreImpulses(std::vector<ContactConstraint>& contacts,
                                             std::vector<LimitConstraint>& limits) const {
  for (std::size_t i = 0; i < rows.points.size(); ++i) {
    ContactConstraint& contact = contacts[static_cast<std::size_t>(rows.place(i))];
    contact.impulse = rows.points[i].impulse.cwiseProduct(rows.points[i].scale);
    contact.moment = rows.points[i].moment.cwiseProduct(rows.points[i].scale);
    contact.utilization = rows.points[i].utilization;
  }
  for (const internal::PairRows& pair : rows.pairs)
    for (int i = pair.first; i < pair.first + pair.count; ++i)
      contacts[static_cast<std::size_t>(rows.place(static_cast<std::size_t>(i)))].gives_way = pair.gives_way;
  for (std::size_t i = 0; i < limits.size(); ++i) limits[i].impulse = rows.limits[i].impulse;
}

ContactSolver::ContactSolver() : work_(std::make_unique<Workspace>()) {}
ContactSolver::~ContactSolver() = default;
ContactSolver::ContactSolver(ContactSolver&&) noexcept = default;
ContactSolver& ContactSolver::operator=(ContactSolver&&) noexcept = default;

void ContactSolver::Reserve(int num_contacts, int num_limits, int num_velocities, int num_freedoms) {
  work_->rows.Reserve(std::max(0, num_contacts), std::max(0, num_limits), std::max(0, num_velocities),
                      std::max(0, num_freedoms));
  work_->semismooth.Reserve(std::max(0, num_velocities));
  work_->fallbacks.Reserve(std::max(0, num_contacts), std::max(0, num_limits), std::max(0, num_velocities));
  for (std::vector<double>* v : {&work_->guess, &work_->change})
    v->reserve(static_cast<std::size_t>(std::max(0, num_velocities)));
  work_->taken.reserve(static_cast<std::size_t>(std::max(0, num_contacts)));
  work_->is_taken.reserve(static_cast<std::size_t>(std::max(0, num_contacts)));
  if (work_->start.size() < num_velocities) work_->start.resize(num_velocities);
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
  Workspace& work = *work_;
  internal::RegularizedContactProblem& rows = work.rows;
  const auto give_up = [&] {
    for (ContactConstraint& contact : contacts) {
      contact.impulse.setZero();
      contact.moment.setZero();
    }
    for (LimitConstraint& limit : limits) limit.impulse = 0;
    report.converged = false;
    return report;
  };
  if (!velocities.allFinite()) return give_up();
  // What stays open changes nothing, and most of what is near does: it is looked at when the others are
  // solved. Where they close it the answer is found again with it.
  work.is_taken.resize(contacts.size());
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    work.is_taken[i] = !contacts[i].IsDeferred();
    contacts[i].utilization = 0;
    contacts[i].gives_way = false;
  }
  if (work.start.size() < velocities.size()) work.start.resize(velocities.size());
  work.start.head(velocities.size()) = velocities;
  for (bool again = false;; again = true) {
    work.taken.clear();
    for (std::size_t i = 0; i < contacts.size(); ++i)
      if (work.is_taken[i]) work.taken.push_back(static_cast<int>(i));
    if (again) velocities = work.start.head(velocities.size());
    if (!rows.Prepare(blocks, contacts, work.taken, limits, velocities, options.max_relative_regularization))
      return give_up();
    // What comes down suddenly presses its material in too deep: once more with a stiffer one, unless it is driven.
    for (int round = 0;; ++round) {
      work.guess.resize(static_cast<std::size_t>(rows.freedoms()));
      rows.Push(work.guess.data());
      work.change = work.guess;
      report.converged =
          work.semismooth.Solve(rows, work.change, options.tolerance, report.newton_iterations);
      if (!report.converged) {
        work.change = work.guess;
        work.fallbacks.Solve(rows, work.semismooth, options, work.change, report);
      }
      if (round == kStiffer || !report.converged || !rows.IsPressedIn()) break;
      const bool probes = round == 1;  // most are held by then
      if (probes) {
        rows.BeginProbe();
        rows.Push(work.change.data());
        rows.EndProbe(work.semismooth.Solve(rows, work.change, options.tolerance, report.newton_iterations));
      }
      if (!rows.DecreaseRegularization() && !probes) break;
    }
    report.residual = work.semismooth.Residual(rows);
    if (!std::isfinite(report.residual)) return give_up();
    work.StoreImpulses(contacts, limits);
    rows.AddChange(work.change.data(), velocities);
    if (!work.AddClosingContacts(contacts, velocities)) break;
  }
  Measure(rows, report);
  return report;
}

}  // namespace fork1s
