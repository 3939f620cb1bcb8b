// A velocity and a force have no sum.
#include <fork1s/spatial/twist.hpp>

fork1s::Twist Sum(const fork1s::Twist& V, const fork1s::Wrench& F) {
#ifdef FORK1S_WRONG
  return V + F;
#else
  static_cast<void>(F);
  return V + V;
#endif
}
