// The list of cases, and where their failures become errors.
#include "cases.hpp"

#include "support.hpp"

namespace fork1s {
namespace {

template <std::vector<KnownAnswer> (*Case)(Refinement)>
Expected<std::vector<KnownAnswer>> Guarded(Refinement refinement) {
  try {
    return Case(refinement);
  } catch (const internal::CaseFailure& failure) {
    return Fail(ErrorCode::kNumerics, "known answer", failure.what());
  }
}

constexpr KnownAnswerCase kCases[] = {
    {"two_link_arm", "Two-link arm, elbow at a right angle", Guarded<internal::TwoLinkArm>},
    {"planar_chain", "Planar chain of ten links", Guarded<internal::PlanarChain>},
    {"stewart_platform", "Cubic Stewart platform", Guarded<internal::StewartPlatform>},
    {"squeezer", "Andrews' squeezing mechanism", Guarded<internal::Squeezer>},
    {"flyball_governor", "Stiff flyball governor", Guarded<internal::FlyballGovernor>},
    {"bricard", "Bricard's linkage", Guarded<internal::Bricard>},
    {"rolling", "A ball rolls down a slope", Guarded<internal::Rolling>},
    {"sliding_to_rolling", "A sliding ball begins to roll", Guarded<internal::SlidingToRolling>},
    {"sticking", "A box sticks or slides on a slope", Guarded<internal::Sticking>},
    {"gain_in_contact", "A stiff gain in contact", Guarded<internal::GainInContact>},
    {"mass_ratio", "A mass ratio of a million", Guarded<internal::MassRatio>},
};

}  // namespace

std::span<const KnownAnswerCase> KnownAnswerCases() { return kCases; }

}  // namespace fork1s
