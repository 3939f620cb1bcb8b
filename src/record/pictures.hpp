// Bytes of pictures, compressed.
#pragma once

#include <cstdint>
#include <vector>

namespace fork1s::internal {

std::vector<std::uint8_t> Deflated(const std::vector<std::uint8_t>& bytes);
/// The `size` bytes that were compressed; none where they are not that many or damaged.
std::vector<std::uint8_t> Inflated(const std::vector<std::uint8_t>& packed, std::size_t size);

}  // namespace fork1s::internal
