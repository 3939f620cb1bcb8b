// Little-endian numbers, one after the other.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <fork1s/spatial/rigid_transform.hpp>
#include <string>

namespace fork1s::internal {

static_assert(std::endian::native == std::endian::little,
              "the wire is little-endian, as every machine we know");

class ByteWriter {
 public:
  void U32(std::uint32_t v) { Raw(&v, sizeof v); }
  void I32(std::int32_t v) { Raw(&v, sizeof v); }
  void F32(double v) {
    const auto f = static_cast<float>(v);
    Raw(&f, sizeof f);
  }
  void F64(double v) { Raw(&v, sizeof v); }
  void Vector(const Vector3& v) {
    for (int i = 0; i < 3; ++i) F32(v(i));
  }
  /// x y z qw qx qy qz in doubles.
  void Pose(const RigidTransform& X) {
    for (int i = 0; i < 3; ++i) F64(X.translation()(i));
    const Quaternion q = X.quaternion();
    for (double c : {q.w(), q.x(), q.y(), q.z()}) F64(c);
  }
  void Bytes(const std::string& bytes) { bytes_ += bytes; }
  std::string Release() { return std::move(bytes_); }

 private:
  void Raw(const void* data, std::size_t size) { bytes_.append(static_cast<const char*>(data), size); }
  std::string bytes_;
};

}  // namespace fork1s::internal
