// What an engine needs to pose all bodies on its graphics processor.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/shared_ptr.h>
#include "text.hpp"

#include <fork1s/record/recovery_buffers.hpp>

#include "bind.hpp"
#include "errors.hpp"
#include "runner.hpp"

namespace fork1s::python {
namespace {

namespace nb = nanobind;

/// With the simulation that they are of.
struct Buffers {
  std::shared_ptr<Runner> runner;
  RecoveryBuffers of;
};

template <class T>
nb::ndarray<nb::numpy, T> OwnRow(std::vector<T> values) {
  auto* kept = new std::vector<T>(std::move(values));
  nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  const std::size_t size = kept->size();
  return nb::ndarray<nb::numpy, T>(kept->data(), 1, &size, owner);
}

/// f(simulation) where the buffers are of it as it is. Throws Refused.
template <class F>
void WithCurrent(const Buffers& buffers, F&& f) {
  const bool is_of = buffers.runner->With([&](Simulation& s) {
    if (!buffers.of.IsOf(s)) return false;
    f(s);
    return true;
  });
  if (!is_of)
    throw Refused{Error{ErrorCode::kUsage, "RecoveryBuffers",
                        "the reference has moved since they were made; make them again from the simulation"}};
}

nb::ndarray<nb::numpy, float> FrameOf(const Buffers& buffers) {
  std::vector<float> frame;
  WithCurrent(buffers, [&](Simulation& s) { buffers.of.WriteFrame(s, frame); });
  return OwnRow(std::move(frame));
}

void SaveTo(const Buffers& buffers, const std::string& directory) {
  WithCurrent(buffers, [&](Simulation& s) { ValueOrThrow(SaveRecoveryBuffers(s, directory)); });
}

}  // namespace

void BindRecovery(nb::module_& m) {
  nb::class_<Buffers>(m, "RecoveryBuffers",
                      R"(What shaders/*.glsl read to pose all bodies of a simulation in an engine.

    buffers = fork1s.RecoveryBuffers(sim)      # upload buffers.tables and buffers.numbers
    sim.step()
    if not buffers.current:                    # bent far: the reference has moved
        buffers = fork1s.RecoveryBuffers(sim)  # upload both again
    frame = buffers.frame()                    # upload, dispatch

docs/engines.md has the layout.)")
      .def(
          "__init__",
          [](Buffers* self, const std::shared_ptr<Runner>& simulation) {
            new (self)
                Buffers{simulation, simulation->With([](Simulation& s) { return RecoveryBuffers(s); })};
          },
          nb::arg("simulation"))
      .def_prop_ro(
          "tables", [](const Buffers& b) { return OwnRow(b.of.tables()); },
          "int32: sizes, then what links, coordinates and bodies are and where their numbers stand.",
          nb::rv_policy::automatic)
      .def_prop_ro(
          "numbers", [](const Buffers& b) { return OwnRow(b.of.numbers()); },
          "float32: the model about its reference.", nb::rv_policy::automatic)
      .def("frame", FrameOf, nb::rv_policy::automatic,
           "float32 of the present state: base poses, z, corrections. Raises UsageError where the buffers "
           "are no longer "
           "current.")
      .def("save", SaveTo, nb::arg("directory"),
           "Writes recovery.json and recovery.bin there, as `fork1s reduce --buffers` does, with the present "
           "state as their "
           "frame. Raises FileError; UsageError where the buffers are no longer current.")
      .def_prop_ro(
          "current",
          [](const Buffers& b) { return b.runner->With([&](Simulation& s) { return b.of.IsOf(s); }); },
          "Whether they still are of the simulation as it is.")
      .def_prop_ro(
          "reference", [](const Buffers& b) { return b.of.reference(); },
          "A number that differs where other buffers are needed.")
      .def_prop_ro(
          "recovery", [](const Buffers& b) { return std::string(Name(b.of.recovery())); },
          "'exact', 'expanded' (as 'exact'), 'curved' or 'twist': which shaders they are for.")
      .def_prop_ro(
          "scan_passes", [](const Buffers& b) { return b.of.scan_passes(); },
          "How often recover_scan has to run so that recover_exact walks no path.");
}

}  // namespace fork1s::python
