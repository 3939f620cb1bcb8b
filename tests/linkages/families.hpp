// Random linkages of one family each, of about unit size: geometry only, no springs yet.
#pragma once

#include <random_mechanism.hpp>

#include "sketch.hpp"

namespace fork1s::linkages {

using testing::RandomSource;

/// One to `loops` loops of pins across a plane, in parallel, nested, in series, and struts that lock them.
Sketch PlanarLinkage(RandomSource& random, int loops);
/// The same on a sphere: all axes meet in one point.
Sketch SphericalLinkage(RandomSource& random, int loops);
/// Stages on parallel cranks of equal length: more cranks than freedoms ask for.
Sketch ParallelogramLinkage(RandomSource& random, int stages);
/// Bennett's loop of four skew hinges, sides and twists in his proportion.
Sketch BennettLinkage(RandomSource& random);
/// A platform on two or three legs of three parallel hinges each: it can only rise.
Sketch SarrusLinkage(RandomSource& random);
/// Loops of any pairs with a freedom or more to spare each.
Sketch SpatialLinkage(RandomSource& random, int loops);
/// A platform on two to four legs with a ball, universal and sliding joint or the like.
Sketch PlatformLinkage(RandomSource& random, int legs);

/// A body on a joint of its own, hung on one that is there.
void HangBody(RandomSource& random, Sketch& sketch);

}  // namespace fork1s::linkages
