// Changing the level of detail while the simulation runs.
#include <fork1s/sim/simulation.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>

#include <algorithm>
#include <fork1s/mechanism/kinematics.hpp>

#include "diagnostics/closure_forces.hpp"
#include "frozen_grasp.hpp"
#include "frozen_shares.hpp"
#include "mechanism/activation.hpp"

namespace fork1s {

World::Options Simulation::WorldOptions(const Fidelity& fidelity) const {
  World::Options o;
  o.reduction = options_.reduction;
  o.reduction.interfaces.clear();
  o.reduction.modes = fidelity.modes;
  o.recovery = fidelity.recovery;
  o.refresh_angle = options_.refresh_angle;
  o.reduction.step = dt_;
  o.collision = options_.collision;
  o.reserved_contacts = options_.reserved_contacts;
  return o;
}

// Of the ranks that frozen contacts leave doubtful, most are no mistake of anyone's: contacts repeat each
// other, and their points and directions are those of contact detection, to 1e-7 or so, so that what is
// dropped is never nothing. What is kept, and is hardly more, is another matter: two contacts nearly at one
// place hold a body against turning, or do not.
void Simulation::ListWarnings() {
  constexpr double kClearlyKept =
      3e-5;  // in one unit: far above contact detection, and above what Rank calls clear
  own_warnings_.resize(given_.size());
  warnings_.clear();
  for (std::size_t i = 0; i < given_.size(); ++i) {
    const MechanismDynamics& m = world_.mechanisms()[i];
    const bool holds = std::any_of(frozen_grasps_.begin(), frozen_grasps_.end(), [&](const FrozenGrasp& h) {
      return internal::MechanismThatHolds(h, places_) == places_[i].mechanism;
    });
    if (!holds) own_warnings_[i] = m.warnings();
    warnings_.insert(warnings_.end(), own_warnings_[i].begin(), own_warnings_[i].end());
    if (!holds) continue;
    for (const RankDoubt& doubt : m.model().doubts) {
      const std::string own = "mechanism '" + m.mechanism().name() + "': " + doubt.Text();
      if (!(doubt.kept < kClearlyKept) ||
          std::count(own_warnings_[i].begin(), own_warnings_[i].end(), own) > 0)
        continue;
      warnings_.push_back("with frozen contacts, " + own +
                          "; or keep detail 'interface', where none are frozen");
    }
  }
}

void Simulation::ListBodies() {
  ListWarnings();
  bodies_.clear();
  const auto is_interface = [&](std::size_t mechanism, int body) {
    const auto& interfaces = world_.mechanisms()[mechanism].model().interfaces;
    return std::find(interfaces.begin(), interfaces.end(), BodyIndex(body)) != interfaces.end();
  };
  for (std::size_t i = 0; i < given_.size(); ++i) {
    const MechanismPlace& at = places_[i];
    for (int b = 0; b < given_[i]->num_bodies(); ++b)
      bodies_.push_back({given_[i]->body(BodyIndex(b)).name, at.mechanism, at.first_body + b,
                         is_interface(static_cast<std::size_t>(at.mechanism), at.first_body + b),
                         static_cast<int>(i)});
  }
  int free = 0;
  for (std::size_t f = 0; f < scene_.free_bodies.size(); ++f) {
    const std::string& name = scene_.free_bodies[f].name;
    const auto hold = std::find_if(frozen_grasps_.begin(), frozen_grasps_.end(),
                                   [&](const FrozenGrasp& h) { return h.free_body == static_cast<int>(f); });
    if (hold == frozen_grasps_.end()) {
      bodies_.push_back({name, -1, free++, false});
      continue;
    }
    const int m = internal::MechanismThatHolds(*hold, places_);
    const int body = world_.mechanisms()[static_cast<std::size_t>(m)].mechanism().FindBody(name).value();
    bodies_.push_back({name, m, body, is_interface(static_cast<std::size_t>(m), body)});
  }
  // Recorders ask for the place of a body for every contact.
  body_of_.assign(world_.mechanisms().size() + 1, {});
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    auto& own = body_of_[static_cast<std::size_t>(bodies_[i].mechanism + 1)];
    const auto at = static_cast<std::size_t>(bodies_[i].index);
    if (own.size() <= at) own.resize(at + 1, -1);
    own[at] = static_cast<int>(i);
  }
}

int Simulation::BodyOf(int mechanism, int index) const {
  FORK1S_REQUIRE(mechanism >= -1 && mechanism + 1 < static_cast<int>(body_of_.size()) && index >= 0, "body",
                 index, "of mechanism", mechanism, "of", body_of_.size() - 1,
                 "; -1 stands for the free bodies");
  const std::vector<int>& own = body_of_[static_cast<std::size_t>(mechanism + 1)];
  return index < static_cast<int>(own.size()) ? own[static_cast<std::size_t>(index)] : -1;
}

int Simulation::BodyOfCollisionBody(int collision_body) const {
  internal::RequireIndex("collision body", collision_body, world_.collision_bodies().size());
  const CollisionBody& c = world_.collision_bodies()[static_cast<std::size_t>(collision_body)];
  if (c.kind == CollisionBody::Kind::kFreeBody) return BodyOf(-1, c.index);
  if (collision_body == 0) return -1;  // the world itself; a fixed base is still too, and has a body
  const MechanismDynamics& m = world_.mechanisms()[static_cast<std::size_t>(c.index)];
  return BodyOf(c.index, m.groups()[static_cast<std::size_t>(c.group)].body.value());
}

VectorX Simulation::JointCoordinates(int mechanism) const {
  internal::RequireIndex("mechanism", mechanism, places_.size());
  const auto i = static_cast<std::size_t>(mechanism);
  const MechanismDynamics& m = world_.mechanisms()[static_cast<std::size_t>(places_[i].mechanism)];
  return m.configuration().q.segment(places_[i].first_coordinate, given_[i]->num_coordinates());
}

VectorX Simulation::JointRates(int mechanism) const {
  internal::RequireIndex("mechanism", mechanism, places_.size());
  const auto i = static_cast<std::size_t>(mechanism);
  const MechanismDynamics& m = world_.mechanisms()[static_cast<std::size_t>(places_[i].mechanism)];
  const VectorX q_dot = m.configuration().Q_now * m.state().w;
  return q_dot.segment(places_[i].first_coordinate, given_[i]->num_coordinates());
}

RigidTransform Simulation::BasePose(int mechanism) const {
  internal::RequireIndex("mechanism", mechanism, places_.size());
  const MechanismPlace& at = place(mechanism);
  const MechanismDynamics& m = world_.mechanisms()[static_cast<std::size_t>(at.mechanism)];
  return at.first_body == 0 ? m.state().X_WR : m.BodyPose(BodyIndex(at.first_body));
}

Vector6 Simulation::BaseTwist(int mechanism) const {
  internal::RequireIndex("mechanism", mechanism, places_.size());
  const MechanismPlace& at = place(mechanism);
  const MechanismDynamics& m = world_.mechanisms()[static_cast<std::size_t>(at.mechanism)];
  if (at.first_body == 0) return m.state().V_R;
  const BodyIndex base(at.first_body);
  return InAxes(m.BodyPose(base).rotation().transpose(), m.BodyVelocity(base));
}

std::vector<std::string> Simulation::CoordinateNames() const {
  std::vector<std::string> names;
  for (const auto& m : given_)
    for (int i = 0; i < m->num_coordinates(); ++i) names.push_back(m->CoordinateName(i));
  return names;
}

KeyframeDef Simulation::State() const {
  KeyframeDef key;
  key.name = "present";
  for (std::size_t i = 0; i < given_.size(); ++i) {
    const MechanismPlace& at = places_[i];
    const MechanismDynamics& m = world_.mechanisms()[static_cast<std::size_t>(at.mechanism)];
    KeyframeDef::MechanismState s;
    s.q = JointCoordinates(static_cast<int>(i));
    s.q_dot = JointRates(static_cast<int>(i));
    s.X_WR = BasePose(static_cast<int>(i));
    s.V_R = BaseTwist(static_cast<int>(i));
    s.controls =
        m.controls().segment(at.first_control, static_cast<Eigen::Index>(given_[i]->controls().size()));
    if (internal::HasActivation(given_[i]->definition()))
      s.activation = m.activation().segment(at.first_control, s.controls.size());
    key.mechanisms.push_back(std::move(s));
  }
  // Free bodies come last, held ones among them.
  for (std::size_t at = bodies_.size() - scene_.free_bodies.size(); at < bodies_.size(); ++at) {
    const Vector6 V = Velocity(static_cast<int>(at));
    key.free_bodies.push_back({Pose(static_cast<int>(at)), V.head<3>(), V.tail<3>()});
  }
  return key;
}

Expected<void> Simulation::SetFidelity(const Fidelity& fidelity,
                                       const std::vector<FrozenGrasp>& known_grasps) {
  if (fidelity == fidelity_) return {};
  std::vector<FrozenGrasp> holds;
  if (fidelity.level == DetailLevel::kObject) {
    for (const MechanismDef& m : scene_.mechanisms)
      if (!m.adhesions.empty())
        return Fail(
            ErrorCode::kModel, "adhesion '" + m.adhesions.front().name + "' of mechanism '" + m.name + "'",
            "detail 'object' holds by contacts that press, and would not let go with the adhesion; keep "
            "detail 'interface'");
    for (const MechanismDef& m : scene_.mechanisms)
      if (!m.switched_closures.empty())
        return Fail(ErrorCode::kModel,
                    "equality '" + m.switched_closures.front().name + "' of mechanism '" + m.name + "'",
                    "detail 'object' makes one mechanism of what holds a body, and would not let go with an "
                    "equality that is switched off; keep detail 'interface'");
    holds = frozen_grasps_.empty() ? known_grasps : frozen_grasps_;
    if (holds.empty()) holds = internal::FindFrozenGrasps(*present_scene_, world_, dt_);
    if (holds.empty())
      return Fail(
          ErrorCode::kModel, "scene '" + scene_.name + "'",
          "holds nothing at present: detail 'object' needs a free body on which two or more bodies of "
          "mechanisms press; switch once it is gripped");
  }
  auto places = internal::PlacesOf(given_, holds);
  if (!places) return tl::unexpected(places.error());
  Scene scene = RefineInterfaces(scene_, fidelity.level);
  KeyframeDef state = State();
  internal::FreezeInScene(holds, *places, given_, scene, state);
  // Keyframes of the scene know nothing of what is held.
  scene.keyframes = {state};
  World::Options options = WorldOptions(fidelity);
  options.initial_keyframe = 0;
  auto world = World::Create(scene, options);
  if (!world) return tl::unexpected(world.error());
  world_ = std::move(*world);
  present_scene_ = std::make_shared<const Scene>(std::move(scene));
  world_keyframe_ = 0;
  fidelity_ = fidelity;
  frozen_grasps_ = std::move(holds);
  places_ = std::move(*places);
  last_step_.exists = false;
  last_step_.wrenches_W.clear();
  last_step_.start_motions.clear();
  ListBodies();
  return {};
}

std::vector<FrozenContactForce> Simulation::FrozenContactForces() const {
  std::vector<FrozenContactForce> out;
  for (const FrozenGrasp& hold : frozen_grasps_) {
    const int number = internal::MechanismThatHolds(hold, places_);
    const auto i = static_cast<std::size_t>(number);
    const MechanismDynamics& m = world_.mechanisms()[i];
    const Mechanism& mechanism = m.mechanism();
    const RigidTransform& X_WR = m.state().X_WR;
    // What the step's contacts and pushes did to the mechanism.
    Matrix6X contacts_R = Matrix6X::Zero(6, mechanism.num_bodies());
    if (i < last_step_.wrenches_W.size() && last_step_.wrenches_W[i].cols() == contacts_R.cols())
      for (Eigen::Index b = 0; b < contacts_R.cols(); ++b)
        contacts_R.col(b) = AdjointTransposeApply(X_WR, last_step_.wrenches_W[i].col(b));
    for (const ContactRecord& c : world_.contacts()) {
      const Vector3 force_W = NetImpulse(c) / dt_;
      for (const auto& [collision_body, sign] :
           {std::pair(c.point.body_a, -1.0), std::pair(c.point.body_b, 1.0)}) {
        const CollisionBody& who = world_.collision_bodies()[static_cast<std::size_t>(collision_body)];
        if (who.kind != CollisionBody::Kind::kGroup || who.index != number) continue;
        Vector6 F_W;
        F_W << sign * c.point.point.cross(force_W), sign * force_W;
        contacts_R.col(m.groups()[static_cast<std::size_t>(who.group)].body.value()) +=
            AdjointTransposeApply(X_WR, F_W);
      }
    }
    const std::string& name = scene_.free_bodies[static_cast<std::size_t>(hold.free_body)].name;
    const auto contact_of = [&](const ClosureDef& closure) -> const FrozenGrasp::Contact* {
      for (std::size_t k = 0; k < hold.contacts.size(); ++k)
        if (closure.name == internal::HoldName(name, k + 1)) return &hold.contacts[k];
      return nullptr;
    };
    VectorX near = VectorX::Zero(mechanism.num_constraints());
    std::vector<internal::FrozenContactRows> shares;
    Eigen::Index row = 0;
    for (const ClosureDef& closure : mechanism.closures()) {
      const auto rows = closure.rigid.count();
      if (const FrozenGrasp::Contact* contact = contact_of(closure)) {
        near.segment(row, rows) = -contact->force_C.head(rows);
        shares.push_back({row, contact->friction, contact->frictionless});
      }
      row += rows;
    }
    const auto balance = [&](const VectorX& x) { return ClosureForces(m, dt_, contacts_R, x); };
    const VectorX forces = internal::ShareWithinFriction(balance(near), shares, balance);
    const double largest = forces.size() > 0 ? forces.cwiseAbs().maxCoeff() : 0;
    row = 0;
    for (const ClosureDef& closure : mechanism.closures()) {
      const auto rows = closure.rigid.count();
      if (const FrozenGrasp::Contact* contact = contact_of(closure)) {
        FrozenContactForce f;
        f.body = BodyOf(number, closure.body_a.value());
        f.held = BodyOf(number, closure.body_b.value());
        const RigidTransform X_WC = m.BodyPose(closure.body_a) * contact->X_BC;
        f.point_W = X_WC.translation();
        f.normal_W = X_WC.rotation().col(0);
        Vector3 force_C = Vector3::Zero();
        force_C.head(rows) = -forces.segment(row, rows);
        f.force_W = X_WC.rotation() * force_C;
        f.friction = contact->friction;
        const double tangential = force_C.tail<2>().norm();
        constexpr double kNothing = 1e-6;  // beside the grip's largest force: it carries nothing
        f.use = force_C.norm() <= kNothing * largest ? 0
                : force_C(0) <= 0                    ? std::numeric_limits<double>::infinity()
                : contact->frictionless              ? 0
                                                     : tangential / (contact->friction * force_C(0));
        out.push_back(f);
      }
      row += rows;
    }
  }
  return out;
}

}  // namespace fork1s
