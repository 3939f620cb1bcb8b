// Pictures as files of their own.
#pragma once

#include <fork1s/geometry/shape.hpp>
#include <string>

namespace fork1s {

/// A PNG file (ISO/IEC 15948) of 8 bits a channel. Throws std::invalid_argument where bytes and size
/// disagree.
std::string Png(const Picture& picture);

}  // namespace fork1s
