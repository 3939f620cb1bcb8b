// The table of docs/peers.md: fork1s and MuJoCo's integrators, each against a converged run of the full model.
#pragma once

#include <string>
#include <vector>

#include "study/peers.hpp"

namespace fork1s {

/// fork1s by two stages and by backward Euler, MuJoCo's three integrators, `discrete` tuned (loops with a time
/// constant of 2 ms, elliptic friction cones, impratio 10). At PeerOptions::dt over `fine_substeps`, where the
/// time step hardly counts: fork1s, MuJoCo Euler, and that tuned; 1: none of these.
std::vector<PeerEntrant> PeerTableEntrants(int fine_substeps = 64);

std::string PeerTableCsv(const std::vector<PeerRow>& rows);
std::string PeerTableMarkdown(const std::vector<PeerRow>& rows);

}  // namespace fork1s
