// How many problems a test draws.
#pragma once

#include <cstdlib>

namespace fork1s::testing {

/// All of them; with sanitizers, which take ten times as long and watch memory rather than answers, every
/// tenth. What the solver answers to all of them the same test asks without sanitizers.
constexpr int Draws(int all) {
#ifdef __SANITIZE_ADDRESS__
  return all / 10;
#else
  return all;
#endif
}

/// How many seeds a search takes whose every draw is a simulation: the first `few`, or `all` where the environment
/// has FORK1S_ALL_DRAWS, as ./check --all sets it.
inline unsigned Seeds(unsigned few, unsigned all) {
  return std::getenv("FORK1S_ALL_DRAWS") != nullptr ? all : few;
}

}  // namespace fork1s::testing
