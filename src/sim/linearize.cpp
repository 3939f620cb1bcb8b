#include <fork1s/sim/linearize.hpp>

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#include "linalg/null_space.hpp"
#include "linalg/select.hpp"
#include "linalg/solve.hpp"
#include "solved_to_rounding.hpp"

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
    at.closing_tolerance = kClosedToRounding;
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

class Linearizer {
 public:
  Linearizer(Simulation& simulation, const LinearizeOptions& options)
      : simulation_(simulation),
        options_(options),
        refreshes_(simulation.step_options().refresh),
        start_(simulation.Save()) {
    simulation.step_options().refresh = false;
    solved_.emplace(simulation);
  }
  ~Linearizer() {
    solved_.reset();
    simulation_.step_options().refresh = refreshes_;
    Restore(start_);
  }
  Linearizer(const Linearizer&) = delete;
  Linearizer& operator=(const Linearizer&) = delete;

  Expected<LinearizedStep> Linearize() {
    List();
    const auto n = static_cast<Eigen::Index>(out_.coordinates.size()), size = change_.size(),
               m = static_cast<Eigen::Index>(inputs_.size());
    Begin begin{VectorX::Zero(size), start_.controls, start_.last_controls};
    if (auto at = Step(begin); at)
      at_rest_ = std::move(*at);
    else
      return tl::unexpected(at.error());
    out_.c = at_rest_.dx;
    out_.outcome = at_rest_.outcome;
    const Eigen::Index outcomes = out_.outcome.size(), m_start = options_.controls_move ? m : 0;
    out_.A.resize(size, size);
    out_.B.resize(size, m);
    out_.B_start.resize(size, m_start);
    out_.outcome_A.resize(outcomes, size);
    out_.outcome_B.resize(outcomes, m);
    out_.outcome_B_start.resize(outcomes, m_start);
    out_.C.resize(static_cast<Eigen::Index>(out_.outputs.size()), size);
    for (Eigen::Index k = 0; k < size; ++k) {
      const auto done =
          Differentiate(begin, begin.dx(k), change_(k), NameOf(k), out_.A.col(k), out_.outcome_A.col(k));
      if (!done) return tl::unexpected(done.error());
      out_.C.col(k).setZero();
      if (k < n && !options_.outputs.empty()) DifferentiateOutputs(k, out_.C.col(k));
    }
    for (Eigen::Index k = 0; k < m; ++k) {
      const auto& name = out_.inputs[static_cast<std::size_t>(k)];
      const auto done = Differentiate(begin, begin.controls(InputAt(k)), ControlChange(k), name,
                                      out_.B.col(k), out_.outcome_B.col(k));
      if (!done) return tl::unexpected(done.error());
    }
    for (Eigen::Index k = 0; k < m_start; ++k) {
      const auto name = "start of " + out_.inputs[static_cast<std::size_t>(k)];
      const auto done = Differentiate(begin, begin.start_controls(InputAt(k)), ControlChange(k), name,
                                      out_.B_start.col(k), out_.outcome_B_start.col(k));
      if (!done) return tl::unexpected(done.error());
    }
    if (auto done = Check(begin); !done) return tl::unexpected(done.error());
    return std::move(out_);
  }

 private:
  // A step: beside the state by dx, with controls that end and start at these.
  struct Begin {
    VectorX dx, controls, start_controls;
  };
  struct End {
    VectorX dx, outcome;
    StepReport report;
  };

  int InputAt(Eigen::Index k) const { return inputs_[static_cast<std::size_t>(k)]; }
  std::string NameOf(Eigen::Index k) const {
    const auto n = out_.coordinates.size(), i = static_cast<std::size_t>(k);
    if (i < n) return out_.coordinates[i];
    return i < 2 * n ? "rate of " + out_.coordinates[i - n] : "activation of " + out_.activations[i - 2 * n];
  }

  struct State {
    std::vector<Reference> mechanisms, free_bodies;
  };
  State StateOf() const {
    State out;
    for (const MechanismDynamics& m : simulation_.world().mechanisms())
      out.mechanisms.push_back(ReferenceOf(m));
    for (const FreeBody& body : simulation_.world().free_bodies())
      out.free_bodies.push_back(ReferenceOf(body));
    return out;
  }

  // Names, references and by how much each coordinate is moved.
  void List() {
    std::vector<double> changes, of_activations;
    const std::vector<std::string> names = simulation_.CoordinateNames();
    out_.num_joints = names.size();
    std::size_t first = 0;
    for (const MechanismDynamics& m : simulation_.world().mechanisms()) {
      const Reference& reference = out_.mechanisms.emplace_back(ReferenceOf(m));
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
      if (reference.has_base) Append(m.mechanism().bodies()[0].name, m.mechanism().length_scale(), changes);
    }
    for (const FreeBody& body : simulation_.world().free_bodies()) {
      out_.free_bodies.push_back(ReferenceOf(body));
      Append(body.name(), std::sqrt(body.inertia().rotational.trace() / body.inertia().mass), changes);
    }
    for (const int body : options_.outputs)
      NameSix(simulation_.bodies()[static_cast<std::size_t>(body)].name, out_.outputs);
    const auto n = static_cast<Eigen::Index>(changes.size()),
               k = static_cast<Eigen::Index>(of_activations.size());
    out_.dt = simulation_.dt();
    change_.resize(2 * n + k);
    change_.head(n) = options_.change * Eigen::Map<const VectorX>(changes.data(), n);
    change_.segment(n, n) = change_.head(n) / out_.dt;
    change_.tail(k) = options_.change * Eigen::Map<const VectorX>(of_activations.data(), k);
    const std::vector<std::string>& controls = simulation_.control_names();
    if (options_.inputs) {
      inputs_ = *options_.inputs;
    } else {
      inputs_.resize(controls.size());
      std::iota(inputs_.begin(), inputs_.end(), 0);
    }
    for (const int i : inputs_) out_.inputs.push_back(controls[static_cast<std::size_t>(i)]);
    out_.controls = start_.controls;
  }
  void Append(const std::string& name, double length, std::vector<double>& changes) {
    NameSix(name, out_.coordinates);
    for (int i = 0; i < 6; ++i) changes.push_back(i < 3 ? 1 : length);
  }

  void MoveTo(const Begin& begin) {
    const VectorX& dx = begin.dx;
    moved_ = start_;
    moved_.controls = begin.controls;
    moved_.last_controls = begin.start_controls;
    const auto n = static_cast<Eigen::Index>(out_.coordinates.size());
    Eigen::Index at = 0, activation = 2 * n;
    const auto part = [&](const Reference& of) {
      const Eigen::Index first = std::exchange(at, at + SizeOf(of));
      return std::pair<VectorX, VectorX>(dx.segment(first, at - first), dx.segment(n + first, at - first));
    };
    for (std::size_t i = 0; i < out_.mechanisms.size(); ++i) {
      const auto [p, v] = part(out_.mechanisms[i]);
      const auto k = static_cast<Eigen::Index>(out_.mechanisms[i].controls.size());
      Move(out_.mechanisms[i], inverses_[i], p, v, dx.segment(activation, k), moved_.world.mechanisms[i]);
      activation += k;
    }
    for (std::size_t i = 0; i < out_.free_bodies.size(); ++i) {
      const auto [p, v] = part(out_.free_bodies[i]);
      Move(out_.free_bodies[i], simulation_.world().free_bodies()[i], p, v, moved_.world.free_bodies[i]);
    }
    Restore(moved_);
  }
  void Restore(const Simulation::Snapshot& moment) {
    const auto done = simulation_.Restore(moment);
    FORK1S_REQUIRE(done.has_value(), "what was saved here fits");
  }

  Expected<End> Step(const Begin& begin) {
    MoveTo(begin);
    End end;
    end.report = simulation_.Step(options_.controls_move);
    if (!end.report.finite || !end.report.stages_converged)
      return Fail(
          ErrorCode::kNumerics, "linearization",
          fmt::format("a step near this state is not solved ({}); shorten the time step or choose another "
                      "state",
                      simulation_.world().NameOf(end.report.stage_residual_of)));
    if (!counts_from_)
      counts_from_ = options_.from_end ? StateOf() : State{out_.mechanisms, out_.free_bodies};
    end.dx = DeviationFrom(counts_from_->mechanisms, counts_from_->free_bodies, simulation_);
    if (options_.outcome) end.outcome = options_.outcome(simulation_);
    FORK1S_REQUIRE(out_.outcome.size() == 0 || end.outcome.size() == out_.outcome.size(), "an outcome of",
                   end.outcome.size(), "numbers after one of", out_.outcome.size(),
                   "; give as many in every state");
    return end;
  }

  // Columns <- derivatives by `value`, an entry of `begin`, which is put back.
  Expected<void> Differentiate(const Begin& begin, double& value, double change, const std::string& name,
                               Eigen::Ref<VectorX> next, Eigen::Ref<VectorX> outcome) {
    const double at = value;
    End ends[2];
    for (int side = 0; side < 2; ++side) {
      value = at + (side == 0 ? change : -change);
      auto end = Step(begin);
      value = at;
      if (!end) return tl::unexpected(end.error());
      ends[side] = std::move(*end);
    }
    next = (ends[0].dx - ends[1].dx) / (2 * change);
    outcome = (ends[0].outcome - ends[1].outcome) / (2 * change);
    // What rounding leaves is no switch.
    const double bent = Size(ends[0].dx - 2 * out_.c + ends[1].dx), moved = Size(ends[0].dx - ends[1].dx);
    if (bent > kSwitch * std::max(moved, kSwitch))
      out_.switches.push_back(
          {name, bent / std::max(moved, kSwitch), WhatSwitched(ends[0].report, ends[1].report)});
    return {};
  }

  double ControlChange(Eigen::Index k) const {
    return options_.change * std::max(1.0, std::abs(start_.controls(InputAt(k))));
  }

  // `difference`: along the direction in which all coordinates and inputs change, by turns to either side.
  Expected<void> Check(const Begin& begin) {
    if (!out_.switches.empty()) {
      out_.difference = std::numeric_limits<double>::quiet_NaN();
      return {};
    }
    const auto m = static_cast<Eigen::Index>(inputs_.size());
    VectorX dx = change_, du(m), du_start = VectorX::Zero(out_.B_start.cols());
    for (Eigen::Index k = 0; k < m; ++k) du(k) = ControlChange(k);
    if (options_.controls_move) du_start = du;
    for (VectorX* d : {&dx, &du, &du_start})
      for (Eigen::Index k = 1; k < d->size(); k += 2) (*d)(k) *= -1;
    VectorX next[2];
    for (int side = 0; side < 2; ++side) {
      const double sign = side == 0 ? 1 : -1;
      Begin moved = begin;
      moved.dx += sign * dx;
      for (Eigen::Index k = 0; k < m; ++k) moved.controls(InputAt(k)) += sign * du(k);
      for (Eigen::Index k = 0; k < du_start.size(); ++k)
        moved.start_controls(InputAt(k)) += sign * du_start(k);
      const auto end = Step(moved);
      if (!end) return tl::unexpected(end.error());
      next[side] = end->dx;
    }
    const VectorX told = out_.A * dx + out_.B * du + out_.B_start * du_start;
    out_.difference = Size(0.5 * (next[0] - next[1]) - told) / std::max(Size(told), 1.0);
    return {};
  }

  // In units of the changes.
  double Size(const VectorX& dx) const { return dx.cwiseQuotient(change_).lpNorm<Eigen::Infinity>(); }

  std::string WhatSwitched(const StepReport& plus, const StepReport& minus) const {
    const std::pair<const char*, int (*)(const StepReport&)> counts[] = {
        {"contacts that bear", [](const StepReport& r) { return r.solver.active; }},
        {"contacts that slide", [](const StepReport& r) { return r.solver.sliding; }},
        {"joint limits that act", [](const StepReport& r) { return r.limits; }},
        {"forces at their bound", [](const StepReport& r) { return r.forces_at_bound; }},
        {"shorter steps", [](const StepReport& r) { return r.parts; }}};
    std::string out;
    for (const auto& [what, count] : counts) {
      const int here = count(at_rest_.report), up = count(plus), down = count(minus);
      if (here == up && here == down) continue;
      out += fmt::format("{}{}: {}, with changes to both sides {} and {}", out.empty() ? "" : "; ", what,
                         here, up, down);
    }
    return out;
  }

  void DifferentiateOutputs(Eigen::Index k, Eigen::Ref<VectorX> column) {
    std::vector<RigidTransform> X[2];
    for (int side = 0; side < 2; ++side) {
      Begin begin{VectorX::Zero(change_.size()), start_.controls, start_.last_controls};
      begin.dx(k) = side == 0 ? change_(k) : -change_(k);
      MoveTo(begin);
      for (const int body : options_.outputs) X[side].push_back(simulation_.Pose(body));
    }
    for (std::size_t i = 0; i < X[0].size(); ++i)
      column.segment<6>(static_cast<Eigen::Index>(6 * i)) = PoseDeviation(X[0][i], X[1][i]);
    column /= 2 * change_(k);
  }

  Simulation& simulation_;
  const LinearizeOptions& options_;
  const bool refreshes_;
  const Simulation::Snapshot start_;
  std::optional<SolvedToRounding> solved_;
  Simulation::Snapshot moved_;
  std::vector<MatrixX> inverses_;  // per mechanism, as of Move
  LinearizedStep out_;
  std::optional<State> counts_from_;  // what deviations after a step count from
  End at_rest_;                       // of the step that is not moved
  std::vector<int> inputs_;           // m, controls
  VectorX change_;                    // N
};

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

Expected<LinearizedStep> Linearize(Simulation& simulation, const LinearizeOptions& options) {
  const auto refuse = [](const std::string& what) { return Fail(ErrorCode::kUsage, "linearization", what); };
  if (!(options.change > 0 && options.change <= kLargestChange))
    return refuse(fmt::format("change = {}; give a number above 0 and up to 0.01", options.change));
  for (const int body : options.outputs)
    if (body < 0 || body >= static_cast<int>(simulation.bodies().size()))
      return refuse(
          fmt::format("there is no body {}; bodies are 0 to {}", body, simulation.bodies().size() - 1));
  if (!simulation.frozen_grasps().empty())
    return refuse("bodies are held by frozen contacts; let them go by another level of detail");

  if (options.inputs)
    for (const int input : *options.inputs)
      if (input < 0 || input >= static_cast<int>(simulation.control_names().size()))
        return refuse(fmt::format("there is no control {}; controls are 0 to {}", input,
                                  static_cast<int>(simulation.control_names().size()) - 1));

  return Linearizer(simulation, options).Linearize();
}

}  // namespace fork1s
