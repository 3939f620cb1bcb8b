// Tables are entered by their own index.
#include <fork1s/mechanism/mechanism.hpp>

const fork1s::Mechanism::Body& Moved(const fork1s::Mechanism& mechanism, fork1s::JointIndex joint) {
#ifdef FORK1S_WRONG
  return mechanism.body(joint);
#else
  return mechanism.body(mechanism.joint(joint).body);
#endif
}
