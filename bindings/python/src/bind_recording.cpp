// Recordings as arrays, a stretch of steps after the other: what fork1s.logs writes to files of other programs.
#include <nanobind/nanobind.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/vector.h>
#include "text.hpp"

#include <fork1s/record/recording.hpp>
#include <fork1s/sim/run_statistics.hpp>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "bind.hpp"
#include "errors.hpp"
#include "geometry/shape_sizes.hpp"
#include "geometry/surface.hpp"
#include "record/body_names.hpp"
#include "record/columns.hpp"
#include "record/output_file.hpp"
#include "released_gil.hpp"

namespace fork1s::python {
namespace {

/// The reader of a file, and what its header says of names and shapes.
class Reader {
 public:
  Reader(const std::string& path, std::size_t bytes)
      : reader_(ValueOrThrow(RecordingReader::Open(path, bytes), path)),
        names_(internal::BodyNames(header())) {
    // Of the bodies none is called as the still world: the base of a mechanism that is fixed to it may be.
    for (std::size_t b = 0; b < names_.size(); ++b) {
      if (names_[b] != "world") continue;
      const int mechanism = header().bodies[b].mechanism;
      names_[b] =
          (mechanism < 0 ? "free" : header().scene.mechanisms[static_cast<std::size_t>(mechanism)].name) +
          "/world";
    }
  }

  const RecordingHeader& header() const { return reader_.header(); }
  const std::vector<std::string>& names() const { return names_; }
  /// May be called by several threads, without the GIL.
  Recording Next() {
    const std::lock_guard one_by_one(mutex_);
    return ValueOrThrow(reader_.Next(), header().path);
  }

 private:
  RecordingReader reader_;
  std::vector<std::string> names_;
  std::mutex mutex_;
};

/// A shape and whose it is. The reader keeps the scene.
struct RecordedShape {
  std::shared_ptr<const Reader> reader;
  const GeometryDef* geometry = nullptr;
  int body = -1;  // -1: the still world
};

// Of all contacts, as of Simulation.contacts.
std::vector<double> FrictionUses(const RecordedSteps& steps) {
  std::vector<double> uses;
  for (std::size_t i = 0; i < steps.contact_friction.size(); ++i)
    uses.push_back(ContactLoad::OfContact(Eigen::Map<const Vector3>(&steps.contact_force[3 * i]),
                                          Eigen::Map<const Vector3>(&steps.contact_normal[3 * i]),
                                          steps.contact_friction[i])
                       .FrictionUse());
  return uses;
}

// Dataset of the file -> (rows, width), but for hashes and checksums, whose 64 bits no double holds, and
// `contacts/friction_use`.
nb::dict RecordedColumns(const Recording& part) {
  nb::dict columns;
  internal::ForEachColumn(part.data(), internal::WidthsOf(part.header()),
                          [&](const internal::Column& column, const auto& values) {
                            if constexpr (!std::is_same_v<std::decay_t<decltype(values[0])>, std::uint64_t>) {
                              const auto width = static_cast<std::size_t>(column.width);
                              if (width == 0) return;
                              std::vector<double> numbers(values.begin(), values.end());
                              const std::size_t rows = numbers.size() / width;
                              columns[column.name] = width == 1 ? Own(std::move(numbers), {rows})
                                                                : Own(std::move(numbers), {rows, width});
                            }
                          });
  columns["contacts/friction_use"] = Own(FrictionUses(part.data()), {part.data().contact_friction.size()});
  return columns;
}

nb::object Next(Reader& reader) {
  std::optional<Recording> part;
  {
    const ReleasedGil others_run;
    part = reader.Next();
  }
  if (part->num_steps() == 0) return nb::none();
  return RecordedColumns(*part);
}

// Of every value of /steps/sensors the name of its sensor.
std::vector<std::string> SensorOfValues(const Reader& reader) {
  std::vector<std::string> names;
  if (reader.header().sensor_names.empty()) return names;  // of a version without them
  for (const SensorDef& sensor : reader.header().scene.sensors)
    names.insert(names.end(), static_cast<std::size_t>(sensor.size), sensor.name);
  return names;
}

std::vector<std::string> CoordinateUnits(const Reader& reader) {
  std::vector<std::string> units;
  for (const MechanismDef& mechanism : reader.header().scene.mechanisms)
    for (const JointDef& joint : mechanism.joints)
      for (const FreedomDef& freedom : joint.freedoms)
        units.emplace_back(freedom.screw_B.head<3>().isZero(0) ? "m" : "rad");
  return units;
}

double Weight(const Reader& reader) {
  const Scene& scene = reader.header().scene;
  double mass = 0;
  for (const MechanismDef& mechanism : scene.mechanisms)
    for (const BodyDef& body : mechanism.bodies) mass += body.inertia.mass;
  for (const FreeBodyDef& body : scene.free_bodies) mass += body.inertia.mass;
  return mass * scene.gravity.norm();
}

std::vector<RecordedShape> Shapes(const std::shared_ptr<const Reader>& reader) {
  const RecordingHeader& h = reader->header();
  std::vector<RecordedShape> shapes;
  for (std::size_t b = 0; b < h.bodies.size(); ++b) {
    const SceneBody& body = h.bodies[b];
    const auto index = static_cast<std::size_t>(body.index);
    const auto& geometries =
        body.mechanism < 0
            ? h.scene.free_bodies[index].geometries
            : h.scene.mechanisms[static_cast<std::size_t>(body.mechanism)].bodies[index].geometries;
    for (const GeometryDef& g : geometries) shapes.push_back({reader, &g, static_cast<int>(b)});
  }
  for (const GeometryDef& g : h.scene.world) shapes.push_back({reader, &g, -1});
  return shapes;
}

nb::tuple TrianglesOf(const RecordedShape& shape) {
  Surface surface;
  try {
    surface = MakeSurface(shape.geometry->shape);
  } catch (const std::invalid_argument& e) {  // meshes that no run can have had
    throw Refused{{ErrorCode::kFormat, shape.reader->header().path,
                   std::string("cannot be drawn (") + e.what() + "); the file is damaged, record it again"}};
  }
  std::vector<double> vertices, normals, triangles;
  const auto append = [](const auto& rows, std::vector<double>& out) {
    for (const auto& row : rows)
      for (int k = 0; k < 3; ++k) out.push_back(static_cast<double>(row(k)));
  };
  append(surface.vertices, vertices);
  append(surface.normals, normals);
  append(surface.triangles, triangles);
  return nb::make_tuple(Own(std::move(vertices), {surface.vertices.size(), 3}),
                        Own(std::move(normals), {surface.normals.size(), 3}),
                        Own(std::move(triangles), {surface.triangles.size(), 3}));
}

/// A file that takes its place once it is whole (record/output_file.hpp).
class NewFile {
 public:
  NewFile(const std::string& path, const std::string& kind, const std::string& begin)
      : kind_(kind),
        begin_(begin),
        file_(ValueOrThrow(OutputFile::Create(path, {kind_.c_str(), begin_}), path)) {}
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;

  std::string part() const { return file_ ? file_->part() : ""; }
  void Commit() {
    if (file_) ValueOrThrow(file_->Commit());
    file_.reset();
  }
  void Drop() { file_.reset(); }

 private:
  std::string kind_, begin_;
  std::optional<OutputFile> file_;
};

}  // namespace

void BindRecording(nb::module_& m) {
  const auto array = [](const char* name) {
    return std::string("def ") + name + "(self) -> numpy.typing.NDArray[numpy.float64]";
  };
  nb::class_<RecordedShape>(m, "RecordedShape", "A shape of a recording.")
      .def_prop_ro("name", [](const RecordedShape& s) { return s.geometry->name; })
      .def_ro("body", &RecordedShape::body, "Place among the bodies; -1: the still world.")
      .def_prop_ro(
          "kind", [](const RecordedShape& s) { return std::string(ShapeName(s.geometry->shape)); },
          "`plane`, `sphere`, `capsule`, `cylinder`, `ellipsoid`, `box`, `mesh` or `heightfield`.")
      .def_prop_ro(
          "size", [](const RecordedShape& s) { return ToArray(internal::ShapeSizes(s.geometry->shape)); },
          "m: half sides, radii, or radius and half length along z without caps. A plane has 0 where it has no "
          "end.",
          kOwn, nb::sig(array("size").c_str()))
      .def_prop_ro(
          "pose",
          [](const RecordedShape& s) {
            std::vector<double> pose(7);
            WritePose(s.geometry->X_BG, pose.data());
            return Own(std::move(pose), {7});
          },
          "(7,) x y z qw qx qy qz in the body.", kOwn, nb::sig(array("pose").c_str()))
      .def_prop_ro(
          "color", [](const RecordedShape& s) { return OwnVector(s.geometry->rgba); }, "(4,) r g b a.", kOwn,
          nb::sig(array("color").c_str()))
      .def_prop_ro(
          "radius", [](const RecordedShape& s) { return BoundingRadius(s.geometry->shape); },
          "m: of a sphere about its origin that contains it; infinite for planes.")
      .def_prop_ro("group", [](const RecordedShape& s) { return s.geometry->group; })
      .def("triangles", TrianglesOf,
           "Vertices (n, 3) [m], their normals (n, 3), and vertex numbers (k, 3), in the frame of the shape.",
           nb::sig("def triangles(self) -> tuple[numpy.typing.NDArray[numpy.float64], "
                   "numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]]"));
  nb::class_<NewFile>(m, "NewFile",
                      "A file that takes the place of `path` when it is kept, and goes when dropped.")
      .def(nb::init<const std::string&, const std::string&, const std::string&>(), nb::arg("path"),
           nb::arg("kind"), nb::arg("begin"))
      .def_prop_ro("part", &NewFile::part, "The name to write under.")
      .def("keep", &NewFile::Commit)
      .def("drop", &NewFile::Drop);
  nb::class_<Reader>(m, "RecordingReader", "A recording, a stretch of steps after the other.")
      .def(
          "__init__",
          [](Reader* self, const std::string& path, std::size_t bytes) {
            const ReleasedGil others_run;
            new (self) Reader(path, bytes);
          },
          nb::arg("path"), nb::arg("bytes") = std::size_t{8} << 20)
      .def_prop_ro("program", [](const Reader& r) { return r.header().program; })
      .def_prop_ro("finished", [](const Reader& r) { return r.header().finished; })
      .def_prop_ro("scene", [](const Reader& r) { return r.header().scene.name; })
      .def_prop_ro("dt", [](const Reader& r) { return r.header().options.dt; })
      .def_prop_ro("weight", Weight, "N, of all bodies.")
      .def_prop_ro(
          "bodies", [](const Reader& r) { return r.names(); }, "Names, each of one body.")
      .def_prop_ro("controls", [](const Reader& r) { return r.header().control_names; })
      .def_prop_ro("coordinates", [](const Reader& r) { return r.header().coordinate_names; })
      .def_prop_ro("coordinate_units", CoordinateUnits, "`rad` or `m`.")
      .def_prop_ro("sensors", [](const Reader& r) { return r.header().sensor_names; })
      .def_prop_ro("sensor_of_values", SensorOfValues, "Of every value of sensors the name of its sensor.")
      .def_prop_ro("finished", [](const Reader& r) { return r.header().finished; })
      .def_prop_ro(
          "initial_poses",
          [](const Reader& r) {
            return Own(r.header().initial_poses, {r.header().bodies.size(), 7});
          },
          "(bodies, 7) x y z qw qx qy qz before the first step.", kOwn,
          nb::sig(array("initial_poses").c_str()))
      .def_prop_ro(
          "shapes",
          [](const std::shared_ptr<Reader>& r) {
            nb::list shapes;
            for (const RecordedShape& shape : Shapes(r)) shapes.append(nb::cast(shape));
            return shapes;
          },
          nb::sig("def shapes(self) -> list[RecordedShape]"))
      .def("next", Next,
           "Dataset of docs/formats.md -> rows of the next steps, one a step or those of a table, and "
           "`contacts/friction_use`; None at the end.",
           nb::sig("def next(self) -> dict[str, numpy.typing.NDArray[numpy.float64]] | None"))
      .def(
          "no_steps", [](Reader& r) { return RecordedColumns(r.Next()); },
          "At the end of the recording: what `next` gives, without rows.",
          nb::sig("def no_steps(self) -> dict[str, numpy.typing.NDArray[numpy.float64]]"));
}

}  // namespace fork1s::python
