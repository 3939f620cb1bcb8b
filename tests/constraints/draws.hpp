// How many problems a test draws.
#pragma once

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

}  // namespace fork1s::testing
