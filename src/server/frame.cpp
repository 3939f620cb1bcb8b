// The messages that repeat: maps after every refresh, frames and ghosts sixty times a second.
#include <fork1s/stepping/mechanism_dynamics.hpp>

#include "body_order.hpp"
#include "byte_writer.hpp"
#include "linalg/select.hpp"
#include "server/wire.hpp"

namespace fork1s {
namespace {

using internal::ByteWriter;

// Joint displacements that z alone does not tell: the closing of loops. On trees it vanishes, and nothing is
// sent.
VectorX Correction(const MechanismDynamics& dynamics) {
  if (dynamics.recovery() == Recovery::kTwist) return {};
  VectorX rest = dynamics.configuration().q - dynamics.model().q_ref;
  if (dynamics.model().size() > 0) rest.noalias() -= dynamics.model().Q * dynamics.state().z;
  constexpr double kInvisible = 1e-8;  // rad or m
  if (rest.size() == 0 || rest.cwiseAbs().maxCoeff() < kInvisible) return {};
  return rest;
}

// The body on the wire that a collision body stands for.
int BodyOf(const World& world, const internal::BodyOrder& order, const CollisionBody& collision_body) {
  if (collision_body.kind == CollisionBody::Kind::kWorld) return -1;
  if (collision_body.kind == CollisionBody::Kind::kFreeBody) return order.OnWire(-1, collision_body.index);
  const auto& groups = world.mechanisms()[static_cast<std::size_t>(collision_body.index)].groups();
  return order.OnWire(collision_body.index,
                      groups[static_cast<std::size_t>(collision_body.group)].body.value());
}

// Those that act and those that are frozen.
void WriteContacts(const Simulation& simulation, const internal::BodyOrder& order, ByteWriter& out) {
  const World& world = simulation.world();
  const auto& collision_bodies = world.collision_bodies();
  const std::vector<FrozenContactForce> held = simulation.FrozenContactForces();
  auto count = static_cast<std::uint32_t>(held.size());
  for (const ContactRecord& c : world.contacts()) count += c.impulse.x() > 0 ? 1 : 0;
  out.U32(count);
  for (const ContactRecord& c : world.contacts()) {
    if (!(c.impulse.x() > 0)) continue;
    out.I32(BodyOf(world, order, collision_bodies[static_cast<std::size_t>(c.point.body_a)]));
    out.I32(BodyOf(world, order, collision_bodies[static_cast<std::size_t>(c.point.body_b)]));
    out.Vector(c.point.point);
    out.Vector(c.point.frame.row(0).transpose());
    out.Vector(c.point.frame.transpose() * c.impulse / simulation.step_options().h);
    out.F32(c.point.gap);
    out.F32(c.friction);
  }
  for (const FrozenContactForce& f : held) {
    out.I32(order.OnWire(f.body));
    out.I32(order.OnWire(f.held));
    for (const Vector3* v : {&f.point_W, &f.normal_W, &f.force_W}) out.Vector(*v);
    out.F32(0);
    out.F32(f.friction);
  }
}

// How each interface body gives way to a force at its origin [m/N], in the axes of R: C = J Q Qᵀ Jᵀ over the
// directions with springs, whose stiffness is 1 in reduced coordinates. A body whose origin moves in a
// direction without a spring has none and is left out.
void WriteCompliance(const ReducedModel& model, ByteWriter& out) {
  constexpr double kStill = 1e-9;  // rounding, as a share of the mechanism's length
  const double length = model.mechanism->length_scale();
  std::vector<std::pair<BodyIndex, Matrix3>> held;
  for (BodyIndex b : model.interfaces) {
    Eigen::Matrix<double, 3, 6> at_origin;
    at_origin << -Skew(model.X_RB_ref[b.u()].translation()), Matrix3::Identity();
    const MatrixX J = at_origin * Columns(model.T_of(b), model.SprungColumns());
    if ((at_origin * Columns(model.T_of(b), model.FreeColumns())).norm() > kStill * length) continue;
    held.emplace_back(b, J * J.transpose());
  }
  out.U32(static_cast<std::uint32_t>(held.size()));
  for (const auto& [b, C] : held) {
    out.U32(static_cast<std::uint32_t>(b.value()));
    for (double c : {C(0, 0), C(1, 1), C(2, 2), C(0, 1), C(0, 2), C(1, 2)}) out.F32(c);
  }
}

}  // namespace

const std::vector<std::string>& ScalarNames() {
  static const std::vector<std::string> names = {"time",           "real_time_factor",
                                                 "step_us",        "steps",
                                                 "kinetic_energy", "potential_energy",
                                                 "joint_gap",      "penetration",
                                                 "residual",       "load_factor",
                                                 "refreshes",      "reduce_ms",
                                                 "viewers",        "error"};
  return names;
}

std::string EncodeMaps(const MechanismDynamics& dynamics, std::uint32_t epoch, std::uint32_t root,
                       std::uint32_t version) {
  const ReducedModel& model = dynamics.model();
  const int n = model.num_coordinates(), r = model.size(), b = model.mechanism->num_bodies();
  const bool twist = dynamics.recovery() == Recovery::kTwist;
  ByteWriter out;
  out.U32(static_cast<std::uint32_t>(WireKind::kMaps));
  out.U32(epoch);
  out.U32(root);
  out.U32(version);
  out.U32(static_cast<std::uint32_t>(n));
  out.U32(static_cast<std::uint32_t>(r));
  out.U32(static_cast<std::uint32_t>(b));
  out.U32(twist ? 1 : 0);
  for (int i = 0; i < n; ++i) out.F64(model.q_ref(i));
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < r; ++k) out.F32(model.Q(i, k));
  if (!twist) {
    WriteCompliance(model, out);
    return out.Release();
  }
  for (int i = 0; i < b; ++i) out.Pose(model.X_RB_ref[static_cast<std::size_t>(i)]);
  for (int i = 0; i < b; ++i)
    for (int k = 0; k < r; ++k)
      for (int c = 0; c < 6; ++c) out.F32(model.T(c, i * r + k));
  WriteCompliance(model, out);
  return out.Release();
}

std::string EncodeFrame(const Simulation& simulation, std::uint32_t epoch, std::uint32_t sequence,
                        bool paused, const FrameScalars& s, const std::vector<std::uint32_t>& versions,
                        const std::vector<ShownPull>& pulls, const std::vector<double>& signals) {
  ByteWriter out;
  out.U32(static_cast<std::uint32_t>(WireKind::kFrame));
  out.U32(epoch);
  out.U32(sequence);
  out.U32(paused ? 1 : 0);
  const double scalars[] = {s.time,           s.real_time_factor,
                            s.step_us,        s.steps,
                            s.kinetic_energy, s.potential_energy,
                            s.joint_gap,      s.penetration,
                            s.residual,       s.load_factor,
                            s.refreshes,      s.reduce_ms,
                            s.viewers,        s.error};
  static_assert(std::size(scalars) == kNumScalars);
  for (double v : scalars) out.F64(v);

  const World& world = simulation.world();
  out.U32(static_cast<std::uint32_t>(world.mechanisms().size() + world.free_bodies().size()));
  for (std::size_t i = 0; i < world.mechanisms().size(); ++i) {
    const MechanismDynamics& m = world.mechanisms()[i];
    const VectorX correction = Correction(m);
    out.U32(versions[i]);
    out.U32(static_cast<std::uint32_t>(m.model().size()));
    out.U32(static_cast<std::uint32_t>(correction.size()));
    out.Pose(m.state().X_WR);
    for (Eigen::Index k = 0; k < m.state().z.size(); ++k) out.F32(m.state().z(k));
    for (Eigen::Index k = 0; k < correction.size(); ++k) out.F32(correction(k));
  }
  for (const FreeBody& body : world.free_bodies()) {
    for (int i = 0; i < 3; ++i) out.U32(0);
    out.Pose(body.pose());
  }

  const internal::BodyOrder order(simulation);
  WriteContacts(simulation, order, out);
  out.U32(static_cast<std::uint32_t>(pulls.size()));
  for (const ShownPull& p : pulls) {
    out.I32(order.OnWire(p.body));
    out.Vector(p.point_W);
    out.Vector(p.target_W);
    out.Vector(p.force_W);
  }
  out.U32(static_cast<std::uint32_t>(signals.size()));
  for (double v : signals) out.F32(v);
  return out.Release();
}

std::string EncodeGhost(const GhostView& view, const Simulation& simulation, std::uint32_t epoch) {
  const internal::BodyOrder order(simulation);
  ByteWriter out;
  out.U32(static_cast<std::uint32_t>(WireKind::kGhost));
  out.U32(epoch);
  for (double v : {view.time, view.behind, view.distance}) out.F64(v);
  out.I32(order.OnWire(view.body));
  out.U32(static_cast<std::uint32_t>(order.size()));
  for (int i = 0; i < order.size(); ++i) {
    const int body = order.InScene(i);
    const RigidTransform X = body < 0 ? RigidTransform() : view.X_WB[static_cast<std::size_t>(body)];
    out.Vector(X.translation());
    const Quaternion q = X.quaternion();
    for (double c : {q.w(), q.x(), q.y(), q.z()}) out.F32(c);
  }
  return out.Release();
}

}  // namespace fork1s
