// The rows of a problem: blocks in freedoms, ports, points in order of their pairs, what each gives.
#include <algorithm>
#include <cmath>
#include <fork1s/base/error.hpp>
#include <fork1s/linalg/in_place.hpp>
#include <limits>
#include <tuple>
#include <utility>

#include "compliant_rows.hpp"
#include "tangent_rows.hpp"

namespace fork1s::internal {
namespace {

// Of the inverse mass at a contact, before anything in it cancels: what a contact gives at least, so that
// hard ones (R = 0) have one answer. Impulses λ = -w/R are found to rounding over this, 2e-5, before they are
// refined (piece_newton.cpp).
constexpr double kLeastGive = 1e-11;

// Share of the larger friction coefficient that a tangent keeps, so that its row remains.
constexpr double kMinFrictionScale = 1e-9;

bool Finite(double sum) { return std::isfinite(sum); }

// As many freedoms, a body's or a finger's, are not looked through for some that move nothing.
constexpr int kAllMove = 6;

// From the first freedom that moves something to the last, apart at the longest gap between them.
template <class Moves>
void FindSpans(int freedoms, const Moves& moves, Span (&out)[2]) {
  int first = 0, last = freedoms - 1, gap_begin = 0, gap = 0;
  while (first < freedoms && !moves(first)) ++first;
  while (last >= first && !moves(last)) --last;
  if (freedoms > kAllMove)
    for (int i = first + 1, before = first; i <= last; ++i) {
      if (!moves(i)) continue;
      if (i - before - 1 > gap) {
        gap_begin = before + 1;
        gap = i - before - 1;
      }
      before = i;
    }
  const int end = std::max(first, last + 1);
  out[0] = {first, gap > 0 ? gap_begin : end};
  out[1] = gap > 0 ? Span{gap_begin + gap, end} : Span();
}

void FindFreedoms(const double* Y, int begin, int freedoms, PortRows& port) {
  const auto moves = [&](int i) {
    for (int c = 0; c < 6; ++c)
      if (Y[static_cast<std::ptrdiff_t>(c) * port.stride + i] != 0) return true;
    return false;
  };
  Span spans[2];
  FindSpans(freedoms, moves, spans);
  port.Y = Y + spans[0].begin;
  port.begin = begin + spans[0].begin;
  port.freedoms = spans[0].size();
  port.Y_apart = Y + spans[1].begin;
  port.begin_apart = begin + spans[1].begin;
  port.freedoms_apart = spans[1].size();
}

// Rows of the tangents and their velocities times their shares of the larger friction coefficient, and radii of
// moments about them over these: friction is isotropic in such rows (laws/friction_cone.hpp), and rolling friction
// unchanged.
void ScaleTangents(const Vector2& friction_scale, PointRows& out) {
  const double largest = std::max(0.0, friction_scale.maxCoeff());
  out.law.coefficient *= largest;
  if (largest > 0) out.scale.tail<2>() = (friction_scale / largest).cwiseMax(kMinFrictionScale);
  for (PaddedRows* rows : {&out.rows_a, &out.rows_b}) *rows *= out.scale.asDiagonal();
  out.start = out.start.cwiseProduct(out.scale);
  out.start_turning = out.start_turning.cwiseProduct(out.scale);
  out.inverse_inertia = out.inverse_inertia.cwiseProduct(out.scale.cwiseAbs2());
  out.moments.radius = out.moments.radius.cwiseQuotient(out.scale);
}

}  // namespace

CompliantRows::CompliantRows() : tangents_(std::make_unique<TangentRows>()) {}
CompliantRows::~CompliantRows() = default;

void CompliantRows::Reserve(int num_contacts, int num_limits, int num_velocities, int num_freedoms) {
  const auto contacts = static_cast<std::size_t>(num_contacts),
             velocities = static_cast<std::size_t>(num_velocities);
  ports.reserve(velocities / 6 + 1);
  pairs.reserve(contacts);
  points.reserve(contacts);
  limits.reserve(static_cast<std::size_t>(num_limits));
  block_of_.reserve(velocities);
  port_of_.reserve(velocities);
  order_.reserve(contacts);
  elimination_.Reserve(num_velocities, num_contacts + num_limits);
  blocks_.reserve(velocities);
  S_ab_.reserve(contacts);
  S_ba_.reserve(contacts);
  push_.reserve(velocities);
  F_.reserve(velocities);
  squeeze_.reserve(velocities);
  U_.reserve(6 * velocities);
  spans_.reserve(velocities);
  squeeze_H_.reserve(velocities * velocities);
  tangents_->Reserve(num_contacts, num_velocities);
  by_freedom_.reserve(2 * velocities * velocities);
  storage_.reserve(velocities * static_cast<std::size_t>(num_freedoms));
}

void CompliantRows::LayOutBlocks(const std::vector<VelocityBlock>& blocks, int num_velocities) {
  block_of_.assign(static_cast<std::size_t>(num_velocities), -1);
  port_of_.assign(static_cast<std::size_t>(num_velocities), -1);
  blocks_.resize(blocks.size());
  const auto moves = [](const VelocityBlock& block, int freedom) {
    for (int c = 0; c < block.size; ++c)
      if (block.Y[static_cast<std::ptrdiff_t>(c) * block.stride + freedom] != 0) return true;
    return false;
  };
  std::size_t room = 0;
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const VelocityBlock& block = blocks[b];
    int moving = block.freedoms;
    if (moving > kAllMove) {
      moving = 0;
      for (int i = 0; i < block.freedoms; ++i) moving += moves(block, i) ? 1 : 0;
    }
    blocks_[b].count = moving;
    if (moving < block.freedoms || moving > block.size)
      room += static_cast<std::size_t>(moving) * static_cast<std::size_t>(block.size);
  }
  storage_.resize(room);
  room = 0;
  for (std::size_t b = 0; b < blocks.size(); ++b)
    room += static_cast<std::size_t>(8 * std::min(blocks_[b].count, blocks[b].size) * (blocks[b].size / 6));
  if (by_freedom_.size() < room) by_freedom_.resize(room);
  by_freedom_used_ = 0;
  room = 0;
  freedoms_ = 0;
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const VelocityBlock& block = blocks[b];
    FORK1S_REQUIRE(block.offset >= 0 && block.offset + block.size <= num_velocities, b);
    std::fill_n(block_of_.begin() + block.offset, block.size, static_cast<int>(b));
    Freedoms& f = blocks_[b];
    const int moving = f.count;
    f = {block.Y, block.stride, freedoms_, moving, block.offset, block.size};
    if (moving < block.freedoms || moving > block.size) {
      // Legs that touch nothing are left out.
      double* Y = storage_.data() + room;
      for (int i = 0, next = 0; i < block.freedoms; ++i) {
        if (!moves(block, i)) continue;
        for (int c = 0; c < block.size; ++c)
          Y[static_cast<std::ptrdiff_t>(c) * moving + next] =
              block.Y[static_cast<std::ptrdiff_t>(c) * block.stride + i];
        ++next;
      }
      f.Y = Y;
      f.stride = moving;
      if (moving > block.size) {
        // Ports move by no more than their rows can tell apart: Y = Q R, and R takes the place of Y.
        TriangularRoot(Y, moving, block.size);
        f.count = block.size;
      }
      room += static_cast<std::size_t>(moving) * static_cast<std::size_t>(block.size);
    }
    freedoms_ += f.count;
  }
}

int CompliantRows::PortAt(const std::vector<VelocityBlock>& blocks, int row) {
  if (row < 0) return -1;
  FORK1S_REQUIRE(row + 6 <= static_cast<int>(block_of_.size()), row);
  int& known = port_of_[static_cast<std::size_t>(row)];
  if (known >= 0) return known;
  const int b = block_of_[static_cast<std::size_t>(row)];
  FORK1S_REQUIRE(b >= 0, row);
  const VelocityBlock& block = blocks[static_cast<std::size_t>(b)];
  FORK1S_REQUIRE(row + 6 <= block.offset + block.size, row, block.offset, block.size);
  const Freedoms& f = blocks_[static_cast<std::size_t>(b)];
  known = static_cast<int>(ports.size());
  PortRows& port = ports.emplace_back();
  port.stride = f.stride;
  port.row = row;
  const double* Y = f.Y + static_cast<std::ptrdiff_t>(row - block.offset) * f.stride;
  FindFreedoms(Y, f.begin, f.count, port);
  port.SetByFreedom(by_freedom_.data() + by_freedom_used_);
  by_freedom_used_ += 8 * static_cast<std::size_t>(port.freedoms + port.freedoms_apart);
  return known;
}

bool CompliantRows::PreparePoint(const ContactConstraint& in, const PairRows& pair, PointRows& out,
                                 const Eigen::Ref<const VectorX>& velocities) const {
  out.law.frozen_normal = -1;
  out.offset.setZero();
  out.shift.setZero();
  out.angular_offset.setZero();
  out.ClearPiece();
  PadRows(in.J_a, out.rows_a);
  PadRows(in.J_b, out.rows_b);
  out.law.coefficient = std::max(0.0, in.friction);
  out.law.share = out.moments.share = 1;
  out.moments.radius = {std::max(0.0, in.torsion), std::max(0.0, in.rolling), std::max(0.0, in.rolling)};
  const bool has_moments = out.has_moments = out.moments.Any();
  Vector3 u = in.bias, turning = Vector3::Zero();
  out.inverse_inertia.setZero();
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
    out.inverse_inertia +=
        (port.W.topLeftCorner<3, 3>() * axes).cwiseProduct(axes).colwise().sum().transpose();
  };
  side(pair.port_a, out.rows_a);
  side(pair.port_b, out.rows_b);
  const double trace = traces.sum(), natural = naturals.sum();
  if (!Finite(u.sum() + trace + in.held.sum() + in.held_moment.sum() + in.friction + in.friction_scale.sum() +
              in.torsion + in.rolling + in.compliance_normal + in.compliance_tangent + in.impulse.sum() +
              in.moment.sum()))
    return false;
  out.least_R = kLeastGive * natural / 3;
  // On the axis of a hinge all of it cancels but rounding, of either sign.
  out.is_moved = trace / 3 > out.least_R;
  out.inverse_mass = out.is_moved ? trace / 3 : 0;
  out.reach = reach;
  out.R_n = in.compliance_normal;
  out.R_t = in.compliance_tangent;
  out.start = u;
  out.start_turning = turning;
  out.scale.setOnes();
  if (in.friction_scale[0] != 1 || in.friction_scale[1] != 1) ScaleTangents(in.friction_scale, out);
  out.give = in.give;
  out.held = in.held.tail<2>().cwiseQuotient(out.scale.tail<2>());
  out.held_normal = in.held[0];
  out.held_use = in.held_use;
  out.held_moment = in.held_moment.cwiseQuotient(out.scale);
  out.impulse = in.impulse.cwiseQuotient(out.scale);
  out.moment = in.moment.cwiseQuotient(out.scale);
  // What a turn of the axes leaves outside the ellipse along its short axis would decide the direction of friction.
  if (out.scale[1] != out.scale[2]) {
    const double bound = std::max(0.0, out.HeldBound());
    out.held = out.held.cwiseMax(-bound).cwiseMin(bound);
  }
  if (out.is_moved) return true;
  out.held_normal = 0;
  out.impulse.setZero();
  out.moment.setZero();
  return true;
}

// Points of a pair are of one material: they give alike.
void CompliantRows::SetGive(PairRows& pair, double most_give) {
  pair.R_n = pair.R_t = std::numeric_limits<double>::infinity();
  pair.least_R = 0;
  for (int i = pair.first; i < pair.first + pair.count; ++i) {
    PointRows& point = points[static_cast<std::size_t>(i)];
    if (!point.is_moved) continue;
    double stiffer = std::min(1.0, most_give * point.inverse_mass / point.R_n);
    if (point.held_normal > 0) stiffer = std::min(stiffer, point.give / (point.held_normal * point.R_n));
    pair.R_n = std::min(pair.R_n, stiffer * point.R_n);
    pair.R_t = std::min(pair.R_t, stiffer * point.R_t);
    pair.least_R = std::max(pair.least_R, point.least_R);
    // Turning gives what the tangents do at a distance of the patch's size.
    for (int k = 0; k < 3; ++k)
      if (const double radius = point.moments.radius[k]; radius > 0)
        point.angular_R[k] =
            std::max(std::min(point.R_t / (radius * radius), most_give * point.inverse_inertia[k]),
                     kLeastGive * point.inverse_inertia[k]);
  }
}

// Rows with what the material gives, and with what tangents and moments bore before: it stays while nothing
// moves.
void CompliantRows::ApplyGive(const PairRows& pair) {
  const double R_n = std::max(pair.R_n, pair.least_R), R_t = std::max(pair.R_t, pair.least_R);
  for (int i = pair.first; i < pair.first + pair.count; ++i) {
    PointRows& point = points[static_cast<std::size_t>(i)];
    point.R_n = point.is_moved ? R_n : 0;
    point.R_t = point.is_moved ? R_t : 0;
    point.SetCompliance(point.R_n, point.R_t);
    point.noise = point.is_moved ? kRounding * std::sqrt(3 * point.inverse_mass) * point.reach / R_n : 0;
    point.base = point.start;
    point.base.tail<2>() -= point.R_t * point.held;
    point.angular_base = point.start_turning - point.angular_R.cwiseProduct(point.held_moment);
  }
}

bool CompliantRows::Stiffen() {
  // Twice the depth is let pass: of what comes in one step the next one takes note.
  constexpr double kLetPass = 2;
  bool any = false;
  for (PairRows& pair : pairs) {
    double share = 1;
    for (int i = pair.first; i < pair.first + pair.count; ++i) {
      const PointRows& point = points[static_cast<std::size_t>(i)];
      const double given = point.impulse[0] * point.R_n;
      if (given > kLetPass * point.give) share = std::min(share, point.give / given);
    }
    if (share == 1 || pair.R_n * share < pair.least_R) continue;
    pair.R_n *= share;
    pair.R_t *= share;
    ApplyGive(pair);
    any = true;
  }
  return any;
}

bool CompliantRows::PrepareLimit(const std::vector<VelocityBlock>& blocks, const LimitConstraint& in,
                                 LimitRows& out, const Eigen::Ref<const VectorX>& velocities) const {
  FORK1S_REQUIRE(in.row >= 0 && in.row < static_cast<int>(block_of_.size()), in.row);
  const int b = block_of_[static_cast<std::size_t>(in.row)];
  FORK1S_REQUIRE(b >= 0, in.row);
  const Freedoms& f = blocks_[static_cast<std::size_t>(b)];
  out = LimitRows{};
  out.Y = f.Y + static_cast<std::ptrdiff_t>(in.row - blocks[static_cast<std::size_t>(b)].offset) * f.stride;
  out.begin = f.begin;
  out.freedoms = f.count;
  out.row = in.row;
  out.sign = in.sign;
  for (int i = 0; i < f.count; ++i) out.inverse_mass += out.Y[i] * out.Y[i];
  FindSpans(
      f.count, [&](int i) { return out.Y[i] != 0; }, out.spans);
  out.material_R = std::max(in.compliance, kLeastGive * out.inverse_mass);
  out.law = {out.material_R, in.lower, in.upper};
  out.base = in.sign * velocities[in.row] + in.bias - out.material_R * in.held;
  out.impulse = in.impulse;
  out.reach = std::abs(velocities[in.row]) + std::abs(in.bias);
  return Finite(out.base + in.impulse + out.inverse_mass) && !std::isnan(in.lower + in.upper);
}

void CompliantRows::FindOrder() {
  elimination_.Begin(freedoms_);
  for (const PairRows& pair : pairs) {
    Span spans[4];
    int count = 0;
    for (const int index : {pair.port_a, pair.port_b}) {
      if (index < 0) continue;
      const PortRows& port = ports[static_cast<std::size_t>(index)];
      spans[count++] = {port.begin, port.begin + port.freedoms};
      spans[count++] = {port.begin_apart, port.begin_apart + port.freedoms_apart};
    }
    elimination_.Meet(spans, count);
  }
  for (const LimitRows& limit : limits) {
    Span spans[2];
    for (int i = 0; i < 2; ++i)
      spans[i] = {limit.begin + limit.spans[i].begin, limit.begin + limit.spans[i].end};
    elimination_.Meet(spans, 2);
  }
  elimination_.Find();
}

bool CompliantRows::Prepare(const std::vector<VelocityBlock>& blocks,
                            const std::vector<ContactConstraint>& contacts, const std::vector<int>& taken,
                            const std::vector<LimitConstraint>& limit_rows,
                            const Eigen::Ref<const VectorX>& velocities, double most_give) {
  LayOutBlocks(blocks, static_cast<int>(velocities.size()));
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
      pair.port_a = PortAt(blocks, c.port_a);
      pair.port_b = PortAt(blocks, c.port_b);
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
  for (PairRows& pair : pairs) SetGive(pair, most_give);
  for (std::size_t i = 0; i < limit_rows.size(); ++i)
    if (!PrepareLimit(blocks, limit_rows[i], limits[i], velocities)) return false;
  FindOrder();
  S_ab_.resize(pairs.size());
  S_ba_.resize(pairs.size());
  push_.resize(static_cast<std::size_t>(freedoms_));
  F_.resize(static_cast<std::size_t>(freedoms_));
  FadeSqueeze();
  for (const PairRows& pair : pairs) ApplyGive(pair);
  return true;
}

}  // namespace fork1s::internal
