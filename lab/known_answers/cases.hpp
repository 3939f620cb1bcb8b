// One function a case, each in the file of its name.
#pragma once

#include <lab/known_answers.hpp>

namespace fork1s::internal {

// linear.cpp
std::vector<KnownAnswer> TwoLinkArm(Refinement);
std::vector<KnownAnswer> PlanarChain(Refinement);
std::vector<KnownAnswer> StewartPlatform(Refinement);
// squeezer.cpp
std::vector<KnownAnswer> Squeezer(Refinement);
// governor.cpp
std::vector<KnownAnswer> FlyballGovernor(Refinement);
// bricard.cpp
std::vector<KnownAnswer> Bricard(Refinement);
// contact.cpp
std::vector<KnownAnswer> Rolling(Refinement);
std::vector<KnownAnswer> SlidingToRolling(Refinement);
std::vector<KnownAnswer> Sticking(Refinement);
// stiff.cpp
std::vector<KnownAnswer> GainInContact(Refinement);
std::vector<KnownAnswer> MassRatio(Refinement);

}  // namespace fork1s::internal
