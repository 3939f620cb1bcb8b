#include <fork1s/sim/load_factor.hpp>

#include "world/contact_curvature.hpp"

namespace fork1s {
namespace {

// The scene at its present pose if everything held were let go, without shapes: nothing is to touch in it.
Expected<World> LetGo(const Simulation& simulation) {
  Scene scene = simulation.scene();
  scene.world.clear();
  scene.excluded_pairs.clear();
  for (MechanismDef& m : scene.mechanisms)
    for (BodyDef& b : m.bodies) b.geometries.clear();
  for (FreeBodyDef& b : scene.free_bodies) b.geometries.clear();
  scene.keyframes = {simulation.State()};
  World::Options options;
  options.reduction = simulation.options().reduction;
  options.reduction.interfaces.clear();
  options.reduction.modes = simulation.fidelity().modes;
  options.initial_keyframe = 0;
  return World::Create(scene, options);
}

// By its place in bodies(), -1 for what stands still.
LoadedContact::Side SideOf(const Simulation& simulation, int body) {
  if (body < 0) return {};
  const SceneBody& b = simulation.bodies()[static_cast<std::size_t>(body)];
  if (b.given >= 0)
    return {.mechanism = b.given, .body = BodyIndex(b.index - simulation.place(b.given).first_body)};
  // Free bodies come last, held ones among them.
  const std::size_t first = simulation.bodies().size() - simulation.scene().free_bodies.size();
  return {.free_body = body - static_cast<int>(first)};
}

std::vector<LoadedContact> FrozenContacts(const Simulation& simulation) {
  const std::vector<FrozenContactForce> forces = simulation.FrozenContactForces();
  std::vector<LoadedContact> out;
  std::size_t next = 0;
  for (const FrozenGrasp& hold : simulation.frozen_grasps())
    for (const FrozenGrasp::Contact& contact : hold.contacts) {
      const FrozenContactForce& f = forces[next++];
      // How far the point migrates where the surfaces roll, from the spring that stands for it. The spring
      // about y is that of a way along z.
      const Matrix3 axes = (simulation.Pose(f.body) * contact.X_BC).rotation();
      const double normal = contact.force_C.x();
      const Vector3 way = normal > 0 ? Vector3(0, contact.rolling(1) / normal, contact.rolling(0) / normal)
                                     : Vector3(0, 0, 0);
      out.push_back({SideOf(simulation, f.body), SideOf(simulation, f.held), f.point_W, f.force_W, f.normal_W,
                     axes * way.asDiagonal() * axes.transpose()});
    }
  return out;
}

}  // namespace

LoadFactor ComputeLoadFactor(const Simulation& simulation) {
  if (simulation.frozen_grasps().empty()) return ComputeLoadFactor(simulation.world(), simulation.dt());
  std::vector<LoadedContact> contacts = FrozenContacts(simulation);
  for (const ContactRecord& c : simulation.world().contacts())
    contacts.push_back({SideOf(simulation, simulation.BodyOfCollisionBody(c.point.body_a)),
                        SideOf(simulation, simulation.BodyOfCollisionBody(c.point.body_b)), c.point.point,
                        c.point.frame.transpose() * c.impulse / simulation.dt(),
                        c.point.frame.row(0).transpose(),
                        ComputeInverseCurvature(simulation.world(), c.point),
                        c.point.frame.transpose() * c.pull / simulation.dt()});
  const auto world = LetGo(simulation);
  if (!world) return {};  // cannot be let go of here either: SetFidelity says why
  return ComputeLoadFactor(*world, contacts);
}

}  // namespace fork1s
