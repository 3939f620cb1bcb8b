// What a run says of its contacts, by pair of bodies.
#pragma once

#include <fork1s/sim/run_statistics.hpp>
#include <vector>

#include "output.hpp"

namespace fork1s::app {

Json ContactsJson(const Simulation& simulation, const std::vector<PairLoad>& pairs);
Json FrictionUseJson(const Simulation& simulation, const std::vector<BodyFriction>& bodies);
void PrintFrictionUse(const Json& bodies);
void PrintContacts(const Json& contacts);

constexpr std::size_t kLines = 8;  // printed of a kind; the JSON has all
/// Says how many of `count` were not printed.
void PrintOmitted(std::size_t count, const char* what);
/// Three digits; components below a thousandth of the largest, or below `floor`, are printed as 0.
std::string VectorText(const Json& v, double floor = 0);

}  // namespace fork1s::app
