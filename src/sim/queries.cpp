#include <fork1s/sim/queries.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

#include "ray_bodies.hpp"

namespace fork1s {
namespace {

// The index of the only one of this name. `name_of` gives that of an element.
template <class Element, class NameOf>
Expected<int> OnlyNamed(const char* what, const char* plural, const std::string& name,
                        const std::vector<Element>& all, const NameOf& name_of) {
  const auto has_it = [&](const Element& e) { return name_of(e) == name; };
  const auto refuse = [&](const std::string& message) { return Fail(ErrorCode::kUsage, name, message); };
  const auto at = std::find_if(all.begin(), all.end(), has_it);
  if (const auto count = std::count_if(at, all.end(), has_it); count > 1)
    return refuse(std::to_string(count) + ' ' + plural + " are named '" + name +
                  "'; rename them in the scene, or name them by index");
  if (at != all.end()) return static_cast<int>(at - all.begin());
  constexpr std::size_t kMaxListed = 40;
  std::string list;
  for (std::size_t i = 0; i < all.size() && i < kMaxListed; ++i)
    list += (i == 0 ? "" : ", ") + name_of(all[i]);
  if (all.size() > kMaxListed) list += ", ...";
  return refuse("there is no " + std::string(what) + " '" + name + "'" +
                (all.empty() ? ", nor any other" : "; there are: " + list));
}

std::string NameAt(const Simulation& simulation, int body) {
  return body < 0 ? "world" : simulation.bodies()[static_cast<std::size_t>(body)].name;
}

}  // namespace

Expected<int> BodyNamed(const Simulation& simulation, const std::string& name) {
  return OnlyNamed("body", "bodies", name, simulation.bodies(),
                   [](const SceneBody& body) -> const std::string& { return body.name; });
}

Expected<int> ControlNamed(const Simulation& simulation, const std::string& name) {
  return OnlyNamed("control", "controls", name, simulation.control_names(),
                   [](const std::string& control) -> const std::string& { return control; });
}

Expected<void> TrySetControl(Simulation& simulation, const std::string& name, double value) {
  const Expected<int> at = ControlNamed(simulation, name);
  if (!at) return tl::unexpected(at.error());
  if (!std::isfinite(value)) return Fail(ErrorCode::kUsage, name, "a set-point must be finite");
  simulation.SetControl(*at, value);
  return {};
}

std::vector<BodyContact> Contacts(const Simulation& simulation) {
  std::vector<BodyContact> all;
  const auto finish = [&](BodyContact& c) {
    if (c.body_a > c.body_b) {
      std::swap(c.body_a, c.body_b);
      for (Vector3* on_b : {&c.normal_W, &c.force_W, &c.moment_W, &c.pull_W}) *on_b = -*on_b;
    }
    c.name_a = NameAt(simulation, c.body_a);
    c.name_b = NameAt(simulation, c.body_b);
  };
  const double h = simulation.dt();
  for (const ContactRecord& record : simulation.world().contacts()) {
    if (!(record.impulse.x() > 0)) continue;
    const Matrix3 axes = record.point.frame.transpose();
    BodyContact& c = all.emplace_back();
    c.body_a = simulation.BodyOfCollisionBody(record.point.body_a);
    c.body_b = simulation.BodyOfCollisionBody(record.point.body_b);
    c.point_W = record.point.point;
    c.normal_W = axes.col(0);
    c.force_W = axes * record.impulse / h;
    c.pull_W = axes * record.pull / h;
    c.moment_W = axes * record.moment / h;
    c.gap = record.point.gap;
    c.friction = record.friction;
    finish(c);
  }
  for (const FrozenContactForce& held : simulation.FrozenContactForces()) {
    BodyContact& c = all.emplace_back();
    c.body_a = held.body;
    c.body_b = held.held;
    c.point_W = held.point_W;
    c.normal_W = held.normal_W;
    c.force_W = held.force_W;
    c.friction = held.friction;
    finish(c);
  }
  return all;
}

Expected<RayCaster> RayCaster::Create(const Simulation& simulation) {
  auto world = RayWorld::Create(internal::RayBodies(simulation.scene()));
  if (!world) return tl::unexpected(world.error());
  return RayCaster(std::move(*world));
}

std::optional<BodyHit> RayCaster::Cast(const Simulation& simulation, const Vector3& origin,
                                       const Vector3& direction, double reach) {
  const int count = static_cast<int>(simulation.bodies().size());
  std::vector<RigidTransform> X_WB;
  simulation.Poses(X_WB);
  for (int b = 0; b < count; ++b) world_.SetPose(b, X_WB[static_cast<std::size_t>(b)]);
  const auto hit = world_.Cast(origin, direction, reach);
  if (!hit) return std::nullopt;
  const int body = hit->body < count ? hit->body : -1;
  return BodyHit{body, NameAt(simulation, body), hit->distance, hit->point, hit->normal};
}

}  // namespace fork1s
