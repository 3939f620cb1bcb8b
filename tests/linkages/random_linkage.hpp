// A random linkage with springs, scale and frames, from a seed.
#pragma once

#include "sketch.hpp"

namespace fork1s::linkages {

/// Family, springs over six orders of magnitude, tendons, gears, bushings, interfaces, a size from 1 mm to 10
/// m and a root up to 100 sizes away.
Sketch RandomLinkage(unsigned seed);

/// Numbers in [0, 1).
std::vector<double> RandomNumbers(unsigned seed, int count);
/// A pose anywhere within `reach`, for tests that move things.
RigidTransform RandomPose(unsigned seed, double reach);

}  // namespace fork1s::linkages
