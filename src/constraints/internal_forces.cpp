// What sticking points bear against each other.
//
// Memory keeps tangential impulses as they first came, two fingertips that pull at one object in opposite
// directions among them. Of all tangential impulses with the same effect Σ G_tᵀλ_t, the least in the metric
// of what friction each could bear, M = µ λ_n, is
//     (Σ G_tᵀ M G_t + ε) y = Σ G_tᵀ λ_t,   λ_t' = M G_t y
// and λ_t goes there as far as cones allow. ε keeps the sum definite where points push in few directions.
// Where these rows are fewer than freedoms the same comes from the rows' side (tangent_rows.cpp).
#include <algorithm>
#include <cmath>

#include "linalg/in_place.hpp"
#include "regularized_contact_problem.hpp"
#include "tangent_rows.hpp"

namespace fork1s::internal {
namespace {

constexpr double kProximal = 1e-12;  // of the mean eigenvalue
constexpr double kInside = 0.95;     // of the cone: what fades brings no point to slide

}  // namespace

void RegularizedContactProblem::RelaxInternalForces() {
  int sticking = 0;
  for (PointRows& point : points) {
    point.previous.fades = point.PreviousBound() > 0 && point.previous.utilization < 1 / kInside;
    sticking += point.previous.fades ? 1 : 0;
  }
  if (sticking < 2) return;
  const int left = tangents_->DropDetermined(*this, sticking);
  if (left == 0) return;
  if (!(2 * left < freedoms() ? tangents_->FindLeast(*this, left) : FindLeastByFreedoms())) return;
  double share = 1;
  for (const PointRows& point : points)
    if (point.previous.fades)
      share = std::min(share, FrictionCone::ShareWithin(point.previous.tangents, point.previous.least,
                                                        kInside * point.PreviousBound()));
  for (PointRows& point : points) {
    if (!point.previous.fades) continue;
    point.previous.tangents += share * (point.previous.least - point.previous.tangents);
    point.impulse.tail<2>() = point.previous.tangents;
  }
}

bool RegularizedContactProblem::FindLeastByFreedoms() {
  const auto n = static_cast<std::size_t>(freedoms());
  for (PortRows& port : ports) {
    port.S.setZero();
    port.push.setZero();
  }
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    S_ab_[p].setZero();
    S_ba_[p].setZero();
    for (int i = pairs[p].first; i < pairs[p].first + pairs[p].count; ++i) {
      const PointRows& point = points[static_cast<std::size_t>(i)];
      if (!point.previous.fades) continue;
      const double M = point.PreviousBound();
      const auto a = point.rows_a.rightCols<2>(), b = point.rows_b.rightCols<2>();
      if (pairs[p].port_a >= 0) {
        PortRows& port = ports[static_cast<std::size_t>(pairs[p].port_a)];
        port.S += M * a.lazyProduct(a.topRows<6>().transpose());
        port.push += a * point.previous.tangents;
      }
      if (pairs[p].port_b >= 0) {
        PortRows& port = ports[static_cast<std::size_t>(pairs[p].port_b)];
        port.S += M * b.lazyProduct(b.topRows<6>().transpose());
        port.push += b * point.previous.tangents;
      }
      if (pairs[p].port_a >= 0 && pairs[p].port_b >= 0)
        S_ab_[p] += M * a.lazyProduct(b.topRows<6>().transpose());
    }
    S_ba_[p].topRows<6>() = S_ab_[p].topRows<6>().transpose();
  }
  internal_forces_.H.resize(n * n);
  internal_forces_.x.resize(n);
  SetDiagonal(0, internal_forces_.H.data());
  AddBlocks(internal_forces_.H.data());
  double trace = 0;
  for (std::size_t i = 0; i < n; ++i) trace += internal_forces_.H[i * (n + 1)];
  if (!(trace > 0)) return false;
  for (std::size_t i = 0; i < n; ++i)
    internal_forces_.H[i * (n + 1)] += kProximal * trace / static_cast<double>(n);
  std::fill(internal_forces_.x.begin(), internal_forces_.x.end(), 0.0);
  for (const PortRows& port : ports) port.AddTo(port.push, internal_forces_.x.data());
  if (!FactorCholesky(internal_forces_.H.data(), freedoms())) return false;
  SolveWithCholesky(internal_forces_.H.data(), freedoms(), internal_forces_.x.data());
  for (PortRows& port : ports) port.SetChange(internal_forces_.x.data());
  for (const PairRows& pair : pairs)
    for (int i = pair.first; i < pair.first + pair.count; ++i) {
      PointRows& point = points[static_cast<std::size_t>(i)];
      if (!point.previous.fades) continue;
      Vector2 y = Vector2::Zero();
      if (pair.port_a >= 0)
        y += point.rows_a.rightCols<2>().transpose() * ports[static_cast<std::size_t>(pair.port_a)].change;
      if (pair.port_b >= 0)
        y += point.rows_b.rightCols<2>().transpose() * ports[static_cast<std::size_t>(pair.port_b)].change;
      point.previous.least = point.PreviousBound() * y;
    }
  return true;
}

}  // namespace fork1s::internal
