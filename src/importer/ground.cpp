// A plane for the model to stand on, and a word where a floating one has nothing to fall on.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fork1s/mechanism/kinematics.hpp>
#include <limits>
#include <variant>

#include "conversion.hpp"

namespace fork1s::internal {
namespace {

constexpr double kNowhere = std::numeric_limits<double>::infinity();

// Height of the lowest point of a shape: origin's height less the extent along the world's z in its own axes.
struct LowestPoint {
  RigidTransform X_WG;

  double Under(double extent) const { return X_WG.translation().z() - extent; }
  Vector3 Down() const { return X_WG.rotation().row(2).transpose(); }

  double operator()(const Sphere& s) const { return Under(s.radius); }
  double operator()(const Capsule& s) const { return Under(s.radius + s.half_length * std::abs(Down().z())); }
  double operator()(const Cylinder& s) const {
    return Under(s.radius * Down().head<2>().norm() + s.half_length * std::abs(Down().z()));
  }
  double operator()(const Ellipsoid& s) const { return Under(s.radii.cwiseProduct(Down()).norm()); }
  double operator()(const Box& s) const { return Under(s.half.dot(Down().cwiseAbs())); }
  double operator()(const MeshShape& s) const {
    double lowest = kNowhere;
    for (const Eigen::Vector3f& v : s.mesh->vertices)
      lowest = std::min(lowest, (X_WG * Vector3(v.cast<double>())).z());
    return lowest;
  }
  double operator()(const Plane&) const { return kNowhere; }
  double operator()(const HeightField&) const { return kNowhere; }
};

double LowestOf(const std::vector<GeometryDef>& geometries, const RigidTransform& X_WB) {
  double lowest = kNowhere;
  for (const GeometryDef& g : geometries) {
    if (g.Collides()) lowest = std::min(lowest, std::visit(LowestPoint{X_WB * g.X_BG}, g.shape) - g.margin);
  }
  return lowest;
}

// Lowest points at the initial state.
struct Lowest {
  double any = kNowhere;       // of all shapes that may touch
  std::string passes;          // the body it belongs to, if that is neither interface nor base
  double touching = kNowhere;  // of those that are
};

Expected<Lowest> LowestOfModel(const Conversion& c) {
  const KeyframeDef* start = c.initial_keyframe >= 0 ? &c.scene.keyframes[c.initial_keyframe] : nullptr;
  Lowest lowest;
  const auto count = [&](double height, bool touches, const std::string& name) {
    if (touches) lowest.touching = std::min(lowest.touching, height);
    if (height < lowest.any) lowest.any = height, lowest.passes = touches ? "" : name;
  };
  for (std::size_t i = 0; i < c.scene.mechanisms.size(); ++i) {
    const auto mechanism = BuildMechanism(c.scene.mechanisms[i]);
    if (!mechanism) return tl::unexpected<Error>(mechanism.error());
    VectorX q = start != nullptr ? start->mechanisms[i].q : VectorX::Zero(mechanism->num_coordinates());
    CloseLoops(*mechanism, q);
    Kinematics kinematics(*mechanism);
    ComputeKinematics(*mechanism, q, kinematics);
    const MechanismDef& definition = mechanism->definition();
    const RigidTransform X_WR = start != nullptr ? start->mechanisms[i].X_WR : definition.X_WR;
    for (std::size_t b = 0; b < definition.bodies.size(); ++b) {
      count(LowestOf(definition.bodies[b].geometries, X_WR * kinematics.X_RB[b]),
            Touches(*mechanism, static_cast<int>(b)), definition.bodies[b].name);
    }
  }
  for (std::size_t i = 0; i < c.scene.free_bodies.size(); ++i) {
    const FreeBodyDef& body = c.scene.free_bodies[i];
    count(LowestOf(body.geometries, start != nullptr ? start->free_bodies[i].X_WB : body.X_WB), true,
          body.name);
  }
  return lowest;
}

std::optional<Error> AddGround(Conversion& c, const ImportOptions& options) {
  const auto refuse = [&](std::string message) {
    return Error{ErrorCode::kUsage, fmt::format("{}, option ground", c.file), std::move(message)};
  };
  for (const GeometryDef& g : c.scene.world) {
    if (g.Collides() && std::holds_alternative<Plane>(g.shape))
      return refuse(fmt::format("the file has a plane already, geom '{}'; leave the option away", g.name));
  }
  if (options.ground_height && !std::isfinite(*options.ground_height))
    return refuse("the height is not finite; write a number of metres");
  const Expected<Lowest> lowest = LowestOfModel(c);
  if (!lowest) return lowest.error();
  if (!std::isfinite(lowest->touching)) {
    return refuse(std::isfinite(lowest->any)
                      ? "no body that touches has a shape to stand on; name others as interface bodies"
                      : "no shape of the model can touch it; give its bodies shapes that collide");
  }
  GeometryDef ground;
  ground.name = "ground";
  const auto taken = [&] {
    for (const GeometryDef& g : c.scene.world) {
      if (g.name == ground.name) return true;
    }
    return false;
  };
  while (taken()) ground.name += '_';
  ground.shape = Plane{};
  const double height = options.ground_height ? *options.ground_height : options.base_pose ? 0 : lowest->any;
  ground.X_BG = RigidTransform(Vector3(0, 0, height));
  c.scene.world.push_back(std::move(ground));
  const double above = lowest->any - height;
  constexpr double kTouch = 1e-6;  // m
  std::string stands = "touches it";
  if (above > kTouch) stands = fmt::format("is {:.4g} m above it", above);
  if (above < -kTouch)
    stands = fmt::format("is {:.4g} m below it: raise the model by its base pose or lower the plane", -above);
  c.Note(ImportNote::Kind::kChosen, "option ground",
         fmt::format("a level plane at z = {:.4g} m; the lowest point of the model {}", height, stands));
  if (!lowest->passes.empty()) {
    c.Note(
        ImportNote::Kind::kChosen, "option ground",
        fmt::format(
            "the lowest point is of body '{}', which passes through it: only interface bodies and the base "
            "touch; name it as an interface body if it is to stand on the plane",
            lowest->passes));
  }
  return std::nullopt;
}

void NoteEndlessFall(Conversion& c) {
  if (c.scene.gravity.isZero()) return;
  for (const GeometryDef& g : c.scene.world) {
    if (g.Collides()) return;
  }
  std::vector<std::string> floating;
  for (const MechanismDef& mechanism : c.scene.mechanisms) {
    if (mechanism.base != BaseKind::kFloating) return;  // it may be what others fall on
    floating.push_back(mechanism.name);
  }
  if (floating.empty()) return;
  c.Note(ImportNote::Kind::kChosen, fmt::format("mechanism '{}'", floating[0]),
         "it floats, and there is nothing to fall on; the option ground puts a plane under it");
}

}  // namespace

bool Touches(const Mechanism& mechanism, int b) {
  const auto same = [&](BodyIndex other) {
    return mechanism.body(other).last_joint == mechanism.body(BodyIndex(b)).last_joint;
  };
  const MechanismDef& definition = mechanism.definition();
  return same(BodyIndex(0)) ||
         std::any_of(definition.interfaces.begin(), definition.interfaces.end(),
                     [&](const std::string& name) { return same(definition.FindBody(name)); });
}

std::optional<Error> ApplyGround(Conversion& c, const ImportOptions& options) {
  if (options.ground) return AddGround(c, options);
  NoteEndlessFall(c);
  return std::nullopt;
}

}  // namespace fork1s::internal
