// What a file may ask of the reader, so that a few lines cannot take all memory or all time.
#pragma once

#include <fork1s/base/error.hpp>
#include <optional>
#include <string>

namespace fork1s::internal {

/// Refuses MJCF that asks for more than any model needs (copies, keyframes, pixels, cells of a height field),
/// and files it names that are no files, before the reader allocates or opens them. Included files too; with
/// file and line.
std::optional<Error> CheckBounds(const std::string& path, const std::string& text);

}  // namespace fork1s::internal
