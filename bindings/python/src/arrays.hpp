// numpy arrays out of ours: views where the owner never changes, own memory otherwise.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <fork1s/spatial/rigid_transform.hpp>
#include <initializer_list>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace fork1s::python {

namespace nb = nanobind;

/// What an array is made of when it owns its numbers.
using Array = nb::ndarray<nb::numpy, double>;
/// A view of numbers that nobody may change.
using View = nb::ndarray<nb::numpy, const double>;
/// Numbers from Python as doubles in rows.
using Numbers = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
/// Whatever numpy can make such an array of without loss: arrays of other types, lists. Copied only where it
/// must be. Throws TypeError for complex numbers, times, text and records, ValueError for masked entries.
Numbers ReadNumbers(nb::handle given, const std::string& argument);

/// For properties that return one of these: it brings its owner along, so the object it came from need not be
/// kept.
inline constexpr auto kOwn = nb::rv_policy::automatic;

/// An array that takes the numbers over.
inline Array Own(std::vector<double> numbers, std::initializer_list<std::size_t> shape) {
  auto* kept = new std::vector<double>(std::move(numbers));
  nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<double>*>(p); });
  return Array(kept->data(), shape.size(), shape.begin(), owner);
}

/// Numbers in rows, before they become an array: made without the GIL.
struct Table {
  std::vector<double> numbers;
  std::size_t rows = 0, columns = 0;
};
inline Array Own(Table table) { return Own(std::move(table.numbers), {table.rows, table.columns}); }

inline Array ToArray(const std::vector<double>& numbers) { return Own(numbers, {numbers.size()}); }

inline Array OwnMatrix(const MatrixX& m) {
  std::vector<double> rows(static_cast<std::size_t>(m.size()));
  Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(rows.data(), m.rows(),
                                                                                     m.cols()) = m;
  return Own(std::move(rows), {static_cast<std::size_t>(m.rows()), static_cast<std::size_t>(m.cols())});
}

inline Array OwnVector(const VectorX& v) {
  return Own(std::vector<double>(v.data(), v.data() + v.size()), {static_cast<std::size_t>(v.size())});
}

/// Keeps what a view looks at alive as long as the view.
template <class T>
nb::capsule Hold(std::shared_ptr<const T> owner) {
  return nb::capsule(new std::shared_ptr<const T>(std::move(owner)),
                     [](void* p) noexcept { delete static_cast<std::shared_ptr<const T>*>(p); });
}

/// A column-major matrix of `owner`, as it lies in memory.
template <class T>
View ViewMatrix(const std::shared_ptr<const T>& owner, const double* data, Eigen::Index rows,
                Eigen::Index columns) {
  const std::size_t shape[2] = {static_cast<std::size_t>(rows), static_cast<std::size_t>(columns)};
  const std::int64_t strides[2] = {1, rows};
  return View(data, 2, shape, Hold(owner), strides);
}

/// Position [m], then the unit quaternion with w first and w >= 0: seven numbers.
inline void WritePose(const RigidTransform& X, double* out) {
  const Quaternion q = X.quaternion();
  const double sign = q.w() < 0 ? -1 : 1;
  const Vector3& p = X.translation();
  const double numbers[7] = {p.x(), p.y(), p.z(), sign * q.w(), sign * q.x(), sign * q.y(), sign * q.z()};
  std::copy(numbers, numbers + 7, out);
}

inline MatrixX Homogeneous(const RigidTransform& X) {
  MatrixX m = MatrixX::Identity(4, 4);
  m.topLeftCorner<3, 3>() = X.rotation();
  m.topRightCorner<3, 1>() = X.translation();
  return m;
}

/// Three finite numbers; ValueError that names the argument else.
Vector3 ReadVector3(nb::handle given, const char* argument);
/// The same, and zeros for None.
inline Vector3 ReadOrZero(const nb::object& given, const char* argument) {
  return given.is_none() ? Vector3(Vector3::Zero()) : ReadVector3(given, argument);
}
/// As many finite numbers as asked for.
VectorX ReadVector(nb::handle given, std::size_t count, const char* argument);
/// (3,) a position, (7,) position and quaternion w first, (4, 4) homogeneous.
RigidTransform ReadPose(nb::handle given, const char* argument);
/// The same, and (6,) a position with roll, pitch and yaw [rad], as in URDF's <origin>.
RigidTransform ReadBasePose(nb::handle given, const char* argument);

}  // namespace fork1s::python
