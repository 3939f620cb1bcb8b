// The ground under scenes/hexapod_terrain.xml.
#pragma once

#include <string>

namespace fork1s::examples {

/// Writes heights of 0 to 1 on a grid of 81 x 41 points in MuJoCo's own format for height fields: rows and
/// columns as int32, then floats, row by row. Bumps of two sizes, four and two cells wide, and level ground
/// where no feet go. False if the file cannot be written.
bool WriteBrokenGround(const std::string& path);

}  // namespace fork1s::examples
