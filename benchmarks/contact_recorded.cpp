// Contact problems as scenes pose them, taken out of the run and solved again: cold, warm, and by a second
// method.
//
//     build/release/benchmarks/contact_recorded SECONDS EVERY MODEL... > FILE.csv
//
// Every step of 1/60 s in which anything may touch is a problem. Cold: no impulses known. Warm: those of the
// step before, as the step itself began. `same` is the largest difference of any velocity that the two end
// with, and `law` the largest violation of Coulomb's law, recomputed from its definition; both as shares of
// the fastest contact velocity. Every EVERYth problem is solved by plain sweeps too, which share no code with
// the solver; where those settle, `other` is the largest difference to them. (Sweeps know no moments:
// problems with torsional friction are left to the solver.)
#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fork1s/world/world.hpp>
#include <plain_sweeps.hpp>
#include <random_problems.hpp>
#include <string>
#include <vector>

#include "benchmarks.hpp"
#include "constraints/contact_problem.hpp"
#include "scene_run.hpp"

namespace fork1s::benchmarks::contact_recorded {
namespace {
using namespace fork1s::testing;

constexpr double kTimeStep = 1.0 / 60;  // s

// Its blocks are views of what is given.
Problem ProblemOf(const ContactProblem& given) {
  Problem p;
  for (const MatrixX& y : given.Y) p.W.push_back(y.transpose() * y);
  p.blocks = given.Blocks();
  p.contacts = given.contacts;
  p.limits = given.limits;
  p.velocity = given.velocity;
  return p;
}

// What the solver settles before it solves, said in the problem, so that other methods need not know: contacts
// between the same two ports give alike, as the stiffest of them; what they bore is kept as given, squeeze
// and all, as of points that slid; and impacts are made no harder.
void SayPlainly(Problem& p) {
  for (ContactConstraint& a : p.contacts) {
    a.hardening_speed = std::numeric_limits<double>::infinity();
    a.previous_utilization = 2;
    for (const ContactConstraint& b : p.contacts)
      if (a.port_a == b.port_a && a.port_b == b.port_b) {
        a.compliance_normal = std::min(a.compliance_normal, b.compliance_normal);
        a.compliance_tangent = std::min(a.compliance_tangent, b.compliance_tangent);
      }
  }
}

// Of any contact [m/s].
double FastestContact(const Problem& p, const VectorX& velocity) {
  double fastest = 0;
  for (const ContactConstraint& c : p.contacts) {
    Vector3 u = Vector3::Zero();
    if (c.port_a >= 0) u += c.J_a * velocity.segment<6>(c.port_a);
    if (c.port_b >= 0) u += c.J_b * velocity.segment<6>(c.port_b);
    fastest = std::max(fastest, u.norm());
  }
  return fastest;
}

double LargestContactDifference(const Problem& p, const VectorX& a, const VectorX& b) {
  return FastestContact(p, a - b);
}

struct Row {
  std::vector<int> cold, warm;
  int cold_unsolved = 0, warm_unsolved = 0, helped = 0, swept = 0, settled = 0;
  std::size_t contacts = 0;
  double same = 0, law = 0, other = 0;

  static int At(std::vector<int>& x, double share) {
    if (x.empty()) return 0;
    std::sort(x.begin(), x.end());
    return x[static_cast<std::size_t>(share * static_cast<double>(x.size() - 1))];
  }
};

void Add(const ContactProblem& given, bool sweep, ContactSolver& solver, Row& row) {
  Problem p = ProblemOf(given);
  const VectorX start = p.velocity;
  row.contacts = std::max(row.contacts, p.contacts.size());
  const ContactSolverReport warm = solver.Solve(p.blocks, p.contacts, p.limits, p.velocity);
  const VectorX by_warm = p.velocity;
  row.warm.push_back(warm.newton_iterations);
  row.warm_unsolved += !warm.converged;
  row.helped += warm.fallback > 0;

  Problem c = ProblemOf(given);
  for (ContactConstraint& contact : c.contacts) contact.impulse = contact.moment = Vector3::Zero();
  for (LimitConstraint& limit : c.limits) limit.impulse = 0;
  const ContactSolverReport cold = solver.Solve(c.blocks, c.contacts, c.limits, c.velocity);
  row.cold.push_back(cold.newton_iterations);
  row.cold_unsolved += !cold.converged;
  const double fastest = std::max(1e-9, FastestContact(p, start));
  if (warm.converged && cold.converged)
    row.same = std::max(row.same, LargestContactDifference(p, by_warm, c.velocity) / fastest);

  Problem plain = ProblemOf(given);
  SayPlainly(plain);
  ContactSolverOptions as_given;
  as_given.max_relative_regularization =
      1e9;  // quarters of a step through an impact are short, and their springs slack
  if (!solver.Solve(plain.blocks, plain.contacts, plain.limits, plain.velocity, as_given).converged) return;
  row.law = std::max(row.law, LawViolation(plain, start, plain.velocity));
  const bool moments = std::any_of(plain.contacts.begin(), plain.contacts.end(),
                                   [](const ContactConstraint& x) { return x.torsion > 0 || x.rolling > 0; });
  if (!sweep || moments || FastestContact(plain, start) < 1e-9) return;  // nothing moves
  ++row.swept;
  Problem swept = ProblemOf(given);
  SayPlainly(swept);
  constexpr int kSweeps = 200000;  // seconds: squeeze fades by what the material gives, 1e-4 a sweep
  const SweepResult other = SweepPlainly(swept, 1e-9, kSweeps);
  if (!other.settled) return;
  ++row.settled;
  row.other = std::max(row.other, LargestContactDifference(plain, other.velocity, plain.velocity) / fastest);
}

bool Print(const std::string& path, double seconds, int every) {
  Row row;
  ContactSolver solver;
  int problems = 0;
  const bool ran = RunScene(path, seconds, kTimeStep, [&](Simulation& simulation, const StepReport& report) {
    if (!report.finite) return false;
    const ContactProblem problem = simulation.world().LastContactProblem();
    if (problem.contacts.empty()) return true;
    Add(problem, problems++ % every == 0, solver, row);
    return true;
  });
  if (!ran) return false;
  fmt::print("{},{},{},{},{},{},{},{},{},{},{},{:.1e},{:.1e},{},{},{:.1e}\n",
             std::filesystem::path(path).stem().string(), problems, row.contacts, Row::At(row.cold, 0.5),
             Row::At(row.cold, 0.99), row.cold_unsolved, Row::At(row.warm, 0.5), Row::At(row.warm, 0.9),
             Row::At(row.warm, 0.99), row.helped, row.warm_unsolved, row.same, row.law, row.swept,
             row.settled, row.other);
  std::fflush(stdout);
  return true;
}

}  // namespace

int Main(int argc, char** argv) {
  if (argc < 4 || std::atof(argv[1]) <= 0 || std::atoi(argv[2]) <= 0) {
    fmt::print(stderr, "usage: contact_recorded SECONDS EVERY MODEL...\n");
    return 2;
  }
  fmt::print(
      "scene,problems,contacts_most,cold_median,cold_p99,cold_unsolved,warm_median,warm_p90,warm_p99,"
      "warm_helped,warm_unsolved,same,law,swept,settled,other\n");
  bool good = true;
  for (int i = 3; i < argc; ++i) good = Print(argv[i], std::atof(argv[1]), std::atoi(argv[2])) && good;
  return good ? 0 : 3;
}

}  // namespace fork1s::benchmarks::contact_recorded
