// Bodies that a reduced simulation lets pass through others, because they are no interface.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/sim/simulation.hpp>
#include <memory>
#include <string>
#include <vector>

namespace fork1s {

/// An interior body that went into something that it would have touched.
struct Interpenetration {
  std::string body;   // no interface
  std::string other;  // what it went into: "world" for still things
  double first = 0;   // s, when it was seen to
  double depth = 0;   // m, the most since
  double when = 0;    // s, of that
};

/// A sentence for each of the first, which are the deepest, and one for how many others there are. remedy: how the caller's
/// user makes the body an interface.
std::vector<std::string> Sentences(const std::vector<Interpenetration>& found, const std::string& remedy);

/// Only interface bodies touch, which is what makes a reduced simulation fast. This looks at all bodies,
/// beside the simulation: neighbours on a joint or loop, and what overlaps at the start, do not count.
class InterpenetrationMonitor {
 public:
  /// Errors as of CollisionWorld::Create.
  static Expected<InterpenetrationMonitor> Create(const Simulation& simulation);
  ~InterpenetrationMonitor();
  InterpenetrationMonitor(InterpenetrationMonitor&&) noexcept;
  InterpenetrationMonitor& operator=(InterpenetrationMonitor&&) noexcept;

  /// After a step: the present poses. One pass of collision detection.
  void Update(const Simulation& simulation);
  /// Deepest first.
  std::vector<Interpenetration> Found() const;

 private:
  InterpenetrationMonitor();
  struct Detail;
  std::unique_ptr<Detail> detail_;
};

}  // namespace fork1s
