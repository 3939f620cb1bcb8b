// The linear companion of everything that moves: docs/method.md, section 8.
#include <fork1s/diagnostics/error_estimate.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <fork1s/recovery/recover.hpp>

#include "error_companion.hpp"
#include "error_contact_loads.hpp"
#include "error_contacts.hpp"
#include "error_free_body.hpp"
#include "linalg/cholesky.hpp"
#include "linalg/solve.hpp"

namespace fork1s {
namespace {

constexpr int kParts = 3;  // interior, nonlinear, time
constexpr int kTime = 2;
constexpr int kSubsteps = 4;                    // of the companion in a step
constexpr double kGamma = 0.29289321881345254;  // 1 - 1/√2

// Points that carry load, and whether they slide.
using ContactModes = std::vector<std::array<int, 5>>;

ContactModes ModesOf(const std::vector<ContactRecord>& contacts) {
  ContactModes modes;
  for (const ContactRecord& c : contacts)
    if (c.impulse(0) > 0)
      modes.push_back({c.point.body_a, c.point.body_b, c.point.geometry_a, c.point.geometry_b,
                       c.friction > 0 && c.use <= 1 ? 0 : 1});
  std::sort(modes.begin(), modes.end());
  return modes;
}

constexpr int kStencil = 5;  // steps of the differences of ErrorCompanion::CorrectCentred

}  // namespace

struct ErrorEstimate::Detail {
  ErrorEstimateOptions options;
  std::vector<ErrorCompanion> mechanisms;
  std::vector<FreeBodyPath> free_bodies;
  std::vector<int> offset;  // of mechanisms, then of free bodies, then the end
  struct {
    int linearisations = 0, steps = 0, since_linearised = 0;
    bool linearised = false;
  } progress;
  double h = 0;

  MatrixX e, rate;       // size x kParts
  MatrixX force, turn;   // at the node, missing for rates that do not change, and for their change over h
  VectorX drag;          // of half of that change
  VectorX kink;          // of controls whose slope changes at the node
  MatrixX force_before;  // at the last one
  struct {
    MatrixX M, D, K;
    MatrixX A;  // of a substep
    LuFactor factor, kink_factor;
  } tangent;
  ErrorContacts contacts;
  std::vector<ContactRecord> last, before_last;  // of the step to the node, and of the one before
  int smooth_steps = 0;  // up to the last one, in which contacts neither came, went nor changed sides
  std::vector<BodyError> bodies;
  std::vector<Vector3> start;
  struct Seen {
    double total, interior, nonlinear, time;
  };
  std::vector<std::deque<Seen>> window;

  void Layout();
  void Linearise(const World& world, const Vector3& gravity);
  void AddKinks(const World& world);
  void Advance(const MatrixX& force_after);
  void Pass();
  void Show(const World& world);
};

ErrorEstimate::ErrorEstimate(const World& world, const ErrorEstimateOptions& options)
    : detail_(std::make_unique<Detail>()) {
  Detail& d = *detail_;
  d.options = options;
  for (std::size_t i = 0; i < world.mechanisms().size(); ++i) {
    const MechanismDynamics& m = world.mechanisms()[i];
    d.mechanisms.emplace_back(m);
    for (BodyIndex b : m.model().interfaces)
      d.bodies.push_back({m.mechanism().body(b).name, static_cast<int>(i), b.value()});
  }
  for (std::size_t i = 0; i < world.free_bodies().size(); ++i) {
    d.free_bodies.emplace_back(world.free_bodies()[i]);
    d.bodies.push_back({world.free_bodies()[i].name(), -1, static_cast<int>(i)});
  }
  d.window.resize(d.bodies.size());
  for (const BodyError& b : d.bodies)
    d.start.push_back(b.mechanism < 0
                          ? world.free_bodies()[static_cast<std::size_t>(b.index)].pose().translation()
                          : world.mechanisms()[static_cast<std::size_t>(b.mechanism)]
                                .BodyPose(BodyIndex(b.index))
                                .translation());
}

ErrorEstimate::~ErrorEstimate() = default;
ErrorEstimate::ErrorEstimate(ErrorEstimate&&) noexcept = default;
ErrorEstimate& ErrorEstimate::operator=(ErrorEstimate&&) noexcept = default;

const std::vector<BodyError>& ErrorEstimate::bodies() const { return detail_->bodies; }

void ErrorEstimate::Begin(const World& world) {
  Detail& d = *detail_;
  for (std::size_t i = 0; i < d.mechanisms.size(); ++i) d.mechanisms[i].Begin(world.mechanisms()[i]);
  for (std::size_t i = 0; i < d.free_bodies.size(); ++i) {
    FreeBodyPath& path = d.free_bodies[i];
    const FreeBody& b = world.free_bodies()[i];
    path.load[0] = path.applied;
    const Vector3& force_W = b.load().force_W;
    path.applied << b.load().MomentAt(b.pose().rotation()) + b.center_W().cross(force_W), force_W;
    path.load[1] = path.applied;
  }
}

void ErrorEstimate::Detail::Layout() {
  offset.assign(1, 0);
  for (const ErrorCompanion& c : mechanisms) offset.push_back(offset.back() + c.size());
  for (std::size_t i = 0; i < free_bodies.size(); ++i) offset.push_back(offset.back() + 6);
  const int n = offset.back();
  for (MatrixX* m : {&tangent.M, &tangent.D, &tangent.K, &tangent.A}) m->setZero(n, n);
}

void ErrorEstimate::Detail::Linearise(const World& world, const Vector3& gravity) {
  const std::size_t count = mechanisms.size();
  std::vector<MatrixX> moved(count);
  const bool first = !progress.linearised;
  for (std::size_t i = 0; i < count; ++i) {
    if (!first) {
      const int at = offset[i], size = offset[i + 1] - at;
      moved[i].resize(size, 3 * kParts);
      moved[i] << e.middleRows(at, size), rate.middleRows(at, size), force_before.middleRows(at, size);
    }
    mechanisms[i].Linearise(world.mechanisms()[i], gravity, moved[i]);
  }
  const MatrixX free_e = first ? MatrixX() : MatrixX(e.bottomRows(6 * static_cast<int>(free_bodies.size())));
  const MatrixX free_rate = first ? MatrixX() : MatrixX(rate.bottomRows(free_e.rows()));
  const MatrixX free_force = first ? MatrixX() : MatrixX(force_before.bottomRows(free_e.rows()));
  Layout();
  const int n = offset.back();
  e.setZero(n, kParts);
  rate = force = turn = force_before = e;
  drag.setZero(n);
  kink.setZero(n);
  for (std::size_t i = 0; i < count; ++i) {
    const int at = offset[i], size = offset[i + 1] - at;
    tangent.M.block(at, at, size, size) = mechanisms[i].M();
    tangent.D.block(at, at, size, size) = mechanisms[i].D();
    tangent.K.block(at, at, size, size) = mechanisms[i].K();
    if (first) continue;
    e.middleRows(at, size) = moved[i].leftCols(kParts);
    rate.middleRows(at, size) = moved[i].middleCols(kParts, kParts);
    force_before.middleRows(at, size) = moved[i].rightCols(kParts);
  }
  for (std::size_t i = 0; i < free_bodies.size(); ++i) {
    const int at = offset[count + i];
    const SpatialInertia& I = world.free_bodies()[i].inertia();
    const Matrix3& R = free_bodies[i].X[1].rotation();
    tangent.M.block<3, 3>(at, at) = R * I.rotational * R.transpose();
    tangent.M.block<3, 3>(at + 3, at + 3) = I.mass * Matrix3::Identity();
  }
  if (!first) {
    e.bottomRows(free_e.rows()) = free_e;
    rate.bottomRows(free_e.rows()) = free_rate;
    force_before.bottomRows(free_e.rows()) = free_force;
  }
  contacts.AddStiffness(mechanisms, offset, tangent.K);
  const double s = kGamma * h / kSubsteps;
  tangent.A = tangent.M + s * tangent.D + (s * s) * tangent.K;
  tangent.factor.Compute(tangent.A);
  tangent.kink_factor.Compute(tangent.M + (h / 4) * tangent.D + (h * h / 20) * tangent.K);
  progress.linearised = true;
  progress.since_linearised = 0;
}

// A centred difference of poses is the mean of accelerations over both steps, weighted by 1 - |t - t_n|/h. By
// a change of slope of the controls it has h/6 of that which the node has not. Springs and dampers answer
// within the step: from rest M a = F t gives M a = F t (1 - (D/M) t/2 - (K/M) t^2/6), of which the mean has
// the factor 1 - (D/M) h/4 - (K/M) h^2/20, here the rational function that stays positive where they are
// stiff.
void ErrorEstimate::Detail::AddKinks(const World& world) {
  if (kink.isZero(0)) return;
  tangent.kink_factor.SolveInPlace(kink);
  kink = tangent.M * kink;
  for (std::size_t i = 0; i < mechanisms.size(); ++i) {
    const int at = offset[i], size = offset[i + 1] - at;
    VectorX seen(size);
    mechanisms[i].SplitOff(world.mechanisms()[i], kink.segment(at, size), seen);
    turn.col(0).segment(at, size) += kink.segment(at, size) - seen;
    turn.col(kTime).segment(at, size) += seen;
  }
  kink.setZero();
}

// Two-stage SDIRK of second order (Alexander 1977) in substeps: what is damped or stiff beyond the step must
// come to rest as it does in truth, and what rings within a few substeps must go on ringing. Forces are
// linear between nodes.
void ErrorEstimate::Detail::Advance(const MatrixX& force_after) {
  const double s = h / kSubsteps;
  for (int i = 0; i < kSubsteps; ++i) {
    auto pull = [&](double at) {
      const double share = (i + at) / kSubsteps;
      return MatrixX((1 - share) * force_before + share * force_after);
    };
    MatrixX k1 = pull(kGamma) - tangent.K * (e + (kGamma * s) * rate) - tangent.D * rate;
    tangent.factor.SolveInPlace(k1);
    MatrixX r1 = rate + (kGamma * s) * k1;
    contacts.Hold(e, kTime, r1);
    k1 = (r1 - rate) / (kGamma * s);
    const MatrixX r_mid = rate + ((1 - kGamma) * s) * k1;
    MatrixX k2 =
        pull(1) - tangent.K * (e + ((1 - kGamma) * s) * r1 + (kGamma * s) * r_mid) - tangent.D * r_mid;
    tangent.factor.SolveInPlace(k2);
    rate = r_mid + (kGamma * s) * k2;
    contacts.Hold(e + ((1 - kGamma) * s) * r1, kTime, rate);
    e += ((1 - kGamma) * s) * r1 + (kGamma * s) * rate;
  }
}

// What is missing is smooth between nodes where rates are those of centred differences. Not so in the first
// step: a prescribed base may start with a blow, and what is too stiff for the step has forgotten it at its
// end. So that step is taken for the straight way that it is, between rates that change at its ends alone.
void ErrorEstimate::Detail::Pass() {
  if (progress.steps == 1) {
    rate = h * SolveSymmetric(tangent.M, turn);
    force_before = force;
    force_before.col(2) -= drag;
    return;
  }
  contacts.Prepare(mechanisms, offset, tangent.factor, kGamma * h / kSubsteps);
  if (progress.steps == 2) {
    MatrixX at_end = force;
    at_end.col(2) += drag;
    Advance(at_end);
    rate += 0.5 * h * SolveSymmetric(tangent.M, turn);
    force_before = force + turn;
  } else {
    force += turn;
    Advance(force);
    force_before = force;
  }
}

void ErrorEstimate::End(const World& world, const StepOptions& options, const StepReport& report) {
  Detail& d = *detail_;
  if (!report.finite) return;
  const double h = options.h;
  d.h = h;
  const bool by_euler = options.integrator == Integrator::kEuler;
  const std::vector<ContactRecord> contacts = MovedTo(world.start_points(), world.contacts());
  const ContactLoads now = LoadsOf(world, contacts, h);
  const ContactLoads then =
      d.progress.steps == 0 ? now : LoadsOf(world, MovedTo(world.start_points(), d.last), h);
  const ContactLoads older =
      d.progress.steps < 2 ? then : LoadsOf(world, MovedTo(world.start_points(), d.before_last), h);
  const auto curved_load = [](const auto& to_node, const auto& from_node, const auto& before) {
    return (from_node - 2 * to_node + before).eval();
  };
  // A step in which points begin or cease to bear, stick or slide, has no Taylor series.
  const bool same = !report.impact && report.parts == 1 && ModesOf(d.last) == ModesOf(world.contacts());
  d.smooth_steps = same ? d.smooth_steps + 1 : 0;
  const bool smooth = d.smooth_steps >= kStencil;
  d.before_last = d.last;
  d.last = world.contacts();
  for (std::size_t i = 0; i < d.mechanisms.size(); ++i) {
    const MechanismDynamics& m = world.mechanisms()[i];
    VectorX stops = VectorX::Zero(m.mechanism().num_coordinates());
    world.AddStopForces(static_cast<int>(i), h, stops);
    d.mechanisms[i].End(m, then.mechanisms[i], now.mechanisms[i],
                        curved_load(then.mechanisms[i], now.mechanisms[i], older.mechanisms[i]), stops,
                        options, smooth);
  }
  for (std::size_t i = 0; i < d.free_bodies.size(); ++i) {
    FreeBodyPath& path = d.free_bodies[i];
    if (d.progress.steps == 0) path.load[0] = path.load[1];
    const FreeBody& body = world.free_bodies()[i];
    if (body.point_spring().IsActive()) {
      const Vector6 wrench = body.point_spring().Wrench(body.pose(), body.OriginVelocity());
      path.applied += wrench;
      path.load[1] += wrench;
    }
    path.load[0] += then.free_bodies[i];
    path.load[1] += now.free_bodies[i];
    path.End(world.free_bodies()[i], h);
  }
  ++d.progress.steps;
  bool stale = d.progress.steps <= 2 || d.progress.since_linearised >= d.options.refresh_every;
  for (std::size_t i = 0; i < d.mechanisms.size() && !stale; ++i)
    stale = d.mechanisms[i].Moved(world.mechanisms()[i], d.progress.since_linearised * h) >
            d.options.refresh_turn;
  if (stale) {
    d.Linearise(world, options.gravity);
    ++d.progress.linearisations;
  }
  ++d.progress.since_linearised;

  for (std::size_t i = 0; i < d.mechanisms.size(); ++i) {
    ErrorCompanion& c = d.mechanisms[i];
    const int at = d.offset[i], size = c.size();
    VectorX centred(size), euler(size), straight(size), seen(size), seen_euler(size), seen_straight(size);
    c.Residuals(world.mechanisms()[i], options.gravity, centred, euler, straight);
    c.SplitOff(world.mechanisms()[i], centred, seen);
    c.SplitOff(world.mechanisms()[i], euler, seen_euler);
    c.SplitOff(world.mechanisms()[i], straight, seen_straight);
    auto force = d.force.middleRows(at, size), turn = d.turn.middleRows(at, size);
    force.col(0) = straight - seen_straight;
    // The other scheme solves equations of its own, beside which the split would be one of large numbers.
    if (by_euler)
      force.col(1) = seen_euler;
    else
      force.col(1).setZero();
    force.col(2) = seen_straight - force.col(1);
    turn.col(0) = (centred - seen) - (straight - seen_straight);
    turn.col(1).setZero();
    turn.col(2) = seen - seen_straight;
    d.drag.segment(at, size) = 0.5 * (c.D() * c.Turn());
    c.ControlKink(world.mechanisms()[i], d.kink.segment(at, size));
  }
  d.AddKinks(world);
  for (std::size_t i = 0; i < d.free_bodies.size(); ++i) {
    const FreeBodyPath& p = d.free_bodies[i];
    const FreeBody& b = world.free_bodies()[i];
    const int at = d.offset[d.mechanisms.size() + i];
    const Vector6 F = LoadAtNode(p.load[0], p.load[1], by_euler);
    const SpatialInertia& I = b.inertia();
    d.force.middleRows(at, 6).setZero();
    d.turn.middleRows(at, 6).setZero();
    // v[0] is not used here: v[1], v[2] are those on both sides of the node.
    FreeBodyPath q = p;
    q.v[0] = p.v[1];
    d.turn.block<3, 1>(at, 2) = -(p.Spin(I, 2, h) - q.Spin(I, 0, h)) / h;
    d.turn.block<3, 1>(at + 3, 2) = -I.mass * (p.v[2] - p.v[1]).tail<3>() / h;
    d.force.block<3, 1>(at, 2) = F.head<3>() - p.X[1].translation().cross(Vector3(F.tail<3>()));
    d.force.block<3, 1>(at + 3, 2) = F.tail<3>() + b.weight_share() * I.mass * options.gravity;
    if (smooth && !by_euler && d.progress.steps > kStencil) {
      d.turn.block<6, 1>(at, 2) = -p.MomentumRate(I, h);
      Vector6 curved = curved_load(then.free_bodies[i], now.free_bodies[i], older.free_bodies[i]);
      curved.head<3>() -= p.X[1].translation().cross(Vector3(curved.tail<3>()));
      d.force.block<6, 1>(at, 2) -= curved / 6;
    }
  }
  d.Pass();
  d.contacts.ComputeRows(world, contacts, d.mechanisms, d.free_bodies, h);
  d.contacts.ComputeStiffness(world, contacts, d.mechanisms, d.free_bodies, h);
  d.Show(world);
}

void ErrorEstimate::Detail::Show(const World& world) {
  const auto length = static_cast<std::size_t>(std::max(1.0, std::round(options.window / h)));
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    BodyError& b = bodies[i];
    Vector3 parts[kParts];
    Vector3 place;
    if (b.mechanism >= 0) {
      const auto at = static_cast<std::size_t>(b.mechanism);
      const MechanismDynamics& m = world.mechanisms()[at];
      for (int k = 0; k < kParts; ++k)
        parts[k] = mechanisms[at].Displacement(m, BodyIndex(b.index),
                                               e.col(k).segment(offset[at], mechanisms[at].size()));
      place = m.BodyPose(BodyIndex(b.index)).translation();
      // Where twists are summed the body is not drawn where its joints have it.
      if (m.recovery() == Recovery::kTwist)
        parts[1] +=
            place -
            (m.state().X_WR * RecoverPoseTwist(m.model(), m.state(), BodyIndex(b.index))).translation();
    } else {
      const int at = offset[mechanisms.size() + static_cast<std::size_t>(b.index)];
      const FreeBody& body = world.free_bodies()[static_cast<std::size_t>(b.index)];
      const Vector3 arm =
          free_bodies[static_cast<std::size_t>(b.index)].X[1].rotation() * (-body.inertia().center);
      for (int k = 0; k < kParts; ++k) parts[k] = e.block<3, 1>(at + 3, k) + e.block<3, 1>(at, k).cross(arm);
      place = body.pose().translation();
    }
    b.interior = parts[0];
    b.nonlinear = parts[1];
    b.time = parts[2];
    b.motion = std::max(b.motion, (place - start[i]).norm());
    auto& w = window[i];
    w.push_back({(parts[0] + parts[1] + parts[2]).norm(), parts[0].norm(), parts[1].norm(), parts[2].norm()});
    if (w.size() > length) w.pop_front();
    b.shown = b.shown_interior = b.shown_nonlinear = b.shown_time = 0;
    for (const Seen& s : w) {
      b.shown = std::max(b.shown, s.total);
      b.shown_interior = std::max(b.shown_interior, s.interior);
      b.shown_nonlinear = std::max(b.shown_nonlinear, s.nonlinear);
      b.shown_time = std::max(b.shown_time, s.time);
    }
  }
}

}  // namespace fork1s
