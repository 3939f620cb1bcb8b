// The matrices of a reduced model, as views that keep it alive.
#include <nanobind/nanobind.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/vector.h>
#include "text.hpp"

#include "arrays.hpp"
#include "bind.hpp"
#include "errors.hpp"
#include "model.hpp"
#include "study/linear_model.hpp"

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

// (e, 4, 4)
Array PosesOf(const std::vector<RigidTransform>& poses) {
  std::vector<double> numbers;
  for (const RigidTransform& X : poses) {
    const MatrixX rows = Homogeneous(X).transpose();
    numbers.insert(numbers.end(), rows.data(), rows.data() + rows.size());
  }
  return Own(std::move(numbers), {poses.size(), 4, 4});
}

// NAME, NAME_units of a class that has these signals.
template <class T>
void BindSignals(nb::class_<T>& of, const char* name, const char* units, Signals T::*signals,
                 const char* text) {
  of.def_prop_ro(
      name, [signals](const T& s) { return (s.*signals).names; }, text);
  of.def_prop_ro(
      units, [signals](const T& s) { return (s.*signals).units; }, "Their units.");
}

template <class T>
void BindMatrix(nb::class_<T>& of, const char* name, MatrixX T::*matrix, const char* text) {
  of.def_prop_ro(
      name, [matrix](const T& s) { return OwnMatrix(s.*matrix); }, text, kOwn);
}

template <class T>
void BindVector(nb::class_<T>& of, const char* name, VectorX T::*vector, const char* text) {
  of.def_prop_ro(
      name, [vector](const T& s) { return OwnVector(s.*vector); }, text, kOwn);
}

constexpr const char* kCoordinateNames =
    "(s) names: the r columns of Q, then 'BASE.rx' to 'BASE.z' of a floating base.";
constexpr const char* kInputNames =
    "(m) names: controls, then 'BODY.rx' to 'BODY.z' of the wrench on each interface body.";
constexpr const char* kOutputNames =
    "(l) names: 'BODY.rx' to 'BODY.z' of each interface body, then joint coordinates.";

void BindLinearModel(nb::module_& m) {
  nb::class_<LinearModel> linear(m, "LinearModel",
                                 R"(Equations of motion of a mechanism to first order about its start:

    M p'' + D p' + K p = f + B u,    y = C p

p: the reduced coordinates of `Matrices`, then of a floating base its rotation vector and the displacement of its origin,
world axes; a fixed or driven base is held. u: changes of the controls, then on every interface body the moment about its
origin and the force there, world axes. y: rotation vector and displacement of the origin of every interface body, world
axes, then joint coordinates. Stiffness is that of springs and set-points. Left out: the geometric stiffness of weight and
preload, limits, bounds of forces, dry friction, contact.)");
  BindMatrix(linear, "M", &LinearModel::M, "(s, s) inertia.");
  BindMatrix(linear, "D", &LinearModel::D, "(s, s) damping.");
  BindMatrix(linear, "K", &LinearModel::K, "(s, s) stiffness: 0 or 1 on the diagonal.");
  BindMatrix(linear, "B", &LinearModel::B, "(s, m) forces per input.");
  BindMatrix(linear, "C", &LinearModel::C, "(l, s) outputs per coordinate.");
  BindVector(linear, "f", &LinearModel::f,
             "(s,) force of weight, springs and controls at the start: 0 at rest.");
  BindVector(linear, "u_ref", &LinearModel::u_ref, "(m,) controls at the start, 0 for wrenches.");
  BindVector(linear, "q_ref", &LinearModel::q_ref, "(n,) joint coordinates at the start, rad or m.");
  BindSignals(linear, "coordinates", "coordinate_units", &LinearModel::coordinates, kCoordinateNames);
  BindSignals(linear, "inputs", "input_units", &LinearModel::inputs, kInputNames);
  BindSignals(linear, "outputs", "output_units", &LinearModel::outputs, kOutputNames);
  BindSignals(linear, "joints", "joint_units", &LinearModel::joints, "(n) names of joint coordinates.");
  linear
      .def_prop_ro(
          "X_WB_ref", [](const LinearModel& s) { return PosesOf(s.X_WB_ref); },
          "(e, 4, 4) poses of the interface bodies at the start.", kOwn)
      .def_prop_ro(
          "interfaces", [](const LinearModel& s) { return s.interfaces; },
          "(e) names of the interface bodies.")
      .def(
          "state_space", [](const LinearModel& s) { return ValueOrThrow(ToStateSpace(s)); },
          "The same as first-order equations (`StateSpace`). Raises NumericsError for a motion without inertia.")
      .def("__repr__", [](const LinearModel& s) {
        return "<fork1s.LinearModel of " + std::to_string(s.M.rows()) + " coordinates, " +
               std::to_string(s.B.cols()) + " inputs, " + std::to_string(s.C.rows()) + " outputs>";
      });

  nb::class_<StateSpace> space(m, "StateSpace",
                               R"(A mechanism to first order about its start, as control libraries take it:

    x' = A x + B u + c,    y = C x + D u,    x = [p, p']

p, u and y are those of `LinearModel`. c is 0 where the start is at rest; a library that has no c describes the motion about
the place where the mechanism comes to rest.)");
  BindMatrix(space, "A", &StateSpace::A, "(2s, 2s)");
  BindMatrix(space, "B", &StateSpace::B, "(2s, m)");
  BindMatrix(space, "C", &StateSpace::C, "(l, 2s)");
  BindMatrix(space, "D", &StateSpace::D, "(l, m), all 0.");
  BindVector(space, "c", &StateSpace::c, "(2s,) acceleration that the forces at the start give.");
  BindSignals(space, "states", "state_units", &StateSpace::states,
              "(2s) names: coordinates, then 'rate of ...'.");
  BindSignals(space, "inputs", "input_units", &StateSpace::inputs, kInputNames);
  BindSignals(space, "outputs", "output_units", &StateSpace::outputs, kOutputNames);
  space.def("__repr__", [](const StateSpace& s) {
    return "<fork1s.StateSpace of " + std::to_string(s.A.rows()) + " states, " + std::to_string(s.B.cols()) +
           " inputs, " + std::to_string(s.C.rows()) + " outputs>";
  });
}

}  // namespace

void BindReduction(nb::module_& m) {
  BindLinearModel(m);
  nb::class_<ReducedModel>(m, "Matrices", R"(The reduced model about the pose where the simulation starts.

Sizes: n joint coordinates, r reduced coordinates z, b bodies. Joint displacements are
q = q_ref + Q z + (the interior's own static answer), and M z'' + D z' + K z = forces. Groups of joints
that are independent while the base is held, as two fingers, have columns of Q of their own, which are contiguous: free
directions (no spring), elastic directions that move the interface bodies, and fixed-interface modes, in this order.
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
