// A joint's index names no body.
#include <fork1s/base/index.hpp>

fork1s::BodyIndex Assign(fork1s::JointIndex joint) {
  fork1s::BodyIndex body;
#ifdef FORK1S_WRONG
  body = joint;
#else
  body = fork1s::BodyIndex(joint.value());
#endif
  return body;
}
