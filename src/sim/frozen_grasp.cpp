#include "frozen_grasp.hpp"
#include "linalg/spectrum.hpp"
#include "world/contact_curvature.hpp"

#include <algorithm>
#include <fork1s/mechanism/kinematics.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <set>

namespace fork1s::internal {
namespace {

// The mechanism's body that a collision body stands for; -1 in `mechanism` for free bodies and the still
// world.
struct Holder {
  int mechanism = -1;
  BodyIndex body;
};

Holder HolderOf(const World& world, int collision_body) {
  const CollisionBody& c = world.collision_bodies()[static_cast<std::size_t>(collision_body)];
  // A fixed base is still world with a name of its own; collision body 0 is the world itself.
  if (collision_body == 0 || c.kind == CollisionBody::Kind::kFreeBody) return {};
  const MechanismDynamics& m = world.mechanisms()[static_cast<std::size_t>(c.index)];
  return {c.index, m.groups()[static_cast<std::size_t>(c.group)].body};
}

// What presses on one free body.
struct Grip {
  std::set<int> bodies;                        // collision bodies
  std::vector<const ContactRecord*> contacts;  // strongest first
};

Grip FindGrip(const World& world, int free_body) {
  Grip grip;
  for (const ContactRecord& c : world.contacts()) {
    if (!(c.impulse(0) > 0)) continue;
    const CollisionBody& a = world.collision_bodies()[static_cast<std::size_t>(c.point.body_a)];
    const CollisionBody& b = world.collision_bodies()[static_cast<std::size_t>(c.point.body_b)];
    const auto is_it = [&](const CollisionBody& x) {
      return x.kind == CollisionBody::Kind::kFreeBody && x.index == free_body;
    };
    if (!is_it(a) && !is_it(b)) continue;
    const int other = is_it(a) ? c.point.body_b : c.point.body_a;
    const Holder holder = HolderOf(world, other);
    if (holder.mechanism < 0) continue;
    grip.bodies.insert(other);
    grip.contacts.push_back(&c);
  }
  std::stable_sort(grip.contacts.begin(), grip.contacts.end(),
                   [](const auto* a, const auto* b) { return a->impulse(0) > b->impulse(0); });
  return grip;
}

Vector6 WorldTwist(const Vector3& omega_W, const Vector3& velocity_W, const Vector3& origin_W) {
  Vector6 V;
  V << omega_W, velocity_W + origin_W.cross(omega_W);
  return V;
}

// A mechanism as its contacts found it, before any joined another.
struct Posed {
  const Mechanism& mechanism;
  const KeyframeDef::MechanismState& state;
  Kinematics kinematics;

  Posed(const Mechanism& m, const KeyframeDef::MechanismState& s) : mechanism(m), state(s), kinematics(m) {
    ComputeKinematics(m, s.q, kinematics);
  }
  RigidTransform Pose(BodyIndex b) const { return state.X_WR * kinematics.X_RB[b.u()]; }
  Vector6 TwistInWorld(BodyIndex b) const {
    Vector6 V_R = state.V_R;
    if (state.q_dot.size() > 0) V_R += BodyJacobian(mechanism, kinematics, b) * state.q_dot;
    return AdjointApply(state.X_WR, V_R);
  }
};

// Adds the held body to the definition that has all who hold it; returns its rates as coordinates of its
// joint.
Vector6 AddHeldBody(const FrozenGrasp& hold, const FreeBodyDef& body,
                    const KeyframeDef::FreeBodyState& motion, const std::vector<Posed>& posed,
                    const std::vector<MechanismPlace>& places, MechanismDef& def) {
  const auto in_def = [&](const FrozenGrasp::Contact& c) {
    const auto m = static_cast<std::size_t>(c.mechanism);
    return BodyIndex(places[m].first_body + posed[m].mechanism.FindBody(c.body).value());
  };
  const FrozenGrasp::Contact& first = hold.contacts.front();
  const Posed& carrier = posed[static_cast<std::size_t>(first.mechanism)];
  const BodyIndex carrying = carrier.mechanism.FindBody(first.body);
  BodyDef held;
  held.name = body.name;
  held.parent = in_def(first);
  held.X_PB = carrier.Pose(carrying).inverse() * motion.X_WB;
  held.inertia = body.inertia;
  held.gravity_compensation = body.gravity_compensation;
  held.geometries = body.geometries;
  const BodyIndex index(static_cast<int>(def.bodies.size()));
  def.bodies.push_back(std::move(held));
  def.joints.push_back(JointDef::Free(HoldName(body.name, 0), index));

  std::set<std::string> hold_it;  // all bodies of the groups that do
  for (std::size_t k = 0; k < hold.contacts.size(); ++k) {
    const FrozenGrasp::Contact& contact = hold.contacts[k];
    const Posed& holder = posed[static_cast<std::size_t>(contact.mechanism)];
    const BodyIndex holding = holder.mechanism.FindBody(contact.body);
    ClosureDef closure;
    closure.name = HoldName(body.name, k + 1);
    closure.body_a = in_def(contact);
    closure.body_b = index;
    closure.X_AJ = contact.X_BC;
    closure.X_BJ = motion.X_WB.inverse() * holder.Pose(holding) * contact.X_BC;
    closure.rigid(3) = true;
    closure.rigid(4) = closure.rigid(5) = !contact.frictionless;
    closure.stiffness.segment<2>(1) = contact.rolling;
    for (const Mechanism::Body& b : holder.mechanism.bodies())
      if (b.last_joint == holder.mechanism.body(holding).last_joint) hold_it.insert(b.name);
    def.closures.push_back(std::move(closure));
  }
  std::erase_if(def.interfaces, [&](const std::string& name) { return hold_it.count(name) > 0; });
  def.interfaces.push_back(body.name);

  const Vector6 own = WorldTwist(motion.omega_W, motion.velocity_W, motion.X_WB.translation());
  return AdjointApply(motion.X_WB.inverse(), own - carrier.TwistInWorld(carrying));
}

// x towards what is held, y and z along the principal directions of rolling.
Matrix3 FrozenContactAxes(const ContactRecord& c, bool held_is_b, const Matrix3& inverse_curvature) {
  const Vector3 x = (held_is_b ? 1 : -1) * c.point.frame.row(0).transpose();
  const Eigen::Matrix<double, 3, 2> tangents = c.point.frame.bottomRows<2>().transpose();
  const SymmetricSpectrum bends = SpectrumOf(tangents.transpose() * inverse_curvature * tangents);
  const Vector3 y = tangents * bends.vectors.col(0);
  Matrix3 axes;
  axes << x, y, x.cross(y);
  return axes;
}

}  // namespace

std::string HoldName(const std::string& held, std::size_t contact) {
  std::string name = "hold:";
  name += held;
  if (contact > 0) name.append(":").append(std::to_string(contact));
  return name;
}

std::vector<FrozenGrasp> FindFrozenGrasps(const Scene& scene, const World& world, double h) {
  std::vector<FrozenGrasp> holds;
  for (std::size_t f = 0; f < scene.free_bodies.size(); ++f) {
    const Grip grip = FindGrip(world, static_cast<int>(f));
    if (grip.bodies.size() < 2) continue;
    FrozenGrasp hold;
    hold.free_body = static_cast<int>(f);
    for (const ContactRecord* c : grip.contacts) {
      const bool held_is_b = world.collision_bodies()[static_cast<std::size_t>(c->point.body_b)].kind ==
                             CollisionBody::Kind::kFreeBody;
      const int other = held_is_b ? c->point.body_a : c->point.body_b;
      const Matrix3 inverse_curvature = ComputeInverseCurvature(world, c->point);
      const Matrix3 axes = FrozenContactAxes(*c, held_is_b, inverse_curvature);
      const Holder holder = HolderOf(world, other);
      const MechanismDynamics& m = world.mechanisms()[static_cast<std::size_t>(holder.mechanism)];
      FrozenGrasp::Contact contact;
      contact.mechanism = holder.mechanism;
      contact.body = m.mechanism().body(holder.body).name;
      // The point was found at the start of the step, and moved on with the body.
      contact.X_BC = world.PoseAtDetection(other).inverse() * RigidTransform(axes, c->point.point);
      // Impulses act on body b.
      contact.force_C = axes.transpose() * c->point.frame.transpose() * c->impulse / h;
      if (!held_is_b) contact.force_C *= -1;
      // Turning about y rolls along z.
      // The map is positive semidefinite, its quadratic form only up to rounding: a flat direction may give
      // -1e-35, which no spring may have.
      const auto along = [&](int k) {
        return std::max(0.0, axes.col(k).dot(inverse_curvature * axes.col(k)));
      };
      contact.rolling = std::max(0.0, contact.force_C.x()) * Eigen::Vector2d(along(2), along(1));
      // In every direction the least of both.
      const Vector2& scale = c->point.friction_scale;
      contact.friction = scale[0] == scale[1] ? c->friction : c->point.friction * scale.minCoeff();
      contact.frictionless = contact.friction == 0;
      hold.contacts.push_back(std::move(contact));
    }
    holds.push_back(std::move(hold));
  }
  return holds;
}

void FreezeInScene(const std::vector<FrozenGrasp>& holds, const std::vector<MechanismPlace>& places,
                   const std::vector<std::shared_ptr<const Mechanism>>& given, Scene& scene,
                   KeyframeDef& state) {
  const std::vector<KeyframeDef::MechanismState> before = state.mechanisms;
  std::vector<Posed> posed;
  for (std::size_t i = 0; i < given.size(); ++i) posed.emplace_back(*given[i], before[i]);
  JoinInScene(places, given, scene, state);
  std::set<int> gone;
  for (const FrozenGrasp& hold : holds) {
    const auto f = static_cast<std::size_t>(hold.free_body);
    const auto m = static_cast<std::size_t>(MechanismThatHolds(hold, places));
    const Vector6 rates =
        AddHeldBody(hold, scene.free_bodies[f], state.free_bodies[f], posed, places, scene.mechanisms[m]);
    // Its body is the last, and so are its coordinates.
    KeyframeDef::MechanismState& s = state.mechanisms[m];
    const Eigen::Index n = s.q.size();
    if (s.q_dot.size() == 0) s.q_dot.setZero(n);
    s.q.conservativeResize(n + 6);
    s.q_dot.conservativeResize(n + 6);
    s.q.tail<6>().setZero();
    s.q_dot.tail<6>() = rates;
    gone.insert(hold.free_body);
  }
  for (auto at = gone.rbegin(); at != gone.rend(); ++at) {
    scene.free_bodies.erase(scene.free_bodies.begin() + *at);
    state.free_bodies.erase(state.free_bodies.begin() + *at);
  }
}

}  // namespace fork1s::internal
