// Batch: many simulations as one array.
#include <nanobind/nanobind.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/vector.h>
#include "text.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "arguments.hpp"
#include "arrays.hpp"
#include "batch.hpp"
#include "batch_arguments.hpp"
#include "bind.hpp"
#include "errors.hpp"
#include "readings.hpp"
#include "words.hpp"

namespace fork1s::python {
namespace {

using BoolArray = nb::ndarray<nb::numpy, bool>;
using IntArray = nb::ndarray<nb::numpy, int>;

template <class T>
nb::ndarray<nb::numpy, T> OwnAll(const std::vector<T>& values) {
  auto* kept = new std::vector<T>(values);
  nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  const std::size_t count = kept->size();
  return nb::ndarray<nb::numpy, T>(kept->data(), 1, &count, owner);
}

nb::dict RangesOf(const Randomisation& ranges) {
  nb::dict all;
  const auto pair = [](const DrawRange& r) { return nb::make_tuple(r.low, r.high); };
  all["stiffness"] = pair(ranges.stiffness);
  all["friction"] = pair(ranges.friction);
  all["mass"] = pair(ranges.mass);
  for (const FactorRange& f : ranges.named) all[f.key.c_str()] = pair(f.range);
  for (const StartRange& s : ranges.start) all[("start:" + s.coordinate).c_str()] = pair(s.range);
  return all;
}

// (n, width) of numbers that f(simulation, row) writes.
template <class F>
Array Gather(const Batch& batch, std::initializer_list<std::size_t> shape, F&& f) {
  std::size_t width = 1;
  for (auto at = shape.begin() + 1; at < shape.end(); ++at) width *= *at;
  std::vector<double> rows(static_cast<std::size_t>(batch.size()) * width);
  batch.ForAll([&](int i, const Simulation& s) { f(s, rows.data() + static_cast<std::size_t>(i) * width); });
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

Array FileNumbersOf(const Batch& batch, VectorX FileState::*part) {
  const std::vector<FileJoint>& joints = batch.model()->joints();
  const auto width = static_cast<std::size_t>(part == &FileState::positions ? batch.model()->NumPositions()
                                                                            : batch.model()->NumVelocities());
  return Gather(batch, {Count(batch), width}, [&](const Simulation& s, double* row) {
    const FileState state = ComputeFileState(joints, batch.model()->scene(), s.State());
    std::copy((state.*part).data(), (state.*part).data() + width, row);
  });
}

// (width,) for all, or (n, width): rows of all members.
std::vector<double> ReadRows(const Batch& batch, const Numbers& read, std::size_t width,
                             const std::string& argument) {
  std::vector<double> rows;
  if (read.ndim() == 1 && read.shape(0) == width) {
    for (int i = 0; i < batch.size(); ++i) rows.insert(rows.end(), read.data(), read.data() + read.size());
  } else if (read.ndim() == 2 && read.shape(0) == Count(batch) && read.shape(1) == width) {
    rows.assign(read.data(), read.data() + read.size());
  } else {
    throw nb::value_error((argument + " must have shape (" + std::to_string(batch.size()) + ", " +
                           std::to_string(width) + ") or (" + std::to_string(width) + ",)")
                              .c_str());
  }
  for (const double number : rows)
    if (!std::isfinite(number)) throw nb::value_error((argument + " must be finite").c_str());
  return rows;
}

// Of each body, forces (3) or [torque; force] (6).
std::vector<MemberPushes> ReadPushes(const Batch& batch, const nb::object& given) {
  std::vector<MemberPushes> pushes;
  if (given.is_none()) return pushes;
  for (const auto& [body, value] :
       ReadAs<std::map<std::string, nb::object>>(given, "push", "a mapping from names of bodies to forces")) {
    MemberPushes& push = pushes.emplace_back();
    push.body = FindBodies(batch, {body}).front();
    const std::string argument = "push['" + body + "']";
    const Numbers read = ReadNumbers(value, argument);
    const std::size_t width = read.ndim() > 0 && read.shape(read.ndim() - 1) == 6 ? 6 : 3;
    const std::vector<double> rows = ReadRows(batch, read, width, argument);
    for (std::size_t i = 0; i < Count(batch); ++i) {
      Vector6 F = Vector6::Zero();
      F.tail(static_cast<Eigen::Index>(width)) =
          Eigen::Map<const VectorX>(rows.data() + i * width, static_cast<Eigen::Index>(width));
      push.F_W.push_back(F);
    }
  }
  return pushes;
}

std::vector<char> ReadMask(const Batch& batch, const nb::object& mask) {
  std::vector<char> chosen(Count(batch), 1);
  if (mask.is_none()) return chosen;
  const VectorX read = ReadVector(mask, Count(batch), "mask");
  for (std::size_t i = 0; i < chosen.size(); ++i) chosen[i] = read(static_cast<Eigen::Index>(i)) != 0;
  return chosen;
}

BatchReport Step(Batch& batch, const nb::object& controls, const Whole& given_steps, bool move,
                 const nb::object& push) {
  const int steps = given_steps.Within("steps", 0);
  std::vector<double> rows;
  if (!controls.is_none())
    rows = ReadRows(batch, ReadNumbers(controls, "controls"), batch.control_names().size(), "controls");
  return batch.Step(controls.is_none() ? nullptr : rows.data(), steps, move, ReadPushes(batch, push));
}

void RestoreBatch(Batch& batch, const nb::object& moment, const nb::object& mask, const nb::object& members) {
  const std::vector<char> chosen = ReadMask(batch, mask);
  if (nb::isinstance<Runner::Snapshot>(moment)) {
    if (!members.is_none())
      throw Refused{{ErrorCode::kUsage, "restore", "the moment of a simulation has no members to choose"}};
    batch.Restore(nb::cast<const Runner::Snapshot&>(moment), chosen);
    return;
  }
  BatchSnapshot* of_batch = nullptr;
  if (!nb::try_cast(moment, of_batch))
    RefuseType("moment", "what Batch.save or Simulation.save gave", moment);
  const auto count = static_cast<int>(of_batch->simulations.size());
  std::vector<int> sources(Count(batch));
  if (members.is_none()) {
    if (count != batch.size())
      throw Refused{{ErrorCode::kUsage, "restore",
                     "the moment is of " + std::to_string(count) + " members, this batch has " +
                         std::to_string(batch.size()) + "; say by members= which of them each takes"}};
    std::iota(sources.begin(), sources.end(), 0);
  } else {
    const VectorX read = ReadVector(members, Count(batch), "members");
    for (std::size_t i = 0; i < sources.size(); ++i) {
      const double at = read(static_cast<Eigen::Index>(i));
      if (!(at >= 0 && at < count && at == std::floor(at)))
        throw nb::value_error(
            ("members must be whole numbers from 0 to " + std::to_string(count - 1)).c_str());
      sources[i] = static_cast<int>(at);
    }
  }
  batch.Restore(*of_batch, chosen, sources);
}

void SetBatchState(Batch& batch, const nb::object& qpos, const nb::object& qvel, const nb::object& mask) {
  std::vector<double> q, v;
  if (!qpos.is_none())
    q = ReadRows(batch, ReadNumbers(qpos, "qpos"), static_cast<std::size_t>(batch.model()->NumPositions()),
                 "qpos");
  if (!qvel.is_none())
    v = ReadRows(batch, ReadNumbers(qvel, "qvel"), static_cast<std::size_t>(batch.model()->NumVelocities()),
                 "qvel");
  batch.SetState(ReadMask(batch, mask), qpos.is_none() ? nullptr : q.data(),
                 qvel.is_none() ? nullptr : v.data());
}

nb::object ContactsOf(const Batch& batch) {
  std::vector<std::vector<ContactRow>> each(Count(batch));
  batch.ForAll(
      [&](int i, const Simulation& s) { each[static_cast<std::size_t>(i)] = fork1s::python::Contacts(s); });
  std::vector<ContactRow> rows;
  std::vector<int> members;
  for (std::size_t i = 0; i < each.size(); ++i) {
    rows.insert(rows.end(), each[i].begin(), each[i].end());
    members.insert(members.end(), each[i].size(), static_cast<int>(i));
  }
  return nb::module_::import_("fork1s._contacts")
      .attr("with_members")(ToArray(std::move(rows)), OwnAll(members));
}

void Reset(Batch& batch, const nb::object& mask, const nb::object& seeds, const nb::object& stiffness,
           const nb::object& friction, const nb::object& mass, const nb::object& factors) {
  const std::size_t count = Count(batch);
  const std::vector<char> chosen = ReadMask(batch, mask);
  if (!seeds.is_none() && !batch.has_seeds())
    throw Refused{{ErrorCode::kUsage, "reset", "this batch was made without seeds; make it with seeds="}};
  const MemberDifferences differences = ReadDifferences(count, seeds, stiffness, friction, mass, factors);
  batch.Reset(chosen, differences);
}

BoolArray Flags(const std::vector<char>& flags) {
  static_assert(sizeof(bool) == 1);
  auto* kept = new std::vector<char>(flags);
  nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<char>*>(p); });
  const std::size_t count = kept->size();
  return BoolArray(reinterpret_cast<bool*>(kept->data()), 1, &count, owner);
}

// What makes each differ: name -> (n,).
nb::dict Factors(const Batch& batch) {
  const std::vector<Drawn> draws = batch.Draws();
  const auto column = [&](auto&& of) {
    std::vector<double> values;
    for (const Drawn& d : draws) values.push_back(of(d));
    return ToArray(values);
  };
  nb::dict all;
  all["stiffness"] = column([](const Drawn& d) { return d.factors.stiffness; });
  all["friction"] = column([](const Drawn& d) { return d.factors.friction; });
  all["mass"] = column([](const Drawn& d) { return d.factors.mass; });
  std::set<std::string> keys;
  for (const Drawn& d : draws)
    for (const auto& named : d.factors.named) keys.insert(named.first);
  for (const std::string& key : keys)
    all[key.c_str()] = column([&](const Drawn& d) {
      const auto named = d.factors.named.find(key);
      return named == d.factors.named.end() ? 1.0 : named->second;
    });
  Eigen::Index at = 0;
  for (const StartRange& s : batch.ranges().start) {
    all[("start:" + s.coordinate).c_str()] = column([&](const Drawn& d) { return d.start(at); });
    ++at;
  }
  return all;
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
      .def_ro("wall", &BatchReport::wall, "s that the steps took, without what Python adds to the call.")
      .def("__repr__", [](const BatchReport& r) {
        const auto count = [](const auto& all, const auto& is) {
          return std::to_string(std::count_if(all.begin(), all.end(), is));
        };
        const std::string broken = count(r.finite, [](char finite) { return finite == 0; });
        return "<fork1s.BatchReport of " + std::to_string(r.finite.size()) +
               " contacts=" + std::to_string(std::accumulate(r.contacts.begin(), r.contacts.end(), 0)) +
               " unconverged=" + count(r.unconverged, [](int steps) { return steps > 0; }) +
               (broken == "0" ? ">" : " NOT FINITE=" + broken + ">");
      });
}

constexpr const char* kBatch = R"(Many simulations of one model, stepped together on threads.

    batch = fork1s.Batch(model, 1024, seeds=7)  # each with a stiffness, friction and mass of its own
    report = batch.step(controls, steps=4)      # controls (1024, c)
    heights = batch.poses("box")[:, 0, 2]
    batch.reset(heights > 0.1)                  # those begin again, and draw again

count: how many. threads: at most this many, 0 for all cores; results are the same bits for any number. dt, keyframe,
recovery and detail as for `Simulation`.

stiffness, friction, mass: factors, a number or (count,), that make the members differ: springs and servo gains (dampers
by the root), sliding coefficients, masses and inertias.

factors: these and more by name, as {name: number or (count,)}: `mass:BODY`, `friction:BODY` (`world`: what stands still),
`stiffness:NAME`, `damping:NAME` and `frictionloss:NAME` of a joint or tendon, `damping` and `frictionloss` of all, and
`gravity`. Those of one element multiply with those of all. A contact takes the larger friction of its two shapes, or that
of the higher priority. `Model.with_factors` gives one model the same.

seeds: draws those factors instead. One whole number, from which each member gets a seed of its own (`seeds`), or (count,)
of them. What a member draws depends on its seed and on how often it has begun, and on nothing else: not on the other
members, their number, or threads. A factor that is given as well counts in place of the drawn one until the member begins
again.

randomise: what seeds draw from, as {name: (smallest, largest)}; default: `usual_ranges`. Names of factors, as above,
of equal likelihood in their logarithm; and where a coordinate starts, relative to where it would: `start:JOINT`, rad or m,
not where loops are closed, and `start:BODY.x` `.y` `.z` [m] `.rx` `.ry` `.rz` [rad] of free bodies and of bases that move.
What is not named is not drawn.

A member takes some 10 kB for a hand, a third of a megabyte where it has factors of its own. Arrays that a Batch returns are those of the
moment, and the caller's own. Raises as `Simulation` does, UsageError for what cannot be drawn, and ValueError for arrays
of another shape.)";

}  // namespace

void BindBatch(nb::module_& m) {
  BindBatchReport(m);
  nb::class_<BatchSnapshot>(m, "BatchSnapshot", "A moment of a batch, from `Batch.save`.")
      .def("__len__", [](const BatchSnapshot& s) { return s.simulations.size(); })
      .def("__repr__", [](const BatchSnapshot& s) {
        return "<fork1s.BatchSnapshot of " + std::to_string(s.simulations.size()) + ">";
      });
  nb::class_<Batch>(m, "Batch", kBatch)
      .def(
          "__init__",
          [](Batch* self, const GivenModel& given_model, const Whole& given_count, const Whole& given_threads,
             const nb::object& seeds, const nb::object& randomise, const nb::object& stiffness,
             const nb::object& friction, const nb::object& mass, const nb::object& factors,
             const std::optional<Real>& dt, const std::optional<std::string>& keyframe,
             const std::string& recovery, const std::string& detail,
             const std::optional<std::string>& integrator) {
            const std::shared_ptr<const Model> model = given_model.Read("model");
            constexpr int kMaxThreads = 1024;  // each takes memory of its own, and no machine has more cores
            const int count = given_count.Within("count", 1);
            const int threads = given_threads.Within("threads", 0, kMaxThreads);
            if (seeds.is_none() && !randomise.is_none())
              throw Refused{{ErrorCode::kUsage, "randomise", "nothing is drawn without seeds; give seeds="}};
            const RunOptions options = ReadRunOptions(dt, keyframe, recovery, detail, integrator);
            auto differences =
                ReadDifferences(static_cast<std::size_t>(count), seeds, stiffness, friction, mass, factors);
            if (!seeds.is_none()) differences.ranges = ReadRanges(randomise);
            new (self) Batch(model, count, std::move(differences), options, threads);
          },
          nb::arg("model"), nb::arg("count"), nb::kw_only(), nb::arg("threads") = 0,
          nb::arg("seeds") = nb::none(), nb::arg("randomise") = nb::none(), nb::arg("stiffness") = nb::none(),
          nb::arg("friction") = nb::none(), nb::arg("mass") = nb::none(), nb::arg("factors") = nb::none(),
          nb::arg("dt") = nb::none(), nb::arg("keyframe") = nb::none(), nb::arg("recovery") = "exact",
          nb::arg("detail") = "interface", nb::arg("integrator") = nb::none(),
          nb::sig(
              "def __init__(self, model: Model, count: int, *, threads: int = 0, seeds: "
              "numpy.typing.ArrayLike | None = None, randomise: collections.abc.Mapping[str, tuple[float, "
              "float]] | None = None, stiffness: "
              "numpy.typing.ArrayLike | None = None, friction: numpy.typing.ArrayLike | None = None, mass: "
              "numpy.typing.ArrayLike | None = None, factors: collections.abc.Mapping[str, numpy.typing.ArrayLike] | "
              "None = None, dt: float | None = None, keyframe: str | None = None, "
              "recovery: str = 'exact', detail: str = 'interface', integrator: str | None = None) -> None"))
      .def(
          "step", Step, nb::arg("controls") = nb::none(), nb::arg("steps") = 1, nb::kw_only(),
          nb::arg("move") = false, nb::arg("push") = nb::none(),
          "Advances all by `steps` time steps. controls: (n, c), or (c,) for all, in the order of "
          "`controls`; they "
          "hold until changed, and None leaves them. A simulation that stops being finite stays where it "
          "was. Ctrl-C ends the call after the steps at hand; members may then differ in `time`.\n\n"
          "move: controls move linearly over the steps of the call, from where the last step left them "
          "(after a start or a reset from their initial values), as samples of a path do; default: they are "
          "held at once.\n\n"
          "push: name of a body -> (3,) or (n, 3) forces [N], or (6,) or (n, 6) [torque; force], world axes, which "
          "act on its origin through these steps.",
          nb::sig("def step(self, controls: numpy.typing.ArrayLike | None = None, steps: int = 1, *, "
                  "move: bool = False, push: collections.abc.Mapping[str, numpy.typing.ArrayLike] | None = "
                  "None) -> BatchReport"))
      .def("save", &Batch::Save, "The moment of all members, to come back to (`BatchSnapshot`).")
      .def(
          "restore", RestoreBatch, nb::arg("moment"), nb::arg("mask") = nb::none(), nb::kw_only(),
          nb::arg("members") = nb::none(),
          "Those whose entry in mask (n,) is true, all for None, go back to a moment; the same steps from there give "
          "the same bits.\n\n"
          "moment: of `Batch.save`, of this batch or another of the same model; or of `Simulation.save`, from which "
          "all members start, where they have no factors of their own. members: (n,) which member of the moment each "
          "takes, with its factors, as resampling does; default: its own. Seeds stay. Raises UsageError for moments of "
          "another model or dt.",
          nb::sig("def restore(self, moment: BatchSnapshot | Snapshot, mask: numpy.typing.ArrayLike | None = "
                  "None, *, members: numpy.typing.ArrayLike | None = None) -> None"))
      .def(
          "set_state", SetBatchState, nb::arg("qpos") = nb::none(), nb::arg("qvel") = nb::none(),
          nb::arg("mask") = nb::none(),
          "Those whose entry in mask (n,) is true, all for None, go on from these positions (n, nq) or (nq,) and "
          "velocities (n, nv) or (nv,) of the joints of the file, with their factors; time begins again. What is not "
          "given stays. Loops are closed. Takes a millisecond each, on threads. Raises ModelError and leaves all as "
          "they were where one cannot.",
          nb::sig(
              "def set_state(self, qpos: numpy.typing.ArrayLike | None = None, qvel: numpy.typing.ArrayLike | "
              "None = None, mask: numpy.typing.ArrayLike | None = None) -> None"))
      .def(
          "reset", Reset, nb::arg("mask") = nb::none(), nb::kw_only(), nb::arg("seeds") = nb::none(),
          nb::arg("stiffness") = nb::none(), nb::arg("friction") = nb::none(), nb::arg("mass") = nb::none(),
          nb::arg("factors") = nb::none(),
          "Those whose entry in mask (n,) is true begin again; None: all. A batch with seeds draws again for "
          "them: "
          "what their seed draws next, or, where seeds are given here, a number or (n,), what these draw "
          "first. "
          "Factors, a number or (n,) each, in `factors` by name, replace those of the ones that begin; without seeds, what is not given "
          "stays. Takes microseconds each, where factors are drawn a millisecond, on threads. Raises ModelError and leaves all as they were where "
          "one "
          "cannot begin.",
          nb::sig(
              "def reset(self, mask: numpy.typing.ArrayLike | None = None, *, seeds: numpy.typing.ArrayLike "
              "| "
              "None = None, stiffness: numpy.typing.ArrayLike "
              "| None = None, friction: numpy.typing.ArrayLike | None = None, mass: numpy.typing.ArrayLike | "
              "None = None, factors: collections.abc.Mapping[str, numpy.typing.ArrayLike] | None = None) -> None"))
      .def_prop_ro(
          "factors", Factors, kOwn,
          "Name -> (n,): what makes the members differ now, stiffness, friction and mass, others that were drawn or given, and "
          "`start:...` [rad or m] where that is drawn.",
          nb::sig("def factors(self) -> dict[str, numpy.typing.NDArray[numpy.float64]]"))
      .def_prop_ro(
          "seeds", [](const Batch& b) { return OwnAll(b.Seeds()); }, kOwn,
          "(n,) of the members, none without seeds: `Batch(model, 1, seeds=batch.seeds[i:i + 1])` begins as "
          "member i did.")
      .def_prop_ro_static(
          "usual_ranges", [](nb::handle) { return RangesOf(UsualRandomisation()); },
          "What is drawn where `randomise` is not given: stiffness 0.7 to 1.4, friction 0.7 to 1.3, mass 0.8 "
          "to "
          "1.25.")
      .def("__len__", &Batch::size)
      .def_prop_ro("model", &Batch::model)
      .def_prop_ro("threads", &Batch::threads, "At most this many; 0: all cores.")
      .def_prop_ro("controls", &Batch::control_names, "Names of the c set-points.")
      .def_prop_ro(
          "bodies", [](const Batch& b) { return b.model()->BodyNames(); },
          "Names of the k bodies, in the order of `poses`.")
      .def_prop_ro(
          "coordinates",
          [](const Batch& b) {
            std::vector<std::string> names;
            b.ForFirst([&](const Simulation& s) { names = s.CoordinateNames(); });
            return names;
          },
          "Names of the q joint coordinates, in the order of `joint_displacements`.")
      .def_prop_ro(
          "dt",
          [](const Batch& b) {
            double dt = 0;
            b.ForFirst([&](const Simulation& s) { dt = s.dt(); });
            return dt;
          },
          "s, of a step.")
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
      .def_prop_ro(
          "qpos", [](const Batch& b) { return FileNumbersOf(b, &FileState::positions); }, kOwn,
          "(n, nq) positions of the joints of the file of each, as `Simulation.qpos`.")
      .def_prop_ro(
          "qvel", [](const Batch& b) { return FileNumbersOf(b, &FileState::velocities); }, kOwn,
          "(n, nv) their velocities, as `Simulation.qvel`.")
      .def_prop_ro("joint_displacements", CoordinatesOf, kOwn,
                   "(n, q) joint coordinates of all mechanisms from the reference pose, rad or m.")
      .def_prop_ro("joint_rates", RatesOf, kOwn, "(n, q) their rates, rad/s or m/s.")
      .def_prop_ro(
          "sensors", [](Batch& b) { return b.ReadSensors(); },
          "What the sensors of the file measure of each at the end of the last step, by name (`Sensors`): (n, k).")
      .def_prop_ro(
          "contacts", ContactsOf,
          "Structured array of the contacts of all members that bear force: `fork1s.BATCH_CONTACT`, with the "
          "`member` of each.",
          nb::sig("def contacts(self) -> numpy.typing.NDArray[numpy.void]"))
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
