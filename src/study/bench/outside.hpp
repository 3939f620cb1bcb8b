// Simulators that run as programs of their own, by the request of benchmarks/peers/tree.py.
#pragma once

#include <string>
#include <vector>

#include "study/bench.hpp"

namespace fork1s::internal {

/// Errors (kModel): a sentence on why there is no motion.
Expected<PeerMotion> RunOutside(const OutsidePeer& peer, const Scene& scene,
                                const std::vector<std::string>& bodies, double dt, int samples, int substeps);

}  // namespace fork1s::internal
