#include "regularized_contact_problem.hpp"

#include <algorithm>
#include <cmath>

namespace fork1s::internal {
Vector3 RegularizedContactProblem::Speed(const PairRows& pair, const PointRows& point) const {
  ThreeSums sums;
  if (pair.port_a >= 0) sums.Add(point.rows_a, ports[static_cast<std::size_t>(pair.port_a)].change);
  if (pair.port_b >= 0) sums.Add(point.rows_b, ports[static_cast<std::size_t>(pair.port_b)].change);
  return point.velocity.base + point.velocity.offset + sums.Sum();
}

double RegularizedContactProblem::NormalSpeed(const PairRows& pair, const PointRows& point) const {
  Quad sum = Quad::Zero();
  const auto add = [&](int port, const PaddedRows& rows) {
    if (port < 0) return;
    const double *change = ports[static_cast<std::size_t>(port)].change.data(), *normal = rows.data();
    sum += QuadAt(normal).cwiseProduct(QuadAt(change));
    sum += QuadAt(normal + 4).cwiseProduct(QuadAt(change + 4));
  };
  add(pair.port_a, point.rows_a);
  add(pair.port_b, point.rows_b);
  return point.velocity.base[0] + point.velocity.offset[0] + sum.sum();
}

Vector3 RegularizedContactProblem::Turning(const PairRows& pair, const PointRows& point) const {
  Vector3 w = point.turning.base + point.turning.offset;
  if (pair.port_a >= 0)
    w += AxesOf(point.rows_a).transpose() * ports[static_cast<std::size_t>(pair.port_a)].change.head<3>();
  if (pair.port_b >= 0)
    w += AxesOf(point.rows_b).transpose() * ports[static_cast<std::size_t>(pair.port_b)].change.head<3>();
  return w;
}

void RegularizedContactProblem::RespondMoments(PointRows& point, const Vector3& turning,
                                               bool with_derivative) const {
  Matrix3 D = Matrix3::Zero();
  Vector3 by_normal = Vector3::Zero();
  point.moment.setZero();
  for (int k = 0; k < 3; ++k) {
    if (!point.moments.Has(k)) continue;
    const BoundLaw law = point.moments.At(k, point.law.BoundingNormal(point.impulse[0]));
    const double y = -turning[k] / law.R;
    point.moment[k] = law.Project(y);
    if (law.IsWithin(y))
      D(k, k) = 1 / law.R;
    else if (!point.law.IsFrozen() && point.impulse[0] > 0)
      by_normal[k] = point.moments.ByNormal(k, y) / point.law.R_n;
  }
  if (!with_derivative) return;
  point.linearization.D_turn = D;
  point.linearization.turn_by_normal = by_normal;
}

void RegularizedContactProblem::ClearPush() {
  for (PortRows& port : ports) port.push.setZero();
}

void RegularizedContactProblem::AddPush(const PairRows& pair, const PointRows& point, const Vector3& impulse,
                                        const Vector3& moment) {
  const auto add = [&](int index, const PaddedRows& rows) {
    if (index < 0) return;
    PortRows& port = ports[static_cast<std::size_t>(index)];
    AddRows(rows, impulse, port.push);
    if (point.HasMoments()) port.push.head<3>() += AxesOf(rows) * moment;
  };
  add(pair.port_a, point.rows_a);
  add(pair.port_b, point.rows_b);
}

// Sums of J_leftᵀ D J_right, and of moments, whose rows are the axes on the angular part of the twist.
void RegularizedContactProblem::AddDerivative(std::size_t p, const PointRows& point) {
  const PairRows& pair = pairs[p];
  const bool a = pair.port_a >= 0, b = pair.port_b >= 0, has_moments = point.HasMoments();
  const PaddedRows &A = point.rows_a, &B = point.rows_b;
  const Matrix3 D_transposed = point.linearization.D.transpose();
  const PaddedRows D_a = RowsTimes(A, D_transposed), D_b = RowsTimes(B, D_transposed);
  const auto add = [&](const PaddedRows& left, const PaddedRows& D_right, const PaddedRows& right,
                       PaddedBlock& S) {
    AddProduct(left, D_right, S);
    if (!has_moments) return;
    const Matrix3 axes = AxesOf(left);
    S.topLeftCorner<3, 3>() += axes * point.linearization.D_turn * AxesOf(right).transpose();
    S.topRows<3>() += axes * point.linearization.turn_by_normal * right.col(0).head<6>().transpose();
  };
  if (a) add(A, D_a, A, ports[static_cast<std::size_t>(pair.port_a)].S);
  if (b) add(B, D_b, B, ports[static_cast<std::size_t>(pair.port_b)].S);
  if (!a || !b) return;
  add(A, D_b, B, S_ab_[p]);
  add(B, D_a, A, S_ba_[p]);
}

void RegularizedContactProblem::Evaluate(const double* d, bool with_derivative) {
  for (PortRows& port : ports) port.SetChange(d);
  ClearPush();
  double noise = 0;
  for (const PairRows& pair : pairs) {
    for (int i = pair.first; i < pair.first + pair.count; ++i) {
      PointRows& point = points[static_cast<std::size_t>(i)];
      if (!(point.law.R_n > 0)) {  // nothing can move it, and its material gives nothing
        point.impulse.setZero();
        point.moment.setZero();
        continue;
      }
      if (point.law.dilatancy > 0) {
        point.linearization.mode = point.law.ProjectDilatant(
            Speed(pair, point), point.impulse, with_derivative ? &point.linearization.D : nullptr);
      } else {
        const FrictionCone::Trial y = point.law.AtVelocity(Speed(pair, point));
        point.impulse = point.law.Project(y);
        point.linearization.mode = point.law.ModeOf(y);
        point.utilization = y.Utilization();
        if (with_derivative) point.law.Derivative(y, point.linearization.D);
      }
      if (with_derivative) point.linearization.is_clear = false;
      if (point.HasMoments()) RespondMoments(point, Turning(pair, point), with_derivative);
      if (!point.CarriesLoad()) continue;
      noise += point.noise * point.noise;
      AddPush(pair, point, point.impulse, point.moment);
    }
  }
  for (LimitRows& limit : limits) {
    double change = 0, reach = limit.reach;
    for (int i = 0; i < limit.freedoms; ++i) {
      const double part = limit.Y[i] * d[limit.begin + i];
      change += part;
      reach += std::abs(part);
    }
    limit.impulse = 0;
    if (with_derivative) limit.D = 0;
    const BoundLaw& law = limit.law;
    if (!(law.R > 0)) continue;
    const double y = -(limit.base + limit.offset + limit.sign * change) / law.R;
    limit.impulse = law.Project(y);
    if (!law.IsWithin(y)) continue;
    if (with_derivative) limit.D = 1 / law.R;
    const double rounding = kRounding * reach / law.R;
    noise += limit.inverse_mass * rounding * rounding;
  }
  GatherPush(&LimitRows::impulse);
  double F2 = 0, push2 = 0;
  for (std::size_t i = 0; i < F_.size(); ++i) {
    F_[i] = d[i] - push_[i];
    F2 += F_[i] * F_[i];
    push2 += push_[i] * push_[i];
  }
  F_norm_ = std::sqrt(F2);
  push_norm_ = std::sqrt(push2);
  noise_ = std::sqrt(noise);
}

void RegularizedContactProblem::GatherPush(double LimitRows::*borne) {
  std::fill(push_.begin(), push_.end(), 0.0);
  for (const PortRows& port : ports) port.AddTo(port.push, push_.data());
  for (const LimitRows& limit : limits)
    for (int i = 0; i < limit.freedoms; ++i)
      push_[static_cast<std::size_t>(limit.begin + i)] += limit.sign * limit.*borne * limit.Y[i];
}

void RegularizedContactProblem::Push(double* into) {
  ClearPush();
  for (const PairRows& pair : pairs)
    for (int i = pair.first; i < pair.first + pair.count; ++i) {
      const PointRows& point = points[static_cast<std::size_t>(i)];
      if (point.impulse.isZero(0) && !point.HasMoments()) continue;
      AddPush(pair, point, point.impulse, point.moment);
    }
  GatherPush(&LimitRows::impulse);
  std::copy(push_.begin(), push_.end(), into);
}

void RegularizedContactProblem::AddChange(const double* d, Eigen::Ref<VectorX> velocities) const {
  for (const BlockFreedoms::Block& f : blocks_.blocks())
    for (int r = 0; r < f.rows; ++r) {
      const double* y = f.Y + static_cast<std::ptrdiff_t>(r) * f.stride;
      double change = 0;
      for (int i = 0; i < f.count; ++i) change += y[i] * d[f.begin + i];
      velocities[f.offset + r] += change;
    }
}

void RegularizedContactProblem::Derivative(double* H) {
  SetDiagonal(1, H);
  AddDerivatives(H);
}

void RegularizedContactProblem::DerivativeByBlocks(double* H) {
  elimination_.SetDiagonal(1, H);
  AddDerivatives(H);
}

void RegularizedContactProblem::AddDerivatives(double* H_data) {
  for (PortRows& port : ports) port.S.setZero();
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    S_ab_[p].setZero();
    S_ba_[p].setZero();
    for (int i = pairs[p].first; i < pairs[p].first + pairs[p].count; ++i)
      if (points[static_cast<std::size_t>(i)].CarriesLoad())
        AddDerivative(p, points[static_cast<std::size_t>(i)]);
  }
  AddBlocks(H_data);
  Eigen::Map<MatrixX> H(H_data, freedoms(), freedoms());
  for (const LimitRows& limit : limits)
    if (limit.D > 0)
      for (const Span& columns : limit.spans)
        for (int c = columns.begin; c < columns.end; ++c)
          for (const Span& rows : limit.spans)
            for (int r = rows.begin; r < rows.end; ++r)
              H(limit.begin + r, limit.begin + c) += limit.D * limit.Y[r] * limit.Y[c];
}

void RegularizedContactProblem::IncreaseRegularization(double share) {
  for (PointRows& point : points) {
    if (!point.compliance.is_moved) continue;
    const double least = share * point.compliance.inverse_mass;
    point.SetCompliance(std::max(point.compliance.R_n, least), std::max(point.compliance.R_t, least));
    point.velocity.offset =
        -Vector3(point.law.R_n - point.compliance.R_n, point.law.R_t - point.compliance.R_t,
                 point.law.R_t - point.compliance.R_t)
             .cwiseProduct(point.impulse);
    if (point.HasMoments())
      point.turning.offset = -(point.moments.R - point.compliance.R_turn).cwiseProduct(point.moment);
  }
  for (LimitRows& limit : limits) {
    limit.law.R = std::max(limit.material_R, share * limit.inverse_mass);
    limit.offset = -(limit.law.R - limit.material_R) * limit.impulse;
  }
}

}  // namespace fork1s::internal
