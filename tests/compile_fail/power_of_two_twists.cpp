// Power pairs a wrench with a twist.
#include <fork1s/spatial/twist.hpp>

double Pair(const fork1s::Twist& V, const fork1s::Wrench& F) {
#ifdef FORK1S_WRONG
  return Power(V, V) + Power(F, V);
#else
  return Power(F, V);
#endif
}
