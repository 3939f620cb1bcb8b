// Members of a batch: simulations of one scene that take turns in a few worlds.
#pragma once

#include <cstdint>
#include <fork1s/sim/randomisation.hpp>
#include <fork1s/sim/sensors.hpp>
#include <fork1s/sim/simulation.hpp>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace fork1s::internal {

/// What a member is between calls is a Snapshot, some kilobytes for a hand. A world, with the scratch of a step, is
/// there for as many members as are worked on at a time, and members that differ by SceneFactors have worlds of their
/// own. Every member gives the bits of a simulation of its own.
///
/// Calls for different members may be made by several threads at a time.
class MemberPool {
 public:
  /// Every member is to Begin before it is used.
  MemberPool(Starts starts, std::size_t count) : starts_(std::move(starts)), members_(count) {}

  std::size_t size() const { return members_.size(); }

  /// The member begins with what was drawn. Errors: those of Starts::Begin; the member is as it was.
  Expected<void> Begin(std::size_t member, const Drawn& drawn);
  /// f(Simulation&): what f leaves is the state of the member; where f throws, that before.
  template <class F>
  void Change(std::size_t member, F&& f) {
    Use use(*this, member);
    use.seat->occupant = nullptr;
    f(use.seat->simulation);
    use.Store();
  }
  /// f(const Simulation&)
  template <class F>
  void Read(std::size_t member, F&& f) {
    const Use use(*this, member);
    f(std::as_const(use.seat->simulation));
  }
  /// f(const Sensors&): at the present state.
  template <class F>
  void ReadSensors(std::size_t member, F&& f) {
    const Use use(*this, member);
    Seat& seat = *use.seat;
    if (seat.sensors)
      seat.sensors->Update(seat.simulation);
    else
      seat.sensors.emplace(seat.simulation);
    f(std::as_const(*seat.sensors));
  }
  /// Whether it has a moment of more or less detail than members begin with, and so a world and a scene of its own.
  bool HasOwnWorld(std::size_t member) const { return members_[member].variant->is_of_one; }
  /// The state of a member.
  const Simulation::Snapshot& Moment(std::size_t member) const { return members_[member].moment; }
  /// The member goes to a moment of a simulation of the scene with these factors. From a moment without
  /// MechanismState::step_model it steps by the model that it has, or by that of members that begin with these factors.
  /// Errors: those of Simulation::Restore; the member is as it was.
  Expected<void> Restore(std::size_t member, const Simulation::Snapshot& moment, const SceneFactors& factors);

 private:
  struct Member;
  // SceneFactors, in an order.
  using FactorsKey = std::pair<std::vector<double>, std::map<std::string, double>>;
  struct Seat {
    Simulation simulation;
    std::shared_ptr<const Scene> made_of;  // of its world, as in Simulation::Snapshot
    int keyframe = -1;                     // likewise
    std::optional<Sensors> sensors;
    const Member* occupant = nullptr;  // whose state it has
    std::uint64_t version = 0;         // Member::version of that state
  };
  struct Variant {  // of members that share worlds
    SceneFactors factors;
    Simulation::Snapshot start;  // of every member, unless starts are drawn
    int members = 0;             // guarded by the mutex of the pool
    bool is_of_one = false;      // that has another detail
    std::mutex mutex;
    std::vector<std::unique_ptr<Seat>> free;  // guarded by `mutex`
  };
  struct Member {
    std::shared_ptr<Variant> variant;
    Simulation::Snapshot moment;
    std::uint64_t version = 0;  // counts states that came from elsewhere than a seat
  };
  /// A member in a seat, for its lifetime.
  struct Use {
    Use(MemberPool& pool, std::size_t index);
    ~Use();
    Use(const Use&) = delete;
    Use& operator=(const Use&) = delete;
    void Store();

    Member& member;
    std::unique_ptr<Seat> seat;
  };

  static FactorsKey KeyOf(const SceneFactors& factors);
  /// Whether a seat has the state of a member.
  static bool Has(const Seat& seat, const Member& member);
  /// Of a member of the seat's variant, as of the scene of its world.
  static void RestoreOwn(Simulation::Snapshot& moment, Seat& seat);
  /// At the start of the scene, no coordinate drawn.
  Expected<Simulation> MakeSimulation(const SceneFactors& factors) const;
  static std::unique_ptr<Seat> MakeSeat(Simulation simulation);
  static void Release(Variant& variant, std::unique_ptr<Seat> seat);
  /// A free one, that with the state of the member if there is one, or a new one.
  std::unique_ptr<Seat> Acquire(Variant& variant, const Member& member) const;
  /// That of these factors; `begun` becomes its first seat where there is none yet.
  Expected<std::shared_ptr<Variant>> FindOrMake(const SceneFactors& factors, std::optional<Simulation> begun);
  void Join(Member& member, std::shared_ptr<Variant> variant);

  Starts starts_;
  std::vector<Member> members_;
  std::mutex mutex_;
  std::map<FactorsKey, std::shared_ptr<Variant>> variants_;  // by their factors
};

}  // namespace fork1s::internal
