#include "sim/interpenetration.hpp"

#include <algorithm>
#include <cstdio>
#include <fork1s/collision/collision_world.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <map>

namespace fork1s {
namespace {

CollisionBodyDef GroupBody(const MechanismDynamics& m, int last_joint, BodyIndex& named_by) {
  const Mechanism& mechanism = m.mechanism();
  CollisionBodyDef body;
  for (int b = 0; b < mechanism.num_bodies(); ++b) {
    const Mechanism::Body& part = mechanism.bodies()[static_cast<std::size_t>(b)];
    if (part.last_joint != last_joint) continue;
    if (!named_by.valid()) named_by = BodyIndex(b);
    const RigidTransform X_GR = mechanism.body(named_by).X_RB0.inverse();
    for (GeometryDef g : mechanism.definition().bodies[static_cast<std::size_t>(b)].geometries) {
      if (!g.Collides()) continue;
      g.X_BG = X_GR * part.X_RB0 * g.X_BG;
      body.geometries.push_back(std::move(g));
    }
  }
  body.name = mechanism.body(named_by).name;
  body.X_WB = m.BodyPose(named_by);
  body.moves = last_joint >= 0 || mechanism.base() != BaseKind::kFixed;
  return body;
}

}  // namespace

struct InterpenetrationMonitor::Detail {
  // Bodies of a mechanism that move as one, or a free body.
  struct RigidGroup {
    int mechanism = -1;  // -1: a free body
    int index = 0;       // body that names it, or free body
    bool interior = false;
  };
  std::vector<CollisionBodyDef> bodies;
  std::vector<RigidGroup> groups;           // of bodies[1] on; bodies[0] is the still world
  std::vector<std::vector<double>> radius;  // m, per body and geometry
  std::unique_ptr<CollisionWorld> collision;
  std::vector<ContactPoint> points;
  std::map<std::pair<int, int>, Interpenetration> found;
  std::vector<std::pair<int, int>> from_the_start;
  bool watches = false;

  const RigidGroup& group(int body) const { return groups[static_cast<std::size_t>(body - 1)]; }
  void Detect(const Simulation& simulation);
};

InterpenetrationMonitor::InterpenetrationMonitor() : detail_(std::make_unique<Detail>()) {}
InterpenetrationMonitor::~InterpenetrationMonitor() = default;
InterpenetrationMonitor::InterpenetrationMonitor(InterpenetrationMonitor&&) noexcept = default;
InterpenetrationMonitor& InterpenetrationMonitor::operator=(InterpenetrationMonitor&&) noexcept = default;

Expected<InterpenetrationMonitor> InterpenetrationMonitor::Create(const Simulation& simulation) {
  InterpenetrationMonitor watch;
  Detail& d = *watch.detail_;
  const Scene& scene = simulation.present_scene();
  std::vector<std::pair<int, int>> excluded;
  std::map<std::string, int> index_of{{"world", 0}};
  d.bodies.push_back({"world", scene.world, false, RigidTransform()});
  const auto& mechanisms = simulation.world().mechanisms();
  for (std::size_t i = 0; i < mechanisms.size(); ++i) {
    const MechanismDynamics& m = mechanisms[i];
    const Mechanism& mechanism = m.mechanism();
    std::map<int, int> of_joint;  // last joint -> collision body
    for (const Mechanism::Body& b : mechanism.bodies()) {
      if (of_joint.count(b.last_joint)) continue;
      BodyIndex named_by;
      CollisionBodyDef body = GroupBody(m, b.last_joint, named_by);
      const bool touches = std::any_of(m.groups().begin(), m.groups().end(),
                                       [&](const ContactGroup& g) { return g.last_joint == b.last_joint; });
      of_joint[b.last_joint] = static_cast<int>(d.bodies.size());
      d.groups.push_back({static_cast<int>(i), named_by.value(), !touches});
      d.watches |= !touches && !body.geometries.empty();
      d.bodies.push_back(std::move(body));
    }
    for (const Mechanism::Body& body : mechanism.bodies()) index_of[body.name] = of_joint[body.last_joint];
    for (const auto& [a, b] : mechanism.FilteredContacts()) excluded.emplace_back(of_joint[a], of_joint[b]);
  }
  for (std::size_t i = 0; i < scene.free_bodies.size(); ++i) {
    index_of[scene.free_bodies[i].name] = static_cast<int>(d.bodies.size());
    d.groups.push_back({-1, static_cast<int>(i), false});
    d.bodies.push_back({scene.free_bodies[i].name, scene.free_bodies[i].geometries, true,
                        simulation.world().free_bodies()[i].pose()});
  }
  for (const auto& [a, b] : scene.excluded_pairs)
    if (index_of.count(a) && index_of.count(b) && index_of[a] != index_of[b])
      excluded.emplace_back(index_of[a], index_of[b]);
  if (!d.watches) return watch;
  for (const CollisionBodyDef& body : d.bodies)
    for (auto& of_body = d.radius.emplace_back(); const GeometryDef& g : body.geometries)
      of_body.push_back(BoundingRadius(g.shape));
  // What the simulation lets touch is its own affair.
  const int count = static_cast<int>(d.bodies.size());
  for (int a = 0; a < count; ++a)
    for (int b = a + 1; b < count; ++b)
      if ((a == 0 || !d.group(a).interior) && !d.group(b).interior) excluded.emplace_back(a, b);
  for (auto& [a, b] : excluded)
    if (a > b) std::swap(a, b);
  std::sort(excluded.begin(), excluded.end());
  excluded.erase(std::unique(excluded.begin(), excluded.end()), excluded.end());
  CollisionOptions options;
  options.margin = 0;
  options.multi_point = false;
  auto collision = CollisionWorld::Create(d.bodies, excluded, options, scene.contact_pairs);
  if (!collision) return tl::unexpected(collision.error());
  d.collision = std::make_unique<CollisionWorld>(std::move(*collision));
  d.Detect(simulation);
  for (const ContactPoint& p : d.points) d.from_the_start.emplace_back(std::minmax(p.body_a, p.body_b));
  std::sort(d.from_the_start.begin(), d.from_the_start.end());
  return watch;
}

void InterpenetrationMonitor::Detail::Detect(const Simulation& simulation) {
  const World& world = simulation.world();
  for (std::size_t i = 1; i < bodies.size(); ++i) {
    if (!bodies[i].moves) continue;
    const RigidGroup& g = groups[i - 1];
    const auto at = static_cast<std::size_t>(g.mechanism < 0 ? g.index : g.mechanism);
    collision->SetPose(static_cast<int>(i), g.mechanism < 0
                                                ? world.free_bodies()[at].pose()
                                                : world.mechanisms()[at].BodyPose(BodyIndex(g.index)));
  }
  collision->Detect(points);
  // Explicit contact pairs are tested whatever is excluded.
  const auto interior = [&](int body) { return body > 0 && group(body).interior; };
  std::erase_if(points, [&](const ContactPoint& p) { return !interior(p.body_a) && !interior(p.body_b); });
}

void InterpenetrationMonitor::Update(const Simulation& simulation) {
  Detail& d = *detail_;
  if (!d.watches) return;
  d.Detect(simulation);
  constexpr double kDeep = 0.01;  // of the smaller shape's radius: what rests on its neighbour sinks by less
  for (const ContactPoint& p : d.points) {
    const std::pair<int, int> pair = std::minmax(p.body_a, p.body_b);
    const auto radius = [&](int body, int geometry) {
      return d.radius[static_cast<std::size_t>(body)][static_cast<std::size_t>(geometry)];
    };
    const double size = std::min(radius(p.body_a, p.geometry_a), radius(p.body_b, p.geometry_b));
    if (-p.gap < kDeep * size || std::binary_search(d.from_the_start.begin(), d.from_the_start.end(), pair))
      continue;
    const auto [at, fresh] = d.found.try_emplace(pair);
    Interpenetration& found = at->second;
    if (fresh) {
      const bool first_is_interior = pair.first > 0 && d.group(pair.first).interior;
      const int inner = first_is_interior ? pair.first : pair.second;
      found.body = d.bodies[static_cast<std::size_t>(inner)].name;
      found.other = d.bodies[static_cast<std::size_t>(first_is_interior ? pair.second : pair.first)].name;
      found.first = simulation.time();
    }
    if (-p.gap <= found.depth) continue;
    found.depth = -p.gap;
    found.when = simulation.time();
  }
}

std::vector<std::string> Sentences(const std::vector<Interpenetration>& found, const std::string& remedy) {
  constexpr std::size_t kTold = 5;
  // Names of bodies are of any length.
  const auto print = [](const char* format, double number) {
    char text[64];
    std::snprintf(text, sizeof text, format, number);
    return std::string(text);
  };
  std::vector<std::string> out;
  for (std::size_t i = 0; i < std::min(kTold, found.size()); ++i) {
    const Interpenetration& one = found[i];
    out.push_back("'" + one.body + "' is no interface body, so it touches nothing: from " +
                  print("%.4g s", one.first) + " on it went into '" + one.other + "', " +
                  print("%.3g mm deep at ", 1e3 * one.depth) + print("%.4g s", one.when) + "; " + remedy);
  }
  if (found.size() > kTold)
    out.push_back(std::to_string(found.size() - kTold) + " more pairs of bodies passed through each other");
  return out;
}

std::vector<Interpenetration> InterpenetrationMonitor::Found() const {
  std::vector<Interpenetration> out;
  for (const auto& [pair, one] : detail_->found) out.push_back(one);
  std::stable_sort(out.begin(), out.end(),
                   [](const Interpenetration& a, const Interpenetration& b) { return a.depth > b.depth; });
  return out;
}

}  // namespace fork1s
