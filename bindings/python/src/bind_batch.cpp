// Batch: many simulations as one array.
#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "arrays.hpp"
#include "batch.hpp"
#include "bind.hpp"
#include "errors.hpp"
#include "words.hpp"

namespace fork1s::python {
namespace {

using BoolArray = nb::ndarray<nb::numpy, bool>;
using IntArray = nb::ndarray<nb::numpy, int>;

// A number for all, or one for each.
std::vector<double> ReadFactors(const nb::object& given, std::size_t count, const char* argument) {
  if (given.is_none()) return std::vector<double>(count, 1.0);
  const Numbers numbers = ReadNumbers(given);
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

std::vector<SceneFactors> ReadAllFactors(std::size_t count, const nb::object& stiffness,
                                         const nb::object& friction, const nb::object& mass) {
  const auto k = ReadFactors(stiffness, count, "stiffness"), mu = ReadFactors(friction, count, "friction"),
             m = ReadFactors(mass, count, "mass");
  std::vector<SceneFactors> factors(count);
  for (std::size_t i = 0; i < count; ++i) factors[i] = {k[i], mu[i], m[i]};
  return factors;
}

// (n, width) of numbers that f(simulation, row) writes.
template <class F>
Array Gather(const Batch& batch, std::initializer_list<std::size_t> shape, F&& f) {
  std::size_t width = 1;
  for (auto at = shape.begin() + 1; at < shape.end(); ++at) width *= *at;
  std::vector<double> rows(static_cast<std::size_t>(batch.size()) * width);
  {
    const nb::gil_scoped_release others_run;
    batch.ForAll(
        [&](int i, const Simulation& s) { f(s, rows.data() + static_cast<std::size_t>(i) * width); });
  }
  return Own(std::move(rows), shape);
}

std::size_t Count(const Batch& b) { return static_cast<std::size_t>(b.size()); }

std::vector<int> FindBodies(const Batch& batch, const std::vector<std::string>& names) {
  const std::vector<std::string> known = batch.model()->BodyNames();
  std::vector<int> places;
  for (const std::string& name : names) {
    const auto at = std::find(known.begin(), known.end(), name);
    if (at == known.end()) RefuseName("body", name, known);
    places.push_back(static_cast<int>(at - known.begin()));
  }
  if (names.empty())
    for (std::size_t i = 0; i < known.size(); ++i) places.push_back(static_cast<int>(i));
  return places;
}

Array PosesOf(const Batch& batch, const std::vector<std::string>& names) {
  const std::vector<int> bodies = FindBodies(batch, names);
  return Gather(batch, {Count(batch), bodies.size(), 7}, [&](const Simulation& s, double* row) {
    for (std::size_t k = 0; k < bodies.size(); ++k) WritePose(s.Pose(bodies[k]), row + 7 * k);
  });
}

Array VelocitiesOf(const Batch& batch, const std::vector<std::string>& names) {
  const std::vector<int> bodies = FindBodies(batch, names);
  return Gather(batch, {Count(batch), bodies.size(), 6}, [&](const Simulation& s, double* row) {
    for (std::size_t k = 0; k < bodies.size(); ++k) {
      const Vector6 V = s.Velocity(bodies[k]);
      std::copy(V.data(), V.data() + 6, row + 6 * k);
    }
  });
}

std::size_t NumCoordinates(const Batch& batch) {
  std::size_t count = 0;
  for (const PosedMechanism& m : batch.model()->mechanisms())
    count += static_cast<std::size_t>(m.mechanism->num_coordinates());
  return count;
}

Array CoordinatesOf(const Batch& batch) {
  return Gather(batch, {Count(batch), NumCoordinates(batch)}, [&](const Simulation& s, double* row) {
    for (std::size_t i = 0; i < batch.model()->mechanisms().size(); ++i) {
      const VectorX q = s.JointCoordinates(static_cast<int>(i));
      row = std::copy(q.data(), q.data() + q.size(), row);
    }
  });
}

Array RatesOf(const Batch& batch) {
  return Gather(batch, {Count(batch), NumCoordinates(batch)}, [&](const Simulation& s, double* row) {
    for (const auto& m : s.State().mechanisms)
      row = std::copy(m.q_dot.data(), m.q_dot.data() + m.q_dot.size(), row);
  });
}

BatchReport Step(Batch& batch, const nb::object& controls, int steps) {
  if (steps < 0) throw nb::value_error("a number of steps is 0 or more");
  std::optional<Numbers> rows;
  std::vector<double> repeated;
  const double* data = nullptr;
  if (!controls.is_none()) {
    const std::size_t width = batch.control_names().size();
    rows = ReadNumbers(controls);
    if (rows->ndim() == 1 && rows->shape(0) == width) {
      for (int i = 0; i < batch.size(); ++i)
        repeated.insert(repeated.end(), rows->data(), rows->data() + rows->size());
      data = repeated.data();
    } else if (rows->ndim() == 2 && rows->shape(0) == Count(batch) && rows->shape(1) == width) {
      data = rows->data();
    } else {
      throw nb::value_error(("controls must have shape (" + std::to_string(batch.size()) + ", " +
                             std::to_string(width) + ") or (" + std::to_string(width) + ",)")
                                .c_str());
    }
    for (std::size_t i = 0; i < rows->size(); ++i)
      if (!std::isfinite(rows->data()[i])) throw nb::value_error("controls must be finite");
  }
  const nb::gil_scoped_release others_run;
  return batch.Step(data, steps);
}

void Reset(Batch& batch, const nb::object& mask, const nb::object& stiffness, const nb::object& friction,
           const nb::object& mass) {
  const std::size_t count = Count(batch);
  std::vector<char> chosen(count, 1);
  if (!mask.is_none()) {
    const VectorX read = ReadVector(mask, count, "mask");
    for (std::size_t i = 0; i < count; ++i) chosen[i] = read(static_cast<Eigen::Index>(i)) != 0;
  }
  std::vector<SceneFactors> factors = batch.factors();
  const std::vector<SceneFactors> given = ReadAllFactors(count, stiffness, friction, mass);
  for (std::size_t i = 0; i < count; ++i) {
    if (!stiffness.is_none()) factors[i].stiffness = given[i].stiffness;
    if (!friction.is_none()) factors[i].friction = given[i].friction;
    if (!mass.is_none()) factors[i].mass = given[i].mass;
  }
  const nb::gil_scoped_release others_run;
  batch.Reset(chosen, factors);
}

template <class T>
nb::ndarray<nb::numpy, T> OwnAll(const std::vector<T>& values) {
  auto* kept = new std::vector<T>(values);
  nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  const std::size_t count = kept->size();
  return nb::ndarray<nb::numpy, T>(kept->data(), 1, &count, owner);
}

BoolArray Flags(const std::vector<char>& flags) {
  static_assert(sizeof(bool) == 1);
  auto* kept = new std::vector<char>(flags);
  nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<char>*>(p); });
  const std::size_t count = kept->size();
  return BoolArray(reinterpret_cast<bool*>(kept->data()), 1, &count, owner);
}

void BindBatchReport(nb::module_& m) {
  nb::class_<BatchReport>(m, "BatchReport", "What `Batch.step` tells, an entry for each simulation.")
      .def_prop_ro(
          "contacts", [](const BatchReport& r) { return OwnAll(r.contacts); }, kOwn,
          "(n,) contact points in the last step.")
      .def_prop_ro(
          "max_penetration", [](const BatchReport& r) { return OwnAll(r.max_penetration); }, kOwn,
          "(n,) m, the deepest of all steps.")
      .def_prop_ro(
          "residual", [](const BatchReport& r) { return OwnAll(r.residual); }, kOwn,
          "(n,) of the contact solver, relative; the worst.")
      .def_prop_ro(
          "unconverged", [](const BatchReport& r) { return OwnAll(r.unconverged); }, kOwn,
          "(n,) steps whose contacts were not solved to tolerance.")
      .def_prop_ro(
          "finite", [](const BatchReport& r) { return Flags(r.finite); }, kOwn,
          "(n,) False: a step gave numbers that are not finite and was undone; reset that simulation.")
      .def_ro("wall", &BatchReport::wall, "s that the steps took, without what Python adds to the call.");
}

constexpr const char* kBatch = R"(Many simulations of one model, stepped together on threads.

    rng = numpy.random.default_rng(seed)
    batch = fork1s.Batch(model, 1024, friction=rng.uniform(0.7, 1.3, 1024))
    report = batch.step(controls, steps=4)      # controls (1024, c)
    heights = batch.poses("box")[:, 0, 2]

count: how many. threads: at most this many, 0 for all cores; results are the same bits for any number. stiffness,
friction, mass: factors, a number or (count,), that make the members differ: springs and servo gains (dampers by the
root), sliding coefficients, masses and inertias. dt, keyframe, recovery and detail as for `Simulation`.

Each member takes what a Simulation takes, half a megabyte for a hand. Arrays that a Batch returns are those of the
moment, and the caller's own. Raises as `Simulation` does, and ValueError for arrays of another shape.)";

}  // namespace

void BindBatch(nb::module_& m) {
  BindBatchReport(m);
  nb::class_<Batch>(m, "Batch", kBatch)
      .def(
          "__init__",
          [](Batch* self, const std::shared_ptr<const Model>& model, int count, int threads,
             const nb::object& stiffness, const nb::object& friction, const nb::object& mass,
             const std::optional<double>& dt, const std::optional<std::string>& keyframe,
             const std::string& recovery, const std::string& detail) {
            if (count < 1) throw nb::value_error("a batch has one simulation or more");
            if (threads < 0) throw nb::value_error("a number of threads is 0 (all cores) or more");
            const RunOptions options = ReadRunOptions(dt, keyframe, recovery, detail);
            auto factors = ReadAllFactors(static_cast<std::size_t>(count), stiffness, friction, mass);
            const nb::gil_scoped_release others_run;
            new (self) Batch(model, std::move(factors), options, threads);
          },
          nb::arg("model"), nb::arg("count"), nb::kw_only(), nb::arg("threads") = 0,
          nb::arg("stiffness") = nb::none(), nb::arg("friction") = nb::none(), nb::arg("mass") = nb::none(),
          nb::arg("dt") = nb::none(), nb::arg("keyframe") = nb::none(), nb::arg("recovery") = "exact",
          nb::arg("detail") = "interface",
          nb::sig(
              "def __init__(self, model: Model, count: int, *, threads: int = 0, stiffness: "
              "numpy.typing.ArrayLike | None = None, friction: numpy.typing.ArrayLike | None = None, mass: "
              "numpy.typing.ArrayLike | None = None, dt: float | None = None, keyframe: str | None = None, "
              "recovery: str = 'exact', detail: str = 'interface') -> None"))
      .def("step", Step, nb::arg("controls") = nb::none(), nb::arg("steps") = 1,
           "Advances all by `steps` time steps. controls: (n, c), or (c,) for all, in the order of "
           "`controls`; they "
           "hold until changed, and None leaves them. A simulation that stops being finite stays where it "
           "was.",
           nb::sig("def step(self, controls: numpy.typing.ArrayLike | None = None, steps: int = 1) -> "
                   "BatchReport"))
      .def(
          "reset", Reset, nb::arg("mask") = nb::none(), nb::kw_only(), nb::arg("stiffness") = nb::none(),
          nb::arg("friction") = nb::none(), nb::arg("mass") = nb::none(),
          "Those whose entry in mask (n,) is true begin anew; None: all. Factors, a number or (n,), replace "
          "those of "
          "the ones that begin; what is not given stays. Takes milliseconds each, on threads. Raises "
          "ModelError and "
          "leaves all as they were where one cannot begin.",
          nb::sig(
              "def reset(self, mask: numpy.typing.ArrayLike | None = None, *, stiffness: "
              "numpy.typing.ArrayLike "
              "| None = None, friction: numpy.typing.ArrayLike | None = None, mass: numpy.typing.ArrayLike | "
              "None = None) -> None"))
      .def("__len__", &Batch::size)
      .def_prop_ro("model", &Batch::model)
      .def_prop_ro("threads", &Batch::threads, "At most this many; 0: all cores.")
      .def_prop_ro("controls", &Batch::control_names, "Names of the c set-points.")
      .def(
          "poses", [](const Batch& b, const nb::args& names) { return PosesOf(b, Words(names)); },
          "(n, k, 7) of the named bodies, all if none is named: position [m], unit quaternion w x y z with w "
          ">= 0. "
          "Raises UnknownNameError.",
          nb::sig("def poses(self, *bodies: str) -> numpy.typing.NDArray[numpy.float64]"))
      .def(
          "velocities", [](const Batch& b, const nb::args& names) { return VelocitiesOf(b, Words(names)); },
          "(n, k, 6) of the named bodies, all if none is named: angular velocity [rad/s], velocity of the "
          "origin "
          "[m/s]. Raises UnknownNameError.",
          nb::sig("def velocities(self, *bodies: str) -> numpy.typing.NDArray[numpy.float64]"))
      .def_prop_ro("qpos", CoordinatesOf, kOwn, "(n, q) joint displacements of all mechanisms, rad or m.")
      .def_prop_ro("qvel", RatesOf, kOwn, "(n, q) their rates, rad/s or m/s.")
      .def_prop_ro(
          "control_values",
          [](const Batch& b) {
            return Gather(b, {Count(b), b.control_names().size()}, [](const Simulation& s, double* row) {
              std::copy(s.controls().data(), s.controls().data() + s.controls().size(), row);
            });
          },
          kOwn, "(n, c) set-points as they are now.")
      .def_prop_ro(
          "time",
          [](const Batch& b) {
            return Gather(b, {Count(b)}, [](const Simulation& s, double* row) { *row = s.time(); });
          },
          kOwn, "(n,) s since each began.")
      .def(
          "hashes",
          [](const Batch& b) {
            std::vector<std::uint64_t> hashes(Count(b));
            b.ForAll(
                [&](int i, const Simulation& s) { hashes[static_cast<std::size_t>(i)] = s.HashState(); });
            return OwnAll(hashes);
          },
          "(n,) 64-bit hashes of the moving states, as `Simulation.hash`.")
      .def("__repr__", [](const Batch& b) {
        return "<fork1s.Batch of " + std::to_string(b.size()) + " '" + b.model()->scene().name + "'>";
      });
}

}  // namespace fork1s::python
