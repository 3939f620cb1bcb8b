// The numbers of a shape, in the order in which fork1s/geometry/shape.hpp declares them.
#pragma once

#include <fork1s/geometry/shape.hpp>
#include <type_traits>
#include <vector>

namespace fork1s::internal {

/// m: half sides, radii, or radius and half length along z; none for meshes and height fields.
inline std::vector<double> ShapeSizes(const Shape& shape) {
  return std::visit(
      [](const auto& s) -> std::vector<double> {
        using S = std::remove_cvref_t<decltype(s)>;
        if constexpr (std::is_same_v<S, Plane>) return {s.half_x, s.half_y};
        if constexpr (std::is_same_v<S, Sphere>) return {s.radius};
        if constexpr (std::is_same_v<S, Capsule> || std::is_same_v<S, Cylinder>)
          return {s.radius, s.half_length};
        if constexpr (std::is_same_v<S, Ellipsoid>) return {s.radii.x(), s.radii.y(), s.radii.z()};
        if constexpr (std::is_same_v<S, Box>) return {s.half.x(), s.half.y(), s.half.z()};
        return {};
      },
      shape);
}

}  // namespace fork1s::internal
