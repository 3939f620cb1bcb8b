// The linear companion of everything that moves: docs/method.md, section 8.
#include <fork1s/dynamics/error_estimate.hpp>

#include <algorithm>
#include <cmath>
#include <deque>
#include <fork1s/linalg/cholesky.hpp>
#include <fork1s/linalg/solve.hpp>

#include "error_companion.hpp"
#include "error_free_body.hpp"

namespace fork1s {
namespace {

constexpr int kParts = 3;                       // interior, nonlinear, time
constexpr int kSubsteps = 4;                    // of the companion in a step
constexpr double kGamma = 0.29289321881345254;  // 1 - 1/√2

}  // namespace

struct ErrorEstimate::Detail {
  ErrorEstimateOptions options;
  std::vector<ErrorCompanion> mechanisms;
  std::vector<FreeBodyPath> free_bodies;
  std::vector<int> offset;  // of mechanisms, then of free bodies, then the end
  int linearisations = 0, steps = 0, since_linearised = 0;
  bool linearised = false;
  double h = 0;

  MatrixX e, rate;  // size x kParts
  MatrixX rho, rho_before;
  MatrixX M, D, K, A;
  MatrixX Jt, Y, Y_S;  // contacts that hold: rows, A⁻¹ of them, that times the inverse of JA⁻¹Jᵀ
  LuFactor factor;
  std::vector<BodyError> bodies;
  std::vector<Vector3> start, place_before;
  struct Seen {
    double total, interior, nonlinear, time;
  };
  std::vector<std::deque<Seen>> window;

  void Layout();
  void Start();
  void Linearise(const World& world, const Vector3& gravity);
  void FindConstraints(const World& world);
  void Constrain();
  void Advance();
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
  d.place_before = d.start;
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
    path.load[0] = path.load[1];
    path.load[1] << b.moment_W() + b.center_W().cross(b.force_W()), b.force_W();
  }
}

void ErrorEstimate::Detail::Layout() {
  offset.assign(1, 0);
  for (const ErrorCompanion& c : mechanisms) offset.push_back(offset.back() + c.size());
  for (std::size_t i = 0; i < free_bodies.size(); ++i) offset.push_back(offset.back() + 6);
  const int n = offset.back();
  for (MatrixX* m : {&M, &D, &K, &A}) m->setZero(n, n);
}

void ErrorEstimate::Detail::Linearise(const World& world, const Vector3& gravity) {
  const std::size_t count = mechanisms.size();
  std::vector<MatrixX> moved(count);
  const bool first = !linearised;
  for (std::size_t i = 0; i < count; ++i) {
    if (!first) {
      const int at = offset[i], size = offset[i + 1] - at;
      moved[i].resize(size, 3 * kParts);
      moved[i] << e.middleRows(at, size), rate.middleRows(at, size), rho_before.middleRows(at, size);
    }
    mechanisms[i].Linearise(world.mechanisms()[i], gravity, moved[i]);
  }
  const MatrixX free_e = first ? MatrixX() : MatrixX(e.bottomRows(6 * static_cast<int>(free_bodies.size())));
  const MatrixX free_rate = first ? MatrixX() : MatrixX(rate.bottomRows(free_e.rows()));
  const MatrixX free_rho = first ? MatrixX() : MatrixX(rho_before.bottomRows(free_e.rows()));
  Layout();
  const int n = offset.back();
  e.setZero(n, kParts);
  rate = rho = rho_before = e;
  for (std::size_t i = 0; i < count; ++i) {
    const int at = offset[i], size = offset[i + 1] - at;
    M.block(at, at, size, size) = mechanisms[i].M();
    D.block(at, at, size, size) = mechanisms[i].D();
    K.block(at, at, size, size) = mechanisms[i].K();
    if (first) continue;
    e.middleRows(at, size) = moved[i].leftCols(kParts);
    rate.middleRows(at, size) = moved[i].middleCols(kParts, kParts);
    rho_before.middleRows(at, size) = moved[i].rightCols(kParts);
  }
  for (std::size_t i = 0; i < free_bodies.size(); ++i) {
    const int at = offset[count + i];
    const SpatialInertia& I = world.free_bodies()[i].inertia();
    const Matrix3& R = free_bodies[i].X[1].rotation();
    M.block<3, 3>(at, at) = R * I.rotational * R.transpose();
    M.block<3, 3>(at + 3, at + 3) = I.mass * Matrix3::Identity();
  }
  if (!first) {
    e.bottomRows(free_e.rows()) = free_e;
    rate.bottomRows(free_e.rows()) = free_rate;
    rho_before.bottomRows(free_e.rows()) = free_rho;
  }
  const double s = kGamma * h / kSubsteps;
  A = M + s * D + (s * s) * K;
  factor.Compute(A);
  linearised = true;
  since_linearised = 0;
}

// What touches and sticks cannot part: rates of the error along contacts that carry force vanish.
void ErrorEstimate::Detail::FindConstraints(const World& world) {
  Y.resize(0, 0);
  const auto& contacts = world.contacts();
  const auto& contactors = world.contactors();
  std::vector<VectorX> rows;
  std::vector<char> used(contacts.size(), 0);
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    if (used[i] || contacts[i].impulse(0) <= 0) continue;
    const ContactPoint& first = contacts[i].point;
    std::vector<Vector6> wrenches;  // about `first.point`, moments in lengths
    double reach = 1e-3;
    for (std::size_t k = i; k < contacts.size(); ++k)
      if (contacts[k].point.body_a == first.body_a && contacts[k].point.body_b == first.body_b &&
          contacts[k].impulse(0) > 0)
        reach = std::max(reach, (contacts[k].point.point - first.point).norm());
    for (std::size_t k = i; k < contacts.size(); ++k) {
      const ContactRecord& c = contacts[k];
      if (c.point.body_a != first.body_a || c.point.body_b != first.body_b || c.impulse(0) <= 0) continue;
      used[k] = 1;
      const bool sticks = c.impulse.tail<2>().norm() < 0.99 * c.friction * c.impulse(0);
      for (int direction = 0; direction < (sticks ? 3 : 1); ++direction) {
        const Vector3 f = c.point.frame.row(direction).transpose();
        Vector6 w;
        w << Vector3(c.point.point - first.point).cross(f) / reach, f;
        for (int pass = 0; pass < 2; ++pass)
          for (const Vector6& other : wrenches) w -= other.dot(w) * other;
        if (w.norm() < 1e-2) continue;
        wrenches.push_back(w.normalized());
      }
    }
    for (Vector6 w : wrenches) {
      w.head<3>() *= reach;
      w.head<3>() += first.point.cross(Vector3(w.tail<3>()));
      VectorX row = VectorX::Zero(offset.back());
      for (const auto& [body, sign] : {std::pair(first.body_a, -1.0), std::pair(first.body_b, 1.0)}) {
        const Contactor& c = contactors[static_cast<std::size_t>(body)];
        const auto at = static_cast<std::size_t>(c.index);
        if (c.kind == Contactor::Kind::kGroup) {
          const MechanismDynamics& m = world.mechanisms()[at];
          VectorX part(mechanisms[at].size());
          mechanisms[at].WrenchRow(m, m.groups()[static_cast<std::size_t>(c.group)].last_joint, w, part);
          row.segment(offset[at], part.size()) += sign * part;
        } else if (c.kind == Contactor::Kind::kFreeBody) {
          const int o = offset[mechanisms.size() + at];
          Vector6 at_center = w;
          at_center.head<3>() -= free_bodies[at].X[1].translation().cross(Vector3(w.tail<3>()));
          row.segment<6>(o) += sign * at_center;
        }
      }
      if (row.norm() > 1e-12) rows.push_back(row / row.norm());
    }
  }
  if (rows.empty()) return;
  Jt.resize(offset.back(), static_cast<Eigen::Index>(rows.size()));
  for (std::size_t k = 0; k < rows.size(); ++k) Jt.col(static_cast<Eigen::Index>(k)) = rows[k];
  Y = Jt;
  factor.SolveInPlace(Y);
  MatrixX S = Jt.transpose() * Y;
  S = 0.5 * (S + S.transpose()).eval();
  S.diagonal() *= 1 + 1e-9;
  S.diagonal().array() += 1e-12 * S.diagonal().maxCoeff();
  Y_S = SolveSymmetric(S, Y.transpose()).transpose();
}

void ErrorEstimate::Detail::Constrain() {
  if (Y.cols() > 0) rate -= Y_S * (Jt.transpose() * rate);
}

// Two-stage SDIRK of second order (Alexander 1977) in substeps: what is damped or stiff beyond the step must
// come to rest as it does in truth, and what rings within a few substeps must go on ringing. Forces are
// linear between nodes.
void ErrorEstimate::Detail::Advance() {
  const double s = h / kSubsteps;
  for (int i = 0; i < kSubsteps; ++i) {
    auto force = [&](double at) {
      const double share = (i + at) / kSubsteps;
      return MatrixX((1 - share) * rho_before + share * rho);
    };
    MatrixX k1 = force(kGamma) - K * (e + (kGamma * s) * rate) - D * rate;
    factor.SolveInPlace(k1);
    const MatrixX r1 = rate + (kGamma * s) * k1;
    const MatrixX r_mid = rate + ((1 - kGamma) * s) * k1;
    MatrixX k2 = force(1) - K * (e + ((1 - kGamma) * s) * r1 + (kGamma * s) * r_mid) - D * r_mid;
    factor.SolveInPlace(k2);
    rate = r_mid + (kGamma * s) * k2;
    Constrain();
    e += ((1 - kGamma) * s) * r1 + (kGamma * s) * rate;
  }
}

// Before the first node there is the initial rate alone. Its difference to the rate that nodes show, and half
// of what is missing at that node, make up for each other where a scheme is better than of first order: for
// what moves rigidly both are taken at once, or 0.2 mm would stay of every free fall.
void ErrorEstimate::Detail::Start() {
  for (std::size_t i = 0; i < mechanisms.size(); ++i) {
    const int at = offset[i], size = mechanisms[i].size();
    rate.col(2).segment(at, size) = mechanisms[i].StartRate();
    if (mechanisms[i].base_size() == 0) continue;
    for (int k = 0; k < kParts; ++k) {
      const Vector6 by = SolvePositive(M.block<6, 6>(at, at), rho.block<6, 1>(at, k));
      rate.block<6, 1>(at, k) += 0.5 * h * by;
      rho.col(k).segment(at, size) -= M.block(at, at, size, 6) * by;
    }
  }
  for (std::size_t i = 0; i < free_bodies.size(); ++i) {
    const int at = offset[mechanisms.size() + i];
    rate.col(2).segment<6>(at) = 0.5 * (free_bodies[i].v[1] - free_bodies[i].v[2]) +
                                 0.5 * h * SolvePositive(M.block<6, 6>(at, at), rho.block<6, 1>(at, 2));
    rho.middleRows(at, 6).setZero();
  }
  rho_before = rho;
}

void ErrorEstimate::End(const World& world, const StepOptions& options, const StepReport& report) {
  Detail& d = *detail_;
  if (!report.finite) return;
  const double h = options.h;
  d.h = h;
  const bool by_euler = options.integrator == Integrator::kEuler, at_end = report.forces_at_end;
  const auto& contactors = world.contactors();
  std::vector<Matrix6X> wrenches;
  for (const MechanismDynamics& m : world.mechanisms())
    wrenches.push_back(Matrix6X::Zero(6, m.mechanism().num_bodies()));
  for (const ContactRecord& c : world.contacts()) {
    const Vector3 f = c.point.frame.transpose() * c.impulse / h;
    Vector6 F;
    F << c.point.point.cross(f) + Vector3(c.point.frame.transpose() * c.moment / h), f;
    for (const auto& [body, sign] : {std::pair(c.point.body_a, -1.0), std::pair(c.point.body_b, 1.0)}) {
      const Contactor& side = contactors[static_cast<std::size_t>(body)];
      const auto at = static_cast<std::size_t>(side.index);
      if (side.kind == Contactor::Kind::kGroup)
        wrenches[at].col(
            world.mechanisms()[at].groups()[static_cast<std::size_t>(side.group)].body.value()) += sign * F;
      else if (side.kind == Contactor::Kind::kFreeBody)
        d.free_bodies[at].load[1] += sign * F;
    }
  }
  for (std::size_t i = 0; i < d.mechanisms.size(); ++i) {
    const MechanismDynamics& m = world.mechanisms()[i];
    VectorX stops = VectorX::Zero(m.mechanism().num_coordinates());
    world.AddStopForces(static_cast<int>(i), h, stops);
    d.mechanisms[i].End(m, wrenches[i], stops, h, at_end);
  }
  for (std::size_t i = 0; i < d.free_bodies.size(); ++i) {
    if (d.steps == 0) d.free_bodies[i].load[0] = d.free_bodies[i].load[1];
    d.free_bodies[i].End(world.free_bodies()[i], h);
  }
  ++d.steps;
  const bool first = !d.linearised;
  bool stale = d.steps <= 2 || d.since_linearised >= d.options.refresh_every;
  for (std::size_t i = 0; i < d.mechanisms.size() && !stale; ++i)
    stale = d.mechanisms[i].Moved(world.mechanisms()[i], d.since_linearised * h) > d.options.refresh_turn;
  if (stale) {
    d.Linearise(world, options.gravity);
    ++d.linearisations;
  }
  ++d.since_linearised;

  for (std::size_t i = 0; i < d.mechanisms.size(); ++i) {
    ErrorCompanion& c = d.mechanisms[i];
    const int at = d.offset[i], size = c.size();
    VectorX centred(size), euler(size), seen(size), seen_euler(size);
    c.Residuals(world.mechanisms()[i], options.gravity, centred, euler);
    c.SplitOff(world.mechanisms()[i], centred, seen);
    c.SplitOff(world.mechanisms()[i], euler, seen_euler);
    VectorX following(size), seen_following(size);
    c.FollowingForce(world.mechanisms()[i], following);
    c.SplitOff(world.mechanisms()[i], following, seen_following);
    d.rho.col(0).segment(at, size) = centred - seen + seen_following;
    // The other scheme solves equations of its own, beside which the split would be one of large numbers.
    if (by_euler) {
      d.rho.col(1).segment(at, size) = seen_euler - seen_following;
      d.rho.col(2).segment(at, size) = seen - seen_euler;
    } else {
      d.rho.col(1).segment(at, size).setZero();
      d.rho.col(2).segment(at, size) = seen - seen_following;
    }
  }
  for (std::size_t i = 0; i < d.free_bodies.size(); ++i) {
    const FreeBodyPath& p = d.free_bodies[i];
    const FreeBody& b = world.free_bodies()[i];
    const int at = d.offset[d.mechanisms.size() + i];
    const Vector6 F = LoadAtNode(p.load[0], p.load[1], at_end);
    const SpatialInertia& I = b.inertia();
    d.rho.middleRows(at, 6).setZero();
    // v[0] is not used here: v[1], v[2] are those on both sides of the node.
    FreeBodyPath q = p;
    q.v[0] = p.v[1];
    const Vector3 spin_rate = (p.Spin(I, 2, h) - q.Spin(I, 0, h)) / h;
    d.rho.block<3, 1>(at, 2) = F.head<3>() - p.X[1].translation().cross(Vector3(F.tail<3>())) - spin_rate;
    d.rho.block<3, 1>(at + 3, 2) =
        F.tail<3>() + b.weight_share() * I.mass * options.gravity - I.mass * (p.v[2] - p.v[1]).tail<3>() / h;
  }
  if (first) {
    d.Start();
    d.FindConstraints(world);
    d.Constrain();
    d.Show(world);
    return;
  }
  d.FindConstraints(world);
  d.Advance();
  d.rho_before = d.rho;
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
      // Where twists are summed the body is not where its joints have it.
      if (m.recovery() == Recovery::kTwist)
        parts[1] += mechanisms[at].Pose(BodyIndex(b.index)).translation() - place_before[i];
      place = m.BodyPose(BodyIndex(b.index)).translation();
      place_before[i] = place;
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
