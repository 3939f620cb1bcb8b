// Sizes, tables and numbers of docs/engines.md, from the models as they are.
#include <fork1s/record/recovery_buffers.hpp>

#include <algorithm>
#include <bit>
#include <cmath>

#include "recovery_parts.hpp"

namespace fork1s {
namespace {

using internal::IsCorrected;
using internal::RootsOf;

using Entry = std::int32_t;

/// Columns [first, first + count) outside which all rows are zero.
struct Span {
  int first = 0, count = 0;
};
Span NonzeroColumns(const double* values, int rows, int columns, Eigen::Index row_stride,
                    Eigen::Index column_stride) {
  Span span;
  for (int k = 0; k < columns; ++k)
    for (int i = 0; i < rows; ++i) {
      if (values[i * row_stride + k * column_stride] == 0) continue;
      if (span.count == 0) span.first = k;
      span.count = k - span.first + 1;
      break;
    }
  return span;
}

// Whole turns change no pose and cost digits in single precision.
double WithoutTurns(double q, const Vector6& screw, bool alone) {
  const Vector3 w = screw.head<3>(), v = screw.tail<3>();
  const bool turns = alone && std::abs(w.squaredNorm() - 1) < 1e-9 && std::abs(w.dot(v)) < 1e-12;
  return turns ? std::remainder(q, 2 * static_cast<double>(EIGEN_PI)) : q;
}

// H of q = ... + zᵀ H z for every coordinate [n x r x r], -½ B N: what loops closed by their curvature add.
std::vector<MatrixX> Curves(const ReducedModel& model) {
  std::vector<MatrixX> H;
  if (!model.curvature.exists()) return H;
  const int r = model.size();
  H.assign(static_cast<std::size_t>(model.num_coordinates()), MatrixX::Zero(r, r));
  RowMatrixX W = RowMatrixX::Zero(model.loop_rank(), (r + 3) / 4 * 4), moved;
  for (int k = 0; k < r; ++k) {
    model.curvature.Apply(VectorX::Unit(r, k), W);
    moved = RowMatrixX::Zero(model.num_coordinates(), r);
    model.loops.SubtractTransposed(model.B, W, moved);
    for (std::size_t i = 0; i < H.size(); ++i) H[i].row(k) = 0.5 * moved.row(static_cast<Eigen::Index>(i));
  }
  return H;
}

/// Where the links, coordinates and z of every mechanism begin; z counts numbers of a frame.
struct Begin {
  std::vector<int> link, z;
};

class TableWriter {
 public:
  TableWriter(std::vector<Entry>& tables, std::vector<float>& numbers) : tables_(tables), numbers_(numbers) {}

  void Write(const Simulation& simulation) {
    const World& world = simulation.world();
    tables_.assign(16, 0);
    Count(world);
    AddLinks(world);
    tables_[6] = Here();
    for (std::size_t i = 0; i < world.mechanisms().size(); ++i)
      AddCoordinates(world.mechanisms()[i], begin_.z[i]);
    tables_[7] = Here();
    for (const SceneBody& body : simulation.bodies()) AddBody(world, body);
    tables_[3] = static_cast<Entry>(simulation.bodies().size());
    tables_[8] = next_correction_;
  }

 private:
  Entry Here() const { return static_cast<Entry>(tables_.size()); }

  void Count(const World& world) {
    const int roots = RootsOf(world);
    int link = roots, n = 0, z = 8 * roots;
    for (const MechanismDynamics& m : world.mechanisms()) {
      begin_.link.push_back(link);
      begin_.z.push_back(z);
      link += m.mechanism().num_joints();
      n += m.mechanism().num_coordinates();
      z += m.model().size();
    }
    tables_[0] = kRecoveryBuffersVersion;
    tables_[1] = roots;
    tables_[2] = link;
    tables_[4] = n;
    tables_[5] = z - 8 * roots;
    next_correction_ = z;
  }

  void AddLinks(const World& world) {
    const int roots = RootsOf(world);
    for (int i = 0; i < roots; ++i) tables_.insert(tables_.end(), {-1, 0, 0, i});
    std::vector<int> depth(static_cast<std::size_t>(tables_[2]), 1);
    int first_coordinate = 0;
    for (std::size_t i = 0; i < world.mechanisms().size(); ++i) {
      const Mechanism& m = world.mechanisms()[i].mechanism();
      const int first_link = begin_.link[i], root = static_cast<int>(i);
      for (int j = 0; j < m.num_joints(); ++j) {
        const Mechanism::Joint& joint = m.joint(JointIndex(j));
        const int before = joint.previous < 0 ? root : first_link + joint.previous;
        tables_.insert(tables_.end(), {before, first_coordinate + joint.offset, joint.size, root});
        depth[static_cast<std::size_t>(first_link + j)] = depth[static_cast<std::size_t>(before)] + 1;
      }
      first_coordinate += m.num_coordinates();
    }
    for (const int d : depth) tables_[9] = std::max(tables_[9], d);
  }

  void AddCoordinates(const MechanismDynamics& dynamics, int z) {
    const ReducedModel& model = dynamics.model();
    const Mechanism& m = dynamics.mechanism();
    const std::vector<MatrixX> H = Curves(model);
    const auto h_of = [&](int i) -> const MatrixX& { return H[static_cast<std::size_t>(i)]; };
    const bool corrected = IsCorrected(dynamics);
    const int r = model.size();
    for (int i = 0; i < m.num_coordinates(); ++i) {
      Span span = NonzeroColumns(model.Q_rows.data() + Eigen::Index{i} * r, 1, r, 0, 1);
      bool bends = false;
      if (!H.empty()) {
        const Span by_curve = NonzeroColumns(h_of(i).data(), r, r, 1, r);
        bends = by_curve.count > 0;
        if (bends) {
          const int end = std::max(span.first + span.count, by_curve.first + by_curve.count);
          span.first = span.count > 0 ? std::min(span.first, by_curve.first) : by_curve.first;
          span.count = end - span.first;
        }
      }
      const Entry row = Number();
      for (int k = 0; k < span.count; ++k) Add(model.Q(i, span.first + k));
      const Entry curve = bends ? Number() : -1;
      if (bends)
        for (int k = span.first; k < span.first + span.count; ++k)
          for (int l = k; l < span.first + span.count; ++l)
            Add(k == l ? h_of(i)(k, k) : h_of(i)(k, l) + h_of(i)(l, k));
      const Entry screw = Number();
      const Vector6 S = m.screws().col(i);
      for (int k = 0; k < 6; ++k) Add(S(k));
      const bool alone = m.joint(m.CoordinateJoint(i)).size == 1;
      Add(WithoutTurns(model.q_ref(i), S, alone));
      const Entry correction = corrected ? next_correction_++ : -1;
      tables_.insert(tables_.end(), {z + span.first, span.count, row, curve, correction, screw, 0, 0});
    }
  }

  void AddBody(const World& world, const SceneBody& body) {
    if (body.mechanism < 0) {
      const Entry still = Number();
      AddPose(RigidTransform());
      const Entry root = static_cast<Entry>(world.mechanisms().size()) + body.index;
      tables_.insert(tables_.end(), {root, root, 0, 0, still, still, still, 0});
      return;
    }
    const auto at = static_cast<std::size_t>(body.mechanism);
    const ReducedModel& model = world.mechanisms()[at].model();
    const BodyIndex index(body.index);
    const Mechanism::Body& b = model.mechanism->body(index);
    const Entry last = b.last_joint < 0 ? body.mechanism : begin_.link[at] + b.last_joint;
    const int r = model.size();
    const double* T = model.T.data() + Eigen::Index{6} * index.value() * r;
    const Span span = NonzeroColumns(T, 6, r, 1, 6);
    const Entry twists = Number();
    for (int k = 0; k < span.count; ++k)
      for (int i = 0; i < 6; ++i) Add(T[6 * (span.first + k) + i]);
    const Entry reference = Number();
    AddPose(model.X_RB_ref[index.u()]);
    const Entry still = Number();
    AddPose(b.X_RB0);
    tables_.insert(tables_.end(), {body.mechanism, last, begin_.z[at] + span.first, span.count, twists,
                                   reference, still, 0});
  }

  Entry Number() const { return static_cast<Entry>(numbers_.size()); }
  void Add(double v) { numbers_.push_back(static_cast<float>(v)); }
  void AddPose(const RigidTransform& X) {
    const Quaternion q = X.quaternion();
    for (double c : {q.x(), q.y(), q.z(), q.w()}) Add(c);
    for (int i = 0; i < 3; ++i) Add(X.translation()(i));
  }

  std::vector<Entry>& tables_;
  std::vector<float>& numbers_;
  Begin begin_;
  int next_correction_ = 0;
};

// FNV-1a over whole words.
class ReferenceHash {
 public:
  void Add(std::uint64_t word) { value_ = (value_ ^ word) * 0x100000001b3ull; }
  void Add(double v) { Add(std::bit_cast<std::uint64_t>(v)); }
  std::uint64_t value() const { return value_ ^ (value_ >> 32); }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325ull;
};

}  // namespace

// What moves in a relinearization: its reference, or by other stiffnesses and modes its inertia. Q is
// long where few coordinates move many joints, and is asked in places.
std::uint64_t RecoveryReference(const Simulation& simulation) {
  ReferenceHash hash;
  const auto count = [&](auto n) { hash.Add(static_cast<std::uint64_t>(n)); };
  count(simulation.bodies().size());
  count(RootsOf(simulation.world()));
  for (const MechanismDynamics& m : simulation.world().mechanisms()) {
    const ReducedModel& model = m.model();
    count(static_cast<int>(m.recovery()) * 2 + (model.curvature.exists() ? 1 : 0));
    count(m.mechanism().num_bodies());
    count(model.size());
    for (const double q : model.q_ref) hash.Add(q);
    for (Eigen::Index k = 0; k < model.M.rows(); ++k) hash.Add(model.M(k, k));
    constexpr Eigen::Index kPlaces = 256;
    const Eigen::Index stride = std::max<Eigen::Index>(1, model.Q.size() / kPlaces);
    for (Eigen::Index i = 0; i < model.Q.size(); i += stride) hash.Add(model.Q.data()[i]);
  }
  return hash.value();
}

RecoveryBuffers::RecoveryBuffers(const Simulation& simulation)
    : recovery_(simulation.fidelity().recovery), reference_(RecoveryReference(simulation)) {
  TableWriter(tables_, numbers_).Write(simulation);
}

int RecoveryBuffers::scan_passes() const {
  return static_cast<int>(std::bit_width(static_cast<unsigned>(std::max(Size(9), 1)) - 1));
}

bool RecoveryBuffers::IsOf(const Simulation& simulation) const {
  return reference_ == RecoveryReference(simulation);
}

}  // namespace fork1s
