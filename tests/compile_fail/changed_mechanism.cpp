// A mechanism is shared and never changes once it is built.
#include <fork1s/mechanism/mechanism.hpp>

double Soften(fork1s::Mechanism& mechanism) {
#ifdef FORK1S_WRONG
  mechanism.stiffness()(0) = 0;
#endif
  return mechanism.stiffness()(0);
}
