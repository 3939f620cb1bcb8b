#include "contact_problem.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "bound_laws.hpp"
#include "linalg/products.hpp"

namespace fork1s::reference {
namespace {

// R of rows without compliance, and least R of all, over the inverse mass before cancellation. It makes the
// solution unique; rows whose inverse mass cancels to less than this cannot be moved.
constexpr double kMinRelativeCompliance = 1e-11;

// Rows of J: those of the points, then of the bounds.
struct RowBuilder {
  MatrixX J;
  VectorX bias;
  int next = 0;

  /// Returns the number of the row.
  int AddRow(const PointConstraint& p, const Vector6& on_a, const Vector6& on_b, double row_bias) {
    if (p.port_a >= 0) J.row(next).segment<6>(p.port_a) += on_a.transpose();
    if (p.port_b >= 0) J.row(next).segment<6>(p.port_b) += on_b.transpose();
    bias[next] = row_bias;
    return next++;
  }
};

// W_v of the stacked velocities.
MatrixX AssembleResponse(const std::vector<ResponseBlock>& blocks, Eigen::Index size) {
  MatrixX W = MatrixX::Zero(size, size);
  for (const ResponseBlock& block : blocks)
    W.block(block.offset, block.offset, block.W.rows(), block.W.cols()) = block.W;
  return W;
}

struct InverseMass {
  double mean = 0;         // trace(J W Jᵀ)/3
  double of_diagonal = 0;  // with the diagonal of W alone
};

InverseMass ComputeInverseMass(const PointConstraint& p, const MatrixX& W) {
  MatrixX J = MatrixX::Zero(3, W.rows());
  if (p.port_a >= 0) J.middleCols<6>(p.port_a) += p.J_a;
  if (p.port_b >= 0) J.middleCols<6>(p.port_b) += p.J_b;
  InverseMass m;
  m.mean = TimesTransposed(Times(J, W), J).trace() / 3;
  m.of_diagonal = J.cwiseAbs2().colwise().sum().dot(W.diagonal()) / 3;
  return m;
}

}  // namespace

ContactProblem AssembleContactProblem(const std::vector<ResponseBlock>& blocks,
                                      const std::vector<PointConstraint>& points,
                                      const std::vector<BoundConstraint>& bounds, const VectorX& velocities) {
  ContactProblem problem;
  const MatrixX W_v = AssembleResponse(blocks, velocities.size());
  const auto max_rows = static_cast<Eigen::Index>(6 * points.size() + bounds.size());
  RowBuilder rows{MatrixX::Zero(max_rows, velocities.size()), VectorX::Zero(max_rows)};
  std::map<std::pair<int, int>, int> pairs;
  std::vector<double> masses;  // inverse, per row
  std::vector<double> previous;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const PointConstraint& p = points[i];
    const InverseMass m = ComputeInverseMass(p, W_v);
    if (!(m.mean > kMinRelativeCompliance * m.of_diagonal)) continue;
    PointBlock block;
    block.constraint = static_cast<int>(i);
    block.inverse_mass = m.mean;
    block.row = rows.next;
    block.pair = pairs.emplace(std::pair(p.port_a, p.port_b), static_cast<int>(pairs.size())).first->second;
    problem.pair_floor.resize(pairs.size(), 0.0);
    double& floor = problem.pair_floor[static_cast<std::size_t>(block.pair)];
    floor = std::max(floor, kMinRelativeCompliance * m.of_diagonal);
    for (int k = 0; k < 3; ++k) {
      rows.AddRow(p, p.J_a.row(k).transpose(), p.J_b.row(k).transpose(), p.bias[k]);
      masses.push_back(m.mean);
      previous.push_back(k == 0 ? 0 : p.previous_impulse[k]);
      // Within the box around the ellipse, which a turn of the axes can leave.
      if (const Vector2 shares = p.FrictionShares(); k > 0 && shares[0] != shares[1]) {
        const double most = p.LargestFriction() * std::max(0.0, p.previous_impulse[0]) * shares[k - 1];
        previous.back() = std::clamp(previous.back(), -most, most);
      }
    }
    for (int k = 0; k < 3; ++k) {
      if (!(p.Radius(k) > 0)) continue;
      Vector6 on_a = Vector6::Zero(), on_b = Vector6::Zero();
      on_a.head<3>() = p.J_a.row(k).tail<3>();
      on_b.head<3>() = p.J_b.row(k).tail<3>();
      block.moment_row[static_cast<std::size_t>(k)] = rows.AddRow(p, on_a, on_b, k == 0 ? p.spin : 0);
      masses.push_back(-1);  // from the diagonal of W
      previous.push_back(p.previous_moment[k]);
    }
    problem.points.push_back(block);
  }
  problem.pair_scale.assign(pairs.size(), 1.0);
  problem.first_bound = rows.next;
  for (const BoundConstraint& bound : bounds) {
    rows.J(rows.next, bound.row) = bound.sign;
    rows.bias[rows.next++] = bound.bias;
    masses.push_back(-1);
    previous.push_back(bound.previous_impulse);
  }
  const Eigen::Index n = rows.next;
  const MatrixX J = rows.J.topRows(n);
  problem.W = TimesTransposed(Times(J, W_v), J);
  problem.W = (0.5 * (problem.W + problem.W.transpose())).eval();
  problem.b = J * velocities + rows.bias.head(n);
  problem.magnitude = J.cwiseAbs() * velocities.cwiseAbs() + rows.bias.head(n).cwiseAbs();
  for (std::size_t k = 0; k < bounds.size(); ++k) {
    const BoundConstraint& bound = bounds[k];
    const Eigen::Index row = problem.first_bound + static_cast<Eigen::Index>(k);
    if (bound.recovery_mass > 0 && bound.bias < 0)
      problem.b[row] -= bound.bias * std::max(0.0, 1 - bound.recovery_mass * problem.W(row, row));
  }
  problem.previous = Eigen::Map<const VectorX>(previous.data(), n);
  problem.inverse_mass = Eigen::Map<const VectorX>(masses.data(), n);
  for (Eigen::Index i = 0; i < n; ++i)
    if (problem.inverse_mass[i] < 0) problem.inverse_mass[i] = std::max(0.0, problem.W(i, i));
  return problem;
}

void InitializePairCompliance(const std::vector<PointConstraint>& points, double max_relative,
                              ContactProblem& problem) {
  std::fill(problem.pair_scale.begin(), problem.pair_scale.end(), 1.0);
  problem.initial_scale = problem.pair_scale;
  problem.driven_pairs.assign(problem.pair_scale.size(), 0);
  for (const PointBlock& block : problem.points) {
    const PointConstraint& p = points[static_cast<std::size_t>(block.constraint)];
    double& scale = problem.pair_scale[static_cast<std::size_t>(block.pair)];
    double& initial = problem.initial_scale[static_cast<std::size_t>(block.pair)];
    initial = std::min(initial, max_relative * block.inverse_mass / p.compliance_normal);
    scale = std::min(scale, initial);
    scale = std::min(scale, p.LoadedScale(p.previous_impulse[0]));
  }
}

std::vector<double> PenetrationSpeeds(const ContactProblem& problem, const VectorX& x) {
  std::vector<double> speeds(problem.pair_scale.size(), 0.0);
  for (const PointBlock& block : problem.points) {
    double& most = speeds[static_cast<std::size_t>(block.pair)];
    most = std::max(most, x[block.row] * problem.R[block.row]);
  }
  return speeds;
}

std::vector<double> ExcessCompliance(const std::vector<PointConstraint>& points,
                                     const ContactProblem& problem, const VectorX& x) {
  std::vector<double> excess(problem.pair_scale.size(), 0.0);
  for (const PointBlock& block : problem.points) {
    const PointConstraint& p = points[static_cast<std::size_t>(block.constraint)];
    double& most = excess[static_cast<std::size_t>(block.pair)];
    most = std::max(most, problem.R[block.row] / (p.LoadedScale(x[block.row]) * p.compliance_normal));
  }
  // Twice the material's is accepted: the next step knows the load.
  for (double& e : excess)
    if (e <= 2) e = 1;
  return excess;
}

bool ReducePairCompliance(const std::vector<PointConstraint>& points, const VectorX& x,
                          ContactProblem& problem) {
  const std::vector<double> excess = ExcessCompliance(points, problem, x);
  bool any = false;
  std::vector<char> at_floor(excess.size(), 0);
  for (const PointBlock& block : problem.points) {
    const auto pair = static_cast<std::size_t>(block.pair);
    if (problem.R[block.row] / excess[pair] < problem.pair_floor[pair]) at_floor[pair] = 1;
  }
  for (std::size_t pair = 0; pair < excess.size(); ++pair) {
    if (excess[pair] == 1 || at_floor[pair] || problem.driven_pairs[pair]) continue;
    problem.pair_scale[pair] /= excess[pair];
    any = true;
  }
  return any;
}

void UpdateCompliance(const std::vector<PointConstraint>& points, double max_relative,
                      ContactProblem& problem) {
  problem.R = kMinRelativeCompliance * problem.inverse_mass;
  for (const PointBlock& block : problem.points) {
    const PointConstraint& p = points[static_cast<std::size_t>(block.constraint)];
    const auto pair = static_cast<std::size_t>(block.pair);
    const double floor = problem.pair_floor[pair], scale = problem.pair_scale[pair];
    problem.R[block.row] = std::max(floor, scale * p.compliance_normal);
    problem.R.segment<2>(block.row + 1) =
        std::max(floor, scale * p.compliance_tangent) * p.FrictionShares().cwiseAbs2().cwiseInverse();
    // A moment meets the tangents' spring at the distance of the radius.
    for (int k = 0; k < 3; ++k) {
      const int row = block.moment_row[static_cast<std::size_t>(k)];
      if (row < 0) continue;
      const double radius = p.Radius(k), inverse_inertia = problem.inverse_mass[row];
      problem.R[row] =
          std::max(std::min(p.compliance_tangent / (radius * radius), max_relative * inverse_inertia),
                   kMinRelativeCompliance * inverse_inertia);
    }
  }
  problem.c = problem.b - problem.R.cwiseProduct(problem.previous);
  for (Eigen::Index i = 0; i < problem.size(); ++i)
    if (!(problem.inverse_mass[i] > 0)) {  // nothing moves the row: x = 0
      problem.R[i] = 1;
      problem.c[i] = 0;
    }
  problem.A = problem.W;
  problem.A.diagonal() += problem.R;
  problem.rho = (problem.inverse_mass + problem.R).cwiseInverse();
  for (const PointBlock& block : problem.points) {
    const Vector2 squares = points[static_cast<std::size_t>(block.constraint)].FrictionShares().cwiseAbs2();
    const Vector2 R = problem.R.segment<2>(block.row + 1).cwiseProduct(squares);
    problem.rho.segment<2>(block.row + 1) = squares.cwiseQuotient((R.array() + block.inverse_mass).matrix());
  }
}

double NaturalMap::Relative() const {
  const double beyond = std::max(0.0, residual - rounding);
  return beyond > 0 ? beyond / std::max(change, residual) : 0;
}

void EvaluateNaturalMap(const ContactProblem& problem, const std::vector<PointConstraint>& points,
                        const std::vector<BoundConstraint>& bounds, const VectorX& x, NaturalMap& map) {
  const VectorX response = problem.W * x;
  map.g = response + problem.R.cwiseProduct(x) + problem.c;
  map.y = x - problem.rho.cwiseProduct(map.g);
  map.projection.resize(x.size());
  map.modes.resize(problem.points.size());
  for (std::size_t i = 0; i < problem.points.size(); ++i) {
    const PointBlock& block = problem.points[i];
    const PointConstraint& p = points[static_cast<std::size_t>(block.constraint)];
    const FrictionProjection cone =
        ProjectOntoFrictionCone(map.y.segment<3>(block.row), p.LargestFriction(), p.FrictionShares());
    map.projection.segment<3>(block.row) = cone.impulse;
    map.modes[i] = cone.mode;
    for (int k = 0; k < 3; ++k)
      if (const int row = block.moment_row[static_cast<std::size_t>(k)]; row >= 0)
        map.projection[row] = ProjectMoment(map.y[row], p.Radius(k), cone.impulse[0]).moment;
  }
  for (std::size_t i = 0; i < bounds.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(problem.first_bound + static_cast<int>(i));
    map.projection[row] = ProjectOntoBounds(map.y[row], bounds[i].lower, bounds[i].upper).impulse;
  }
  const VectorX off = x - map.projection;
  map.residual = std::sqrt(problem.inverse_mass.dot(off.cwiseAbs2()));
  map.change = std::sqrt(std::max(0.0, x.dot(response)));
  const VectorX size =
      problem.rho.cwiseProduct(problem.A.cwiseAbs() * x.cwiseAbs() + problem.magnitude) + x.cwiseAbs();
  map.rounding =
      std::numeric_limits<double>::epsilon() * std::sqrt(problem.inverse_mass.dot(size.cwiseAbs2()));
}

}  // namespace fork1s::reference
