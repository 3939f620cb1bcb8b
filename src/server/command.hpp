// What a viewer asks for.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/base/types.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace fork1s {

struct Command {
  enum class Kind {
    kPull,        ///< hold `point` of `body` with a spring to `target`, until released
    kRelease,     ///< let go
    kPush,        ///< a short push on `point` of `body` along `target`
    kPause,       ///< stop or go on: `on`
    kStep,        ///< one frame, then pause
    kReset,       ///< back to the initial state
    kHold,        ///< set-points of position servos take the present joint positions
    kSet,         ///< `setting` [index] = value
    kInterfaces,  ///< the interface bodies of mechanism `index` are `bodies`
    kResume,      ///< back to the frame `index`, or the kept moment before it
    kWrite,       ///< into a copy of the file, `tuned` numbers, the `moment`, or both
    kShape,       ///< `body` is to give way as `compliance` says, by other stiffnesses
    kGhost,       ///< the full simulation beside the reduced one: `on`
    kLeft,        ///< the viewer has gone; made by the server, never read from the wire
  };
  Kind kind = Kind::kPause;
  int viewer = 0;                    // who asks; set by the server
  int body = -1;                     // place in Simulation::bodies()
  Vector3 point = Vector3::Zero();   // m, in the body
  Vector3 target = Vector3::Zero();  // m, in the world; push: a direction
  bool on = false;
  std::string setting;
  int index = 0;
  double value = 0;
  std::vector<int> bodies;
  Matrix3 compliance = Matrix3::Zero();  // m/N, axes of the root
  double factor = 1;                     // shape: bound on each stiffness over the file's, and its inverse
  bool tuned = false;                    // write: the numbers that were changed
  bool text_only = false;                // write: no file
  int moment = -1;                       // write: -1 none, 0 the present, else that of a frame
};

/// Reads one message of a viewer. Every number is finite and no list longer than 4096. Errors (kFormat) say
/// in one sentence what is wrong; whether bodies and settings exist is for the simulation to say.
Expected<Command> ParseCommand(std::string_view text);

}  // namespace fork1s
