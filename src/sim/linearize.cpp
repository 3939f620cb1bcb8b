#include "linearization.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <cmath>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <limits>
#include <numeric>
#include <utility>

#include "linalg/null_space.hpp"
#include "linalg/select.hpp"
#include "linalg/solve.hpp"

namespace fork1s {
namespace {

using Reference = LinearizedStep::Reference;

constexpr const char* kSix[] = {"rx", "ry", "rz", "x", "y", "z"};
// Share by which differences to both sides may differ where nothing switches. Of a smooth step it is its curvature,
// some 1/(1 rad), times the change.
constexpr double kSwitch = 0.01, kLargestChange = 0.01;

// Joint coordinates, in their units of length or angle, that tell all others.
std::vector<int> IndependentJoints(const MechanismDynamics& m) {
  if (m.model().size() == 0) return {};
  const VectorX inverse_units = m.model().h_inverse.cwiseSqrt().cwiseInverse();
  return ComputeNullSpace(inverse_units.asDiagonal() * m.configuration().Q_now).independent_rows;
}

int SizeOf(const Reference& of) { return static_cast<int>(of.q.size()) + (of.has_base ? 6 : 0); }

Vector6 PoseDeviation(const RigidTransform& X, const RigidTransform& from) {
  Vector6 out;
  out << LogRotation(X.rotation() * from.rotation().transpose()), X.translation() - from.translation();
  return out;
}

RigidTransform MovedPose(const RigidTransform& from, const Vector6& by) {
  return {Matrix3(ExpRotation(by.head<3>()) * from.rotation()), Vector3(from.translation() + by.tail<3>())};
}

Vector6 BaseTwist(const MechanismDynamics& m) { return InAxes(m.state().X_WR.rotation(), m.state().V_R); }

Reference ReferenceOf(const MechanismDynamics& m) {
  Reference out;
  out.joints = IndependentJoints(m);
  out.q = Entries(m.configuration().q, out.joints);
  out.q_dot = Entries(m.configuration().Q_now * m.state().w, out.joints);
  out.has_base = m.mechanism().base() == BaseKind::kFloating;
  out.X = m.state().X_WR;
  out.V = BaseTwist(m);
  for (Eigen::Index k = 0; k < m.controls().size(); ++k)
    if (m.HasDynamics(k)) out.controls.push_back(static_cast<int>(k));
  out.activation = Entries(m.activation(), out.controls);
  return out;
}

Reference ReferenceOf(const FreeBody& body) {
  Reference out;
  out.has_base = true;
  out.X = body.pose();
  out.V = body.OriginVelocity();
  return out;
}

// The state of a mechanism at x* with its coordinates, rates and activations moved by p, v and a. `inverse`: of the rows
// of dq/dz of the independent joints at x*.
void Move(const Reference& from, const MatrixX& inverse, const VectorX& p, const VectorX& v, const VectorX& a,
          MechanismState& state) {
  for (std::size_t k = 0; k < from.controls.size(); ++k)
    state.activation(from.controls[k]) =
        from.activation(static_cast<Eigen::Index>(k)) + a(static_cast<Eigen::Index>(k));
  const auto joints = from.q.size();
  if (joints > 0 && p.head(joints).isZero(0)) {
    state.reduced.w += inverse * v.head(joints);
  } else if (joints > 0) {
    const ReducedModel& model = *state.model;
    Configuration at(model);
    at.closing_tolerance = ClosedToRounding(*model.mechanism);
    at.mu = state.mu;
    state.reduced.z += inverse * p.head(joints);
    // Where loops bend, q follows z to second order. Of changes of 1e-6 each correction leaves 1e-6.
    for (int i = 0; i < 2; ++i) {
      Configure(model, state.reduced, at);
      state.reduced.z += inverse * (from.q + p.head(joints) - Entries(at.q, from.joints));
    }
    Configure(model, state.reduced, at);
    for (int i = 0; i < 3; ++i)
      state.reduced.w +=
          inverse * (from.q_dot + v.head(joints) - Entries(at.Q_now * state.reduced.w, from.joints));
    state.mu = at.mu;
  }
  if (!from.has_base) return;
  state.reduced.X_WR = MovedPose(from.X, p.tail<6>());
  state.reduced.V_R = InAxes(state.reduced.X_WR.rotation().transpose(), from.V + v.tail<6>());
}

// The moment with loops closed to rounding, as in all states beside it.
Simulation::Snapshot CloseLoops(Simulation::Snapshot moment) {
  for (MechanismState& state : moment.world.mechanisms) {
    if (state.mu.size() == 0) continue;
    Configuration at(*state.model);
    at.closing_tolerance = ClosedToRounding(*state.model->mechanism);
    at.mu = state.mu;
    Configure(*state.model, state.reduced, at);
    state.mu = at.mu;
  }
  return moment;
}

void Move(const Reference& from, const FreeBody& body, const VectorX& p, const VectorX& v,
          FreeBody::State& state) {
  const Vector6 V = from.V + v;
  state.X_WB = MovedPose(from.X, p);
  const Matrix3& R = state.X_WB.rotation();
  const Vector3 omega = V.head<3>(), arm = R * body.inertia().center;
  state.omega_B = R.transpose() * omega;
  state.velocity = V.tail<3>() + omega.cross(arm);
}

void NameSix(const std::string& of, std::vector<std::string>& names) {
  for (const char* coordinate : kSix) names.push_back(of + "." + coordinate);
}

// δx of the state of a simulation, counted from that of `mechanisms` and `free_bodies`.
VectorX DeviationFrom(const std::vector<Reference>& mechanisms, const std::vector<Reference>& free_bodies,
                      const Simulation& simulation) {
  Eigen::Index n = 0, activations = 0;
  for (const std::vector<Reference>* of : {&mechanisms, &free_bodies})
    for (const Reference& from : *of) {
      n += SizeOf(from);
      activations += from.activation.size();
    }
  VectorX dx(2 * n + activations);
  Eigen::Index at = 0, activation = 2 * n;
  const auto base = [&](const Reference& from, const RigidTransform& X, const Vector6& V) {
    dx.segment<6>(at) = PoseDeviation(X, from.X);
    dx.segment<6>(n + at) = V - from.V;
    at += 6;
  };
  for (std::size_t i = 0; i < mechanisms.size(); ++i) {
    const Reference& from = mechanisms[i];
    const MechanismDynamics& m = simulation.world().mechanisms()[i];
    const auto joints = from.q.size();
    dx.segment(at, joints) = Entries(m.configuration().q, from.joints) - from.q;
    dx.segment(n + at, joints) = Entries(m.configuration().Q_now * m.state().w, from.joints) - from.q_dot;
    at += joints;
    if (from.has_base) base(from, m.state().X_WR, BaseTwist(m));
    const auto k = static_cast<Eigen::Index>(from.controls.size());
    dx.segment(activation, k) = Entries(m.activation(), from.controls) - from.activation;
    activation += k;
  }
  for (std::size_t i = 0; i < free_bodies.size(); ++i) {
    const FreeBody& body = simulation.world().free_bodies()[i];
    base(free_bodies[i], body.pose(), body.OriginVelocity());
  }
  return dx;
}

// The contact of the same two shapes that is nearest; none where they do not touch.
const ContactRecord* FindContact(const ContactRecord& like, const std::vector<ContactRecord>& among) {
  const auto key = [](const ContactPoint& p) {
    return std::array{p.body_a, p.body_b, p.geometry_a, p.geometry_b};
  };
  const ContactRecord* nearest = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const ContactRecord& c : among) {
    const double distance = (c.point.point - like.point.point).squaredNorm();
    if (key(c.point) != key(like.point) || distance >= least) continue;
    nearest = &c;
    least = distance;
  }
  return nearest;
}

}  // namespace

bool LinearizedStep::IsOf(const Simulation& simulation) const {
  const World& world = simulation.world();
  return world.mechanisms().size() == mechanisms.size() && world.free_bodies().size() == free_bodies.size() &&
         simulation.CoordinateNames().size() == num_joints;
}

VectorX LinearizedStep::Deviation(const Simulation& simulation) const {
  FORK1S_REQUIRE(IsOf(simulation), "a simulation of another model than the one that was linearized");
  return DeviationFrom(mechanisms, free_bodies, simulation);
}

namespace internal {

Linearization::Linearization(Simulation& simulation, LinearizeOptions options)
    : simulation_(simulation),
      options_(std::move(options)),
      given_(simulation.step_options()),
      start_(simulation.Save()),
      closed_start_(CloseLoops(start_)) {
  simulation.step_options().refresh = false;
  simulation.step_options().newton_tolerance = kToRounding;
  Restore(closed_start_);
  ListCoordinates();
  ListForces();
  ListInputs();
}

Linearization::~Linearization() {
  simulation_.step_options() = given_;
  static_cast<void>(simulation_.Restore(start_));  // fits, where nobody made another scene of it meanwhile
}

Expected<std::unique_ptr<Linearization>> Linearization::Begin(Simulation& simulation,
                                                              LinearizeOptions options) {
  const auto refuse = [](const std::string& what) { return Fail(ErrorCode::kUsage, "linearization", what); };
  if (!(options.change > 0 && options.change <= kLargestChange))
    return refuse(fmt::format("change = {}; give a number above 0 and up to 0.01", options.change));
  const auto bodies = static_cast<int>(simulation.bodies().size()),
             controls = static_cast<int>(simulation.control_names().size());
  for (const int body : options.outputs)
    if (body < 0 || body >= bodies)
      return refuse(fmt::format("there is no body {}; bodies are 0 to {}", body, bodies - 1));
  if (!options.inputs) {
    options.inputs.emplace(static_cast<std::size_t>(controls));
    std::iota(options.inputs->begin(), options.inputs->end(), 0);
  }
  for (const int input : *options.inputs)
    if (input < 0 || input >= controls)
      return refuse(fmt::format("there is no control {}; controls are 0 to {}", input, controls - 1));
  if (!simulation.frozen_grasps().empty())
    return refuse("bodies are held by frozen contacts; let them go by another level of detail");
  std::unique_ptr<Linearization> out(new Linearization(simulation, std::move(options)));
  if (out->options_.end)
    if (auto done = simulation.Restore(CloseLoops(*out->options_.end)); !done)
      return tl::unexpected(done.error());
  out->counts_from_ = out->StateAt(out->options_.end ? *out->options_.end : out->start_);
  out->next_.resize(out->size_ + static_cast<Eigen::Index>(out->counts_from_.forces.size()),
                    out->change_.size());
  return out;
}

// Names, references and by how much each coordinate is moved.
void Linearization::ListCoordinates() {
  std::vector<double> changes, of_activations;
  const std::vector<std::string> names = simulation_.CoordinateNames();
  out_.num_joints = names.size();
  std::size_t first = 0;
  for (const MechanismDynamics& m : simulation_.world().mechanisms()) {
    const Reference& reference = out_.mechanisms.emplace_back(ReferenceOf(m));
    has_friction_ |= !m.mechanism().frictions().empty();
    const auto joints = static_cast<Eigen::Index>(reference.joints.size());
    inverses_.push_back(SolveSquare(Rows(MatrixX(m.configuration().Q_now), reference.joints),
                                    MatrixX::Identity(joints, joints)));
    for (const int i : reference.joints) {
      out_.coordinates.push_back(names[first + static_cast<std::size_t>(i)]);
      changes.push_back(std::sqrt(m.model().h_inverse(i)));
    }
    first += static_cast<std::size_t>(m.mechanism().num_coordinates());
    for (std::size_t k = 0; k < reference.controls.size(); ++k) {
      out_.activations.push_back(
          m.mechanism().controls()[static_cast<std::size_t>(reference.controls[k])].name);
      of_activations.push_back(std::max(1.0, std::abs(reference.activation(static_cast<Eigen::Index>(k)))));
    }
    if (reference.has_base) ListBase(m.mechanism().bodies()[0].name, m.mechanism().length_scale(), changes);
  }
  for (const FreeBody& body : simulation_.world().free_bodies()) {
    out_.free_bodies.push_back(ReferenceOf(body));
    ListBase(body.name(), std::sqrt(body.inertia().rotational.trace() / body.inertia().mass), changes);
  }
  const auto n = static_cast<Eigen::Index>(changes.size()),
             k = static_cast<Eigen::Index>(of_activations.size());
  out_.dt = simulation_.dt();
  change_.resize(2 * n + k);
  change_.head(n) = options_.change * Eigen::Map<const VectorX>(changes.data(), n);
  change_.segment(n, n) = change_.head(n) / out_.dt;
  change_.tail(k) = options_.change * Eigen::Map<const VectorX>(of_activations.data(), k);
}

void Linearization::ListBase(const std::string& name, double length, std::vector<double>& changes) {
  NameSix(name, out_.coordinates);
  for (int i = 0; i < 6; ++i) changes.push_back(i < 3 ? 1 : length);
}

void Linearization::ListInputs() {
  const auto size = change_.size(), m = static_cast<Eigen::Index>(options_.inputs->size()),
             m_start = options_.start_controls ? m : 0;
  change_.conservativeResize(size + m + m_start);
  for (Eigen::Index k = 0; k < m; ++k) {
    const int input = (*options_.inputs)[static_cast<std::size_t>(k)];
    out_.inputs.push_back(simulation_.control_names()[static_cast<std::size_t>(input)]);
    change_(size + k) = options_.change * std::max(1.0, std::abs(start_.controls(input)));
  }
  change_.tail(m_start) = change_.segment(size, m_start);
  for (const int body : options_.outputs)
    NameSix(simulation_.bodies()[static_cast<std::size_t>(body)].name, out_.outputs);
  out_.controls = start_.controls;
}

std::string Linearization::NameOf(Eigen::Index variable) const {
  const auto n = out_.coordinates.size(), k = out_.activations.size(), m = out_.inputs.size();
  auto i = static_cast<std::size_t>(variable);
  if (i < n) return out_.coordinates[i];
  if (i < 2 * n) return "rate of " + out_.coordinates[i - n];
  if (i < 2 * n + k) return "activation of " + out_.activations[i - 2 * n];
  i -= 2 * n + k;
  if (i < forces_.size()) return out_.forces[i];
  i -= forces_.size();
  return i < m ? out_.inputs[i] : "start of " + out_.inputs[i - m];
}

std::string Linearization::NameOf(const Force& force) const {
  if (force.contact < 0)
    return fmt::format("friction {} of {}", force.at,
                       simulation_.world().NameOf({StepSubject::Kind::kMechanism, force.mechanism, -1}));
  const ContactPoint& point = start_.world.contacts[static_cast<std::size_t>(force.contact)].point;
  constexpr const char* kComponents[] = {"normal force", "friction 1", "friction 2",
                                         "torsion",      "rolling 1",  "rolling 2"};
  return fmt::format("{} of {}", kComponents[force.at],
                     simulation_.world().NameOf({StepSubject::Kind::kContact, point.body_a, point.body_b}));
}

// Those that are not zero, each to be varied by a share of what its contact or joint bears.
std::vector<Linearization::Force> Linearization::ForcesOf(const WorldState& state) const {
  std::vector<Force> out;
  if (!options_.friction_forces) return out;
  // Springs of contacts give way by micrometres, of which differences have to tell a share.
  const double share = 100 * options_.change;
  for (std::size_t i = 0; i < state.contacts.size(); ++i) {
    const ContactRecord& c = state.contacts[i];
    const double force = c.end_force.norm(), moment = c.end_moment.norm();
    for (int k = 0; k < 6; ++k)
      if (const double bears = k < 3 ? force : moment; bears > 0)
        out.push_back({static_cast<int>(i), -1, k, share * bears});
  }
  for (std::size_t i = 0; i < state.rows.size(); ++i)
    for (std::size_t k = 0; k < state.rows[i].friction_impulses.size(); ++k)
      if (const double bears = std::abs(state.rows[i].friction_impulses[k]); bears > 0)
        out.push_back({-1, static_cast<int>(i), static_cast<int>(k), share * bears});
  return out;
}

void Linearization::ListForces() {
  forces_ = ForcesOf(start_.world);
  size_ = change_.size();
  change_.conservativeResize(size_ + static_cast<Eigen::Index>(forces_.size()));
  for (std::size_t k = 0; k < forces_.size(); ++k) {
    change_(size_ + static_cast<Eigen::Index>(k)) = forces_[k].change;
    out_.forces.push_back(NameOf(forces_[k]));
  }
}

// Where the simulation stands, which is at `moment`.
Linearization::State Linearization::StateAt(const Simulation::Snapshot& moment) const {
  State out;
  for (const MechanismDynamics& m : simulation_.world().mechanisms())
    out.mechanisms.push_back(ReferenceOf(m));
  for (const FreeBody& body : simulation_.world().free_bodies()) out.free_bodies.push_back(ReferenceOf(body));
  out.forces = ForcesOf(moment.world);
  out.contacts = moment.world.contacts;
  out.rows = moment.world.rows;
  return out;
}

// From what deviations count from.
VectorX Linearization::PresentDeviation(const WorldState& present) const {
  VectorX out(next_.rows());
  out.head(size_) = DeviationFrom(counts_from_.mechanisms, counts_from_.free_bodies, simulation_);
  if (counts_from_.forces.empty()) return out;
  const std::vector<ContactRecord>& contacts = simulation_.world().contacts();
  for (std::size_t k = 0; k < counts_from_.forces.size(); ++k) {
    const Force& force = counts_from_.forces[k];
    double& deviation = out(size_ + static_cast<Eigen::Index>(k));
    if (force.contact < 0) {
      const auto impulse = [&](const std::vector<WorldState::Rows>& rows) {
        return rows[static_cast<std::size_t>(force.mechanism)]
            .friction_impulses[static_cast<std::size_t>(force.at)];
      };
      deviation = impulse(present.rows) - impulse(counts_from_.rows);
      continue;
    }
    const ContactRecord& from = counts_from_.contacts[static_cast<std::size_t>(force.contact)];
    const ContactRecord* now = FindContact(from, contacts);
    const auto part = [&](const ContactRecord& c) { return force.at < 3 ? c.end_force : c.end_moment; };
    Vector3 change = -part(from);
    if (now) change += from.point.frame * now->point.frame.transpose() * part(*now);
    deviation = change(force.at % 3);
  }
  return out;
}

// Of the step just taken.
std::vector<std::string> Linearization::StuckFrictions(const WorldState& present) const {
  constexpr double kRounding = 1e-6;  // share of the bound that its impulse is known by
  std::vector<std::string> out;
  for (std::size_t i = 0; has_friction_ && i < out_.mechanisms.size(); ++i) {
    const auto& frictions = simulation_.world().mechanisms()[i].mechanism().frictions();
    for (std::size_t k = 0; k < frictions.size(); ++k)
      if (std::abs(present.rows[i].friction_impulses[k]) < (1 - kRounding) * out_.dt * frictions[k].force)
        out.push_back(frictions[k].name);
  }
  return out;
}

// By which the step starts beside x* and u*: at both sides of one variable after the other, then of all, by turns.
VectorX Linearization::VariationOf(int step) const {
  VectorX out = VectorX::Zero(change_.size());
  if (step == 0) return out;
  const int variable = (step - 1) / 2;
  if (variable < change_.size()) {
    out(variable) = change_(variable);
  } else {
    out = change_;
    for (Eigen::Index k = 1; k < out.size(); k += 2) out(k) *= -1;
  }
  return step % 2 == 1 ? out : VectorX(-out);
}

void Linearization::MoveTo(const VectorX& variation) {
  moved_ = closed_start_;
  const auto n = static_cast<Eigen::Index>(out_.coordinates.size()),
             m = static_cast<Eigen::Index>(out_.inputs.size()),
             size = size_ + static_cast<Eigen::Index>(forces_.size());
  for (std::size_t k = 0; k < forces_.size(); ++k) {
    const double by = variation(size_ + static_cast<Eigen::Index>(k));
    const Force& force = forces_[k];
    if (force.contact < 0) {
      moved_.world.rows[static_cast<std::size_t>(force.mechanism)]
          .friction_impulses[static_cast<std::size_t>(force.at)] += by;
      continue;
    }
    ContactRecord& c = moved_.world.contacts[static_cast<std::size_t>(force.contact)];
    (force.at < 3 ? c.end_force : c.end_moment)(force.at % 3) += by;
  }
  for (Eigen::Index k = 0; k < m; ++k) {
    const int input = (*options_.inputs)[static_cast<std::size_t>(k)];
    moved_.controls(input) += variation(size + k);
    if (options_.start_controls) moved_.last_controls(input) += variation(size + m + k);
  }
  Eigen::Index at = 0, activation = 2 * n;
  const auto part = [&](const Reference& of) {
    const Eigen::Index first = std::exchange(at, at + fork1s::SizeOf(of));
    return std::pair<VectorX, VectorX>(variation.segment(first, at - first),
                                       variation.segment(n + first, at - first));
  };
  for (std::size_t i = 0; i < out_.mechanisms.size(); ++i) {
    const auto [p, v] = part(out_.mechanisms[i]);
    const auto k = static_cast<Eigen::Index>(out_.mechanisms[i].controls.size());
    Move(out_.mechanisms[i], inverses_[i], p, v, variation.segment(activation, k),
         moved_.world.mechanisms[i]);
    activation += k;
  }
  for (std::size_t i = 0; i < out_.free_bodies.size(); ++i) {
    const auto [p, v] = part(out_.free_bodies[i]);
    Move(out_.free_bodies[i], simulation_.world().free_bodies()[i], p, v, moved_.world.free_bodies[i]);
  }
  Restore(moved_);
}

void Linearization::Restore(const Simulation::Snapshot& moment) {
  const auto done = simulation_.Restore(moment);
  FORK1S_REQUIRE(done.has_value(), "what was saved here fits");
}

Expected<bool> Linearization::Advance() {
  const auto variables = static_cast<int>(change_.size());
  if (taken_ > 0 && taken_ % 2 == 1) CompareSides((taken_ - 1) / 2 - 1);
  const bool along_all = taken_ > 2 * variables;
  if (taken_ > 2 * variables + 2 || (along_all && !out_.switches.empty())) return false;
  MoveTo(VariationOf(taken_));
  End& end = taken_ == 0 ? at_rest_ : sides_[(taken_ - 1) % 2];
  end.report = simulation_.Step(options_.controls_move);
  if (!end.report.finite || !end.report.stages_converged)
    return Fail(
        ErrorCode::kNumerics, "linearization",
        fmt::format(
            "a step near this state is not solved ({}); shorten the time step or choose another state",
            simulation_.world().NameOf(end.report.stage_residual_of)));
  if (has_friction_) simulation_.world().Save(present_);
  end.dx = PresentDeviation(present_);
  end.stuck = StuckFrictions(present_);
  if (taken_ == 0) out_.stuck = end.stuck;
  ++taken_;
  return true;
}

void Linearization::SetOutcome(const VectorX& outcome) {
  FORK1S_REQUIRE(taken_ == 1 || outcome.size() == at_rest_.outcome.size(), "an outcome of", outcome.size(),
                 "numbers after one of", at_rest_.outcome.size(), "; give as many in every state");
  (taken_ == 1 ? at_rest_ : sides_[taken_ % 2]).outcome = outcome;
  if (taken_ == 1) outcome_.resize(outcome.size(), change_.size());
}

// After the steps to both sides of a variable, or at the end along all of them.
void Linearization::CompareSides(Eigen::Index variable) {
  if (variable < 0) return;
  const VectorX difference = sides_[0].dx - sides_[1].dx;
  if (variable == change_.size()) {
    const VectorX told = next_ * VariationOf(2 * static_cast<int>(variable) + 1);
    out_.difference = SizeOf(0.5 * difference - told) / std::max(SizeOf(told), 1.0);
    return;
  }
  next_.col(variable) = difference / (2 * change_(variable));
  if (outcome_.rows() > 0)
    outcome_.col(variable) = (sides_[0].outcome - sides_[1].outcome) / (2 * change_(variable));
  // What rounding leaves is no switch.
  const double bent = SizeOf(sides_[0].dx - 2 * at_rest_.dx + sides_[1].dx), moved = SizeOf(difference);
  if (bent > kSwitch * std::max(moved, kSwitch))
    out_.switches.push_back({NameOf(variable), bent / std::max(moved, kSwitch), WhatSwitched()});
}

// In units of the changes, without forces.
double Linearization::SizeOf(const VectorX& dx) const {
  return dx.head(size_).cwiseQuotient(change_.head(size_)).lpNorm<Eigen::Infinity>();
}

std::string Linearization::WhatSwitched() const {
  const std::pair<const char*, int (*)(const End&)> counts[] = {
      {"contacts that bear", [](const End& e) { return e.report.solver.active; }},
      {"contacts that slide", [](const End& e) { return e.report.solver.sliding; }},
      {"joint limits that act", [](const End& e) { return e.report.limits; }},
      {"forces at their bound", [](const End& e) { return e.report.forces_at_bound; }},
      {"joints and tendons that dry friction holds",
       [](const End& e) { return static_cast<int>(e.stuck.size()); }},
      {"shorter steps", [](const End& e) { return e.report.parts; }}};
  std::string out;
  for (const auto& [what, count] : counts) {
    const int here = count(at_rest_), up = count(sides_[0]), down = count(sides_[1]);
    if (here == up && here == down) continue;
    out += fmt::format("{}{}: {}, with changes to both sides {} and {}", out.empty() ? "" : "; ", what, here,
                       up, down);
  }
  return out.empty() ? "other contacts, stops, bounds or directions of sliding, as many as before" : out;
}

// C, of which rates and activations move nothing.
void Linearization::DifferentiateOutputs() {
  out_.C.setZero(static_cast<Eigen::Index>(out_.outputs.size()),
                 size_ + static_cast<Eigen::Index>(forces_.size()));
  if (options_.outputs.empty()) return;
  for (std::size_t k = 0; k < out_.coordinates.size(); ++k) {
    std::vector<RigidTransform> X[2];
    for (const int side : {0, 1}) {
      MoveTo(VariationOf(2 * static_cast<int>(k) + 1 + side));
      for (const int body : options_.outputs) X[side].push_back(simulation_.Pose(body));
    }
    const auto column = static_cast<Eigen::Index>(k);
    for (std::size_t i = 0; i < X[0].size(); ++i)
      out_.C.block<6, 1>(static_cast<Eigen::Index>(6 * i), column) =
          PoseDeviation(X[0][i], X[1][i]) / (2 * change_(column));
  }
}

LinearizedStep Linearization::Finish() {
  if (!out_.switches.empty()) out_.difference = std::numeric_limits<double>::quiet_NaN();
  const auto size = size_ + static_cast<Eigen::Index>(forces_.size()),
             m = static_cast<Eigen::Index>(out_.inputs.size()), m_start = change_.size() - size - m;
  out_.A = next_.leftCols(size);
  out_.B = next_.middleCols(size, m);
  out_.B_start = next_.rightCols(m_start);
  out_.c = at_rest_.dx;
  out_.outcome = at_rest_.outcome;
  if (outcome_.rows() > 0) {
    out_.outcome_A = outcome_.leftCols(size);
    out_.outcome_B = outcome_.middleCols(size, m);
    out_.outcome_B_start = outcome_.rightCols(m_start);
  }
  DifferentiateOutputs();
  return std::move(out_);
}

}  // namespace internal

Expected<LinearizedStep> Linearize(Simulation& simulation, const LinearizeOptions& options) {
  const auto steps = internal::Linearization::Begin(simulation, options);
  if (!steps) return tl::unexpected(steps.error());
  for (;;) {
    const auto taken = (*steps)->Advance();
    if (!taken) return tl::unexpected(taken.error());
    if (!*taken) return (*steps)->Finish();
    if (options.outcome) (*steps)->SetOutcome(options.outcome(simulation));
  }
}

}  // namespace fork1s
