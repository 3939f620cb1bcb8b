#include <cmath>
#include <limits>

#include "record/scene_json.hpp"
#include "support.hpp"

namespace fork1s::testing {
namespace {

// Every value of a scene as bits, listed here again so that a field forgotten by the writer shows.
class BitList {
 public:
  std::vector<std::uint64_t> bits;

  void Add(double v) { bits.push_back(std::bit_cast<std::uint64_t>(v)); }
  void Add(float v) { bits.push_back(std::bit_cast<std::uint32_t>(v)); }
  void Add(int v) { bits.push_back(static_cast<std::uint64_t>(v)); }
  void Add(bool v) { bits.push_back(v ? 1 : 0); }
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
  void Add(const RigidTransform& X) { Add(X.rotation()), Add(X.translation()); }
  void Add(const SpatialInertia& I) { Add(I.mass), Add(I.center), Add(I.rotational); }
  void Add(const FreedomRef& r) { Add(r.joint.value()), Add(r.freedom); }
  template <class T>
  void Add(const std::vector<T>& v) {
    Add(static_cast<int>(v.size()));
    for (const T& x : v) Add(x);
  }
  template <class A, class B>
  void Add(const std::pair<A, B>& p) {
    Add(p.first), Add(p.second);
  }
  void Add(const ContactPairDef& p) {
    Add(p.name), Add(p.friction), Add(p.torsion), Add(p.rolling), Add(p.restitution), Add(p.margin);
    Add(p.gap);
  }
  void Add(const GeometryDef& g) {
    Add(g.name), Add(static_cast<int>(g.shape.index())), Add(g.X_BG), Add(g.friction), Add(g.priority);
    Add(g.contype), Add(g.conaffinity), Add(g.frictionless), Add(g.margin), Add(g.gap), Add(g.pairs),
        Add(g.rgba), Add(g.group);
    Add(g.picture != nullptr), Add(g.picture_x), Add(g.picture_y);
    if (g.picture) Add(g.picture->name), Add(g.picture->width), Add(static_cast<int>(g.picture->rgb.size()));
    if (auto* s = std::get_if<Plane>(&g.shape)) Add(s->half_x), Add(s->half_y);
    if (auto* s = std::get_if<Sphere>(&g.shape)) Add(s->radius);
    if (auto* s = std::get_if<Capsule>(&g.shape)) Add(s->radius), Add(s->half_length);
    if (auto* s = std::get_if<Cylinder>(&g.shape)) Add(s->radius), Add(s->half_length);
    if (auto* s = std::get_if<Ellipsoid>(&g.shape)) Add(s->radii);
    if (auto* s = std::get_if<Box>(&g.shape)) Add(s->half);
    if (auto* s = std::get_if<MeshShape>(&g.shape)) {
      Add(s->mesh != nullptr);
      if (s->mesh) Add(s->mesh->name), Add(s->mesh->vertices), Add(s->mesh->triangles);
    }
    if (auto* s = std::get_if<HeightField>(&g.shape)) {
      Add(s->grid != nullptr);
      if (s->grid)
        Add(s->grid->name), Add(s->grid->rows), Add(s->grid->columns), Add(s->grid->half_x),
            Add(s->grid->half_y), Add(s->grid->max_height), Add(s->grid->base_depth), Add(s->grid->values);
    }
  }
  void Add(const BodyDef& b) {
    Add(b.name), Add(b.parent.value()), Add(b.X_PB), Add(b.inertia), Add(b.geometries);
  }
  void Add(const FreedomDef& f) {
    Add(f.screw_B), Add(f.stiffness), Add(f.damping), Add(f.armature), Add(f.rest), Add(f.lower),
        Add(f.upper);
  }
  void Add(const JointDef& j) {
    Add(j.name), Add(j.body.value()), Add(static_cast<int>(j.kind)), Add(j.freedoms);
  }
  void Add(const ClosureDef& c) {
    Add(c.name), Add(c.body_a.value()), Add(c.body_b.value()), Add(c.X_AJ), Add(c.X_BJ), Add(c.rigid);
    Add(c.stiffness), Add(c.damping);
  }
  void Add(const CouplingDef& c) {
    Add(c.name), Add(c.a), Add(c.b);
    for (double p : c.polynomial) Add(p);
    Add(c.terms);
  }
  void Add(const PathElementDef& e) {
    Add(static_cast<int>(e.kind)), Add(e.body.value()), Add(e.X_BE), Add(e.radius), Add(e.divisor);
    Add(e.has_side), Add(e.side_body.value()), Add(e.side_B);
  }
  void Add(const PathDef& p) {
    Add(p.name), Add(p.elements), Add(static_cast<int>(p.kind)), Add(p.rod), Add(p.gear);
  }
  void Add(const PathRef& u) { Add(u.path), Add(u.gear); }
  void Add(const SpringDef& s) {
    Add(s.name), Add(s.terms), Add(s.stiffness), Add(s.damping), Add(s.rest), Add(s.along), Add(s.slack);
    for (double higher :
         {s.higher_stiffness[0], s.higher_stiffness[1], s.higher_damping[0], s.higher_damping[1]})
      Add(higher);
  }
  void Add(const ControlDef& c) {
    Add(c.name), Add(c.terms), Add(c.gain), Add(c.is_setpoint), Add(c.lower), Add(c.upper), Add(c.initial);
    Add(c.along), Add(static_cast<int>(c.dynamics)), Add(c.time_constant), Add(c.activation_lower);
    Add(c.activation_upper), Add(c.initial_activation), Add(c.deactivation_time), Add(c.smoothing);
  }
  void Add(const MuscleDef& m) {
    Add(m.name), Add(m.terms), Add(m.control), Add(m.along);
    for (const double x : {m.force, m.length_lower, m.length_upper, m.range_lower, m.range_upper, m.lmin,
                           m.lmax, m.vmax, m.fpmax, m.fvmax})
      Add(x);
  }
  void Add(const AdhesionDef& a) {
    Add(a.name), Add(a.body), Add(a.control), Add(a.gain), Add(a.lower), Add(a.upper);
  }
  void Add(const SwitchedClosureDef& s) {
    Add(s.name), Add(s.body_a), Add(s.body_b), Add(s.X_AJ), Add(s.X_BJ), Add(s.control), Add(s.time_constant);
    for (int k = 0; k < 6; ++k) Add(static_cast<int>(s.rigid[k]));
  }
  void Add(const MechanismDef& m) {
    Add(m.name), Add(static_cast<int>(m.base)), Add(m.X_WR), Add(m.bodies), Add(m.joints), Add(m.closures);
    Add(m.couplings), Add(m.paths), Add(m.springs), Add(m.controls), Add(m.muscles), Add(m.adhesions),
        Add(m.switched_closures), Add(m.interfaces), Add(m.interfaces_chosen), Add(m.modes),
        Add(static_cast<int>(m.parent_filter));
  }
  void Add(const FreeBodyDef& b) { Add(b.name), Add(b.X_WB), Add(b.inertia), Add(b.geometries); }
  void Add(const KeyframeDef::MechanismState& s) {
    Add(s.q), Add(s.q_dot), Add(s.X_WR), Add(s.V_R), Add(s.controls), Add(s.activation);
  }
  void Add(const KeyframeDef::FreeBodyState& s) { Add(s.X_WB), Add(s.omega_W), Add(s.velocity_W); }
  void Add(const KeyframeDef& k) { Add(k.name), Add(k.mechanisms), Add(k.free_bodies); }
  void Add(const Scene& s) {
    Add(s.name), Add(s.gravity), Add(s.timestep), Add(s.mechanisms), Add(s.free_bodies), Add(s.world);
    Add(s.excluded_pairs), Add(s.contact_pairs), Add(s.keyframes);
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
