#include "broken_ground.hpp"

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <vector>

namespace fork1s::examples {
namespace {

constexpr std::int32_t kColumns = 81, kRows = 41;

// A number of 0 to 1 that belongs to a point of a lattice: the same on every machine.
double Noise(int i, int k, std::uint32_t seed) {
  std::uint32_t x =
      seed + 0x9e3779b9u * static_cast<std::uint32_t>(i) + 0x85ebca6bu * static_cast<std::uint32_t>(k);
  x = (x ^ (x >> 16)) * 0x7feb352du;
  x = (x ^ (x >> 15)) * 0x846ca68bu;
  return static_cast<double>(x ^ (x >> 16)) / 4294967295.0;
}

// Between lattice points `cells` apart, without a kink.
double Bumps(int row, int column, int cells, std::uint32_t seed) {
  const int i = row / cells, k = column / cells;
  const auto smooth = [&](int rest) {
    const double t = static_cast<double>(rest) / cells;
    return t * t * (3 - 2 * t);
  };
  const double s = smooth(row % cells), t = smooth(column % cells);
  return (1 - s) * ((1 - t) * Noise(i, k, seed) + t * Noise(i, k + 1, seed)) +
         s * ((1 - t) * Noise(i + 1, k, seed) + t * Noise(i + 1, k + 1, seed));
}

}  // namespace

bool WriteBrokenGround(const std::string& path) {
  std::vector<float> heights;
  for (int row = 0; row < kRows; ++row)
    for (int column = 0; column < kColumns; ++column) {
      // Falls off to level ground over the last cells.
      const int border = std::min({row, column, kRows - 1 - row, kColumns - 1 - column});
      const double rough = 0.7 * Bumps(row, column, 4, 1) + 0.3 * Bumps(row, column, 2, 2);
      heights.push_back(static_cast<float>(rough * std::min(1.0, border / 4.0)));
    }
  std::ofstream out(path, std::ios::binary);
  out.write(reinterpret_cast<const char*>(&kRows), sizeof kRows);
  out.write(reinterpret_cast<const char*>(&kColumns), sizeof kColumns);
  out.write(reinterpret_cast<const char*>(heights.data()),
            static_cast<std::streamsize>(heights.size() * sizeof(float)));
  return static_cast<bool>(out);
}

}  // namespace fork1s::examples
