// What `bench` prints.
#pragma once

#include "study/bench.hpp"

#include "output.hpp"

namespace fork1s::app {

/// One scene under its name in "scenes".
/// `controls`: the table's path; empty: none.
Json SceneJson(const BenchScene& scene, const std::string& controls);
/// `out` with what was measured beside the scenes.
Json PartsJson(const BenchResults& results, Json out);

void PrintScene(const BenchScene& scene);
void PrintParts(const BenchResults& results);

}  // namespace fork1s::app
