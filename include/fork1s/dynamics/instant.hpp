// When within a step things are looked at.
#pragma once

namespace fork1s {

/// Where a step finds contacts and takes forces: at its start (implicit Euler), or, by second order, half way
/// (what nothing holds) or where it is foreseen to end (lasting contact); docs/method.md, section 5.
enum class Instant { kStart, kMiddle, kEnd };

}  // namespace fork1s
