#include "switched_closures.hpp"

#include <algorithm>
#include <cmath>

#include "ports.hpp"

namespace fork1s {
namespace {

// A direction is not moved where all but this share of the inverse mass at it cancels, as of contacts
// (constraints/prepare_rows.cpp): nothing can close its gap, and it bears nothing.
constexpr double kLeastInverseMass = 1e-11;

RigidTransform PoseOf(const Bodies& bodies, const Detection& detection, int collision_body) {
  const CollisionBody& c = detection.collision_bodies[static_cast<std::size_t>(collision_body)];
  return c.kind == CollisionBody::Kind::kWorld ? RigidTransform() : bodies.PoseOf(c);
}

struct Frames {
  RigidTransform X_WA, X_WB, X_WaJ, X_WbJ;
};
Frames FramesOf(const SwitchedClosure& closure, const Bodies& bodies, const Detection& detection) {
  Frames f;
  f.X_WA = PoseOf(bodies, detection, closure.a);
  f.X_WB = PoseOf(bodies, detection, closure.b);
  f.X_WaJ = f.X_WA * closure.X_AJ;
  f.X_WbJ = f.X_WB * closure.X_BJ;
  return f;
}

// c; of a hinge the turn from the z axis of a to that of b, whatever the angle about it.
Vector6 GapOf(const SwitchedClosure& closure, const Frames& f) {
  const Matrix3 R_E = f.X_WaJ.rotation().transpose() * f.X_WbJ.rotation();
  Vector6 c;
  c << (closure.rigid[2] ? LogRotation(R_E) : Vector3(Vector3::UnitZ().cross(Vector3(R_E.col(2))))),
      f.X_WaJ.rotation().transpose() * (f.X_WbJ.translation() - f.X_WaJ.translation());
  for (int k = 0; k < 6; ++k)
    if (!closure.rigid[k]) c[k] = 0;
  return c;
}

// Twist in world axes about a point.
Vector6 VelocityAt(const Bodies& bodies, const Detection& detection, int collision_body,
                   const RigidTransform& X_WC, const Vector3& point) {
  const CollisionBody& c = detection.collision_bodies[static_cast<std::size_t>(collision_body)];
  if (c.kind == CollisionBody::Kind::kWorld) return Vector6::Zero();
  Vector6 V = bodies.VelocityOf(c);
  V.tail<3>() += V.head<3>().cross(point - X_WC.translation());
  return V;
}

// Q R of the columns of G by Gram-Schmidt with pivoting; columns in units of what they are before anything in them
// cancels, so that what is left of one is a share of it. Q takes the place of G, column k that of pivots[k].
int FactorWithPivoting(MatrixX& G, MatrixX& R, std::vector<int>& pivots) {
  const Eigen::Index n = G.cols();
  R.setZero(n, n);  // columns are those of G
  pivots.clear();
  std::vector<char> is_taken(static_cast<std::size_t>(n), 0);
  for (Eigen::Index step = 0; step < n; ++step) {
    Eigen::Index next = -1;
    double largest = kLeastInverseMass;
    for (Eigen::Index k = 0; k < n; ++k)
      if (const double left = G.col(k).squaredNorm();
          !is_taken[static_cast<std::size_t>(k)] && left > largest) {
        largest = left;
        next = k;
      }
    if (next < 0) break;
    // Once more against those before: what is left is small where rows nearly repeat each other.
    for (std::size_t j = 0; j < pivots.size(); ++j) {
      const double more = G.col(pivots[j]).dot(G.col(next));
      R(static_cast<Eigen::Index>(j), next) += more;
      G.col(next) -= more * G.col(pivots[j]);
    }
    const double norm = G.col(next).norm();
    R(step, next) = norm;
    G.col(next) /= norm;
    is_taken[static_cast<std::size_t>(next)] = 1;
    pivots.push_back(static_cast<int>(next));
    for (Eigen::Index k = 0; k < n; ++k) {
      if (is_taken[static_cast<std::size_t>(k)]) continue;
      R(step, k) = G.col(next).dot(G.col(k));
      G.col(k) -= R(step, k) * G.col(next);
    }
  }
  return static_cast<int>(pivots.size());
}

// The blocks of a group one below the other in its Y; they leave the list.
void StackBlocks(ClosureGroup& group, std::vector<VelocityBlock>& blocks) {
  const auto is_in = [&](const VelocityBlock& b) { return b.offset >= group.begin && b.offset < group.end; };
  Eigen::Index freedoms = 0;
  for (const VelocityBlock& b : blocks)
    if (is_in(b)) freedoms += b.freedoms;
  group.Y.setZero(freedoms, group.end - group.begin);
  Eigen::Index row = 0;
  for (const VelocityBlock& b : blocks) {
    if (!is_in(b)) continue;
    group.Y.block(row, b.offset - group.begin, b.freedoms, b.size) =
        Eigen::Map<const MatrixX, 0, Eigen::OuterStride<>>(b.Y, b.freedoms, b.size,
                                                           Eigen::OuterStride<>(b.stride));
    row += b.freedoms;
  }
  std::erase_if(blocks, is_in);
}

}  // namespace

void StartSwitchedClosures(const Bodies& bodies, const Detection& detection, double h,
                           std::vector<SwitchedClosure>& closures) {
  for (SwitchedClosure& closure : closures) {
    closure.acts =
        SwitchedClosureDef::IsOn(bodies.mechanisms[closure.mechanism].ActivationOf(closure.control));
    closure.rate.setZero();
    if (closure.acts)
      closure.rate =
          std::expm1(-h / closure.time_constant) / h * GapOf(closure, FramesOf(closure, bodies, detection));
  }
}

const SwitchedClosure* FindClosureImpact(const std::vector<SwitchedClosure>& closures, const Bodies& bodies,
                                         const Detection& detection, double impact_speed) {
  for (const SwitchedClosure& closure : closures) {
    if (!closure.acts) continue;
    const Frames f = FramesOf(closure, bodies, detection);
    const Vector3& p = f.X_WbJ.translation();
    const Vector6 V = VelocityAt(bodies, detection, closure.b, f.X_WB, p) -
                      VelocityAt(bodies, detection, closure.a, f.X_WA, p);
    Vector6 off;
    off << f.X_WaJ.rotation().transpose() * V.head<3>(), f.X_WaJ.rotation().transpose() * V.tail<3>();
    off -= closure.rate;
    for (int k = 0; k < 6; ++k)
      if (!closure.rigid[k]) off[k] = 0;
    // Turns count at the distance of the joint, or of the shapes' ends.
    double arm = 0;
    for (const auto& [collision_body, X] : {std::pair(closure.a, f.X_WA), std::pair(closure.b, f.X_WB)})
      if (detection.collision_bodies[static_cast<std::size_t>(collision_body)].kind !=
          CollisionBody::Kind::kWorld)
        arm = std::max({arm, (p - X.translation()).norm(),
                        detection.shapes.radius[static_cast<std::size_t>(collision_body)]});
    if (off.tail<3>().norm() + arm * off.head<3>().norm() > impact_speed) return &closure;
  }
  return nullptr;
}

void AssembleClosures(const std::vector<SwitchedClosure>& closures, const Bodies& bodies,
                      const Detection& detection, ConstraintRows& rows) {
  rows.closures.clear();
  for (std::size_t i = 0; i < closures.size(); ++i) {
    const SwitchedClosure& closure = closures[i];
    if (!closure.acts) continue;
    SwitchedRows& out = rows.closures.emplace_back();
    out.closure = static_cast<int>(i);
    const Frames f = FramesOf(closure, bodies, detection);
    out.axes_W = f.X_WaJ.rotation();
    out.point_W = f.X_WbJ.translation();
    const auto side = [&](int collision_body, double sign, Matrix6& J) {
      const int port = rows.port_offset[static_cast<std::size_t>(collision_body)];
      if (port < 0) return port;
      const Matrix36 linear = PortRows(detection, rows, collision_body, out.point_W, out.axes_W.transpose());
      J.bottomRows<3>() = sign * linear;
      J.topLeftCorner<3, 3>() = sign * linear.rightCols<3>();
      for (int k = 0; k < 6; ++k)
        if (!closure.rigid[k]) J.row(k).setZero();
      return port;
    };
    out.port_a = side(closure.a, -1, out.J_a);
    out.port_b = side(closure.b, 1, out.J_b);
    out.rate = closure.rate;
    for (std::size_t g = 0; g < rows.closure_groups.size(); ++g) {
      const ClosureGroup& group = rows.closure_groups[g];
      const int port = std::max(out.port_a, out.port_b);
      if (port >= group.begin && port < group.end) out.group = static_cast<int>(g);
    }
  }
}

void EliminateClosures(ConstraintRows& rows) {
  for (std::size_t at = 0; at < rows.closure_groups.size(); ++at) {
    ClosureGroup& group = rows.closure_groups[at];
    StackBlocks(group, rows.blocks);
    group.places.clear();
    for (std::size_t c = 0; c < rows.closures.size(); ++c)
      if (rows.closures[c].group == static_cast<int>(at))
        for (int k = 0; k < 6; ++k) group.places.emplace_back(static_cast<int>(c), k);
    const auto count = static_cast<Eigen::Index>(group.places.size());
    group.Q.setZero(group.Y.rows(), count);
    group.unit.setZero(count);
    group.r.setZero(count);
    for (Eigen::Index k = 0; k < count; ++k) {
      const auto [c, row] = group.places[static_cast<std::size_t>(k)];
      const SwitchedRows& closure = rows.closures[static_cast<std::size_t>(c)];
      double natural = 0, off = -closure.rate[row];
      for (const bool is_a : {true, false}) {
        const int port = is_a ? closure.port_a : closure.port_b;
        if (port < 0) continue;
        const Vector6 J = (is_a ? closure.J_a : closure.J_b).row(row).transpose();
        group.scratch.noalias() = group.Y.middleCols(port - group.begin, 6) * J;
        natural += group.scratch.squaredNorm();
        group.Q.col(k) += group.scratch;
        off += J.dot(rows.velocities.segment<6>(port));
      }
      if (!(natural > 0)) continue;
      group.unit[k] = 1 / std::sqrt(natural);
      group.Q.col(k) *= group.unit[k];
      group.r[k] = group.unit[k] * off;
    }
    const int rank = FactorWithPivoting(group.Q, group.R, group.pivots);
    // Rᵀ y = -r, forward.
    group.y.setZero(rank);
    for (int k = 0; k < rank; ++k) {
      double sum = -group.r[group.pivots[static_cast<std::size_t>(k)]];
      for (int j = 0; j < k; ++j) sum -= group.R(j, group.pivots[static_cast<std::size_t>(k)]) * group.y[j];
      group.y[k] = sum / group.R(k, group.pivots[static_cast<std::size_t>(k)]);
    }
    const int size = group.end - group.begin;
    group.C.resize(rank, size);
    for (int k = 0; k < rank; ++k)
      group.C.row(k).noalias() = group.Q.col(group.pivots[static_cast<std::size_t>(k)]).transpose() * group.Y;
    rows.velocities.segment(group.begin, size).noalias() += group.C.transpose() * group.y;
    group.scratch = group.Y.colwise().squaredNorm().transpose();
    for (int k = 0; k < rank; ++k)
      group.Y.noalias() -= group.Q.col(group.pivots[static_cast<std::size_t>(k)]) * group.C.row(k);
    // What is held altogether moves by rounding alone, which a contact would take for its inverse mass.
    for (Eigen::Index k = 0; k < size; ++k)
      if (group.Y.col(k).squaredNorm() <= kLeastInverseMass * group.scratch[k]) group.Y.col(k).setZero();
    const int freedoms = static_cast<int>(group.Y.rows());
    rows.blocks.push_back({group.begin, size, group.Y.data(), freedoms, freedoms});
  }
}

void ComputeClosureImpulses(ConstraintRows& rows) {
  for (SwitchedRows& closure : rows.closures) closure.impulse.setZero();
  for (ClosureGroup& group : rows.closure_groups) {
    const auto rank = static_cast<Eigen::Index>(group.pivots.size());
    group.p.setZero(group.end - group.begin);
    const auto add = [&](int port, const Matrix36& J, const ContactConstraint& c) {
      if (port >= group.begin && port < group.end) group.p.segment<6>(port - group.begin) += c.ImpulseOn(J);
    };
    for (const ContactConstraint& c : rows.contacts) {
      add(c.port_a, c.J_a, c);
      add(c.port_b, c.J_b, c);
    }
    for (const LimitConstraint& limit : rows.limits)
      if (limit.row >= group.begin && limit.row < group.end)
        group.p[limit.row - group.begin] += limit.sign * limit.impulse;
    group.lambda.noalias() = group.y - group.C * group.p;
    for (Eigen::Index k = rank; k-- > 0;) {
      for (Eigen::Index j = k + 1; j < rank; ++j)
        group.lambda[k] -= group.R(k, group.pivots[static_cast<std::size_t>(j)]) * group.lambda[j];
      group.lambda[k] /= group.R(k, group.pivots[static_cast<std::size_t>(k)]);
    }
    for (Eigen::Index k = 0; k < rank; ++k) {
      const int pivot = group.pivots[static_cast<std::size_t>(k)];
      const auto [c, row] = group.places[static_cast<std::size_t>(pivot)];
      rows.closures[static_cast<std::size_t>(c)].impulse[row] = group.unit[pivot] * group.lambda[k];
    }
  }
}

void GatherClosureImpulses(const std::vector<SwitchedClosure>& closures, const Detection& detection,
                           ConstraintRows& rows) {
  for (const SwitchedRows& row : rows.closures) {
    const SwitchedClosure& closure = closures[static_cast<std::size_t>(row.closure)];
    for (const bool is_a : {true, false}) {
      const int port = is_a ? row.port_a : row.port_b;
      if (port < 0) continue;
      const auto at = static_cast<std::size_t>(is_a ? closure.a : closure.b);
      rows.is_pushed[at] = 1;
      const CollisionBody& c = detection.collision_bodies[at];
      if (c.kind != CollisionBody::Kind::kGroup) continue;
      PartRows& part = rows.mechanisms[static_cast<std::size_t>(c.index)]
                           .parts[static_cast<std::size_t>(rows.port_part[at])];
      part.impulse.segment<6>(port - part.offset) += (is_a ? row.J_a : row.J_b).transpose() * row.impulse;
    }
  }
}

void SumClosureImpulses(double weight, const ConstraintRows& rows, std::vector<Vector6>& sums) {
  for (const SwitchedRows& closure : rows.closures) {
    const Vector3 impulse = closure.axes_W * closure.impulse.tail<3>(),
                  moment = closure.axes_W * closure.impulse.head<3>();
    Vector6& sum = sums[static_cast<std::size_t>(closure.closure)];
    sum.head<3>() += weight * (moment + closure.point_W.cross(impulse));
    sum.tail<3>() += weight * impulse;
  }
}

void RecordClosures(const std::vector<SwitchedClosure>& closures, const Bodies& bodies,
                    const Detection& detection, const std::vector<Vector6>& sums,
                    std::vector<SwitchedClosureRecord>& records) {
  records.resize(closures.size());
  for (std::size_t i = 0; i < closures.size(); ++i) {
    SwitchedClosureRecord& record = records[i];
    record.acts = closures[i].acts;
    record.point_W = (PoseOf(bodies, detection, closures[i].b) * closures[i].X_BJ).translation();
    record.impulse_W = sums[i].tail<3>();
    record.moment_W = sums[i].head<3>() - record.point_W.cross(record.impulse_W);
  }
}

}  // namespace fork1s
