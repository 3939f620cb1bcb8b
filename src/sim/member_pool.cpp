#include "sim/member_pool.hpp"

#include <algorithm>

namespace fork1s::internal {

namespace {

bool HasStepModels(const Simulation::Snapshot& moment) {
  return std::all_of(moment.world.mechanisms.begin(), moment.world.mechanisms.end(),
                     [](const MechanismState& state) { return state.step_model != nullptr; });
}

}  // namespace

MemberPool::FactorsKey MemberPool::KeyOf(const SceneFactors& factors) {
  FactorsKey key{{factors.stiffness, factors.friction, factors.mass}, factors.named};
  std::erase_if(key.second, [](const auto& named) { return named.second == 1; });
  return key;
}

MemberPool::Use::Use(MemberPool& pool, std::size_t index)
    : member(pool.members_[index]), seat(pool.Acquire(*member.variant, member)) {
  if (Has(*seat, member)) return;
  seat->occupant = nullptr;
  RestoreOwn(member.moment, *seat);
  seat->occupant = &member;
  seat->version = member.version;
}

MemberPool::Use::~Use() {
  if (seat) Release(*member.variant, std::move(seat));
}

void MemberPool::Use::Store() {
  seat->simulation.Save(member.moment);
  seat->occupant = &member;
  seat->version = member.version;
}

bool MemberPool::Has(const Seat& seat, const Member& member) {
  return seat.occupant == &member && seat.version == member.version;
}

void MemberPool::RestoreOwn(Simulation::Snapshot& moment, Seat& seat) {
  moment.made_of = seat.made_of;
  moment.keyframe = seat.keyframe;
  const auto restored = seat.simulation.Restore(moment);
  FORK1S_REQUIRE(restored.has_value(), restored ? "" : restored.error().Text());
}

Expected<Simulation> MemberPool::MakeSimulation(const SceneFactors& factors) const {
  return starts_.Begin({factors, VectorX::Zero(starts_.num_coordinates())});
}

std::unique_ptr<MemberPool::Seat> MemberPool::MakeSeat(Simulation simulation) {
  Simulation::Snapshot made = simulation.Save();
  return std::make_unique<Seat>(Seat{std::move(simulation), std::move(made.made_of), made.keyframe, {}});
}

void MemberPool::Release(Variant& variant, std::unique_ptr<Seat> seat) {
  const std::lock_guard lock(variant.mutex);
  variant.free.push_back(std::move(seat));
}

std::unique_ptr<MemberPool::Seat> MemberPool::Acquire(Variant& variant, const Member& member) const {
  {
    const std::lock_guard lock(variant.mutex);
    auto& free = variant.free;
    auto at =
        std::find_if(free.begin(), free.end(), [&](const auto& seat) { return seat->occupant == &member; });
    if (at == free.end() && !free.empty()) at = std::prev(free.end());
    if (at != free.end()) {
      std::unique_ptr<Seat> seat = std::move(*at);
      free.erase(at);
      return seat;
    }
  }
  auto made = MakeSimulation(variant.factors);
  FORK1S_REQUIRE(made.has_value(), made ? "" : made.error().Text());  // as it was made before
  return MakeSeat(std::move(*made));
}

Expected<std::shared_ptr<MemberPool::Variant>> MemberPool::FindOrMake(const SceneFactors& factors,
                                                                      std::optional<Simulation> begun) {
  const FactorsKey key = KeyOf(factors);
  {
    const std::lock_guard lock(mutex_);
    if (const auto at = variants_.find(key); at != variants_.end()) return at->second;
  }
  if (!begun) {
    auto made = MakeSimulation(factors);
    if (!made) return tl::unexpected(made.error());
    begun = std::move(*made);
  }
  auto variant = std::make_shared<Variant>();
  variant->factors = factors;
  begun->Save(variant->start);
  variant->free.push_back(MakeSeat(std::move(*begun)));
  const std::lock_guard lock(mutex_);
  return variants_.emplace(key, std::move(variant)).first->second;  // or that of another thread
}

void MemberPool::Join(Member& member, std::shared_ptr<Variant> variant) {
  const std::lock_guard lock(mutex_);
  ++variant->members;
  std::swap(member.variant, variant);
  if (!variant || --variant->members > 0) return;
  const auto at = variants_.find(KeyOf(variant->factors));
  if (at != variants_.end() && at->second == variant) variants_.erase(at);
}

Expected<void> MemberPool::Begin(std::size_t index, const Drawn& drawn) {
  Simulation::Snapshot moment;
  std::optional<Simulation> begun;
  if (drawn.start.size() > 0) {
    auto made = starts_.Begin(drawn);
    if (!made) return tl::unexpected(made.error());
    made->Save(moment);
    begun = std::move(*made);
  }
  auto variant = FindOrMake(drawn.factors, std::move(begun));
  if (!variant) return tl::unexpected(variant.error());
  if (drawn.start.size() == 0) moment = (*variant)->start;
  moment.made_of = (*variant)->start.made_of;
  moment.keyframe = (*variant)->start.keyframe;
  Member& member = members_[index];
  member.moment = std::move(moment);
  ++member.version;
  Join(member, std::move(*variant));
  return {};
}

Expected<void> MemberPool::Restore(std::size_t index, const Simulation::Snapshot& moment,
                                   const SceneFactors& factors) {
  Member& member = members_[index];
  auto found = FindOrMake(factors, {});
  if (!found) return tl::unexpected(found.error());
  std::shared_ptr<Variant> variant = *found;
  Simulation::Snapshot next = moment;
  std::unique_ptr<Seat> seat;
  if (!(moment.fidelity == variant->start.fidelity) || !moment.frozen_grasps.empty()) {
    // Of more or less detail than others: a world of its own.
    auto own = std::make_shared<Variant>();
    own->factors = factors;
    own->is_of_one = true;
    seat = Acquire(*own, member);
    variant = std::move(own);
  } else {
    seat = Acquire(*variant, member);
    if (!HasStepModels(next) && !Has(*seat, member)) {
      Simulation::Snapshot now = member.variant == variant ? member.moment : variant->start;
      RestoreOwn(now, *seat);
    }
    // Another scene is told by its name.
    if (next.made_of && next.made_of->name == seat->made_of->name) {
      next.made_of = seat->made_of;
      next.keyframe = seat->keyframe;
    }
  }
  seat->occupant = nullptr;
  if (auto restored = seat->simulation.Restore(next); !restored) {
    Release(*variant, std::move(seat));
    return restored;
  }
  seat->simulation.Save(next);
  seat->made_of = next.made_of;
  seat->keyframe = next.keyframe;
  member.moment = std::move(next);
  seat->occupant = &member;
  seat->version = ++member.version;
  Release(*variant, std::move(seat));
  Join(member, std::move(variant));
  return {};
}

}  // namespace fork1s::internal
