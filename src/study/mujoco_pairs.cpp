#include "mujoco_pairs.hpp"

#include <algorithm>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <set>

#include <fmt/format.h>

namespace fork1s::internal {
namespace {

// MuJoCo's own rule (computation chapter, "Collision detection", Selection), short of the named pairs:
// bodies without a joint between them never touch, nor do parent and child, unless the parent is the world.
bool BodiesMayTouch(const mjModel* m, int a, int b) {
  const int weld_a = m->body_weldid[a], weld_b = m->body_weldid[b];
  if (weld_a == weld_b) return false;
  const int signature = (std::min(a, b) << 16) + std::max(a, b);
  if (std::find(m->exclude_signature, m->exclude_signature + m->nexclude, signature) !=
      m->exclude_signature + m->nexclude)
    return false;
  if (m->opt.disableflags & mjDSBL_FILTERPARENT || weld_a == 0 || weld_b == 0) return true;
  return m->body_weldid[m->body_parentid[weld_a]] != weld_b &&
         m->body_weldid[m->body_parentid[weld_b]] != weld_a;
}

bool ShapesMayTouch(const mjModel* m, int g, int h) {
  return (m->geom_contype[g] & m->geom_conaffinity[h]) || (m->geom_contype[h] & m->geom_conaffinity[g]);
}

}  // namespace

PairDifference::PairDifference(const mjModel* m, const Simulation& reduced) : m_(m) {
  // What is welded together touches as one, under the name of the body that carries it.
  std::map<std::string, std::string> group_of;
  for (const MechanismDynamics& mechanism : reduced.world().mechanisms())
    for (const ContactGroup& group : mechanism.groups())
      for (BodyIndex b : group.bodies)
        group_of[mechanism.mechanism().body(b).name] =
            group.last_joint < 0 && mechanism.mechanism().base() == BaseKind::kFixed
                ? "world"
                : mechanism.mechanism().body(group.body).name;
  for (int b = 0; b < m->nbody; ++b) {
    const char* known = mj_id2name(m, mjOBJ_BODY, b);
    const std::string own = known && *known ? known : fmt::format("body{}", b);
    const auto group = group_of.find(own);
    name_.push_back(m->body_weldid[b] == 0 ? "world" : group == group_of.end() ? own : group->second);
  }

  std::set<Pair> ours, theirs;
  const auto& collision_bodies = reduced.world().collision_bodies();
  const auto name_of = [&](int collision_body) {
    const CollisionBody& c = collision_bodies[static_cast<std::size_t>(collision_body)];
    return c.kind == CollisionBody::Kind::kWorld ? std::string("world") : c.name;
  };
  for (const auto& [a, b] : reduced.world().PairsThatMayTouch())
    ours.insert(std::minmax(name_of(a), name_of(b)));
  if (!(m->opt.disableflags & (mjDSBL_CONTACT | mjDSBL_CONSTRAINT))) {
    for (int k = 0; k < m->npair; ++k) theirs.insert(PairOf(m->pair_geom1[k], m->pair_geom2[k]));
    for (int g = 0; g < m->ngeom; ++g)
      for (int h = g + 1; h < m->ngeom; ++h)
        if (ShapesMayTouch(m, g, h) && BodiesMayTouch(m, m->geom_bodyid[g], m->geom_bodyid[h]))
          theirs.insert(PairOf(g, h));
  }
  for (const Pair& pair : theirs)
    if (pair.first != pair.second && !ours.contains(pair)) only_mujoco_[pair] = false;
  for (const Pair& pair : ours)
    if (!theirs.contains(pair)) only_reduced_.push_back({pair.first, pair.second, false});
}

PairDifference::Pair PairDifference::PairOf(int geom_a, int geom_b) const {
  return std::minmax(name_[static_cast<std::size_t>(m_->geom_bodyid[geom_a])],
                     name_[static_cast<std::size_t>(m_->geom_bodyid[geom_b])]);
}

void PairDifference::Observe(const mjData* d) {
  if (only_mujoco_.empty()) return;
  for (int i = 0; i < d->ncon; ++i) {
    const mjContact& c = d->contact[i];
    // A negative number of a geom stands for a flexible body, which we do not read.
    if (c.exclude != 0 || c.geom[0] < 0 || c.geom[1] < 0) continue;
    if (const auto found = only_mujoco_.find(PairOf(c.geom[0], c.geom[1])); found != only_mujoco_.end())
      found->second = true;
  }
}

std::vector<ContactPair> PairDifference::OnlyMuJoCo() const {
  std::vector<ContactPair> pairs;
  for (const auto& [pair, touched] : only_mujoco_) pairs.push_back({pair.first, pair.second, touched});
  return pairs;
}

}  // namespace fork1s::internal
