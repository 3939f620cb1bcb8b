#include <algorithm>
#include <cmath>
#include <fork1s/reduction/compliance.hpp>

#include <fmt/format.h>
#include <Eigen/QR>

#include "world_axes.hpp"

namespace fork1s {
namespace {

// Compliance along the paths of the body graph: prefix[j] = Σ S k⁻¹ Sᵀ over the joints from the root to j.
// Two bodies share the prefix of their last common joint, which is what couples them.
class PathCompliance {
 public:
  PathCompliance(const Mechanism& mechanism, const Kinematics& kinematics)
      : mechanism_(mechanism),
        S_(kinematics.S),
        prefix_(static_cast<std::size_t>(mechanism.num_joints())),
        depth_(static_cast<std::size_t>(mechanism.num_joints())) {
    for (std::size_t j = 0; j < prefix_.size(); ++j) {
      const auto& joint = mechanism.joints()[j];
      prefix_[j] =
          joint.previous < 0 ? Matrix6(Matrix6::Zero()) : prefix_[static_cast<std::size_t>(joint.previous)];
      depth_[j] = joint.previous < 0 ? 1 : depth_[static_cast<std::size_t>(joint.previous)] + 1;
      for (int i = joint.offset; i < joint.offset + joint.size; ++i)
        if (const double k = mechanism.stiffness()(i); k > 0)
          prefix_[j] += S_.col(i) * (S_.col(i) / k).transpose();
    }
  }

  Matrix6 Between(BodyIndex a, BodyIndex b) const {
    int i = mechanism_.body(a).last_joint, j = mechanism_.body(b).last_joint;
    while (i != j) {
      const int di = i < 0 ? 0 : depth_[static_cast<std::size_t>(i)],
                dj = j < 0 ? 0 : depth_[static_cast<std::size_t>(j)];
      if (di >= dj) i = mechanism_.joint(JointIndex(i)).previous;
      if (dj >= di) j = mechanism_.joint(JointIndex(j)).previous;
    }
    return i < 0 ? Matrix6(Matrix6::Zero()) : prefix_[static_cast<std::size_t>(i)];
  }

  bool OnPath(int coordinate, BodyIndex b) const {
    const int joint = mechanism_.CoordinateJoint(coordinate).value();
    int j = mechanism_.body(b).last_joint;
    while (j > joint) j = mechanism_.joint(JointIndex(j)).previous;
    return j == joint;
  }
  Vector6 Column(int coordinate, BodyIndex b) const {
    return OnPath(coordinate, b) ? Vector6(S_.col(coordinate)) : Vector6(Vector6::Zero());
  }

 private:
  const Mechanism& mechanism_;
  const Matrix6X& S_;
  std::vector<Matrix6> prefix_;
  std::vector<int> depth_;
};

// Something whose displacement is a linear map of body twists and coordinates: an interface, a closure, a
// spring.
struct Port {
  std::vector<std::pair<BodyIndex, MatrixX>> bodies;  // rows x 6
  std::vector<std::pair<int, double>> coordinates;    // one row
  Eigen::Index rows = 0;
};

MatrixX CrossCompliance(const Mechanism& mechanism, const PathCompliance& path, const Port& a,
                        const Port& b) {
  MatrixX C = MatrixX::Zero(a.rows, b.rows);
  for (const auto& [body_a, B_a] : a.bodies)
    for (const auto& [body_b, B_b] : b.bodies) C += B_a * path.Between(body_a, body_b) * B_b.transpose();
  auto inverse = [&](int i) { return mechanism.stiffness()(i) > 0 ? 1 / mechanism.stiffness()(i) : 0.0; };
  for (const auto& [body_a, B_a] : a.bodies)
    for (const auto& [i, c] : b.coordinates) C.col(0) += B_a * path.Column(i, body_a) * (c * inverse(i));
  for (const auto& [i, c] : a.coordinates)
    for (const auto& [body_b, B_b] : b.bodies)
      C.row(0) += (B_b * path.Column(i, body_b)).transpose() * (c * inverse(i));
  for (const auto& [i, ci] : a.coordinates)
    for (const auto& [j, cj] : b.coordinates)
      if (i == j) C(0, 0) += ci * cj * inverse(i);
  return C;
}

VectorX FreeColumn(const PathCompliance& path, const Port& port, int coordinate) {
  VectorX column = VectorX::Zero(port.rows);
  for (const auto& [body, B] : port.bodies) column += B * path.Column(coordinate, body);
  for (const auto& [i, c] : port.coordinates)
    if (i == coordinate) column(0) += c;
  return column;
}

// Twist of body b in R -> [rotation; translation of the body's origin].
MatrixX AboutBodyOrigin(const Kinematics& kinematics, BodyIndex b) {
  MatrixX B = MatrixX::Identity(6, 6);
  B.bottomLeftCorner<3, 3>() = -Skew(kinematics.X_RB[b.u()].translation());
  return B;
}

struct Loops {
  std::vector<Port> ports;
  std::vector<VectorX> softness;  // compliance of the closure itself, per row; 0 = rigid
};

Loops CollectLoops(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q) {
  Loops loops;
  for (const ClosureDef& closure : mechanism.closures()) {
    const RigidTransform X_aJ = kinematics.X_RB[closure.body_a.u()] * closure.X_AJ;
    const RigidTransform E = X_aJ.inverse() * (kinematics.X_RB[closure.body_b.u()] * closure.X_BJ);
    Matrix6 L = Matrix6::Identity();
    L.topLeftCorner<3, 3>() = DexpInverseRotation(LogRotation(E.rotation()));
    L.bottomLeftCorner<3, 3>() = -Skew(E.translation());
    const Matrix6 B = L * Adjoint(X_aJ.inverse());
    std::vector<int> kept;
    for (int i = 0; i < 6; ++i)
      if (closure.rigid(i) || closure.stiffness(i) > 0) kept.push_back(i);
    if (kept.empty()) continue;
    Port port;
    port.rows = static_cast<Eigen::Index>(kept.size());
    MatrixX rows(port.rows, 6);
    VectorX soft(port.rows);
    for (Eigen::Index i = 0; i < port.rows; ++i) {
      const int k = kept[static_cast<std::size_t>(i)];
      rows.row(i) = B.row(k);
      soft(i) = closure.rigid(k) ? 0 : 1 / closure.stiffness(k);
    }
    port.bodies = {{closure.body_b, rows}, {closure.body_a, -rows}};
    loops.ports.push_back(std::move(port));
    loops.softness.push_back(soft);
  }
  auto add_row = [&](std::vector<std::pair<int, double>> terms, double softness) {
    Port port;
    port.rows = 1;
    port.coordinates = std::move(terms);
    loops.ports.push_back(std::move(port));
    loops.softness.push_back(VectorX::Constant(1, softness));
  };
  for (const Mechanism::Spring& s : mechanism.springs())
    if (s.stiffness > 0) add_row(s.terms, 1 / s.stiffness);
  for (const Mechanism::Coupling& k : mechanism.couplings()) {
    std::vector<std::pair<int, double>> terms{{k.a, 1.0}};
    if (k.b >= 0) {
      const double x = q(k.b);
      const auto& p = k.polynomial;
      terms.emplace_back(k.b, -(p[1] + x * (2 * p[2] + x * (3 * p[3] + x * 4 * p[4]))));
    }
    add_row(std::move(terms), 0);
  }
  return loops;
}

}  // namespace

Expected<MatrixX> WalkCompliance(const Mechanism& mechanism, const VectorX& q,
                                 const std::vector<BodyIndex>& bodies) {
  Kinematics kinematics(mechanism);
  ComputeKinematics(mechanism, q, kinematics);
  const PathCompliance path(mechanism, kinematics);
  const Eigen::Index e = static_cast<Eigen::Index>(bodies.size());

  std::vector<Port> ends;
  for (BodyIndex b : bodies) {
    Port port;
    port.rows = 6;
    port.bodies.push_back({b, AboutBodyOrigin(kinematics, b)});
    ends.push_back(std::move(port));
  }
  MatrixX C(6 * e, 6 * e);
  for (Eigen::Index i = 0; i < e; ++i)
    for (Eigen::Index j = 0; j < e; ++j)
      C.block<6, 6>(6 * i, 6 * j) = CrossCompliance(mechanism, path, ends[static_cast<std::size_t>(i)],
                                                    ends[static_cast<std::size_t>(j)]);

  const Loops loops = CollectLoops(mechanism, kinematics, q);
  std::vector<int> unsprung;
  for (int i = 0; i < mechanism.num_coordinates(); ++i)
    if (mechanism.stiffness()(i) == 0) unsprung.push_back(i);

  // Displacements are C (f - Wᵀλ) plus the unsprung joints' own motion F a. With loop reactions λ, loops
  // closed and unsprung joints in equilibrium:
  //     [ W C Wᵀ + C_l   -W_u ] [λ]   [ W C f   ]
  //     [ -W_uᵀ             0 ] [a] = [ -J_uᵀ f ]
  Eigen::Index m = 0;
  for (const Port& p : loops.ports) m += p.rows;
  const Eigen::Index u = static_cast<Eigen::Index>(unsprung.size());
  if (m + u > 0) {
    MatrixX S = MatrixX::Zero(m + u, m + u), B = MatrixX::Zero(m + u, 6 * e);
    Eigen::Index row = 0;
    for (std::size_t i = 0; i < loops.ports.size(); ++i) {
      const Port& p = loops.ports[i];
      Eigen::Index column = 0;
      for (const Port& o : loops.ports) {
        S.block(row, column, p.rows, o.rows) = CrossCompliance(mechanism, path, p, o);
        column += o.rows;
      }
      S.block(row, row, p.rows, p.rows).diagonal() += loops.softness[i];
      for (Eigen::Index k = 0; k < u; ++k) {
        const VectorX w = FreeColumn(path, p, unsprung[static_cast<std::size_t>(k)]);
        S.block(row, m + k, p.rows, 1) = -w;
        S.block(m + k, row, 1, p.rows) = -w.transpose();
      }
      for (Eigen::Index j = 0; j < e; ++j)
        B.block(row, 6 * j, p.rows, 6) =
            CrossCompliance(mechanism, path, p, ends[static_cast<std::size_t>(j)]);
      row += p.rows;
    }
    for (Eigen::Index k = 0; k < u; ++k)
      for (Eigen::Index j = 0; j < e; ++j)
        B.block(m + k, 6 * j, 1, 6) =
            -FreeColumn(path, ends[static_cast<std::size_t>(j)], unsprung[static_cast<std::size_t>(k)])
                 .transpose();

    // Rows in rad/N·m, m/N and lengths differ by many orders: balance them before any rank is decided.
    VectorX balance = VectorX::Ones(m + u);
    for (int pass = 0; pass < 8; ++pass) {
      const MatrixX scaled = balance.asDiagonal() * S * balance.asDiagonal();
      for (Eigen::Index i = 0; i < m + u; ++i) {
        const double largest = scaled.row(i).cwiseAbs().maxCoeff();
        if (largest > 0) balance(i) /= std::sqrt(largest);
      }
    }
    const MatrixX S_balanced = balance.asDiagonal() * S * balance.asDiagonal();
    const MatrixX B_balanced = balance.asDiagonal() * B;
    Eigen::CompleteOrthogonalDecomposition<MatrixX> solver;
    solver.setThreshold(1e-10);
    solver.compute(S_balanced);
    const MatrixX X = solver.solve(B_balanced);
    const double left = (S_balanced * X - B_balanced).cwiseAbs().maxCoeff();
    if (left > 1e-7 * std::max(1e-300, B_balanced.cwiseAbs().maxCoeff()))
      return Fail(
          ErrorCode::kUnderdetermined, fmt::format("mechanism '{}'", mechanism.name()),
          "has a spring-free motion that moves an interface body, so that its compliance does not exist");
    // d = C f - B₁ᵀ λ + J_u a, and the lower part of B is -J_uᵀ: both signs agree.
    C -= B_balanced.transpose() * X;
  }
  const MatrixX R = internal::WorldAxes(mechanism, bodies.size());
  C = R * C * R.transpose();
  return MatrixX(0.5 * (C + C.transpose()));
}

}  // namespace fork1s
