// A bare number is not an index, nor an index a number.
#include <fork1s/mechanism/mechanism.hpp>

const fork1s::Mechanism::Body& Third(const fork1s::Mechanism& mechanism) {
#ifdef FORK1S_WRONG
  return mechanism.body(3);
#else
  return mechanism.body(fork1s::BodyIndex(3));
#endif
}
