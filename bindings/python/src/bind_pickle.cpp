// What Model, Simulation, Snapshot and Batch are as plain values of Python: for pickles and copies.
#include <nanobind/nanobind.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>
#include "text.hpp"

#include <map>
#include <tuple>

#include "batch.hpp"
#include "bind.hpp"
#include "errors.hpp"
#include "record/simulation_bytes.hpp"
#include "released_gil.hpp"
#include "runner.hpp"

namespace fork1s::python {
namespace {

using ModelPtr = std::shared_ptr<const Model>;
using NumberList = std::vector<double>;

[[noreturn]] void RefusePickle(const char* what, const std::string& why) {
  throw Refused{
      {ErrorCode::kFormat, std::string("pickle of ") + what, why + "; make it again with this version"}};
}

/// The values of a state that Join made. Throws Refused where it is of another version, or is not one.
template <class... T>
std::tuple<T...> Split(const nb::handle& state, const char* what) {
  std::string version;
  if (!nb::isinstance<nb::tuple>(state) || nb::len(state) == 0 || !nb::try_cast(state[0], version))
    RefusePickle(what, "is none that fork1s made");
  if (version != FORK1S_VERSION)
    RefusePickle(what, "was made by fork1s " + version + ", and this is fork1s " FORK1S_VERSION);
  std::tuple<std::string, T...> values;
  if (!nb::try_cast(state, values)) RefusePickle(what, "does not have the values that it should");
  return std::apply([](const std::string&, const T&... rest) { return std::tuple<T...>(rest...); }, values);
}

template <class... T>
nb::tuple Join(const T&... values) {
  return nb::make_tuple(std::string(FORK1S_VERSION), values...);
}

std::string ToText(const nb::bytes& bytes) { return {bytes.c_str(), bytes.size()}; }
nb::bytes ToBytes(const std::string& text) { return nb::bytes(text.data(), text.size()); }

/// write() and read() without the GIL.
template <class F>
auto WithoutGil(F&& f) {
  const ReleasedGil others_run;
  return f();
}

NumberList ListOf(const std::vector<internal::BodyPush>& pushes) {
  NumberList all;
  for (const internal::BodyPush& p : pushes) {
    all.push_back(p.body);
    for (const Vector3* v : {&p.force_W, &p.moment_W, &p.point_B})
      all.insert(all.end(), v->data(), v->data() + 3);
  }
  return all;
}

std::vector<internal::BodyPush> PushesOf(const NumberList& all, const char* what) {
  constexpr std::size_t kNumbers = 10;
  if (all.size() % kNumbers != 0) RefusePickle(what, "has pushes that are cut off");
  std::vector<internal::BodyPush> pushes;
  for (std::size_t at = 0; at < all.size(); at += kNumbers) {
    const auto vector = [&](std::size_t k) {
      return Vector3(Eigen::Map<const Vector3>(all.data() + at + k));
    };
    pushes.push_back({static_cast<int>(all[at]), vector(1), vector(4), vector(7)});
  }
  return pushes;
}

void BindSimulationPickle() {
  constexpr const char* kWhat = "Simulation";
  nb::borrow<nb::class_<Runner>>(nb::type<Runner>())
      .def(
          "__getstate__",
          [](Runner& r) {
            const Runner::Content content = r.GetContent();
            const std::string bytes = WithoutGil([&] { return WriteSimulationBytes(content.simulation); });
            return Join(r.model(), ToBytes(bytes), content.time_before, content.state_change,
                        ListOf(content.pushes), content.estimates_error, content.watches);
          },
          nb::sig("def __getstate__(self) -> object"))
      .def(
          "__setstate__",
          [](Runner& r, const nb::object& state) {
            const auto [model, bytes, time_before, state_change, pushes, estimates_error, watches] =
                Split<ModelPtr, nb::bytes, double, double, NumberList, bool, bool>(state, kWhat);
            Runner::Content content{
                {}, time_before, state_change, PushesOf(pushes, kWhat), estimates_error, watches};
            const std::string text = ToText(bytes);
            const ModelPtr& of = model;
            WithoutGil([&] {
              content.simulation = ValueOrThrow(ReadSimulationBytes(text, "pickle of Simulation"));
              new (&r) Runner(of, std::move(content));
            });
          },
          nb::arg("state"), nb::sig("def __setstate__(self, state: object) -> None"));
}

void BindSnapshotPickle() {
  constexpr const char* kWhat = "Snapshot";
  using Stiffness = std::vector<std::pair<std::string, double>>;
  nb::borrow<nb::class_<Runner::Snapshot>>(nb::type<Runner::Snapshot>())
      .def(
          "__getstate__",
          [](const Runner::Snapshot& s) {
            const std::string bytes = WithoutGil([&] { return WriteSnapshotBytes(s.simulation); });
            return Join(ToBytes(bytes), s.time_before, ListOf(s.pushes), s.dt, s.stiffness);
          },
          nb::sig("def __getstate__(self) -> object"))
      .def(
          "__setstate__",
          [](Runner::Snapshot& s, const nb::object& state) {
            const auto [bytes, time_before, pushes, dt, stiffness] =
                Split<nb::bytes, double, NumberList, double, Stiffness>(state, kWhat);
            const std::string text = ToText(bytes);
            auto moment =
                WithoutGil([&] { return ValueOrThrow(ReadSnapshotBytes(text, "pickle of Snapshot")); });
            new (&s) Runner::Snapshot{std::move(moment), time_before, PushesOf(pushes, kWhat), dt,
                                      stiffness,         std::nullopt};
          },
          nb::arg("state"), nb::sig("def __setstate__(self, state: object) -> None"))
      // It stays as it is, so a copy is the same.
      .def(
          "__copy__", [](const nb::object& self) { return self; }, nb::sig("def __copy__(self) -> Snapshot"))
      .def(
          "__deepcopy__", [](const nb::object& self, const nb::object&) { return self; }, nb::arg("memo"),
          nb::sig("def __deepcopy__(self, memo: object) -> Snapshot"));
}

using NamedFactors = std::vector<std::map<std::string, double>>;  // of each member

NamedFactors NamedOf(const std::vector<Drawn>& drawn) {
  NamedFactors all;
  for (const Drawn& d : drawn) all.push_back(d.factors.named);
  return all;
}

// Factors of stiffness, friction and mass, then starts.
std::vector<NumberList> ListOf(const std::vector<Drawn>& drawn) {
  std::vector<NumberList> all;
  for (const Drawn& d : drawn) {
    all.push_back({d.factors.stiffness, d.factors.friction, d.factors.mass});
    all.back().insert(all.back().end(), d.start.begin(), d.start.end());
  }
  return all;
}

std::vector<Drawn> DrawnOf(const std::vector<NumberList>& all, const NamedFactors& named, std::size_t starts,
                           const char* what) {
  std::vector<Drawn> drawn;
  if (named.size() != all.size()) RefusePickle(what, "does not have the values that it should");
  for (const NumberList& d : all) {
    if (d.size() != 3 + starts) RefusePickle(what, "does not have the values that it should");
    drawn.push_back({{d[0], d[1], d[2], named[drawn.size()]},
                     Eigen::Map<const VectorX>(d.data() + 3, static_cast<Eigen::Index>(starts))});
  }
  return drawn;
}

void BindBatchSnapshotPickle() {
  constexpr const char* kWhat = "BatchSnapshot";
  nb::borrow<nb::class_<BatchSnapshot>>(nb::type<BatchSnapshot>())
      .def(
          "__getstate__",
          [](const BatchSnapshot& s) {
            const std::string bytes = WithoutGil([&] { return WriteBatchBytes({{}, s.simulations}); });
            return Join(ToBytes(bytes), s.dt, ListOf(s.drawn), NamedOf(s.drawn));
          },
          nb::sig("def __getstate__(self) -> object"))
      .def(
          "__setstate__",
          [](BatchSnapshot& s, const nb::object& state) {
            const auto [bytes, dt, drawn, named] =
                Split<nb::bytes, double, std::vector<NumberList>, NamedFactors>(state, kWhat);
            const std::string text = ToText(bytes);
            BatchContent content =
                WithoutGil([&] { return ValueOrThrow(ReadBatchBytes(text, "pickle of BatchSnapshot")); });
            if (content.snapshots.size() != drawn.size())
              RefusePickle(kWhat, "does not have the values that it should");
            const std::size_t starts = drawn.empty() ? 0 : std::max<std::size_t>(3, drawn[0].size()) - 3;
            new (&s) BatchSnapshot{dt, std::move(content.snapshots), DrawnOf(drawn, named, starts, kWhat)};
          },
          nb::arg("state"), nb::sig("def __setstate__(self, state: object) -> None"))
      // It stays as it is, so a copy is the same.
      .def(
          "__copy__", [](const nb::object& self) { return self; },
          nb::sig("def __copy__(self) -> BatchSnapshot"))
      .def(
          "__deepcopy__", [](const nb::object& self, const nb::object&) { return self; }, nb::arg("memo"),
          nb::sig("def __deepcopy__(self, memo: object) -> BatchSnapshot"));
}

// A range as (low, high).
using Pair = std::pair<double, double>;
// Starts, or factors, by name.
using Starting = std::vector<std::pair<std::string, Pair>>;

void BindBatchPickle() {
  constexpr const char* kWhat = "Batch";
  nb::borrow<nb::class_<Batch>>(nb::type<Batch>())
      .def(
          "__getstate__",
          [](const Batch& b) {
            const Batch::Content content = b.GetContent();
            const std::string bytes = WithoutGil([&] { return WriteBatchBytes(content.simulations); });
            const auto pair = [](const DrawRange& r) { return Pair(r.low, r.high); };
            const Randomisation& r = content.ranges;
            Starting starts;
            for (const StartRange& s : r.start) starts.emplace_back(s.coordinate, pair(s.range));
            Starting factors;
            for (const FactorRange& f : r.named) factors.emplace_back(f.key, pair(f.range));
            return Join(b.model(), ToBytes(bytes), content.threads,
                        std::vector<Pair>{pair(r.stiffness), pair(r.friction), pair(r.mass)}, starts,
                        content.seeds, content.times, ListOf(content.drawn), factors, NamedOf(content.drawn));
          },
          nb::sig("def __getstate__(self) -> object"))
      .def(
          "__setstate__",
          [](Batch& b, const nb::object& state) {
            using Seeds = std::vector<std::uint64_t>;
            const auto [model, bytes, threads, ranges, starts, seeds, times, drawn, factors, named] =
                Split<ModelPtr, nb::bytes, int, std::vector<Pair>, Starting, Seeds, Seeds,
                      std::vector<NumberList>, Starting, NamedFactors>(state, kWhat);
            Batch::Content content;
            content.threads = threads;
            content.simulations = ValueOrThrow(ReadBatchBytes(ToText(bytes), "pickle of Batch"));
            content.seeds = seeds;
            content.times = times;
            const std::size_t count = drawn.size();
            if (ranges.size() != 3 || count == 0 || content.simulations.snapshots.size() != count ||
                (!seeds.empty() && seeds.size() != count) || times.size() != seeds.size())
              RefusePickle(kWhat, "does not have the values that it should");
            const auto range = [](const Pair& p) { return DrawRange{p.first, p.second}; };
            content.ranges = {range(ranges[0]), range(ranges[1]), range(ranges[2]), {}, {}};
            for (const auto& [coordinate, of] : starts)
              content.ranges.start.push_back({coordinate, range(of)});
            for (const auto& [key, of] : factors) content.ranges.named.push_back({key, range(of)});
            content.drawn = DrawnOf(drawn, named, starts.size(), kWhat);
            new (&b) Batch(model, std::move(content));
          },
          nb::arg("state"), nb::sig("def __setstate__(self, state: object) -> None"));
}

void BindModelPickle(nb::module_& m) {
  nb::borrow<nb::class_<Model>>(nb::type<Model>())
      // It never changes, so a copy is the same.
      .def(
          "__copy__", [](const nb::object& self) { return self; }, nb::sig("def __copy__(self) -> Model"))
      .def(
          "__deepcopy__", [](const nb::object& self, const nb::object&) { return self; }, nb::arg("memo"),
          nb::sig("def __deepcopy__(self, memo: object) -> Model"))
      .def(
          "_state",
          [](const ModelPtr& s) {
            const std::string bytes = WithoutGil([&] {
              return WriteModelBytes({s->imported(), s->file_options()});
            });
            return Join(ToBytes(bytes), s->origin());
          },
          nb::sig("def _state(self) -> object"));
  m.def(
      "model_of_state",
      [](const nb::object& state) {
        const auto [bytes, origin] = Split<nb::bytes, std::string>(state, "Model");
        const std::string text = ToText(bytes), of = origin;
        const ReleasedGil others_run;
        ModelContent content = ValueOrThrow(ReadModelBytes(text, "pickle of Model"));
        return Model::Create(std::move(content.imported), of, std::move(content.options));
      },
      nb::arg("state"), nb::sig("def model_of_state(state: object) -> Model"));
}

}  // namespace

void BindPickles(nb::module_& m) {
  BindModelPickle(m);
  BindSimulationPickle();
  BindSnapshotPickle();
  BindBatchSnapshotPickle();
  BindBatchPickle();
}

}  // namespace fork1s::python
