// The rows of a problem: points in order of their pairs, what each gives.
#include <algorithm>
#include <cmath>
#include <fork1s/base/error.hpp>
#include <limits>
#include <tuple>
#include <utility>

#include "regularized_contact_problem.hpp"
#include "tangent_rows.hpp"

namespace fork1s::internal {
namespace {

// Of the inverse mass at a contact, before anything in it cancels: what a contact gives at least, so that
// hard ones (R = 0) have one answer. Impulses λ = -w/R are found to rounding over this, 2e-5, before they are
// refined (semismooth_newton.cpp).
constexpr double kMinRelativeRegularization = 1e-11;

bool Finite(double sum) { return std::isfinite(sum); }

// Rows of the tangents and their velocities times their shares of the larger friction coefficient, and radii of
// moments about them over these: friction is isotropic in such rows (laws/friction_cone.hpp), and rolling friction
// unchanged.
void ScaleTangents(const Vector2& friction_scale, PointRows& out) {
  const double largest = std::max(0.0, friction_scale.maxCoeff());
  out.law.coefficient *= largest;
  if (largest > 0)
    out.scale.tail<2>() = (friction_scale / largest).cwiseMax(ContactConstraint::kMinFrictionScale);
  for (PaddedRows* rows : {&out.rows_a, &out.rows_b}) *rows *= out.scale.asDiagonal();
  out.velocity.start = out.velocity.start.cwiseProduct(out.scale);
  out.turning.start = out.turning.start.cwiseProduct(out.scale);
  out.compliance.inverse_inertia = out.compliance.inverse_inertia.cwiseProduct(out.scale.cwiseAbs2());
  out.moments.radius = out.moments.radius.cwiseQuotient(out.scale);
}

}  // namespace

RegularizedContactProblem::RegularizedContactProblem() : tangents_(std::make_unique<TangentRows>()) {}
RegularizedContactProblem::~RegularizedContactProblem() = default;

void RegularizedContactProblem::Reserve(int num_contacts, int num_limits, int num_velocities,
                                        int num_freedoms) {
  const auto contacts = static_cast<std::size_t>(num_contacts),
             velocities = static_cast<std::size_t>(num_velocities);
  ports.reserve(velocities / 6 + 1);
  pairs.reserve(contacts);
  points.reserve(contacts);
  probe_.pairs.reserve(contacts);
  probe_.points.reserve(contacts);
  probe_.given.reserve(contacts);
  probe_.limits.reserve(static_cast<std::size_t>(num_limits));
  limits.reserve(static_cast<std::size_t>(num_limits));
  blocks_.Reserve(num_velocities, num_freedoms);
  order_.reserve(contacts);
  elimination_.Reserve(num_velocities, num_contacts + num_limits);
  S_ab_.reserve(contacts);
  S_ba_.reserve(contacts);
  push_.reserve(velocities);
  F_.reserve(velocities);
  internal_forces_.x.reserve(velocities);
  internal_forces_.H.reserve(velocities * velocities);
  block_scratch_.U.reserve(6 * velocities);
  block_scratch_.spans.reserve(velocities);
  tangents_->Reserve(num_contacts, num_velocities);
}

bool RegularizedContactProblem::PreparePoint(const ContactConstraint& in, const PairRows& pair,
                                             PointRows& out,
                                             const Eigen::Ref<const VectorX>& velocities) const {
  out.law.frozen_normal = -1;
  out.law.dilatancy = 0;
  out.velocity.offset.setZero();
  out.velocity.shift.setZero();
  out.turning.offset.setZero();
  out.ClearLinearization();
  PadRows(in.J_a, out.rows_a);
  PadRows(in.J_b, out.rows_b);
  out.law.coefficient = std::max(0.0, in.friction);
  out.law.share = out.moments.share = 1;
  out.moments.radius = {std::max(0.0, in.torsion), std::max(0.0, in.rolling), std::max(0.0, in.rolling)};
  const bool has_moments = out.has_moments = out.moments.Any();
  Vector3 u = in.bias, turning(in.spin, 0, 0);
  out.compliance.inverse_inertia.setZero();
  Quad traces = Quad::Zero(), naturals = traces;
  double reach = u.cwiseAbs().sum();
  const auto side = [&](int index, const PaddedRows& rows) {
    if (index < 0) return;
    const PortRows& port = ports[static_cast<std::size_t>(index)];
    Padded6 V;
    V << velocities.segment<6>(port.row), 0, 0;
    ThreeSums sums;
    sums.Add(rows, V);
    const Vector3 part = sums.Sum();
    u += part;
    reach += part.cwiseAbs().sum();
    AddTraces(rows, port.W, port.W_diagonal, traces, naturals);
    if (!has_moments) return;
    const auto axes = AxesOf(rows);
    turning += axes.transpose() * V.head<3>();
    out.compliance.inverse_inertia +=
        (port.W.topLeftCorner<3, 3>() * axes).cwiseProduct(axes).colwise().sum().transpose();
  };
  side(pair.port_a, out.rows_a);
  side(pair.port_b, out.rows_b);
  const double trace = traces.sum(), natural = naturals.sum();
  if (!Finite(u.sum() + trace + in.previous_impulse.sum() + in.previous_moment.sum() + in.friction +
              in.friction_scale.sum() + in.torsion + in.rolling + in.compliance_normal +
              in.compliance_tangent + in.impulse.sum() + in.moment.sum() + in.spin))
    return false;
  out.compliance.least_R = kMinRelativeRegularization * natural / 3;
  // On the axis of a hinge all of it cancels but rounding, of either sign.
  out.compliance.is_moved = trace / 3 > out.compliance.least_R;
  out.compliance.inverse_mass = out.compliance.is_moved ? trace / 3 : 0;
  out.reach = reach;
  out.compliance.R_n = out.compliance.unloaded_R_n = in.compliance_normal;
  out.compliance.R_t = in.compliance_tangent;
  out.velocity.start = u;
  out.turning.start = turning;
  out.scale.setOnes();
  if (in.friction_scale[0] != 1 || in.friction_scale[1] != 1) ScaleTangents(in.friction_scale, out);
  out.compliance.hardening_speed = in.hardening_speed;
  out.previous.tangents = in.previous_impulse.tail<2>().cwiseQuotient(out.scale.tail<2>());
  out.previous.normal = in.previous_impulse[0];
  out.previous.utilization = in.previous_utilization;
  out.previous.moment = in.previous_moment.cwiseQuotient(out.scale);
  out.impulse = in.impulse.cwiseQuotient(out.scale);
  out.moment = in.moment.cwiseQuotient(out.scale);
  // What a turn of the axes leaves outside the ellipse along its short axis would decide the direction of friction.
  if (out.scale[1] != out.scale[2]) {
    const double bound = std::max(0.0, out.PreviousBound());
    out.previous.tangents = out.previous.tangents.cwiseMax(-bound).cwiseMin(bound);
  }
  if (out.compliance.is_moved) return true;
  out.previous.normal = 0;
  out.impulse.setZero();
  out.moment.setZero();
  return true;
}

// Points of a pair are of one material: they give alike.
void RegularizedContactProblem::SetPairCompliance(PairRows& pair, double max_relative_regularization) {
  pair.material_R_n = pair.material_R_t = pair.R_n = pair.R_t = std::numeric_limits<double>::infinity();
  pair.least_R = 0;
  pair.gives_way = false;
  for (int i = pair.first; i < pair.first + pair.count; ++i) {
    PointRows& point = points[static_cast<std::size_t>(i)];
    if (!point.compliance.is_moved) continue;
    double stiffer =
        std::min(1.0, max_relative_regularization * point.compliance.inverse_mass / point.compliance.R_n);
    pair.material_R_n = std::min(pair.material_R_n, stiffer * point.compliance.R_n);
    pair.material_R_t = std::min(pair.material_R_t, stiffer * point.compliance.R_t);
    stiffer =
        std::min(stiffer, point.compliance.LoadedR_n(point.previous.normal) / point.compliance.unloaded_R_n);
    pair.R_n = std::min(pair.R_n, stiffer * point.compliance.R_n);
    pair.R_t = std::min(pair.R_t, stiffer * point.compliance.R_t);
    pair.least_R = std::max(pair.least_R, point.compliance.least_R);
    // Turning gives what the tangents do at a distance of the patch's size.
    for (int k = 0; k < 3; ++k)
      if (const double radius = point.moments.radius[k]; radius > 0)
        point.compliance.R_turn[k] =
            std::max(std::min(point.compliance.R_t / (radius * radius),
                              max_relative_regularization * point.compliance.inverse_inertia[k]),
                     kMinRelativeRegularization * point.compliance.inverse_inertia[k]);
  }
}

// Rows with what the material gives, and with what tangents and moments bore before: it stays while nothing
// moves.
void RegularizedContactProblem::ApplyPairCompliance(const PairRows& pair) {
  const double R_n = std::max(pair.R_n, pair.least_R), R_t = std::max(pair.R_t, pair.least_R);
  for (int i = pair.first; i < pair.first + pair.count; ++i) {
    PointRows& point = points[static_cast<std::size_t>(i)];
    point.compliance.R_n = point.compliance.is_moved ? R_n : 0;
    point.compliance.R_t = point.compliance.is_moved ? R_t : 0;
    point.SetCompliance(point.compliance.R_n, point.compliance.R_t);
    point.noise = point.compliance.is_moved
                      ? kRounding * std::sqrt(3 * point.compliance.inverse_mass) * point.reach / R_n
                      : 0;
    point.velocity.base = point.velocity.start;
    point.velocity.base.tail<2>() -= point.compliance.R_t * point.previous.tangents;
    point.turning.base = point.turning.start - point.compliance.R_turn.cwiseProduct(point.previous.moment);
  }
}

// Speed [m/s] by which the point gives that gives most, and the share of its R that its material has under that load.
RegularizedContactProblem::Pressed RegularizedContactProblem::PressedIn(const PairRows& pair) const {
  // Twice as soft is let pass: of what comes in one step the next one takes note.
  constexpr double kLetPass = 2;
  Pressed pressed;
  for (int i = pair.first; i < pair.first + pair.count; ++i) {
    const PointRows& point = points[static_cast<std::size_t>(i)];
    const double R_n = point.compliance.R_n;
    const double loaded = point.compliance.LoadedR_n(point.impulse[0]);
    pressed.given = std::max(pressed.given, point.impulse[0] * R_n);
    if (R_n > kLetPass * loaded) pressed.share = std::min(pressed.share, loaded / R_n);
  }
  return pressed;
}

bool RegularizedContactProblem::IsPressedIn() const {
  return std::any_of(pairs.begin(), pairs.end(),
                     [&](const PairRows& pair) { return !pair.gives_way && PressedIn(pair).share < 1; });
}

bool RegularizedContactProblem::DecreaseRegularization() {
  bool any = false;
  for (PairRows& pair : pairs) {
    const double share = PressedIn(pair).share;
    if (pair.gives_way || share == 1 || pair.R_n * share < pair.least_R) continue;
    pair.R_n *= share;
    pair.R_t *= share;
    ApplyPairCompliance(pair);
    any = true;
  }
  return any;
}

void RegularizedContactProblem::BeginProbe() {
  probe_.pairs = pairs;
  probe_.points = points;
  probe_.limits = limits;
  probe_.given.clear();
  for (PairRows& pair : pairs) {
    probe_.given.push_back(PressedIn(pair).given);
    if (pair.gives_way) continue;
    pair.R_n = pair.R_t = pair.least_R;
    ApplyPairCompliance(pair);
  }
}

void RegularizedContactProblem::EndProbe(bool solved) {
  // Pressed at the speed v by what has the inverse mass W, a pair gives v R/(R + W): less than half of v where W exceeds
  // the compliance of hard contact.
  constexpr double kLeft = 0.5;
  std::vector<double>& given = probe_.given;
  for (std::size_t p = 0; p < pairs.size(); ++p)
    given[p] = solved ? PressedIn(pairs[p]).given / std::max(given[p], 1e-300) : 0;
  pairs.swap(probe_.pairs);
  points.swap(probe_.points);
  limits.swap(probe_.limits);
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    PairRows& pair = pairs[p];
    if (pair.gives_way || !(given[p] > kLeft) || PressedIn(pair).share == 1) continue;
    pair.gives_way = true;
    pair.R_n = pair.material_R_n;
    pair.R_t = pair.material_R_t;
    ApplyPairCompliance(pair);
  }
}

bool RegularizedContactProblem::PrepareLimit(const LimitConstraint& in, LimitRows& out,
                                             const Eigen::Ref<const VectorX>& velocities) const {
  const BlockFreedoms::Block& f = blocks_.BlockOf(in.row);
  out = LimitRows{};
  out.Y = f.Row(in.row);
  out.begin = f.begin;
  out.freedoms = f.count;
  out.row = in.row;
  out.sign = in.sign;
  for (int i = 0; i < f.count; ++i) out.inverse_mass += out.Y[i] * out.Y[i];
  FindSpans(out.Y, f.count, out.spans);
  out.material_R = std::max(in.compliance, kMinRelativeRegularization * out.inverse_mass);
  out.law = {out.material_R, in.lower, in.upper};
  out.base = in.sign * velocities[in.row] + in.bias - out.material_R * in.previous_impulse;
  out.impulse = in.impulse;
  out.reach = std::abs(velocities[in.row]) + std::abs(in.bias);
  return Finite(out.base + in.impulse + out.inverse_mass) && !std::isnan(in.lower + in.upper);
}

void RegularizedContactProblem::FindOrder() {
  elimination_.Begin(freedoms());
  for (const PairRows& pair : pairs) {
    Span spans[4];
    int count = 0;
    for (const int index : {pair.port_a, pair.port_b}) {
      if (index < 0) continue;
      const PortRows& port = ports[static_cast<std::size_t>(index)];
      spans[count++] = {port.begin, port.begin + port.freedoms};
      spans[count++] = {port.begin_apart, port.begin_apart + port.freedoms_apart};
    }
    elimination_.Connect(spans, count);
  }
  for (const LimitRows& limit : limits) {
    Span spans[2];
    for (int i = 0; i < 2; ++i)
      spans[i] = {limit.begin + limit.spans[i].begin, limit.begin + limit.spans[i].end};
    elimination_.Connect(spans, 2);
  }
  elimination_.Find();
}

bool RegularizedContactProblem::Prepare(const std::vector<VelocityBlock>& blocks,
                                        const std::vector<ContactConstraint>& contacts,
                                        const std::vector<int>& taken,
                                        const std::vector<LimitConstraint>& limit_rows,
                                        const Eigen::Ref<const VectorX>& velocities,
                                        double max_relative_regularization) {
  blocks_.SetBlocks(blocks, static_cast<int>(velocities.size()));
  ports.clear();
  pairs.clear();
  points.resize(taken.size());
  limits.resize(limit_rows.size());
  order_ = taken;
  const auto key = [&](int i) {
    const ContactConstraint& c = contacts[static_cast<std::size_t>(i)];
    return std::tuple(c.port_a, c.port_b, i);
  };
  const auto earlier = [&](int i, int j) { return key(i) < key(j); };
  if (!std::is_sorted(order_.begin(), order_.end(), earlier))
    std::sort(order_.begin(), order_.end(), earlier);
  for (std::size_t i = 0; i < order_.size(); ++i) {
    const ContactConstraint& c = contacts[static_cast<std::size_t>(order_[i])];
    if (i == 0 || c.port_a != contacts[static_cast<std::size_t>(order_[i - 1])].port_a ||
        c.port_b != contacts[static_cast<std::size_t>(order_[i - 1])].port_b) {
      PairRows& pair = pairs.emplace_back();
      pair.port_a = blocks_.PortAt(c.port_a, ports);
      pair.port_b = blocks_.PortAt(c.port_b, ports);
      const int here = static_cast<int>(pairs.size()) - 1;
      if (pair.port_a >= 0)
        pair.next_of_a = std::exchange(ports[static_cast<std::size_t>(pair.port_a)].first_pair, here);
      if (pair.port_b >= 0)
        pair.next_of_b = std::exchange(ports[static_cast<std::size_t>(pair.port_b)].first_pair, here);
      pair.first = static_cast<int>(i);
    }
    ++pairs.back().count;
    if (!PreparePoint(c, pairs.back(), points[i], velocities)) return false;
  }
  for (PairRows& pair : pairs) SetPairCompliance(pair, max_relative_regularization);
  for (std::size_t i = 0; i < limit_rows.size(); ++i)
    if (!PrepareLimit(limit_rows[i], limits[i], velocities)) return false;
  FindOrder();
  S_ab_.resize(pairs.size());
  S_ba_.resize(pairs.size());
  push_.resize(static_cast<std::size_t>(freedoms()));
  F_.resize(static_cast<std::size_t>(freedoms()));
  RelaxInternalForces();
  for (const PairRows& pair : pairs) ApplyPairCompliance(pair);
  return true;
}

}  // namespace fork1s::internal
