#include <fork1s/reduction/compliance.hpp>

#include <fork1s/reduction/free_motion.hpp>

#include <fmt/format.h>

namespace fork1s {

Expected<std::vector<int>> CoordinatesToLock(const Mechanism& mechanism, const VectorX& q,
                                             const std::vector<BodyIndex>& bodies, OnFreeMotion on_free) {
  std::vector<int> locked;
  for (const FreeMotion& motion : FindFreeMotions(mechanism, q, bodies)) {
    if (!motion.body.valid()) continue;  // none of the bodies moves
    if (on_free == OnFreeMotion::kRefuse)
      return Fail(
          ErrorCode::kUnderdetermined, fmt::format("joint '{}'", mechanism.joint(motion.joints.front()).name),
          fmt::format(
              "the compliance of body '{}' has no bound: {}, or ask for the compliance with it locked",
              mechanism.body(motion.body).name, motion.Text(mechanism)));
    locked.push_back(motion.pivot);
  }
  return locked;
}

Expected<InterfaceCompliance> ComputeCompliance(const Mechanism& mechanism, const VectorX& q,
                                                const std::vector<BodyIndex>& bodies, OnFreeMotion on_free) {
  const auto locked = CoordinatesToLock(mechanism, q, bodies, on_free);
  if (!locked) return tl::unexpected(locked.error());
  return WalkCompliance(mechanism, q, bodies, *locked);
}

}  // namespace fork1s
