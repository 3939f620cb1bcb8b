#include <cmath>
#include <limits>

#include "record/scene_json.hpp"
#include "support.hpp"

namespace fork1s::testing {
namespace {

// Every value of a scene as bits. Structures are taken apart by all their members, so that a new member does not
// compile before it stands here; the writer's own list is not used.
class BitList {
 public:
  std::vector<std::uint64_t> bits;

  void Add(double v) { bits.push_back(std::bit_cast<std::uint64_t>(v)); }
  void Add(float v) { bits.push_back(std::bit_cast<std::uint32_t>(v)); }
  void Add(int v) { bits.push_back(static_cast<std::uint64_t>(v)); }
  void Add(bool v) { bits.push_back(v ? 1 : 0); }
  void Add(std::uint8_t v) { bits.push_back(v); }
  template <class E>
    requires std::is_enum_v<E>
  void Add(E v) {
    bits.push_back(static_cast<std::uint64_t>(v));
  }
  template <class Tag>
  void Add(Index<Tag> v) {
    Add(v.value());
  }
  void Add(const std::string& s) {
    bits.push_back(s.size());
    for (char c : s) bits.push_back(static_cast<unsigned char>(c));
  }
  template <class D>
  void Add(const Eigen::DenseBase<D>& m) {
    bits.push_back(static_cast<std::uint64_t>(m.size()));
    for (Eigen::Index i = 0; i < m.rows(); ++i)
      for (Eigen::Index k = 0; k < m.cols(); ++k) Add(typename D::Scalar(m.derived()(i, k)));
  }
  template <class T>
  void Add(const std::vector<T>& v) {
    Add(static_cast<int>(v.size()));
    for (const T& x : v) Add(x);
  }
  template <class T, std::size_t n>
  void Add(const std::array<T, n>& v) {
    for (const T& x : v) Add(x);
  }
  template <class A, class B>
  void Add(const std::pair<A, B>& p) {
    Add(p.first), Add(p.second);
  }
  template <class T>
  void Add(const std::shared_ptr<const T>& p) {
    Add(p != nullptr);
    if (p) Add(*p);
  }
  void Add(const Shape& shape) {
    Add(static_cast<int>(shape.index()));
    std::visit([&](const auto& s) { Add(s); }, shape);
  }
  void Add(const RigidTransform& X) { All(X.rotation(), X.translation()); }
  void Add(const SpatialInertia& s) {
    const auto& [mass, center, rotational] = s;
    All(mass, center, rotational);
  }
  void Add(const Plane& s) {
    const auto& [half_x, half_y] = s;
    All(half_x, half_y);
  }
  void Add(const Sphere& s) { Add(s.radius); }
  void Add(const Capsule& s) {
    const auto& [radius, half_length] = s;
    All(radius, half_length);
  }
  void Add(const Cylinder& s) {
    const auto& [radius, half_length] = s;
    All(radius, half_length);
  }
  void Add(const Ellipsoid& s) { Add(s.radii); }
  void Add(const Box& s) { Add(s.half); }
  void Add(const MeshShape& s) { Add(s.mesh); }
  void Add(const HeightField& s) { Add(s.grid); }
  void Add(const TriangleMesh& s) {
    const auto& [name, vertices, triangles, corner_uv] = s;
    All(name, vertices, triangles, corner_uv);
  }
  void Add(const HeightGrid& s) {
    const auto& [name, rows, columns, half_x, half_y, max_height, base_depth, values] = s;
    All(name, rows, columns, half_x, half_y, max_height, base_depth, values);
  }
  void Add(const Picture& s) {
    const auto& [name, width, height, rgb] = s;
    All(name, width, height, rgb);
  }
  void Add(const GeometryDef& s) {
    const auto& [name, shape, X_BG, friction, priority, contype, conaffinity, frictionless, torsion, rolling,
                 moments, restitution, margin, gap, adhesion, surface_velocity, pairs, rgba, group, picture,
                 picture_x, picture_y] = s;
    All(name, shape, X_BG, friction, priority, contype, conaffinity, frictionless, torsion, rolling, moments,
        restitution, margin, gap, adhesion, surface_velocity, pairs, rgba, group, picture, picture_x,
        picture_y);
  }
  void Add(const ContactPairDef& s) {
    const auto& [name, friction, friction_scale, torsion, rolling, restitution, margin, gap, adhesion] = s;
    All(name, friction, friction_scale, torsion, rolling, restitution, margin, gap, adhesion);
  }
  void Add(const BodyDef& s) {
    const auto& [name, parent, X_PB, inertia, geometries, gravity_compensation] = s;
    All(name, parent, X_PB, inertia, geometries, gravity_compensation);
  }
  void Add(const FreedomDef& s) {
    const auto& [screw_B, stiffness, damping, armature, rest, lower, upper] = s;
    All(screw_B, stiffness, damping, armature, rest, lower, upper);
  }
  void Add(const FreedomRef& s) {
    const auto& [joint, freedom] = s;
    All(joint, freedom);
  }
  void Add(const JointDef& s) {
    const auto& [name, body, kind, freedoms] = s;
    All(name, body, kind, freedoms);
  }
  void Add(const ClosureDef& s) {
    const auto& [name, body_a, body_b, X_AJ, X_BJ, rigid, stiffness, damping] = s;
    All(name, body_a, body_b, X_AJ, X_BJ, rigid, stiffness, damping);
  }
  void Add(const CouplingDef& s) {
    const auto& [name, a, b, polynomial, terms] = s;
    All(name, a, b);
    for (const double p : polynomial) Add(p);
    Add(terms);
  }
  void Add(const PathElementDef& s) {
    const auto& [kind, body, X_BE, radius, divisor, has_side, side_body, side_B] = s;
    All(kind, body, X_BE, radius, divisor, has_side, side_body, side_B);
  }
  void Add(const PathDef& s) {
    const auto& [name, elements, kind, rod, gear] = s;
    All(name, elements, kind, rod, gear);
  }
  void Add(const PathRef& s) {
    const auto& [path, gear] = s;
    All(path, gear);
  }
  void Add(const SpringDef& s) {
    const auto& [name, terms, stiffness, damping, rest, along, higher_stiffness, higher_damping, slack] = s;
    All(name, terms, stiffness, damping, rest, along, higher_stiffness, higher_damping, slack);
  }
  void Add(const DryFrictionDef& s) {
    const auto& [name, terms, force, along] = s;
    All(name, terms, force, along);
  }
  void Add(const LengthLimitDef& s) {
    const auto& [name, terms, lower, upper, along] = s;
    All(name, terms, lower, upper, along);
  }
  void Add(const ForceLimitDef& s) {
    const auto& [name, terms, inputs, stiffness, damping, rest, lower, upper, along] = s;
    All(name, terms, inputs, stiffness, damping, rest, lower, upper, along);
  }
  void Add(const ControlDef& s) {
    const auto& [name, terms, gain, is_setpoint, lower, upper, initial, along, dynamics, time_constant,
                 activation_lower, activation_upper, initial_activation, deactivation_time, smoothing,
                 setpoint_per_unit, setpoint_rest, is_velocity_setpoint] = s;
    All(name, terms, gain, is_setpoint, lower, upper, initial, along, dynamics, time_constant,
        activation_lower, activation_upper, initial_activation, deactivation_time, smoothing,
        setpoint_per_unit, setpoint_rest, is_velocity_setpoint);
  }
  void Add(const MuscleDef& s) {
    const auto& [name, terms, control, force, length_lower, length_upper, range_lower, range_upper, lmin,
                 lmax, vmax, fpmax, fvmax, along] = s;
    All(name, terms, control, force, length_lower, length_upper, range_lower, range_upper, lmin, lmax, vmax,
        fpmax, fvmax, along);
  }
  void Add(const AdhesionDef& s) {
    const auto& [name, body, control, gain, lower, upper] = s;
    All(name, body, control, gain, lower, upper);
  }
  void Add(const SwitchedClosureDef& s) {
    const auto& [name, body_a, body_b, X_AJ, X_BJ, rigid, control, time_constant] = s;
    All(name, body_a, body_b, X_AJ, X_BJ, rigid, control, time_constant);
  }
  void Add(const MechanismDef& s) {
    const auto& [name, base, X_WR, bodies, joints, closures, couplings, paths, springs, controls, frictions,
                 length_limits, force_limits, muscles, adhesions, switched_closures, interfaces,
                 interfaces_chosen, modes, modes_by_step, mode_choice, parent_filter] = s;
    All(name, base, X_WR, bodies, joints, closures, couplings, paths, springs, controls, frictions,
        length_limits, force_limits, muscles, adhesions, switched_closures, interfaces, interfaces_chosen,
        modes, modes_by_step, mode_choice, parent_filter);
  }
  void Add(const FreeBodyDef& s) {
    const auto& [name, X_WB, inertia, geometries, gravity_compensation] = s;
    All(name, X_WB, inertia, geometries, gravity_compensation);
  }
  void Add(const KeyframeDef::MechanismState& s) {
    const auto& [q, q_dot, X_WR, V_R, controls, activation] = s;
    All(q, q_dot, X_WR, V_R, controls, activation);
  }
  void Add(const KeyframeDef::FreeBodyState& s) {
    const auto& [X_WB, omega_W, velocity_W] = s;
    All(X_WB, omega_W, velocity_W);
  }
  void Add(const KeyframeDef& s) {
    const auto& [name, mechanisms, free_bodies] = s;
    All(name, mechanisms, free_bodies);
  }
  void Add(const SensorBody& s) {
    const auto& [mechanism, body, free_body] = s;
    All(mechanism, body, free_body);
  }
  void Add(const SensorFrame& s) {
    const auto& [body, X_BF] = s;
    All(body, X_BF);
  }
  void Add(const SensorActuator& s) {
    const auto& [mechanism, terms, along, at_reference, inputs, muscle, stiffness, damping, bias, lower,
                 upper] = s;
    All(mechanism, terms, along, at_reference, inputs, muscle, stiffness, damping, bias, lower, upper);
  }
  void Add(const SensorSpring& s) {
    const auto& [mechanism, spring] = s;
    All(mechanism, spring);
  }
  void Add(const SensorDef& s) {
    const auto& [name, kind, size, frame, reference, own_axes, subtree, mechanism, terms, along, at_reference,
                 lower, upper, volume, field_W, actuators, springs, unseen, limit, clip_lower, clip_upper,
                 reason] = s;
    All(name, kind, size, frame, reference, own_axes, subtree, mechanism, terms, along, at_reference, lower,
        upper, volume, field_W, actuators, springs, unseen, limit, clip_lower, clip_upper, reason);
  }
  void Add(const Scene& s) {
    const auto& [name, gravity, timestep, mechanisms, free_bodies, world, excluded_pairs, contact_pairs,
                 keyframes, sensors] = s;
    All(name, gravity, timestep, mechanisms, free_bodies, world, excluded_pairs, contact_pairs, keyframes,
        sensors);
  }

 private:
  template <class... T>
  void All(const T&... values) {
    (Add(values), ...);
  }
};

std::vector<std::uint64_t> BitsOf(const Scene& scene) {
  BitList list;
  list.Add(scene);
  return list.bits;
}

TEST(SceneJson, KeepsEveryBitOfRandomScenes) {
  for (unsigned seed = 0; seed < 30; ++seed) {
    const Scene scene = SceneWithEverything(seed);
    const ModelText text = WriteScene(scene);
    const auto read = ReadScene(text, "test");
    ASSERT_TRUE(read) << read.error().Text();
    EXPECT_EQ(BitsOf(*read), BitsOf(scene)) << seed;
    EXPECT_EQ(WriteScene(*read).json, text.json);
  }
}

TEST(SceneJson, SharesMeshesAgain) {
  const ModelText text = WriteScene(SceneWithEverything(1));
  EXPECT_EQ(text.meshes.size(), 1u);
  EXPECT_EQ(text.grids.size(), 1u);
  EXPECT_EQ(text.pictures.size(), 1u);
  const auto read = ReadScene(text, "test");
  ASSERT_TRUE(read);
  const auto& a = std::get<MeshShape>(read->world[6].shape).mesh;
  EXPECT_EQ(a, std::get<MeshShape>(read->free_bodies[1].geometries[7].shape).mesh);
}

TEST(SceneJson, KeepsDoublesAtTheEdges) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (double v : {0.0, -0.0, 5e-324, -2.2250738585072014e-308, 1.7976931348623157e308, 0.1, 1e23, kInfinity,
                   -kInfinity, std::nextafter(1.0, 2.0), 9007199254740993.0, 1e16, 100.0}) {
    Scene scene;
    scene.timestep = v;
    const auto read = ReadScene(WriteScene(scene), "test");
    ASSERT_TRUE(read);
    EXPECT_EQ(std::bit_cast<std::uint64_t>(read->timestep), std::bit_cast<std::uint64_t>(v)) << v;
  }
  Scene scene;
  scene.timestep = std::nan("");
  EXPECT_TRUE(std::isnan(ReadScene(WriteScene(scene), "test")->timestep));
}

TEST(SceneJson, NamesTheMemberAtFault) {
  const ModelText text = WriteScene(TouchingScene());
  auto broken = [&](const std::string& from, const std::string& to) {
    ModelText other = text;
    const auto at = other.json.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    other.json.replace(at, from.size(), to);
    const auto read = ReadScene(other, "file.h5");
    EXPECT_FALSE(read) << from;
    if (read) return std::string();
    EXPECT_EQ(read.error().code, ErrorCode::kFormat);
    EXPECT_EQ(read.error().where, "file.h5");
    return read.error().message;
  };
  EXPECT_NE(broken("\"mass\": 0.5", "\"mass\": \"heavy\"").find("mechanisms[0].bodies[0].inertia.mass"),
            std::string::npos);
  EXPECT_NE(broken("\"mass\": 0.5,", "").find("is missing"), std::string::npos);
  EXPECT_NE(broken("\"kind\": \"sphere\"", "\"kind\": \"torus\"").find("torus"), std::string::npos);
  EXPECT_NE(broken("\"base\": \"driven\"", "\"base\": \"flying\"").find("mechanisms[0].base"),
            std::string::npos);
  broken("{", "[");
  broken("\"timestep\"", "timestep");
}

// Files of older versions have couplings of two joints alone.
TEST(SceneJson, CouplingsWithoutTerms_HaveNone) {
  CouplingDef coupling;
  coupling.name = "gear";
  coupling.polynomial[1] = 0.5;
  MechanismDef mechanism;
  mechanism.couplings = {coupling};
  ModelText text = WriteMechanism(mechanism);
  const std::string key = "\"terms\"";
  ASSERT_NE(text.json.find(key), std::string::npos);
  text.json.replace(text.json.find(key), key.size(), "\"unknown\"");
  const auto read = ReadMechanism(text, "test");
  ASSERT_TRUE(read) << read.error().Text();
  ASSERT_EQ(read->couplings.size(), 1u);
  EXPECT_EQ(read->couplings[0].polynomial[1], 0.5);
  EXPECT_TRUE(read->couplings[0].terms.empty());
}

TEST(SceneJson, CutTextIsRefused) {
  const std::string json = WriteScene(TouchingScene()).json;
  for (std::size_t i = 0; i < 40; ++i) {
    ModelText cut;
    cut.json = json.substr(0, json.size() * i / 40);
    EXPECT_FALSE(ReadScene(cut, "test"));
  }
}

TEST(OptionsJson, RoundTrip) {
  SimulationOptions options;
  options.dt = 0.1;
  options.recovery = Recovery::kTwist;
  options.reduction.modes = 7;
  options.reduction.rank_tolerance = 1.0 / 3e5;
  options.reduction.promote_hidden = true;
  options.refresh_angle = 0.7;
  options.initial_keyframe = 3;
  options.step.material.depth = 2e-5;
  options.step.contact.max_newton_iterations = 12;
  options.step.refresh = false;
  options.collision.margin = 0.003;
  options.collision.multi_point = false;
  const auto read = ReadOptions(WriteOptions(options), "test");
  ASSERT_TRUE(read) << read.error().Text();
  EXPECT_EQ(read->recovery, Recovery::kTwist);
  EXPECT_EQ(read->reduction.modes, 7);
  EXPECT_EQ(read->reduction.rank_tolerance, 1.0 / 3e5);
  EXPECT_EQ(read->step.contact.max_newton_iterations, 12);
  EXPECT_FALSE(read->collision.multi_point);
  EXPECT_EQ(WriteOptions(*read), WriteOptions(options));
}

}  // namespace
}  // namespace fork1s::testing
