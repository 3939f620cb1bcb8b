#include "arrays.hpp"

#include <cmath>
#include <string>

#include "spatial/roll_pitch_yaw.hpp"
#include "text.hpp"

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

Numbers ReadNumbers(nb::handle given, const std::string& argument) {
  const nb::module_ numpy = nb::module_::import_("numpy");
  std::string cause;
  try {
    if (nb::cast<bool>(numpy.attr("ma").attr("is_masked")(given)))
      throw nb::value_error((argument + " has masked entries; fill them first, as .filled() does").c_str());
    const nb::object array = numpy.attr("asarray")(given);
    const nb::object type = array.attr("dtype");
    // Whole and real numbers, truth values, and objects that may be either.
    if (std::string("biufO").find(nb::cast<std::string>(type.attr("kind"))) != std::string::npos)
      return nb::cast<Numbers>(numpy.attr("ascontiguousarray")(array, numpy.attr("float64")));
    cause = "an array of type " + nb::cast<std::string>(nb::str(type));
  } catch (const nb::python_error& error) {
    if (!error.matches(PyExc_TypeError) && !error.matches(PyExc_ValueError) &&
        !error.matches(PyExc_OverflowError))
      throw;
    cause = "what numpy refuses (" + nb::cast<std::string>(nb::str(error.value())) + ")";
  }
  throw nb::type_error((argument + " must be an array of real numbers, not " + cause).c_str());
}

VectorX ReadVector(nb::handle given, std::size_t count, const char* argument) {
  const Numbers numbers = ReadNumbers(given, argument);
  if (numbers.ndim() != 1 || numbers.size() != count)
    Refuse(argument, std::to_string(count) + (count == 1 ? " number" : " numbers"), numbers);
  RequireFinite(numbers, argument);
  return Eigen::Map<const VectorX>(numbers.data(), static_cast<Eigen::Index>(count));
}

Vector3 ReadVector3(nb::handle given, const char* argument) { return ReadVector(given, 3, argument); }

namespace {

constexpr const char* kPoseForms =
    "3 numbers (a position), 7 (position and quaternion, w first) or a 4 x 4 matrix";

RigidTransform MakePose(const Numbers& numbers, const char* argument, const char* forms) {
  const double* n = numbers.data();
  const auto has = [&](std::size_t size) { return numbers.ndim() == 1 && numbers.size() == size; };
  const bool is_matrix = numbers.ndim() == 2 && numbers.shape(0) == 4 && numbers.shape(1) == 4;
  if (!has(3) && !has(7) && !is_matrix) Refuse(argument, forms, numbers);
  RequireFinite(numbers, argument);
  if (has(3)) return RigidTransform(Vector3(n[0], n[1], n[2]));
  if (has(7)) {
    const Quaternion q(n[3], n[4], n[5], n[6]);
    if (!(q.norm() > 0))
      throw nb::value_error((std::string(argument) + " has a quaternion of length 0").c_str());
    return {q.normalized(), Vector3(n[0], n[1], n[2])};
  }
  const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> m(n);
  const Matrix3 R = m.topLeftCorner<3, 3>();
  if (!(R.transpose() * R).isIdentity(1e-6) || !(R.determinant() > 0))
    throw nb::value_error((std::string(argument) + " has no rotation in its upper left 3 x 3").c_str());
  return {R, Vector3(m.topRightCorner<3, 1>())};
}

}  // namespace

RigidTransform ReadPose(nb::handle given, const char* argument) {
  return MakePose(ReadNumbers(given, argument), argument, kPoseForms);
}

RigidTransform ReadBasePose(nb::handle given, const char* argument) {
  const Numbers numbers = ReadNumbers(given, argument);
  if (numbers.ndim() != 1 || numbers.size() != 6)
    return MakePose(
        numbers, argument,
        "3 numbers (a position), 6 (position, roll, pitch and yaw), 7 (position and quaternion, w "
        "first) or a 4 x 4 matrix");
  RequireFinite(numbers, argument);
  const double* n = numbers.data();
  return {RollPitchYawRotation({n[3], n[4], n[5]}), Vector3(n[0], n[1], n[2])};
}

}  // namespace fork1s::python
