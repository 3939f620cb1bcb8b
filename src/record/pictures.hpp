// Bytes of pictures, compressed, and as PNG.
#pragma once

#include <cstdint>
#include <fork1s/geometry/shape.hpp>
#include <string>
#include <vector>

namespace fork1s::internal {

std::vector<std::uint8_t> Deflated(const std::vector<std::uint8_t>& bytes);
/// The `size` bytes that were compressed; none where they are not that many or damaged.
std::vector<std::uint8_t> Inflated(const std::vector<std::uint8_t>& packed, std::size_t size);

/// A PNG file (ISO/IEC 15948) of 8 bits a channel. Throws std::invalid_argument where bytes and size
/// disagree.
std::string Png(const Picture& picture);

}  // namespace fork1s::internal
