// Six bare numbers do not say whether they are a twist or a wrench.
#include <fork1s/spatial/twist.hpp>

fork1s::Twist Wrap(const fork1s::Vector6& x) {
#ifdef FORK1S_WRONG
  return x;
#else
  return fork1s::Twist(x);
#endif
}
