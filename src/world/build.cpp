#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "detail.hpp"
#include "group_geometry.hpp"

namespace fork1s {
namespace {

// A keyframe made by hand may not fit its scene.
Expected<void> CheckKeyframe(const Scene& scene, const KeyframeDef& key) {
  const std::string where = "keyframe '" + key.name + "'";
  if (key.mechanisms.size() != scene.mechanisms.size() || key.free_bodies.size() != scene.free_bodies.size())
    return Fail(ErrorCode::kModel, where,
                "is for another number of mechanisms or free bodies than the scene has; give each its state");
  for (std::size_t i = 0; i < key.free_bodies.size(); ++i) {
    const auto& state = key.free_bodies[i];
    if (!state.X_WB.IsFinite() || !state.omega_W.allFinite() || !state.velocity_W.allFinite())
      return Fail(ErrorCode::kModel, where,
                  "the state of body '" + scene.free_bodies[i].name + "' has a number that is not finite");
  }
  return {};
}

Expected<void> CheckKeyframe(const Mechanism& m, const KeyframeDef::MechanismState& state,
                             const std::string& name) {
  const std::string where = "keyframe '" + name + "'", of = " of mechanism '" + m.name() + "'";
  const auto is = [](const VectorX& v, Eigen::Index n) { return v.size() == n; };
  const Eigen::Index n = m.num_coordinates(), controls = static_cast<Eigen::Index>(m.controls().size());
  if (!is(state.q, n) || !(is(state.q_dot, 0) || is(state.q_dot, n)))
    return Fail(ErrorCode::kModel, where,
                "has another number of joint displacements or rates than the " + std::to_string(n) + of);
  if (!is(state.controls, 0) && !is(state.controls, controls))
    return Fail(ErrorCode::kModel, where,
                "has another number of controls than the " + std::to_string(controls) + of);
  if (!is(state.activation, 0) && !is(state.activation, controls))
    return Fail(ErrorCode::kModel, where,
                "has another number of activations than the " + std::to_string(controls) + " controls" + of);
  if (!state.q.allFinite() || !state.q_dot.allFinite() || !state.X_WR.IsFinite() || !state.V_R.allFinite() ||
      !state.controls.allFinite() || !state.activation.allFinite())
    return Fail(ErrorCode::kModel, where, "the state" + of + " has a number that is not finite");
  return {};
}

}  // namespace

World::World() : detail_(std::make_unique<Detail>()) {}
World::~World() = default;
World::World(World&&) noexcept = default;
World& World::operator=(World&&) noexcept = default;
World World::Empty() { return World(); }

std::vector<MechanismDynamics>& World::mechanisms() { return detail_->bodies_.mechanisms; }
const std::vector<MechanismDynamics>& World::mechanisms() const { return detail_->bodies_.mechanisms; }
std::vector<FreeBody>& World::free_bodies() { return detail_->bodies_.free_bodies; }
const std::vector<FreeBody>& World::free_bodies() const { return detail_->bodies_.free_bodies; }
const std::vector<ContactRecord>& World::contacts() const { return detail_->contacts_; }
const std::vector<ContactPoint>& World::start_points() const { return detail_->start_points_; }
const std::vector<CollisionBody>& World::collision_bodies() const {
  return detail_->detection_.collision_bodies;
}
const std::vector<SwitchedClosureRecord>& World::switched_closures() const {
  return detail_->closure_records_;
}
std::vector<std::pair<int, int>> World::PairsThatMayTouch() const {
  if (!detail_->detection_.world) return {};
  return detail_->detection_.world->PairsThatMayTouch();
}
const RigidTransform& World::PoseAtDetection(int collision_body) const {
  return detail_->detection_.poses[static_cast<std::size_t>(collision_body)];
}
const GeometryDef& World::geometry(int collision_body, int geometry) const {
  return detail_->detection_.shapes
      .geometries[static_cast<std::size_t>(collision_body)][static_cast<std::size_t>(geometry)];
}
const std::vector<std::string>& World::warnings() const { return detail_->warnings_; }

std::string World::NameOf(const StepSubject& subject) const {
  const auto index = static_cast<std::size_t>(subject.index), part = static_cast<std::size_t>(subject.part);
  const auto of_mechanism = [&](const char* kind, const std::string& name) {
    return std::string(kind) + " '" + name + "' of '" +
           detail_->bodies_.mechanisms[index].mechanism().name() + "'";
  };
  switch (subject.kind) {
    case StepSubject::Kind::kNone:
      break;
    case StepSubject::Kind::kMechanism:
      return "mechanism '" + detail_->bodies_.mechanisms[index].mechanism().name() + "'";
    case StepSubject::Kind::kFreeBody:
      return "body '" + detail_->bodies_.free_bodies[index].name() + "'";
    case StepSubject::Kind::kServo:
      return of_mechanism("servo", detail_->bodies_.mechanisms[index].mechanism().force_limits()[part].name);
    case StepSubject::Kind::kSpring:
      return of_mechanism("spring", detail_->bodies_.mechanisms[index].mechanism().springs()[part].name);
    case StepSubject::Kind::kStop:
      return of_mechanism("stop", detail_->bodies_.mechanisms[index].mechanism().length_limits()[part].name);
    case StepSubject::Kind::kCoordinate:
      return of_mechanism("joint",
                          detail_->bodies_.mechanisms[index].mechanism().CoordinateName(subject.part));
    case StepSubject::Kind::kContact:
      return "contact of '" + detail_->detection_.collision_bodies[index].name + "' and '" +
             detail_->detection_.collision_bodies[part].name + "'";
  }
  return {};
}

Expected<World> World::Create(const Scene& scene, const Options& options) {
  World world;
  Detail& detail = *world.detail_;
  const KeyframeDef* key = nullptr;
  if (options.initial_keyframe >= 0) {
    FORK1S_REQUIRE(options.initial_keyframe < static_cast<int>(scene.keyframes.size()));
    key = &scene.keyframes[static_cast<std::size_t>(options.initial_keyframe)];
    if (auto fits = CheckKeyframe(scene, *key); !fits) return tl::unexpected(fits.error());
  }
  for (std::size_t i = 0; i < scene.mechanisms.size(); ++i) {
    auto built = BuildMechanism(scene.mechanisms[i]);
    if (!built) return tl::unexpected(built.error());
    auto mechanism = std::make_shared<const Mechanism>(std::move(*built));
    MechanismDynamics::Options o;
    o.reduction = options.reduction;
    o.reduction.promote_hidden = options.reduction.promote_hidden || !scene.mechanisms[i].interfaces_chosen;
    o.recovery = options.recovery;
    o.refresh_angle = options.refresh_angle;
    o.gravity_W = scene.gravity;
    VectorX q = VectorX::Zero(mechanism->num_coordinates()), q_dot;
    RigidTransform X_WR = scene.mechanisms[i].X_WR;
    Vector6 V_R = Vector6::Zero();
    if (key) {
      const auto& state = key->mechanisms[i];
      if (auto fits = CheckKeyframe(*mechanism, state, key->name); !fits) return tl::unexpected(fits.error());
      q = state.q;
      q_dot = state.q_dot;
      X_WR = state.X_WR;
      V_R = state.V_R;
    }
    auto dynamics = MechanismDynamics::Create(mechanism, q, q_dot, X_WR, V_R, o);
    if (!dynamics) return tl::unexpected(dynamics.error());
    if (key && key->mechanisms[i].controls.size() > 0) {
      dynamics->controls() = key->mechanisms[i].controls;
      dynamics->StartControlsFrom(0, dynamics->controls());
    }
    if (key && key->mechanisms[i].activation.size() > 0)
      dynamics->SetActivation(key->mechanisms[i].activation);
    for (const std::string& w : dynamics->warnings()) detail.warnings_.push_back(w);
    detail.bodies_.mechanisms.push_back(std::move(*dynamics));
  }
  for (std::size_t i = 0; i < scene.free_bodies.size(); ++i) {
    const FreeBodyDef& def = scene.free_bodies[i];
    if (!(def.inertia.mass > 0) || !(def.inertia.rotational.determinant() > 0))
      return Fail(ErrorCode::kModel, "body '" + def.name + "'",
                  "moves freely and needs mass and rotational inertia above 0");
    detail.bodies_.free_bodies.emplace_back(def);
    if (key) {
      const auto& state = key->free_bodies[i];
      detail.bodies_.free_bodies.back().SetState(state.X_WB, state.omega_W, state.velocity_W);
    }
  }
  if (auto ok = detail.BuildCollision(scene, options); !ok) return tl::unexpected(ok.error());

  const auto room = static_cast<std::size_t>(options.reserved_contacts);
  detail.detection_.points.reserve(room);
  detail.contacts_.reserve(room);
  detail.history_.Reserve(room);
  detail.rows_.pushes.reserve(room);
  detail.sums_.Reserve(room);
  for (Detail::Halving::Level& halving : detail.halving_.levels) halving.sums.Reserve(room);
  detail.summation_.Reserve(room);
  detail.rows_.contacts.reserve(room);
  detail.rows_.pulls.reserve(room);
  detail.approaches_.rebound.reserve(room);
  detail.approaches_.closing.reserve(room);
  detail.approaches_.pose_gaps.reserve(room);
  detail.start_points_.reserve(room);
  detail.bodies_.SetMechanismGrain();
  std::size_t blocks = detail.bodies_.free_bodies.size();
  for (const MechanismDynamics& m : detail.bodies_.mechanisms)
    blocks += m.groups().size() + m.length_limits().size() + m.mechanism().frictions().size() +
              m.step_model().part_of_bounded_force.size();
  detail.rows_.blocks.reserve(blocks);
  int velocities = 6 * static_cast<int>(detail.bodies_.free_bodies.size());
  int limits = 0, widest = 6, most_rows = 0;
  std::size_t all_bounded = 0;
  for (const MechanismDynamics& m : detail.bodies_.mechanisms) {
    const int limited = static_cast<int>(m.length_limits().size());
    const int frictions = static_cast<int>(m.mechanism().frictions().size());
    const int bounded = static_cast<int>(m.step_model().part_of_bounded_force.size());
    const int rows = 6 * static_cast<int>(m.groups().size()) + 2 * limited + frictions + bounded;
    detail.stops_.emplace_back().Resize(static_cast<std::size_t>(2 * limited),
                                        static_cast<std::size_t>(frictions));
    detail.switches_.any = detail.switches_.any || HasComplementarity(m);
    velocities += rows;
    most_rows = std::max(most_rows, rows);
    limits += 2 * limited + frictions + bounded;
    all_bounded += static_cast<std::size_t>(bounded);
    widest = std::max(widest, m.num_velocities());
  }
  detail.rows_.limits.reserve(static_cast<std::size_t>(limits));
  detail.rows_.bounded_forces.reserve(all_bounded);
  detail.rows_.velocities.setZero(velocities);
  detail.rows_.start_velocities.setZero(velocities);
  detail.rows_.mechanisms.resize(detail.bodies_.mechanisms.size());
  detail.refreshes_.resize(detail.bodies_.mechanisms.size());
  detail.finite_.resize(detail.bodies_.mechanisms.size());
  detail.rows_.free_Y.resize(detail.bodies_.free_bodies.size());
  detail.switches_.free_velocity.resize(detail.bodies_.free_bodies.size());
  // A mechanism and what it may hold, or a small heap.
  constexpr std::size_t kTogether = 16;
  const int together =
      most_rows + 6 * static_cast<int>(std::min(kTogether, detail.bodies_.free_bodies.size()));
  detail.solver_.Reserve(options.reserved_contacts, limits, static_cast<int>(blocks), velocities, together,
                         widest);
  return world;
}

Expected<void> World::Detail::BuildCollision(const Scene& scene, const Options& options) {
  std::vector<CollisionBodyDef> bodies;
  std::map<std::string, int> index_of;
  std::set<std::string> closed;  // bodies of switched closures, which take part without a shape
  for (const MechanismDef& m : scene.mechanisms)
    for (const SwitchedClosureDef& closure : m.switched_closures)
      closed.insert({closure.body_a, closure.body_b});
  closed.erase("world");
  std::map<std::string, BodyOnCollisionBody> places = {{"world", {0, RigidTransform()}}};
  auto add = [&](CollisionBodyDef body, CollisionBody collision_body, bool is_closed = false) {
    const bool touches = is_closed || std::any_of(body.geometries.begin(), body.geometries.end(),
                                                  [](const GeometryDef& g) { return g.Collides(); });
    if (!touches && collision_body.kind != CollisionBody::Kind::kWorld) return -1;
    collision_body.name = body.name;
    bodies.push_back(std::move(body));
    detection_.collision_bodies.push_back(std::move(collision_body));
    return static_cast<int>(bodies.size()) - 1;
  };
  add({"world", scene.world, false, RigidTransform()}, {});
  index_of["world"] = 0;

  std::vector<std::pair<int, int>> excluded;
  for (std::size_t i = 0; i < bodies_.mechanisms.size(); ++i) {
    const MechanismDynamics& m = bodies_.mechanisms[i];
    std::map<int, int> of_joint;  // collision body of a group by its last joint
    for (std::size_t g = 0; g < m.groups().size(); ++g) {
      const ContactGroup& group = m.groups()[g];
      CollisionBodyDef body;
      body.name = m.mechanism().body(group.body).name;
      body.geometries = GroupGeometry(m.mechanism(), group);
      body.moves = group.last_joint >= 0 || m.mechanism().base() != BaseKind::kFixed;
      body.X_WB = GroupPose(m, static_cast<int>(g));
      CollisionBody collision_body;
      // A fixed base is still world with a name of its own.
      collision_body.kind = body.moves ? CollisionBody::Kind::kGroup : CollisionBody::Kind::kWorld;
      collision_body.index = static_cast<int>(i);
      collision_body.group = static_cast<int>(g);
      const bool is_closed = std::any_of(group.bodies.begin(), group.bodies.end(), [&](BodyIndex b) {
        return closed.count(m.mechanism().body(b).name) > 0;
      });
      if (body.geometries.empty() && !is_closed) continue;
      const RigidTransform X_GR = m.mechanism().body(group.body).X_RB0.inverse(),
                           X_CG = body.moves ? RigidTransform() : body.X_WB;
      const int at = of_joint[group.last_joint] = add(std::move(body), collision_body, is_closed);
      for (BodyIndex b : group.bodies) {
        index_of[m.mechanism().body(b).name] = at;
        places.emplace(m.mechanism().body(b).name,
                       BodyOnCollisionBody{at, X_CG * (X_GR * m.mechanism().body(b).X_RB0)});
      }
    }
    for (const auto& [a, b] : m.mechanism().FilteredContacts())
      if (const auto in_a = of_joint.find(a), in_b = of_joint.find(b);
          in_a != of_joint.end() && in_b != of_joint.end())
        excluded.emplace_back(in_a->second, in_b->second);
  }
  for (std::size_t i = 0; i < bodies_.free_bodies.size(); ++i) {
    CollisionBody collision_body;
    collision_body.kind = CollisionBody::Kind::kFreeBody;
    collision_body.index = static_cast<int>(i);
    const int at =
        add({scene.free_bodies[i].name, scene.free_bodies[i].geometries, true, bodies_.free_bodies[i].pose()},
            collision_body, closed.count(scene.free_bodies[i].name) > 0);
    if (at < 0) continue;
    index_of[scene.free_bodies[i].name] = at;
    places.emplace(scene.free_bodies[i].name, BodyOnCollisionBody{at, RigidTransform()});
  }
  for (const auto& [a, b] : scene.excluded_pairs)
    if (index_of.count(a) && index_of.count(b) && index_of[a] != index_of[b])
      excluded.emplace_back(index_of[a], index_of[b]);

  detection_.most_margin = options.collision.margin;
  for (const CollisionBodyDef& body : bodies) detection_.shapes.Add(body);
  detection_.shapes.least_size = std::min(detection_.shapes.least_size, detection_.most_margin);
  for (const CollisionBodyDef& body : bodies) detection_.poses.push_back(body.X_WB);
  for (const CollisionBody& body : detection_.collision_bodies)
    detection_.margins.group.push_back(body.kind == CollisionBody::Kind::kGroup ? body.index : -1);
  auto collision = CollisionWorld::Create(bodies, excluded, options.collision, scene.contact_pairs);
  if (!collision) return tl::unexpected(collision.error());
  detection_.world = std::make_unique<CollisionWorld>(std::move(*collision));
  auto adhesions = FindAdhesions(bodies_, scene.contact_pairs, detection_);
  if (!adhesions) return tl::unexpected(adhesions.error());
  adhesions_ = std::move(*adhesions);
  auto closures = FindSwitchedClosures(bodies_, [&](const std::string& name) {
    const auto at = places.find(name);
    return at == places.end() ? BodyOnCollisionBody() : at->second;
  });
  if (!closures) return tl::unexpected(closures.error());
  closures_ = std::move(*closures);
  closure_records_.resize(closures_.size());
  rows_.port_offset.assign(detection_.collision_bodies.size(), -1);
  rows_.port_part.assign(detection_.collision_bodies.size(), 0);
  return {};
}

void World::ResetContacts() {
  detail_->contacts_.clear();
  detail_->history_.contacts.clear();
  for (StopHistory& stops : detail_->stops_)
    for (std::vector<double>* impulses : {&stops.impulses, &stops.friction_impulses})
      std::fill(impulses->begin(), impulses->end(), 0.0);
}

double World::PairSize(const ContactPoint& point) const { return detail_->detection_.shapes.PairSize(point); }

const std::vector<double>& World::StopImpulses(int mechanism) const {
  return detail_->stops_[static_cast<std::size_t>(mechanism)].impulses;
}

void World::AddStopForces(int mechanism, double h, VectorX& tau) const {
  const StopHistory& stops = detail_->stops_[static_cast<std::size_t>(mechanism)];
  fork1s::AddStopForces(detail_->bodies_.mechanisms[static_cast<std::size_t>(mechanism)], h, stops.impulses,
                        stops.friction_impulses, tau);
}

double World::KineticEnergy() const {
  double energy = 0;
  for (const auto& m : detail_->bodies_.mechanisms) energy += m.KineticEnergy();
  for (const auto& b : detail_->bodies_.free_bodies) energy += b.KineticEnergy();
  return energy;
}

double World::PotentialEnergy(const Vector3& gravity) const {
  double energy = 0;
  for (const auto& m : detail_->bodies_.mechanisms) energy += m.PotentialEnergy(gravity);
  for (const auto& b : detail_->bodies_.free_bodies) energy += b.PotentialEnergy(gravity);
  return energy;
}

}  // namespace fork1s
