// Which bodies collide, and the collision world they live in.
#include <algorithm>
#include <cmath>
#include <map>

#include "contact_set.hpp"

namespace fork1s::internal {
namespace {

// Bodies without a joint between them move as one and collide as one.
struct Group {
  int body = 0;  // names it
  int last_joint = -1;
  int collision_body = -1;
};

std::vector<GeometryDef> GroupGeometry(const Mechanism& mechanism, const Group& group) {
  std::vector<GeometryDef> shapes;
  const RigidTransform X_GR = mechanism.bodies()[static_cast<std::size_t>(group.body)].X_RB0.inverse();
  for (std::size_t b = 0; b < mechanism.bodies().size(); ++b) {
    if (mechanism.bodies()[b].last_joint != group.last_joint) continue;
    for (GeometryDef g : mechanism.definition().bodies[b].geometries) {
      if (!g.Collides()) continue;
      g.X_BG = X_GR * mechanism.bodies()[b].X_RB0 * g.X_BG;
      shapes.push_back(std::move(g));
    }
  }
  return shapes;
}

// Bodies next to each other across a joint or a closure overlap by design.
bool AreNeighbours(const Mechanism& mechanism, int joint_a, int joint_b) {
  auto hangs_on = [&](int lower, int upper) {
    if (lower < 0 || !mechanism.definition().FiltersParent(upper < 0)) return false;
    const BodyIndex parent = mechanism.body(mechanism.joint(JointIndex(lower)).body).parent;
    return mechanism.body(parent).last_joint == upper;
  };
  if (hangs_on(joint_a, joint_b) || hangs_on(joint_b, joint_a)) return true;
  return std::any_of(mechanism.closures().begin(), mechanism.closures().end(), [&](const ClosureDef& c) {
    const int a = mechanism.body(c.body_a).last_joint, b = mechanism.body(c.body_b).last_joint;
    return (a == joint_a && b == joint_b) || (a == joint_b && b == joint_a);
  });
}

double Radius(const std::vector<GeometryDef>& shapes) {
  double radius = 0;
  for (const GeometryDef& g : shapes)
    if (const double r = BoundingRadius(g.shape); std::isfinite(r))
      radius = std::max(radius, g.X_BG.translation().norm() + r);
  return radius;
}

}  // namespace

Expected<void> ContactSet::Build(const Scene& scene, const Mechanisms& mechanisms, const Bodies& free_bodies,
                                 const std::vector<std::vector<int>>& interfaces,
                                 const CollisionOptions& options) {
  std::vector<CollisionBodyDef> bodies;
  std::map<std::string, int> named;
  std::vector<std::pair<int, int>> excluded;
  auto add = [&](CollisionBodyDef body, FullCollisionBody collision_body) {
    collision_body.radius = Radius(body.geometries);
    collision_bodies_.push_back(collision_body);
    bodies.push_back(std::move(body));
    return static_cast<int>(bodies.size()) - 1;
  };
  named["world"] = add({"world", scene.world, false, RigidTransform()}, {});

  int scene_body = 0;
  for (std::size_t i = 0; i < mechanisms.size(); ++i) {
    const Mechanism& m = mechanisms[i].mechanism();
    std::vector<Group> groups;
    auto add_group = [&](int body) {
      const int joint = m.bodies()[static_cast<std::size_t>(body)].last_joint;
      for (const Group& g : groups)
        if (g.last_joint == joint) return;
      groups.push_back({body, joint, -1});
    };
    add_group(0);
    for (int b : interfaces[i]) add_group(b);
    for (Group& g : groups) {
      CollisionBodyDef body;
      body.name = m.bodies()[static_cast<std::size_t>(g.body)].name;
      body.geometries = GroupGeometry(m, g);
      body.moves = g.last_joint >= 0 || m.base() != BaseKind::kFixed;
      body.X_WB = mechanisms[i].Pose(g.body);
      if (body.geometries.empty()) continue;
      FullCollisionBody collision_body;
      collision_body.kind =
          body.moves ? FullCollisionBody::Kind::kMechanism : FullCollisionBody::Kind::kWorld;
      collision_body.index = static_cast<int>(i);
      collision_body.body = g.body;
      collision_body.scene_body = body.moves ? scene_body + g.body : -1;
      g.collision_body = add(std::move(body), collision_body);
      for (const Mechanism::Body& b : m.bodies())
        if (b.last_joint == g.last_joint) named[b.name] = g.collision_body;
    }
    for (std::size_t a = 0; a < groups.size(); ++a)
      for (std::size_t b = a + 1; b < groups.size(); ++b)
        if (groups[a].collision_body >= 0 && groups[b].collision_body >= 0 &&
            AreNeighbours(m, groups[a].last_joint, groups[b].last_joint))
          excluded.emplace_back(groups[a].collision_body, groups[b].collision_body);
    scene_body += m.num_bodies();
  }
  for (std::size_t i = 0; i < free_bodies.size(); ++i, ++scene_body) {
    const FreeBodyDef& def = scene.free_bodies[i];
    if (std::none_of(def.geometries.begin(), def.geometries.end(),
                     [](const auto& g) { return g.Collides(); }))
      continue;
    FullCollisionBody collision_body;
    collision_body.kind = FullCollisionBody::Kind::kFreeBody;
    collision_body.index = static_cast<int>(i);
    collision_body.scene_body = scene_body;
    named[def.name] = add({def.name, def.geometries, true, free_bodies[i].pose()}, collision_body);
  }
  for (const auto& [a, b] : scene.excluded_pairs)
    if (named.count(a) && named.count(b) && named[a] != named[b]) excluded.emplace_back(named[a], named[b]);

  auto collision = CollisionWorld::Create(bodies, excluded, options, scene.contact_pairs);
  if (!collision) return tl::unexpected(collision.error());
  collision_ = std::make_unique<CollisionWorld>(std::move(*collision));
  margin_max_ = options.margin;
  previous_pose_.resize(collision_bodies_.size());
  port_offset_.assign(collision_bodies_.size(), -1);
  blocks_.resize(mechanisms.size());
  for (std::size_t i = 0; i < mechanisms.size(); ++i)
    blocks_[i].limit_impulses.assign(2 * mechanisms[i].mechanism().length_limits().size(), 0.0);
  for (std::size_t i = 0; i < mechanisms.size(); ++i)
    blocks_[i].friction_impulses.assign(mechanisms[i].mechanism().frictions().size(), 0.0);
  return {};
}

bool ContactSet::Detect(const Mechanisms& mechanisms, const Bodies& free_bodies, double h,
                        const Vector3& gravity_W) {
  // What can close within a step: twice the last step's motion, what gravity adds, and a millimetre.
  double motion = 0;
  for (std::size_t i = 0; i < collision_bodies_.size(); ++i) {
    const FullCollisionBody& c = collision_bodies_[i];
    if (c.kind == FullCollisionBody::Kind::kWorld) continue;
    const auto at = static_cast<std::size_t>(c.index);
    const RigidTransform X =
        c.kind == FullCollisionBody::Kind::kMechanism ? mechanisms[at].Pose(c.body) : free_bodies[at].pose();
    collision_->SetPose(static_cast<int>(i), X);
    motion = std::max(motion, (X.translation() - previous_pose_[i].translation()).norm() +
                                  (X.rotation() - previous_pose_[i].rotation()).norm() * c.radius);
    previous_pose_[i] = X;
  }
  const double needed = 0.001 + 2 * motion + gravity_W.norm() * h * h;
  collision_->SetMargin(has_previous_pose_ ? std::min(margin_max_, needed) : margin_max_);
  has_previous_pose_ = true;
  return collision_->Detect(points_);
}

}  // namespace fork1s::internal
