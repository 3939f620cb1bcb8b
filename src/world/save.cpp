// What a world is between steps, taken out and put back.
#include "detail.hpp"

namespace fork1s {

void World::Detail::Save(WorldState& out) const {
  out.contraction = newton_.contraction;
  out.mechanisms.resize(bodies_.mechanisms.size());
  out.rows.resize(bodies_.mechanisms.size());
  bodies_.ForMechanisms([&](std::size_t i) {
    bodies_.mechanisms[i].Save(out.mechanisms[i]);
    out.rows[i].limit_impulses = stops_[i].impulses;
    out.rows[i].friction_impulses = stops_[i].friction_impulses;
    out.rows[i].refreshed = refreshes_[i].result > 0;
  });
  out.free_bodies.resize(bodies_.free_bodies.size());
  for (std::size_t i = 0; i < bodies_.free_bodies.size(); ++i)
    out.free_bodies[i] = bodies_.free_bodies[i].Save();
  out.contacts = contacts_;
  out.contacts_h = contacts_h_;
  out.collision_body_poses = detection_.poses;
  out.switched_closures = closure_records_;
}

void World::Detail::Restore(const WorldState& state) {
  for (std::size_t i = 0; i < bodies_.mechanisms.size(); ++i) {
    bodies_.mechanisms[i].Restore(state.mechanisms[i]);
    stops_[i].impulses = state.rows[i].limit_impulses;
    stops_[i].friction_impulses = state.rows[i].friction_impulses;
    refreshes_[i].result = state.rows[i].refreshed ? 1 : 0;
  }
  for (std::size_t i = 0; i < bodies_.free_bodies.size(); ++i)
    bodies_.free_bodies[i].Restore(state.free_bodies[i]);
  newton_.contraction = state.contraction;
  RestoreContacts(state);
}

void World::Detail::RestoreContacts(const WorldState& state) {
  contacts_ = state.contacts;
  contacts_h_ = state.contacts_h;
  detection_.poses = state.collision_body_poses;
  closure_records_ = state.switched_closures;
}

void World::Save(WorldState& out) const { detail_->Save(out); }
void World::Restore(const WorldState& state) {
  const auto fits = CanRestore(state);
  FORK1S_REQUIRE(fits.has_value(), fits ? "" : fits.error().Text());
  detail_->Restore(state);
}

Expected<void> World::CanRestore(const WorldState& state) const {
  const auto fail = [](const std::string& what) {
    return Fail(ErrorCode::kUsage, "saved state",
                what + "; restore it where it was saved, or in the same scene");
  };
  const auto& mechanisms = detail_->bodies_.mechanisms;
  if (state.mechanisms.size() != mechanisms.size() || state.rows.size() != mechanisms.size() ||
      state.free_bodies.size() != detail_->bodies_.free_bodies.size() ||
      state.collision_body_poses.size() != detail_->detection_.poses.size() ||
      state.switched_closures.size() != detail_->closures_.size())
    return fail(
        "has another number of mechanisms, free bodies, touching bodies or switched closures than this world");
  for (std::size_t i = 0; i < mechanisms.size(); ++i) {
    const Mechanism& ctx = mechanisms[i].mechanism();
    const MechanismState& then = state.mechanisms[i];
    if (!then.model) return fail("has nothing of mechanism '" + ctx.name() + "'");
    const Mechanism& there = *then.model->mechanism;
    if (there.num_bodies() != ctx.num_bodies() || there.num_coordinates() != ctx.num_coordinates() ||
        there.num_constraints() != ctx.num_constraints() || there.base() != ctx.base() ||
        then.model->interfaces != mechanisms[i].model().interfaces ||
        then.controls.size() != mechanisms[i].controls().size() ||
        then.activation.size() != mechanisms[i].activation().size())
      return fail("has a mechanism '" + there.name() + "' that differs from '" + ctx.name() +
                  "' of this world");
  }
  return {};
}

}  // namespace fork1s
