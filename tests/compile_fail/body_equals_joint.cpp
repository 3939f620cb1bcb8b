// Indices into different tables do not compare.
#include <fork1s/base/index.hpp>

bool Same(fork1s::BodyIndex body, fork1s::JointIndex joint) {
#ifdef FORK1S_WRONG
  return body == joint;
#else
  return body.value() == joint.value();
#endif
}
