// What the solvers keep of each constraint: its Jacobian in aligned form, its column of W Jᵀ, its local law.
#pragma once

#include <algorithm>
#include <fork1s/contact/contact_solver.hpp>
#include <vector>

#include "local_coulomb.hpp"

namespace fork1s::internal {

/// Part of W Jᵀ: the rows of one block of velocities, 3 columns (1 for a limit), each padded by zeros to a
/// multiple of four so that loops have no remainder. Adding the padding reaches into the next block's rows
/// (or the spare end of the velocities) without changing them.
struct ResponsePart {
  int offset = 0;  // first velocity row
  int size = 0;
  int stride = 0;        // padded rows; 0: no such part
  std::size_t data = 0;  // start in RowSet::storage
};

struct ContactRow {
  alignas(32) double J_a[24];  // 4 x 6 column-major, fourth row zero; tangents turned
  alignas(32) double J_b[24];
  alignas(32) double bias[4];
  alignas(32) double impulse[4];
  int port_a = -1;
  int port_b = -1;
  ResponsePart part[2];
  LocalCoulomb law;
  double c = 1, s = 0;       // turned tangents: t1' = c t1 + s t2, t2' = c t2 − s t1
  double scale = 0;          // r of the residual: momentum per velocity of the heavier side, kg
  double newton_scale = 0;   // r of the Newton equations: that of the contact as a whole, kg
  double change_weight = 1;  // (scale / newton_scale)²: a change of impulse in the units of the residual
  bool live = false;         // false: nothing here can move, so no impulse can help
};

/// Moment of a contact about one axis: u = J_a ω_a + J_b ω_b, |impulse| <= radius times the normal impulse.
struct MomentRow {
  int contact = 0, axis = 0;  // 0 normal, 1 and 2 tangents, as given
  int port_a = -1, port_b = -1;
  Vector3 J_a = Vector3::Zero(), J_b = Vector3::Zero();
  ResponsePart part[2];
  double radius = 0, impulse = 0;
  double inverse = 0;  // 1 / (J W Jᵀ)
  double arm = 1;      // m: at which a force of the contact turns as much as it pushes
  bool live = false;

  double Bounded(double value, double normal) const {
    const double bound = radius * std::max(0.0, normal);
    return std::min(std::max(value, -bound), bound);
  }
};

struct LimitRow {
  int row = 0;
  double sign = 1, bias = 0, impulse = 0, lower = 0, upper = 0;
  ResponsePart part;
  double inverse = 0;  // 1 / W_rr
  bool live = false;

  double Bounded(double value) const { return std::min(std::max(value, lower), upper); }
};

struct RowSet {
  std::vector<ContactRow> contacts;
  std::vector<MomentRow> moments;
  std::vector<LimitRow> limits;
  std::vector<double> storage;   // response columns
  std::vector<int> block_of;     // velocity row -> block
  std::vector<double> start;     // v* with four spare rows
  std::vector<double> velocity;  // v with four spare rows
  std::vector<double> kept;      // impulses set aside
  double momentum = 0;           // largest r (|J||v*| + |bias|): the size of impulses to expect
  double speed = 0;              // largest |J||v*| + |bias|

  /// Reads the problem. Returns false when anything in it is not finite.
  bool Prepare(const std::vector<VelocityBlock>& blocks, const std::vector<ContactConstraint>& contact_list,
               const std::vector<LimitConstraint>& limit_list, const Eigen::Ref<const VectorX>& velocities);
  /// velocity = v* + W Jᵀ λ, afresh.
  void ResetVelocity();
  /// Sets the present impulses aside, and takes them back with the velocity that belongs to them.
  void KeepImpulses();
  void RestoreImpulses();
  /// One Gauss-Seidel sweep. Returns the largest change, in the units of the residual's numerator.
  double Sweep();
  /// Divisor of the residual: the largest impulse within sensible bounds.
  double ResidualScale() const;
  /// Natural-map residual of the law at the present impulses and velocity: the larger of the impulse error
  /// relative to the largest impulse and the velocity error relative to the largest speed.
  double Residual() const;

  void ContactVelocity(const ContactRow& row, double* u) const;
  double LimitVelocity(const LimitRow& row) const {
    return row.sign * velocity[static_cast<std::size_t>(row.row)] + row.bias;
  }
  double MomentVelocity(const MomentRow& row) const;
  double NormalImpulse(const MomentRow& row) const {
    return contacts[static_cast<std::size_t>(row.contact)].impulse[0];
  }
  void AddResponse(const MomentRow& row, double delta);
  void AddResponse(const ContactRow& row, const double* delta);
  void AddResponse(const LimitRow& row, double delta);
  double LargestImpulse() const;

 private:
  bool PrepareContact(const std::vector<VelocityBlock>& blocks, const ContactConstraint& in, ContactRow& row);
  bool PrepareMoments(const std::vector<VelocityBlock>& blocks, const ContactConstraint& in, int contact);
  bool PrepareLimit(const std::vector<VelocityBlock>& blocks, const LimitConstraint& in, LimitRow& row);
  std::size_t Allocate(int stride, int columns);
  int BlockOf(const std::vector<VelocityBlock>& blocks, int row, int rows) const;
};

inline void RowSet::ContactVelocity(const ContactRow& row, double* u) const {
  using Column = Eigen::Map<const Eigen::Array4d, Eigen::Aligned32>;
  Eigen::Array4d x = Column(row.bias), y = Eigen::Array4d::Zero();
  if (row.port_a >= 0) {
    const double* v = velocity.data() + row.port_a;
    for (int k = 0; k < 6; k += 2) {
      x += Column(row.J_a + 4 * k) * v[k];
      y += Column(row.J_a + 4 * k + 4) * v[k + 1];
    }
  }
  if (row.port_b >= 0) {
    const double* v = velocity.data() + row.port_b;
    for (int k = 0; k < 6; k += 2) {
      x += Column(row.J_b + 4 * k) * v[k];
      y += Column(row.J_b + 4 * k + 4) * v[k + 1];
    }
  }
  Eigen::Map<Eigen::Array4d, Eigen::Aligned32> out(u);
  out = x + y;
}

inline void RowSet::AddResponse(const ContactRow& row, const double* delta) {
  using Packet = Eigen::Array4d;
  const double d0 = delta[0], d1 = delta[1], d2 = delta[2];
  for (const ResponsePart& part : row.part) {
    const double* k = storage.data() + part.data;
    double* v = velocity.data() + part.offset;
    const int n = part.stride;
    for (int i = 0; i < n; i += 4) {
      Eigen::Map<Packet> out(v + i);
      out += Eigen::Map<const Packet>(k + i) * d0 + Eigen::Map<const Packet>(k + n + i) * d1 +
             Eigen::Map<const Packet>(k + 2 * n + i) * d2;
    }
  }
}

inline double RowSet::MomentVelocity(const MomentRow& row) const {
  double u = 0;
  for (int k = 0; k < 3; ++k) {
    if (row.port_a >= 0) u += row.J_a[k] * velocity[static_cast<std::size_t>(row.port_a + k)];
    if (row.port_b >= 0) u += row.J_b[k] * velocity[static_cast<std::size_t>(row.port_b + k)];
  }
  return u;
}

inline void RowSet::AddResponse(const MomentRow& row, double delta) {
  for (const ResponsePart& part : row.part) {
    const double* k = storage.data() + part.data;
    double* v = velocity.data() + part.offset;
    for (int i = 0; i < part.stride; ++i) v[i] += k[i] * delta;
  }
}

inline void RowSet::AddResponse(const LimitRow& row, double delta) {
  using Packet = Eigen::Array4d;
  const double* k = storage.data() + row.part.data;
  double* v = velocity.data() + row.part.offset;
  for (int i = 0; i < row.part.stride; i += 4) {
    Eigen::Map<Packet> out(v + i);
    out += Eigen::Map<const Packet>(k + i) * delta;
  }
}

}  // namespace fork1s::internal
