// The mechanisms that the accuracy figures are measured on.
#include <fork1s/importer/importer.hpp>
#include <fork1s/mechanism/builder.hpp>
#include <lab/accuracy.hpp>
#include <limits>
#include <numbers>
#include <random>

#include <fmt/format.h>

namespace fork1s {
namespace {

// Uniform thin rod from the frame's origin to `end`; a hundredth of its inertia about its own axis.
SpatialInertia Rod(double mass, const Vector3& end) {
  SpatialInertia I;
  I.mass = mass;
  I.center = 0.5 * end;
  const double across = mass * end.squaredNorm() / 12;
  const Vector3 axis = end.normalized();
  I.rotational = across * (Matrix3::Identity() - 0.99 * axis * axis.transpose());
  return I;
}

// Crank AB on a spring, passive pins B, C, D, and a sprung finger at C, in the plane x, z: one loop, two
// freedoms.
MechanismDef FourBar() {
  const Vector3 A(0, 0, 0), B(0, 0, 0.1), C(0.12, 0, 0.12), D(0.1, 0, 0), tip(0.17, 0, 0.17);
  MechanismBuilder builder("fourbar");
  auto bar = [&](const char* name, BodyIndex parent, const Vector3& from, const Vector3& to, double mass) {
    BodyDef body;
    body.name = name;
    body.parent = parent;
    const Vector3 origin = parent == builder.base() ? Vector3::Zero() : B;
    body.X_PB = RigidTransform(Vector3(from - origin));
    body.inertia = Rod(mass, to - from);
    return builder.AddBody(body);
  };
  const BodyIndex crank = bar("crank", builder.base(), A, B, 0.05);
  BodyDef middle;
  middle.name = "coupler";
  middle.parent = crank;
  middle.X_PB = RigidTransform(Vector3(B - A));
  middle.inertia = Rod(0.06, C - B);
  const BodyIndex coupler = builder.AddBody(middle);
  // The finger's frame is at its tip, where it is loaded.
  BodyDef end;
  end.name = "finger";
  end.parent = coupler;
  end.X_PB = RigidTransform(Vector3(tip - B));
  end.inertia = Rod(0.03, C - tip);
  const BodyIndex finger = builder.AddBody(end);
  const BodyIndex rocker = bar("rocker", builder.base(), D, C, 0.05);
  const Vector3 y = Vector3::UnitY();
  builder.AddJoint(JointDef::Hinge("A", crank, y).WithSpring(2, 0.04));
  builder.AddJoint(JointDef::Hinge("B", coupler, y));
  builder.AddJoint(JointDef::Hinge("wrist", finger, y, C - tip).WithSpring(5, 0.1));
  builder.AddJoint(JointDef::Hinge("D", rocker, y));
  builder.AddClosure(ClosureDef::Connect("C", coupler, rocker, C - B, C - D));
  builder.SetInterfaces({"finger"});
  return builder.definition();
}

// Links along x, hinged about z and y in turn, the last one the interface.
MechanismDef Chain(int links, double length, double mass, double stiffness, double damping) {
  MechanismBuilder builder("chain");
  BodyIndex parent = builder.base();
  for (int i = 0; i < links; ++i) {
    BodyDef link;
    link.name = fmt::format("link{}", i + 1);
    link.parent = parent;
    link.X_PB = RigidTransform(Vector3(i == 0 ? 0 : length, 0, 0));
    link.inertia = Rod(mass, Vector3(length, 0, 0));
    parent = builder.AddBody(link);
    builder.AddJoint(JointDef::Hinge(fmt::format("joint{}", i + 1), parent,
                                     i % 2 == 0 ? Vector3::UnitY() : Vector3::UnitZ())
                         .WithSpring(stiffness, damping));
  }
  BodyDef tip;
  tip.name = "tip";
  tip.parent = parent;
  tip.X_PB = RigidTransform(Vector3(length, 0, 0));
  builder.AddBody(tip);
  builder.SetInterfaces({"tip"});
  return builder.definition();
}

// Pulled at the point `at` of a body: a massless body without joint carries it.
Expected<StaticCase> Make(const std::string& name, MechanismDef definition, const std::string& body,
                          const Vector3& direction_W, const Vector3& at = Vector3::Zero()) {
  BodyDef point;
  point.name = body + "_point";
  point.parent = definition.FindBody(body);
  FORK1S_REQUIRE(point.parent.valid(), body);
  point.X_PB = RigidTransform(at);
  definition.bodies.push_back(point);
  auto built = BuildMechanism(std::move(definition));
  if (!built) return tl::unexpected(built.error());
  StaticCase c{name, std::make_shared<const Mechanism>(std::move(*built)), {}, {}, {}};
  c.q0 = VectorX::Zero(c.mechanism->num_coordinates());
  CloseLoops(*c.mechanism, c.q0);
  c.body = c.mechanism->FindBody(point.name);
  c.direction_R = c.mechanism->definition().X_WR.rotation().transpose() * direction_W.normalized();
  return c;
}

Expected<std::vector<StaticCase>> Gather(std::vector<Expected<StaticCase>> made) {
  std::vector<StaticCase> cases;
  for (auto& c : made) {
    if (!c) return tl::unexpected(c.error());
    cases.push_back(std::move(*c));
  }
  return cases;
}

Expected<ImportedScene> Load(const std::string& folder, const std::string& name) {
  return LoadMechanism(folder + "/" + name + ".xml");
}

// Servos, as stiff as the springs, on all joints but the last.
void AddServos(MechanismDef& definition) {
  for (int j = 0; j + 1 < static_cast<int>(definition.joints.size()); ++j) {
    const JointDef& joint = definition.joints[static_cast<std::size_t>(j)];
    ControlDef servo;
    servo.name = joint.name;
    servo.terms = {{{JointIndex(j), 0}, 1.0}};
    servo.gain = joint.freedoms[0].stiffness;
    servo.is_setpoint = true;
    definition.controls.push_back(servo);
  }
}

// A tree of hinges with servos, of bodies about 0.2 m apart, the last body its interface. Loops are closed by
// points of two bodies.
MechanismDef RandomMechanism(unsigned seed, int bodies, int loops) {
  std::mt19937 engine(seed);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(engine()) / 4294967296.0;
  };
  const auto vector = [&] {
    const double x = uniform(-1, 1), y = uniform(-1, 1), z = uniform(-1, 1);
    return Vector3(x, y, z);
  };
  MechanismBuilder builder(fmt::format("random {}", seed));
  std::vector<Vector3> at{Vector3::Zero()};  // of origins in the world
  for (int i = 1; i <= bodies; ++i) {
    BodyDef body;
    body.name = fmt::format("body{}", i);
    const int parent = i % 3 == 0 ? i / 2 : i - 1;
    body.parent = BodyIndex(parent);
    const Vector3 step = 0.2 * vector().normalized();
    body.X_PB = RigidTransform(step);
    body.inertia = Rod(uniform(0.2, 1), 0.2 * vector().normalized());
    at.push_back(at[static_cast<std::size_t>(parent)] + step);
    builder.AddJoint(JointDef::Hinge(fmt::format("joint{}", i), builder.AddBody(body), vector().normalized())
                         .WithSpring(uniform(2000, 20000), 1));
  }
  for (int k = 0; k < loops; ++k) {
    const int a = bodies - 1 - k, b = bodies / 2 - k;
    builder.AddClosure(
        ClosureDef::Connect(fmt::format("loop{}", k + 1), BodyIndex(a), BodyIndex(b), Vector3::Zero(),
                            at[static_cast<std::size_t>(a)] - at[static_cast<std::size_t>(b)]));
  }
  builder.SetInterfaces({fmt::format("body{}", bodies)});
  MechanismDef definition = builder.definition();
  AddServos(definition);
  return definition;
}

Expected<RestCase> MakeRest(const std::string& name, MechanismDef definition, const std::string& interior) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  definition.base = BaseKind::kFixed;
  definition.frictions.clear();
  definition.length_limits.clear();
  definition.force_limits.clear();
  for (BodyDef& body : definition.bodies) body.geometries.clear();
  for (JointDef& joint : definition.joints)
    for (FreedomDef& freedom : joint.freedoms) freedom.lower = -(freedom.upper = kInfinity);
  for (ControlDef& control : definition.controls) control.lower = -(control.upper = kInfinity);
  auto built = BuildMechanism(std::move(definition));
  if (!built) return tl::unexpected(built.error());
  RestCase c{name, std::make_shared<const Mechanism>(std::move(*built)), {}, {}};
  c.interface = c.mechanism->FindBody(c.mechanism->definition().interfaces.back());
  c.interior = c.mechanism->FindBody(interior);
  FORK1S_REQUIRE(c.interior.valid(), interior);
  return c;
}

}  // namespace

Expected<std::vector<RestCase>> MakeRestCases(const std::string& folder) {
  struct FromScene {
    const char *name, *file, *interior;
  };
  std::vector<RestCase> cases;
  for (const auto& [name, file, interior] : {FromScene{"hexapod", "hexapod", "front_left_femur"},
                                             {"firemen", "firemen", "west_chest"},
                                             {"two-link arm", "two_link_arm", "upper_arm"},
                                             {"arm and hand", "peg_in_hole", "forearm"},
                                             {"excavator", "excavator", "stick"}}) {
    auto scene = Load(folder, file);
    if (!scene) return tl::unexpected(scene.error());
    auto c = MakeRest(name, scene->scene.mechanisms[0], interior);
    if (!c) return tl::unexpected(c.error());
    cases.push_back(std::move(*c));
  }
  MechanismDef chain = Chain(24, 0.05, 0.02, 100, 1);
  AddServos(chain);
  std::vector<std::pair<std::string, MechanismDef>> made{{"chain", std::move(chain)}};
  for (unsigned seed = 1; seed <= 4; ++seed)
    made.emplace_back(fmt::format("random tree {}", seed), RandomMechanism(seed, 24, 0));
  for (unsigned seed = 5; seed <= 8; ++seed)
    made.emplace_back(fmt::format("random loops {}", seed - 4), RandomMechanism(seed, 24, 3));
  for (auto& [name, definition] : made) {
    const std::string interior = definition.bodies[definition.bodies.size() / 2].name;
    auto c = MakeRest(name, std::move(definition), interior);
    if (!c) return tl::unexpected(c.error());
    cases.push_back(std::move(*c));
  }
  return cases;
}

Expected<std::vector<StaticCase>> MakeStaticCases(const std::string& folder) {
  auto hand = Load(folder, "hand"), hexapod = Load(folder, "hexapod"), firemen = Load(folder, "firemen");
  for (const auto* scene : {&hand, &hexapod, &firemen})
    if (!*scene) return tl::unexpected(scene->error());
  // Oblique, at the tip of the finger or leg: every joint on the path takes part.
  return Gather(
      {Make("hand", hand->scene.mechanisms[0], "index_tip", {0, 0.3, 1}, {0.02, 0, 0}),
       Make("hexapod", hexapod->scene.mechanisms[0], "front_left_tibia", {-0.3, 0.5, 1}, {0.02, 0, -0.12}),
       Make("four-bar", FourBar(), "finger", {1, 0, -1}),
       Make("firemen", firemen->scene.mechanisms[0], "sheet", {0.2, 0.1, -1}),
       Make("chain", Chain(10, 0.1, 0.05, 100, 1), "tip", {0, 0.3, 1})});
}

Expected<std::vector<StaticCase>> MakeFrequencyCases(const std::string& folder) {
  auto hand = Load(folder, "hand"), arm = Load(folder, "peg_in_hole"), firemen = Load(folder, "firemen");
  for (const auto* scene : {&hand, &arm, &firemen})
    if (!*scene) return tl::unexpected(scene->error());
  // With the palm held no finger would know of the others, and one fingertip nothing of four fingers.
  hand->scene.mechanisms[0].base = BaseKind::kFloating;
  return Gather({Make("firemen", firemen->scene.mechanisms[0], "sheet", Vector3::UnitZ()),
                 Make("hand", hand->scene.mechanisms[0], "index_tip", Vector3::UnitZ()),
                 Make("arm and hand", arm->scene.mechanisms[0], "peg", Vector3::UnitZ()),
                 Make("chain", Chain(20, 0.05, 0.025, 100, 1), "tip", Vector3::UnitZ())});
}

Expected<std::vector<TransientCase>> MakeTransientCases(const std::string& folder) {
  std::vector<TransientCase> cases;
  for (const char* name : {"hand", "hexapod", "firemen"}) {
    auto imported = Load(folder, name);
    if (!imported) return tl::unexpected(imported.error());
    cases.push_back({name, std::move(imported->scene), {}, 1});
  }
  // Three fingers bend by half a radian while the palm rises and turns.
  cases[0].controls.names = {"index_knuckle_flex", "middle_knuckle_flex", "ring_knuckle_flex", "palm.z",
                             "palm.rz"};
  cases[0].controls.times = {0, 0.5, 1};
  cases[0].controls.rows = {{0, 0, 0, 0, 0}, {0.5, 0.6, 0.7, 0.05, 0.3}, {0.5, 0.6, 0.7, 0.05, 0.3}};
  // It stands and leans: the hips of one side lift, those of the other side give way.
  for (const char* side : {"left", "right"})
    for (const char* row : {"front", "middle", "rear"})
      cases[1].controls.names.push_back(fmt::format("{}_{}_hip", row, side));
  cases[1].controls.times = {0, 0.3, 0.6, 1};
  cases[1].controls.rows = {{0, 0, 0, 0, 0, 0},
                            {-0.15, -0.15, -0.15, 0.1, 0.1, 0.1},
                            {0.1, 0.1, 0.1, -0.15, -0.15, -0.15},
                            {0, 0, 0, 0, 0, 0}};
  cases[2].time = 1.2;  // the bunny lands at 0.6 s
  // Hung out to the side and let go.
  TransientCase whip{"chain", {}, {}, 1};
  whip.scene.name = "chain";
  whip.scene.mechanisms.push_back(Chain(10, 0.1, 0.05, 2, 0.005));
  cases.push_back(std::move(whip));
  return cases;
}

}  // namespace fork1s
