#include "batch_arguments.hpp"

#include <nanobind/stl/map.h>
#include <nanobind/stl/pair.h>

#include <algorithm>
#include <cmath>

#include "arguments.hpp"
#include "arrays.hpp"
#include "errors.hpp"
#include "sim/vary.hpp"
#include "text.hpp"

namespace fork1s::python {
namespace {

// A number for all, or one for each.
std::vector<double> ReadFactors(const nb::object& given, std::size_t count, const char* argument) {
  if (given.is_none()) return std::vector<double>(count, 1.0);
  const Numbers numbers = ReadNumbers(given, argument);
  std::vector<double> factors(count);
  if (numbers.size() == 1) {
    factors.assign(count, numbers.data()[0]);
  } else {
    const VectorX read = ReadVector(given, count, argument);
    factors.assign(read.data(), read.data() + read.size());
  }
  for (const double f : factors)
    if (!(std::isfinite(f) && f > 0))
      throw nb::value_error((std::string(argument) + " must be finite and above 0").c_str());
  return factors;
}

// One for all, from which each member's is mixed, or one for each.
std::vector<std::uint64_t> ReadSeeds(const nb::object& given, std::size_t count) {
  if (given.is_none()) return {};
  // As objects, since numpy makes floating-point numbers of a list of small and large whole ones.
  const nb::module_ numpy = nb::module_::import_("numpy");
  if (nb::cast<bool>(numpy.attr("ma").attr("is_masked")(given)))
    throw nb::value_error("seeds has masked entries; fill them first, as .filled() does");
  const nb::object array = numpy.attr("asarray")(given, numpy.attr("object_"));
  std::vector<std::uint64_t> read;
  for (nb::handle entry : array.attr("ravel")()) {
    const auto whole = nb::steal<nb::object>(PyNumber_Index(entry.ptr()));
    const std::uint64_t value = whole.is_valid() ? PyLong_AsUnsignedLongLong(whole.ptr()) : 0;
    if (PyErr_Occurred()) break;
    read.push_back(value);
  }
  const bool is_one = nb::cast<int>(array.attr("ndim")) == 0;
  if (PyErr_Occurred() || read.size() != (is_one ? 1 : count)) {
    PyErr_Clear();
    throw nb::value_error(
        ("seeds must be a whole number from 0 to 2^64 - 1, or " + std::to_string(count) + " of them")
            .c_str());
  }
  if (is_one)
    for (std::size_t i = 1; i < count; ++i) read.push_back(SeedOf(read[0], i));
  if (is_one) read[0] = SeedOf(read[0], 0);
  return read;
}

}  // namespace

Randomisation ReadRanges(const nb::object& given) {
  if (given.is_none()) return UsualRandomisation();
  Randomisation ranges;
  const std::string start = "start:";
  const auto all = ReadAs<std::map<std::string, std::pair<double, double>>>(
      given, "randomise", "a mapping from names to (smallest, largest)");
  for (const auto& [name, range] : all) {
    const DrawRange read{range.first, range.second};
    const bool is_start = name.starts_with(start);
    if (!(read.low <= read.high && std::isfinite(read.low) && std::isfinite(read.high)) ||
        (!is_start && !(read.low > 0)))
      throw Refused{{ErrorCode::kUsage, "randomise",
                     "'" + name + "' must be " + (is_start ? "" : "0 < ") + "smallest <= largest, not " +
                         nb::cast<std::string>(nb::str(nb::float_(read.low))) + " and " +
                         nb::cast<std::string>(nb::str(nb::float_(read.high)))}};
    if (name == "stiffness")
      ranges.stiffness = read;
    else if (name == "friction")
      ranges.friction = read;
    else if (name == "mass")
      ranges.mass = read;
    else if (is_start)
      ranges.start.push_back({name.substr(start.size()), read});
    else if (fork1s::internal::IsOfQuantity(name))
      ranges.named.push_back({name, read});
    else
      throw Refused{{ErrorCode::kUsage, "randomise",
                     "'" + name + "' is none of: " + fork1s::internal::kFactorKeys + ", start:COORDINATE"}};
  }
  return ranges;
}

MemberDifferences ReadDifferences(std::size_t count, const nb::object& seeds, const nb::object& stiffness,
                                  const nb::object& friction, const nb::object& mass,
                                  const nb::object& factors) {
  MemberDifferences differences;
  differences.seeds = ReadSeeds(seeds, count);
  const std::pair<const nb::object&, const char*> all[3] = {
      {stiffness, "stiffness"}, {friction, "friction"}, {mass, "mass"}};
  for (std::size_t k = 0; k < 3; ++k)
    if (!all[k].first.is_none())
      differences.given[all[k].second] = ReadFactors(all[k].first, count, all[k].second);
  if (factors.is_none()) return differences;
  for (const auto& [key, of_members] :
       ReadAs<std::map<std::string, nb::object>>(factors, "factors", "a mapping from names to factors"))
    if (!differences.given.emplace(key, ReadFactors(of_members, count, ("factors['" + key + "']").c_str()))
             .second)
      throw Refused{{ErrorCode::kUsage, "factors", "'" + key + "' is given as an argument of its own, too"}};
  return differences;
}

}  // namespace fork1s::python
