// The matrices of a reduced model, as views that keep it alive.
#include <nanobind/nanobind.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/vector.h>
#include "text.hpp"

#include "arrays.hpp"
#include "bind.hpp"
#include "model.hpp"

namespace fork1s::python {
namespace {

using Reduced = std::shared_ptr<const ReducedModel>;

// T_B = T.middleCols(B r, r) of a 6 x (b r) matrix, as (b, 6, r).
View TwistMaps(const Reduced& m) {
  const auto bodies = static_cast<std::size_t>(m->mechanism->num_bodies());
  const auto r = static_cast<std::size_t>(m->size());
  const std::size_t shape[3] = {bodies, 6, r};
  const std::int64_t strides[3] = {static_cast<std::int64_t>(6 * r), 1, 6};
  return View(m->T.data(), 3, shape, Hold(m), strides);
}

}  // namespace

void BindReduction(nb::module_& m) {
  nb::class_<ReducedModel>(m, "Matrices", R"(The reduced model about the pose where the simulation starts.

Sizes: n joint coordinates, r reduced coordinates z, b bodies. Joint displacements are
q = q_ref + Q z + (the interior's own static answer), and M z'' + D z' + K z = forces. Joints that hear nothing of
each other while the base is held, as those of two fingers, have columns of Q of their own, which stand together: in this
order directions that no spring holds, elastic directions that the interface bodies feel, and fixed-interface modes.
Arrays are views that nobody may change; they stay valid when everything else is gone.)")
      .def_prop_ro(
          "M", [](const Reduced& s) { return ViewMatrix(s, s->M.data(), s->M.rows(), s->M.cols()); },
          "(r, r) inertia; reduced coordinates have no unit of their own: K is 0 or 1 in them.", kOwn)
      .def_prop_ro(
          "D", [](const Reduced& s) { return ViewMatrix(s, s->D.data(), s->D.rows(), s->D.cols()); },
          "(r, r) damping.", kOwn)
      .def_prop_ro(
          "K", [](const Reduced& s) { return OwnMatrix(s->K_r.asDiagonal()); },
          "(r, r) stiffness: diagonal, 0 for the free directions, 1 for all others. A copy.", kOwn)
      .def_prop_ro(
          "Q", [](const Reduced& s) { return ViewMatrix(s, s->Q.data(), s->Q.rows(), s->Q.cols()); },
          "(n, r) joint displacements per reduced coordinate, rad or m.", kOwn)
      .def_prop_ro("T", TwistMaps,
                   "(b, 6, r) twist of every body per reduced rate: [angular; linear], in the axes of the "
                   "mechanism's base "
                   "frame about its origin.",
                   kOwn)
      .def_prop_ro(
          "q_ref",
          [](const Reduced& s) {
            const auto n = static_cast<std::size_t>(s->q_ref.size());
            return View(s->q_ref.data(), 1, &n, Hold(s));
          },
          "(n,) pose about which the model is linear, rad or m.", kOwn)
      .def_prop_ro(
          "num_free", [](const Reduced& s) { return s->num_free; }, "Directions that no spring holds.")
      .def_prop_ro(
          "num_elastic", [](const Reduced& s) { return s->num_elastic; },
          "Directions in which the interface bodies feel springs.")
      .def_prop_ro(
          "num_modes", [](const Reduced& s) { return s->num_modes; }, "Fixed-interface modes.")
      .def_prop_ro(
          "num_loads", [](const Reduced& s) { return s->num_loads; },
          "Load columns: static answers of all other motions to weight and other loads.")
      .def_prop_ro(
          "column_names", [](const Reduced& s) { return s->column_names; },
          "What each column of Q is: 'elastic 1', 'mode 2', 'weight z (JOINT)', the joint that moves most.")
      .def_prop_ro(
          "warnings", [](const Reduced& s) { return s->warnings; }, "Sentences about doubtful decisions.")
      .def("__repr__", [](const Reduced& s) {
        return "<fork1s.Matrices r=" + std::to_string(s->size()) + " (" + std::to_string(s->num_free) +
               " free, " + std::to_string(s->num_elastic) + " elastic, " + std::to_string(s->num_modes) +
               " modes, " + std::to_string(s->num_loads) +
               " loads) of n=" + std::to_string(s->num_coordinates()) + ">";
      });
}

}  // namespace fork1s::python
