#include "contact_rows.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/base/error.hpp>

namespace fork1s::internal {
namespace {

// Below this fraction of its natural size an effective inverse mass is rounding.
constexpr double kImmovable = 1e-13;
// Regularisation of the local law. The sweeps solve for the change of the impulse, so their fixed points
// stay those of the law itself; directions in which W is singular just keep the impulse they have.
constexpr double kRegularisation = 1e-9;
// Impulses below this fraction of the momentum at hand count as zero in the residual: velocities cancel to
// about 1e-15, and the tolerance asks for 1e-4 of what is left.
constexpr double kSmallestScale = 1e-9;
// Impulses above this multiple of the momentum at hand do not excuse larger errors: they appear where no
// impulse can satisfy the law, such as between two immovable jaws.
constexpr double kLargestScale = 1e3;

using ConstW = Eigen::Map<const MatrixX, 0, Eigen::OuterStride<>>;

ConstW OperatorOf(const VelocityBlock& block) {
  return ConstW(block.W, block.size, block.size, Eigen::OuterStride<>(block.stride));
}

int Padded(int size) { return (size + 3) / 4 * 4; }

/// K += W(:, columns) Jᵀ for the six columns of W at `W` (leading dimension `stride`). Each element is summed
/// in one order whatever its address, so that the bits do not depend on where the heap put things.
void AddWJ(const double* W, int stride, int size, const Matrix36& J, int k_stride, double* __restrict K) {
  const double *w0 = W, *w1 = w0 + stride, *w2 = w1 + stride, *w3 = w2 + stride, *w4 = w3 + stride,
               *w5 = w4 + stride;
  for (int r = 0; r < 3; ++r) {
    const double j0 = J(r, 0), j1 = J(r, 1), j2 = J(r, 2), j3 = J(r, 3), j4 = J(r, 4), j5 = J(r, 5);
    double* __restrict k = K + r * k_stride;
    for (int i = 0; i < size; ++i) {
      k[i] += w0[i] * j0 + w1[i] * j1 + w2[i] * j2 + w3[i] * j3 + w4[i] * j4 + w5[i] * j5;
    }
  }
}

// One test in place of one a number: NaN and infinity survive a sum.
bool FiniteSum(double sum) { return std::isfinite(sum); }

// Cosine c and sine s of the turn [c s; -s c] that diagonalises [S11 S12; S12 S22], c ≥ 0.
void DiagonalisingTurn(double S11, double S12, double S22, double& c, double& s) {
  const double difference = S11 - S22, length = std::sqrt(difference * difference + 4 * S12 * S12);
  if (!(length > 0)) return;
  const double double_cosine = difference / length;
  // By the half angle, from the larger of the two.
  const double larger = std::sqrt(0.5 * (1 + std::abs(double_cosine)));
  const double smaller = std::abs(S12) / (length * larger), sign = S12 < 0 ? -1 : 1;
  c = double_cosine >= 0 ? larger : smaller;
  s = sign * (double_cosine >= 0 ? smaller : larger);
}

void StoreJacobian(const Matrix36& J, double* out) {
  Eigen::Map<Eigen::Matrix<double, 4, 6>> target(out);
  target.topRows<3>() = J;
  target.row(3).setZero();
}

}  // namespace

int RowSet::BlockOf(const std::vector<VelocityBlock>& blocks, int row, int rows) const {
  FORK1S_REQUIRE(row >= 0 && row + rows <= static_cast<int>(block_of.size()), row);
  const int block = block_of[static_cast<std::size_t>(row)];
  FORK1S_REQUIRE(block >= 0, row);
  const VelocityBlock& b = blocks[static_cast<std::size_t>(block)];
  FORK1S_REQUIRE(row + rows <= b.offset + b.size, row, b.offset, b.size);
  return block;
}

std::size_t RowSet::Allocate(int stride, int columns) {
  const std::size_t start_at = storage.size();
  storage.resize(start_at + static_cast<std::size_t>(stride) * static_cast<std::size_t>(columns), 0.0);
  return start_at;
}

bool RowSet::PrepareContact(const std::vector<VelocityBlock>& blocks, const ContactConstraint& in,
                            ContactRow& row) {
  row.port_a = in.port_a;
  row.port_b = in.port_b;
  row.part[0] = row.part[1] = ResponsePart{};
  row.live = false;
  row.c = 1;
  row.s = 0;
  row.scale = row.newton_scale = 0;
  Eigen::Map<Vector4>(row.impulse).setZero();
  if (!FiniteSum(in.bias.sum() + in.impulse.sum() + in.J_a.sum() + in.J_b.sum() + in.friction)) return false;

  Matrix36 J[2] = {in.J_a, in.J_b};
  const int port[2] = {in.port_a, in.port_b};
  int part_of[2] = {0, 0};
  Matrix3 D = Matrix3::Zero();
  double natural = 0, lightest = -1, reach = 0;
  bool coupled = false;  // both sides in one block
  for (int side = 0; side < 2; ++side) {
    if (port[side] < 0) continue;
    const int index = BlockOf(blocks, port[side], 6);
    const VelocityBlock& block = blocks[static_cast<std::size_t>(index)];
    const ConstW W = OperatorOf(block);
    const int local = port[side] - block.offset;
    const bool shared = side == 1 && port[0] >= 0 && BlockOf(blocks, port[0], 6) == index;
    part_of[side] = shared ? 0 : side;
    ResponsePart& part = row.part[part_of[side]];
    if (!shared) part = {block.offset, block.size, Padded(block.size), Allocate(Padded(block.size), 3)};
    AddWJ(block.W + static_cast<std::ptrdiff_t>(local) * block.stride, block.stride, block.size, J[side],
          part.stride, storage.data() + part.data);
    natural += J[side].squaredNorm() * W.diagonal().segment<6>(local).sum();
    coupled = coupled || shared;
    reach += (J[side].cwiseAbs() * Eigen::Map<const Vector6>(velocity.data() + port[side]).cwiseAbs()).norm();
  }
  for (int side = 0; side < 2; ++side) {
    if (port[side] < 0) continue;
    const ResponsePart& part = row.part[part_of[side]];
    const Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 3>, 0, Eigen::OuterStride<>> K(
        storage.data() + part.data, part.stride, 3, Eigen::OuterStride<>(part.stride));
    const Matrix3 own = J[side].lazyProduct(K.middleRows<6>(port[side] - part.offset));
    D += own;
    if (!FiniteSum(K.sum())) return false;
    double trace = own.trace();
    if (coupled) {
      const int at = port[side] - part.offset;
      const ConstW W = OperatorOf(blocks[static_cast<std::size_t>(BlockOf(blocks, port[side], 6))]);
      trace = J[side].lazyProduct(W.block<6, 6>(at, at)).cwiseProduct(J[side]).sum();
    }
    if (trace > 0 && (lightest < 0 || trace < lightest)) lightest = trace;
  }
  D = (0.5 * (D + D.transpose())).eval();
  if (!FiniteSum(D.sum() + natural)) return false;

  if (D(0, 0) > kImmovable * natural) {
    row.live = true;
    D.diagonal().array() += kRegularisation * D.trace() / 3;
    // Turn the tangents to the eigenvectors of S = D_tt − d dᵀ / D_nn.
    const double S11 = D(1, 1) - D(1, 0) * D(1, 0) / D(0, 0);
    const double S12 = D(1, 2) - D(1, 0) * D(2, 0) / D(0, 0);
    const double S22 = D(2, 2) - D(2, 0) * D(2, 0) / D(0, 0);
    DiagonalisingTurn(S11, S12, S22, row.c, row.s);
    const double c = row.c, sn = row.s;
    for (Matrix36& j : J) {
      const Eigen::Matrix<double, 1, 6> t1 = j.row(1), t2 = j.row(2);
      j.row(1) = c * t1 + sn * t2;
      j.row(2) = c * t2 - sn * t1;
    }
    for (const ResponsePart& part : row.part) {
      if (part.stride == 0) continue;
      double* k1 = storage.data() + part.data + part.stride;
      double* k2 = k1 + part.stride;
      for (int i = 0; i < part.stride; ++i) {
        const double a = k1[i], b = k2[i];
        k1[i] = row.c * a + row.s * b;
        k2[i] = row.c * b - row.s * a;
      }
    }
    LocalCoulomb& law = row.law;
    law = LocalCoulomb{};
    law.nn = D(0, 0);
    law.n1 = c * D(0, 1) + sn * D(0, 2);
    law.n2 = c * D(0, 2) - sn * D(0, 1);
    law.t11 = c * c * D(1, 1) + 2 * c * sn * D(1, 2) + sn * sn * D(2, 2);
    law.t12 = c * sn * (D(2, 2) - D(1, 1)) + (c * c - sn * sn) * D(1, 2);
    law.t22 = sn * sn * D(1, 1) - 2 * c * sn * D(1, 2) + c * c * D(2, 2);
    law.nn_inverse = 1 / law.nn;
    const double smallest = kRegularisation * D.trace() / 3;
    law.s1 = std::max(smallest, law.t11 - law.n1 * law.n1 * law.nn_inverse);
    law.s2 = std::max(smallest, law.t22 - law.n2 * law.n2 * law.nn_inverse);
    law.s1_inverse = 1 / law.s1;
    law.s2_inverse = 1 / law.s2;
    law.friction = std::max(0.0, in.friction);
    row.newton_scale = 3 / D.trace();
    row.scale = std::max(row.newton_scale, lightest > kImmovable * natural ? 3 / lightest : 0.0);
    const double ratio = row.scale / row.newton_scale;
    row.change_weight = ratio * ratio;
    momentum = std::max(momentum, row.scale * (reach + in.bias.norm()));
    speed = std::max(speed, reach + in.bias.norm());

    // The warm start, brought into the cone.
    Vector3 impulse(in.impulse[0], c * in.impulse[1] + sn * in.impulse[2],
                    c * in.impulse[2] - sn * in.impulse[1]);
    impulse[0] = std::max(0.0, impulse[0]);
    const double bound = law.friction * impulse[0], size = impulse.tail<2>().norm();
    if (size > bound) impulse.tail<2>() *= bound > 0 ? bound / size : 0.0;
    Eigen::Map<Vector3>(row.impulse) = impulse;
  }
  StoreJacobian(J[0], row.J_a);
  StoreJacobian(J[1], row.J_b);
  Eigen::Map<Vector4>(row.bias) << in.bias[0], row.c * in.bias[1] + row.s * in.bias[2],
      row.c * in.bias[2] - row.s * in.bias[1], 0;
  return true;
}

bool RowSet::PrepareMoments(const std::vector<VelocityBlock>& blocks, const ContactConstraint& in,
                            int contact) {
  if (!(in.torsion > 0) && !(in.rolling > 0)) return FiniteSum(in.torsion + in.rolling);
  if (!FiniteSum(in.torsion + in.rolling + in.moment.sum())) return false;
  for (int axis = 0; axis < 3; ++axis) {
    MomentRow row;
    row.radius = axis == 0 ? in.torsion : in.rolling;
    if (!(row.radius > 0)) continue;
    row.contact = contact;
    row.axis = axis;
    row.port_a = in.port_a;
    row.port_b = in.port_b;
    row.J_a = in.J_a.block<1, 3>(axis, 3).transpose();
    row.J_b = in.J_b.block<1, 3>(axis, 3).transpose();
    double own = 0, natural = 0;
    const int port[2] = {in.port_a, in.port_b};
    const Vector3* J[2] = {&row.J_a, &row.J_b};
    for (int side = 0; side < 2; ++side) {
      if (port[side] < 0) continue;
      const int index = BlockOf(blocks, port[side], 6);
      const VelocityBlock& block = blocks[static_cast<std::size_t>(index)];
      const bool shared = side == 1 && port[0] >= 0 && BlockOf(blocks, port[0], 6) == index;
      ResponsePart& part = row.part[shared ? 0 : side];
      if (!shared) part = {block.offset, block.size, Padded(block.size), Allocate(Padded(block.size), 1)};
      const ConstW W = OperatorOf(block);
      const int local = port[side] - block.offset;
      Eigen::Map<VectorX> K(storage.data() + part.data, block.size);
      for (int k = 0; k < 3; ++k) K += (*J[side])[k] * W.col(local + k);
      natural += W.diagonal().segment<3>(local).sum();
    }
    for (int side = 0; side < 2; ++side) {
      if (port[side] < 0) continue;
      const ResponsePart& part = row.part[side == 1 && port[0] >= 0 && row.part[1].stride == 0 ? 0 : side];
      const double* K = storage.data() + part.data + (port[side] - part.offset);
      for (int k = 0; k < 3; ++k) own += (*J[side])[k] * K[k];
    }
    if (!FiniteSum(own + natural)) return false;
    if (own > kImmovable * natural) {
      row.live = contacts[static_cast<std::size_t>(contact)].live;
      row.inverse = 1 / own;
      if (row.live)
        row.arm = std::sqrt(row.inverse / contacts[static_cast<std::size_t>(contact)].newton_scale);
      row.impulse = row.Bounded(in.moment[axis], in.impulse[0]);
    }
    moments.push_back(row);
  }
  return true;
}

bool RowSet::PrepareLimit(const std::vector<VelocityBlock>& blocks, const LimitConstraint& in,
                          LimitRow& row) {
  row = LimitRow{};
  row.row = in.row;
  row.sign = in.sign < 0 ? -1 : 1;
  row.bias = in.bias;
  row.lower = in.lower;
  row.upper = in.upper;
  if (!std::isfinite(in.bias) || !std::isfinite(in.impulse) || !(in.lower <= in.upper)) return false;
  const VelocityBlock& block = blocks[static_cast<std::size_t>(BlockOf(blocks, in.row, 1))];
  const ConstW W = OperatorOf(block);
  const int local = in.row - block.offset;
  row.part = {block.offset, block.size, Padded(block.size), Allocate(Padded(block.size), 1)};
  Eigen::Map<VectorX> K(storage.data() + row.part.data, block.size);
  K = row.sign * W.col(local);
  if (!K.allFinite()) return false;
  const double own = W(local, local);
  if (own > kImmovable * W.diagonal().cwiseAbs().maxCoeff()) {
    row.live = true;
    row.inverse = 1 / own;
    row.impulse = row.Bounded(in.impulse);
    const double own_speed = std::abs(velocity[static_cast<std::size_t>(in.row)]) + std::abs(in.bias);
    momentum = std::max(momentum, row.inverse * own_speed);
    speed = std::max(speed, own_speed);
  }
  return true;
}

bool RowSet::Prepare(const std::vector<VelocityBlock>& blocks,
                     const std::vector<ContactConstraint>& contact_list,
                     const std::vector<LimitConstraint>& limit_list,
                     const Eigen::Ref<const VectorX>& velocities) {
  contacts.resize(contact_list.size());
  limits.resize(limit_list.size());
  moments.clear();
  storage.clear();
  momentum = speed = 0;
  start.assign(static_cast<std::size_t>(velocities.size()) + 4, 0.0);
  std::copy_n(velocities.data(), velocities.size(), start.begin());
  velocity = start;
  block_of.assign(static_cast<std::size_t>(velocities.size()), -1);
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    FORK1S_REQUIRE(blocks[b].offset >= 0 && blocks[b].offset + blocks[b].size <= velocities.size(), b);
    std::fill_n(block_of.begin() + blocks[b].offset, blocks[b].size, static_cast<int>(b));
  }
  bool finite = velocities.allFinite();
  for (std::size_t i = 0; i < contact_list.size(); ++i) {
    if (!PrepareContact(blocks, contact_list[i], contacts[i])) finite = false;
  }
  for (std::size_t i = 0; i < contact_list.size(); ++i) {
    if (!PrepareMoments(blocks, contact_list[i], static_cast<int>(i))) finite = false;
  }
  for (std::size_t i = 0; i < limit_list.size(); ++i) {
    if (!PrepareLimit(blocks, limit_list[i], limits[i])) finite = false;
  }
  return finite;
}

void RowSet::ResetVelocity() {
  velocity = start;
  for (const ContactRow& row : contacts) {
    if (row.live) AddResponse(row, row.impulse);
  }
  for (const MomentRow& row : moments) {
    if (row.live) AddResponse(row, row.impulse);
  }
  for (const LimitRow& row : limits) {
    if (row.live) AddResponse(row, row.impulse);
  }
}

void RowSet::KeepImpulses() {
  kept.clear();
  for (const ContactRow& row : contacts) kept.insert(kept.end(), row.impulse, row.impulse + 3);
  for (const MomentRow& row : moments) kept.push_back(row.impulse);
  for (const LimitRow& row : limits) kept.push_back(row.impulse);
}

void RowSet::RestoreImpulses() {
  const double* from = kept.data();
  for (ContactRow& row : contacts) {
    std::copy_n(from, 3, row.impulse);
    from += 3;
  }
  for (MomentRow& row : moments) row.impulse = *from++;
  for (LimitRow& row : limits) row.impulse = *from++;
  ResetVelocity();
}

double RowSet::LargestImpulse() const {
  double largest = 0;
  for (const ContactRow& row : contacts) largest = std::max(largest, row.impulse[0]);
  for (const LimitRow& row : limits) largest = std::max(largest, std::abs(row.impulse));
  return largest;
}

double RowSet::ResidualScale() const {
  const double scale = std::clamp(LargestImpulse(), kSmallestScale * momentum, kLargestScale * momentum);
  return std::max(scale, 1e-300);
}

double RowSet::Sweep() {
  double worst = 0;
  alignas(32) double u[4];
  for (ContactRow& row : contacts) {
    if (!row.live) continue;
    ContactVelocity(row, u);
    const double before[3] = {row.impulse[0], row.impulse[1], row.impulse[2]};
    row.law.Solve(u, row.impulse);
    const double delta[3] = {row.impulse[0] - before[0], row.impulse[1] - before[1],
                             row.impulse[2] - before[2]};
    const double change = delta[0] * delta[0] + delta[1] * delta[1] + delta[2] * delta[2];
    if (change == 0) continue;
    AddResponse(row, delta);
    worst = std::max(worst, change * row.change_weight);
  }
  worst = std::sqrt(worst);
  for (MomentRow& row : moments) {
    if (!row.live) continue;
    const double next = row.Bounded(row.impulse - row.inverse * MomentVelocity(row), NormalImpulse(row));
    const double delta = next - row.impulse;
    if (delta == 0) continue;
    row.impulse = next;
    AddResponse(row, delta);
    worst = std::max(worst, std::abs(delta) / row.arm);
  }
  for (LimitRow& row : limits) {
    if (!row.live) continue;
    const double next = row.Bounded(row.impulse - row.inverse * LimitVelocity(row));
    const double delta = next - row.impulse;
    if (delta == 0) continue;
    row.impulse = next;
    AddResponse(row, delta);
    worst = std::max(worst, std::abs(delta));
  }
  return worst;
}

double RowSet::Residual() const {
  double worst = 0;
  const double impulse_inverse = 1 / ResidualScale(), speed_inverse = speed > 0 ? 1 / speed : 0;
  // A light body under a heavy one: what is little beside the largest impulse may still throw it about.
  const auto note = [&](double error, double r) {
    const double share = error * std::max(impulse_inverse, speed_inverse / r);
    if (!(share <= worst)) worst = share;
  };
  alignas(32) double u[4];
  for (const ContactRow& row : contacts) {
    if (!row.live) continue;
    ContactVelocity(row, u);
    const double n = std::max(0.0, row.impulse[0] - row.scale * u[0]);
    double t1 = row.impulse[1] - row.scale * u[1], t2 = row.impulse[2] - row.scale * u[2];
    const double bound = row.law.friction * n, size = std::sqrt(t1 * t1 + t2 * t2);
    if (size > bound) {
      t1 *= bound / size;
      t2 *= bound / size;
    }
    const double e0 = row.impulse[0] - n, e1 = row.impulse[1] - t1, e2 = row.impulse[2] - t2;
    note(std::sqrt(e0 * e0 + e1 * e1 + e2 * e2), row.scale);
  }
  // A moment counts as the force that moves as much: the rolling friction of a shoe, a tenth of a millimetre
  // times its load, need not be known to a share of itself.
  for (const MomentRow& row : moments) {
    if (!row.live) continue;
    const double next = row.Bounded(row.impulse - row.inverse * MomentVelocity(row), NormalImpulse(row));
    note(std::abs(row.impulse - next) / row.arm, row.inverse / (row.arm * row.arm));
  }
  for (const LimitRow& row : limits) {
    if (!row.live) continue;
    note(std::abs(row.impulse - row.Bounded(row.impulse - row.inverse * LimitVelocity(row))), row.inverse);
  }
  return worst;
}

}  // namespace fork1s::internal
