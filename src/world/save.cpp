// What a world is between steps, taken out and put back.
#include "detail.hpp"

namespace fork1s {

void World::Detail::Save(WorldState& out) const {
  out.contraction = contraction_;
  out.mechanisms.resize(mechanisms_.size());
  out.rows.resize(mechanisms_.size());
  ForMechanisms([&](std::size_t i) {
    const MechanismBlock& block = mechanism_blocks_[i];
    mechanisms_[i].Save(out.mechanisms[i]);
    out.rows[i].limit_impulses = block.limit_impulses;
    out.rows[i].friction_impulses = block.friction_impulses;
    out.rows[i].refreshed = block.refreshed > 0;
  });
  out.free_bodies.resize(free_bodies_.size());
  for (std::size_t i = 0; i < free_bodies_.size(); ++i) out.free_bodies[i] = free_bodies_[i].Save();
  out.contacts = contacts_;
  out.contacts_h = contacts_h_;
  out.contactor_poses = contactor_pose_;
}

void World::Detail::Restore(const WorldState& state) {
  for (std::size_t i = 0; i < mechanisms_.size(); ++i) {
    MechanismBlock& block = mechanism_blocks_[i];
    mechanisms_[i].Restore(state.mechanisms[i]);
    block.limit_impulses = state.rows[i].limit_impulses;
    block.friction_impulses = state.rows[i].friction_impulses;
    block.refreshed = state.rows[i].refreshed ? 1 : 0;
  }
  for (std::size_t i = 0; i < free_bodies_.size(); ++i) free_bodies_[i].Restore(state.free_bodies[i]);
  contacts_ = state.contacts;
  contacts_h_ = state.contacts_h;
  contactor_pose_ = state.contactor_poses;
  contraction_ = state.contraction;
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
  const auto& mechanisms = detail_->mechanisms_;
  if (state.mechanisms.size() != mechanisms.size() || state.rows.size() != mechanisms.size() ||
      state.free_bodies.size() != detail_->free_bodies_.size() ||
      state.contactor_poses.size() != detail_->contactor_pose_.size())
    return fail("has another number of mechanisms, free bodies or touching bodies than this world");
  for (std::size_t i = 0; i < mechanisms.size(); ++i) {
    const Mechanism& here = mechanisms[i].mechanism();
    const MechanismState& then = state.mechanisms[i];
    if (!then.model) return fail("has nothing of mechanism '" + here.name() + "'");
    const Mechanism& there = *then.model->mechanism;
    if (there.num_bodies() != here.num_bodies() || there.num_coordinates() != here.num_coordinates() ||
        there.num_constraints() != here.num_constraints() || there.base() != here.base() ||
        then.model->interfaces != mechanisms[i].model().interfaces ||
        then.controls.size() != mechanisms[i].controls().size())
      return fail("has a mechanism '" + there.name() + "' that differs from '" + here.name() +
                  "' of this world");
  }
  return {};
}

}  // namespace fork1s
