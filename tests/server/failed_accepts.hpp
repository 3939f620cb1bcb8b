#pragma once

#include <atomic>

namespace fork1s::test {

/// How often the system refused this program a connection that it asked for, since it began. Nobody waiting is
/// no refusal.
extern std::atomic<long> failed_accepts;

}  // namespace fork1s::test
