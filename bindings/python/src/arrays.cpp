#include "arrays.hpp"

#include <cmath>
#include <string>

namespace fork1s::python {
namespace {

std::string ShapeOf(const Numbers& numbers) {
  std::string shape = "(";
  for (std::size_t i = 0; i < numbers.ndim(); ++i)
    shape += (i == 0 ? "" : ", ") + std::to_string(numbers.shape(i));
  return shape + (numbers.ndim() == 1 ? ",)" : ")");
}

[[noreturn]] void Refuse(const char* argument, const std::string& wanted, const Numbers& numbers) {
  throw nb::value_error(
      (std::string(argument) + " must be " + wanted + ", not an array of shape " + ShapeOf(numbers)).c_str());
}

void RequireFinite(const Numbers& numbers, const char* argument) {
  for (std::size_t i = 0; i < numbers.size(); ++i)
    if (!std::isfinite(numbers.data()[i]))
      throw nb::value_error((std::string(argument) + " must be finite, and entry " + std::to_string(i) +
                             " is " + std::to_string(numbers.data()[i]))
                                .c_str());
}

}  // namespace

Numbers ReadNumbers(nb::handle given) {
  const nb::module_ numpy = nb::module_::import_("numpy");
  return nb::cast<Numbers>(numpy.attr("ascontiguousarray")(given, numpy.attr("float64")));
}

VectorX ReadVector(nb::handle given, std::size_t count, const char* argument) {
  const Numbers numbers = ReadNumbers(given);
  if (numbers.ndim() != 1 || numbers.size() != count)
    Refuse(argument, std::to_string(count) + (count == 1 ? " number" : " numbers"), numbers);
  RequireFinite(numbers, argument);
  return Eigen::Map<const VectorX>(numbers.data(), static_cast<Eigen::Index>(count));
}

Vector3 ReadVector3(nb::handle given, const char* argument) { return ReadVector(given, 3, argument); }

RigidTransform ReadPose(nb::handle given, const char* argument) {
  const Numbers numbers = ReadNumbers(given);
  const double* n = numbers.data();
  if (numbers.ndim() == 1 && numbers.size() == 3) return RigidTransform(ReadVector3(given, argument));
  RequireFinite(numbers, argument);
  if (numbers.ndim() == 1 && numbers.size() == 7) {
    const Quaternion q(n[3], n[4], n[5], n[6]);
    if (!(q.norm() > 0))
      throw nb::value_error((std::string(argument) + " has a quaternion of length 0").c_str());
    return {q.normalized(), Vector3(n[0], n[1], n[2])};
  }
  if (numbers.ndim() == 2 && numbers.shape(0) == 4 && numbers.shape(1) == 4) {
    const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> m(n);
    const Matrix3 R = m.topLeftCorner<3, 3>();
    if (!(R.transpose() * R).isIdentity(1e-6) || !(R.determinant() > 0))
      throw nb::value_error((std::string(argument) + " has no rotation in its upper left 3 x 3").c_str());
    return {R, Vector3(m.topRightCorner<3, 1>())};
  }
  Refuse(argument, "3 numbers (a position), 7 (position and quaternion, w first) or a 4 x 4 matrix", numbers);
}

}  // namespace fork1s::python
