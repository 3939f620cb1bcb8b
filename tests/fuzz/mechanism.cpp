// Mechanisms out of bytes: built, reduced, stepped. What an input says is always a mechanism, mostly one that
// might be meant: trees of every joint, loops, couplings, tendons, motors, stops and friction. Half of the
// inputs have numbers from the edges of what a double holds among their others.
#include <fork1s/mechanism/builder.hpp>

#include "fuzz.hpp"

namespace {

using namespace fork1s;

class MechanismSource {
 public:
  explicit MechanismSource(fuzz::Input input) : in_(input) {
    const int kind = in_.Byte();
    tame_ = kind & 1;
    rest_ = kind & 2;
  }

  Scene Draw() {
    Scene scene;
    scene.name = "fuzz";
    def_.name = "drawn";
    def_.base = static_cast<BaseKind>(in_.Below(3));
    def_.X_WR = Pose();
    const int bodies = 1 + in_.Below(7);
    for (int i = 0; i <= bodies; ++i) AddBody(i);
    for (int parts = in_.Below(8); parts > 0 && !in_.empty(); --parts) AddPart(parts);
    def_.modes = in_.Below(8);
    def_.mode_choice = in_.Flag() ? ModeChoice::kContribution : ModeChoice::kLowest;
    for (int i = 1 + in_.Below(3); i > 0; --i)
      def_.interfaces.push_back(def_.bodies[static_cast<std::size_t>(in_.Below(bodies + 1))].name);
    scene.mechanisms.push_back(def_);
    GeometryDef ground;
    ground.name = "ground";
    ground.shape = Plane{};
    ground.X_BG = RigidTransform(Vector3(0, 0, -1));
    scene.world.push_back(ground);
    if (in_.Flag()) {
      FreeBodyDef ball;
      ball.name = "ball";
      ball.X_WB = Pose();
      ball.inertia = Inertia();
      ball.geometries.push_back(Geometry("ball"));
      scene.free_bodies.push_back(ball);
    }
    return scene;
  }

  SimulationOptions Options() {
    SimulationOptions options;
    static constexpr double kSteps[] = {0, 1.0 / 60, 1e-3, 0.1, 1e-6, 10};
    options.dt = kSteps[in_.Below(tame_ ? 4 : 6)];
    const int way = in_.Below(16);
    if (way & 1) options.step.integrator = Integrator::kEuler;
    if (way == 2 || way == 3) options.recovery = Recovery::kTwist;
    return options;
  }

 private:
  double Real() { return in_.Real(tame_); }
  double Positive() { return std::abs(Real()) + (tame_ ? 1e-3 : 0); }
  Vector3 Vector() {
    const double x = Real(), y = Real(), z = Real();
    return {x, y, z};
  }
  Vector3 Axis() {
    switch (in_.Below(5)) {
      case 0:
        return Vector3::UnitX();
      case 1:
        return Vector3::UnitY();
      case 2:
        return Vector3::UnitZ();
      default: {
        const Vector3 axis = Vector();
        return tame_ ? (axis + Vector3(0, 0, 20)).normalized() : axis;
      }
    }
  }
  RigidTransform Pose() {
    const Vector3 p = 0.1 * Vector();
    return in_.Flag() ? RigidTransform(ExpRotation(Vector()), p) : RigidTransform(p);
  }
  SpatialInertia Inertia() {
    SpatialInertia I;
    if (in_.Below(30) == 29) return I;  // massless
    I.mass = Positive();
    I.center = 0.05 * Vector();
    const Vector3 s = (0.1 * Vector()).cwiseAbs2();
    I.rotational =
        I.mass * Vector3(s.y() + s.z() + 1e-4, s.x() + s.z() + 1e-4, s.x() + s.y() + 1e-4).asDiagonal();
    if (!tame_ && !in_.Below(8)) I.rotational(in_.Below(3), in_.Below(3)) = Real();
    return I;
  }
  GeometryDef Geometry(const std::string& name) {
    GeometryDef g;
    g.name = name;
    switch (in_.Below(4)) {
      case 0:
        g.shape = Box{0.1 * Vector().cwiseAbs() + Vector3::Constant(0.01)};
        break;
      case 1:
        g.shape = Capsule{0.1 * Positive(), 0.1 * Positive()};
        break;
      default:
        g.shape = Sphere{0.1 * Positive()};
    }
    g.friction = Positive();
    g.moments = in_.Below(3);
    g.restitution = in_.Flag() ? 0.125 * in_.Below(9) : 0;
    return g;
  }
  BodyIndex Body() { return BodyIndex(in_.Below(static_cast<int>(def_.bodies.size()))); }
  FreedomRef Freedom() {
    const int j = in_.Below(static_cast<int>(def_.joints.size()));
    return {JointIndex(j),
            in_.Below(static_cast<int>(def_.joints[static_cast<std::size_t>(j)].freedoms.size()))};
  }
  std::vector<std::pair<FreedomRef, double>> Terms() {
    std::vector<std::pair<FreedomRef, double>> terms;
    for (int k = 1 + in_.Below(3); k > 0; --k) {
      const FreedomRef freedom = Freedom();
      terms.emplace_back(freedom, Real());
    }
    return terms;
  }

  void AddBody(int i) {
    BodyDef body;
    body.name = "body" + std::to_string(i);
    body.inertia = Inertia();
    if (i > 0) {
      body.parent = BodyIndex(in_.Flag() ? i - 1 : in_.Below(i));
      body.X_PB = Pose();
    }
    if (in_.Flag()) body.geometries.push_back(Geometry(body.name + "_shape"));
    body.gravity_compensation = in_.Below(4) ? 0 : Real();
    def_.bodies.push_back(body);
    const int joints = i == 0 ? 0 : in_.Below(8) == 0 ? 2 : in_.Below(8) == 0 && !def_.joints.empty() ? 0 : 1;
    for (int j = 0; j < joints; ++j) AddJoint(i, "joint" + std::to_string(i) + "_" + std::to_string(j));
  }

  void AddJoint(int i, const std::string& name) {
    const BodyIndex body(i);
    const auto joint = [&]() -> JointDef {
      switch (in_.Below(9)) {
        case 0:
          return JointDef::Slide(name, body, Axis());
        case 1:
          return JointDef::Ball(name, body, 0.1 * Vector());
        case 2:
          return JointDef::Cylindrical(name, body, Axis(), 0.1 * Vector());
        case 3:
          return JointDef::Planar(name, body, Axis(), 0.1 * Vector());
        case 4:
          return JointDef::Free(name, body);
        case 5: {
          Matrix6X S(6, 1 + in_.Below(2));
          for (Eigen::Index k = 0; k < S.cols(); ++k) {
            S.col(k).head<3>() = Vector();
            S.col(k).tail<3>() = Vector();
          }
          return JointDef::General(name, body, S);
        }
        default:
          return JointDef::Hinge(name, body, Axis(), 0.1 * Vector());
      }
    };
    def_.joints.push_back(joint());
    const bool sprung = in_.Below(40) != 39;  // what nothing holds is refused, mostly
    for (FreedomDef& f : def_.joints.back().freedoms) {
      if (sprung) f.stiffness = 100 * Positive();
      f.damping = in_.Flag() ? Positive() : 0;
      if (!in_.Below(4)) f.armature = Positive();
      if (rest_) f.rest = Real();
      if (!in_.Below(4)) {
        f.lower = -Positive();
        f.upper = Positive();
      }
    }
  }

  void AddPart(int number) {
    const std::string name = "part" + std::to_string(number);
    switch (in_.Below(9)) {
      case 0:
      case 1: {
        const BodyIndex a = Body(), b = Body();
        ClosureDef c = in_.Flag() ? ClosureDef::Connect(name, a, b, 0.1 * Vector(), 0.1 * Vector())
                                  : ClosureDef::Weld(name, a, b, Pose(), Pose());
        for (int k = 0; k < 6; ++k)
          if (!in_.Below(4)) {
            c.rigid(k) = false;
            c.stiffness(k) = Positive();
            c.damping(k) = Positive();
          }
        // Most loops are closed at the reference, as those that are meant are.
        if (in_.Below(8))
          if (const auto tree = BuildMechanism(def_))
            c.X_BJ = tree->body(b).X_RB0.inverse() * tree->body(a).X_RB0 * c.X_AJ;
        def_.closures.push_back(c);
        break;
      }
      case 2: {
        CouplingDef c;
        c.name = name;
        c.a = Freedom();
        if (in_.Below(5)) c.b = Freedom();
        c.polynomial[0] = in_.Below(8) ? 0 : Real();
        for (int k = 1; k < 5; ++k) c.polynomial[k] = in_.Flag() ? Real() : 0;
        if (in_.Below(4) == 0)
          for (int k = 1 + static_cast<int>(in_.Below(3)); k > 0; --k)
            c.terms.emplace_back(Freedom(), Real());
        def_.couplings.push_back(c);
        break;
      }
      case 3: {
        SpringDef s;
        s.name = name;
        Along(s.terms, s.along);
        s.stiffness = 100 * Positive();
        s.damping = Positive();
        s.rest = Real();
        s.slack = s.rest > 0 ? s.rest : 0;
        if (in_.Flag()) s.higher_stiffness = {Real(), Real()};
        def_.springs.push_back(s);
        break;
      }
      case 4: {
        DryFrictionDef f;
        f.name = name;
        Along(f.terms, f.along);
        f.force = Positive();
        def_.frictions.push_back(f);
        break;
      }
      case 5: {
        LengthLimitDef l;
        l.name = name;
        Along(l.terms, l.along);
        l.lower = -Positive();
        l.upper = Positive();
        def_.length_limits.push_back(l);
        break;
      }
      case 6: {
        ForceLimitDef f;
        f.name = name;
        Along(f.terms, f.along);
        f.stiffness = Positive();
        f.damping = Positive();
        f.lower = -Positive();
        f.upper = Positive();
        def_.force_limits.push_back(f);
        break;
      }
      default: {
        ControlDef c;
        c.name = name;
        Along(c.terms, c.along);
        c.gain = Positive();
        c.is_setpoint = in_.Flag();
        c.initial = Real();
        def_.controls.push_back(c);
      }
    }
  }

  // A length over freedoms, or now and then that of a path through space.
  void Along(std::vector<std::pair<FreedomRef, double>>& terms, PathRef& along) {
    if (in_.Below(4)) {
      terms = Terms();
      return;
    }
    PathDef path;
    path.name = "path" + std::to_string(def_.paths.size());
    for (int i = 0, n = 2 + in_.Below(4); i < n; ++i) {
      PathElementDef e;
      e.kind = i == 0 || i == n - 1 ? PathElementDef::Kind::kPoint
                                    : static_cast<PathElementDef::Kind>(in_.Below(4));
      if (e.kind != PathElementDef::Kind::kPulley) e.body = Body();
      e.X_BE = Pose();
      e.radius = 0.01 * Positive();
      e.divisor = Positive();
      if (in_.Flag() && e.kind != PathElementDef::Kind::kPoint && e.kind != PathElementDef::Kind::kPulley) {
        e.has_side = true;
        e.side_body = Body();
        e.side_B = 0.05 * Vector();
      }
      path.elements.push_back(e);
    }
    along = {static_cast<int>(def_.paths.size()), Real()};
    def_.paths.push_back(path);
  }

  fuzz::Source in_;
  bool tame_ = false, rest_ = false;
  MechanismDef def_;
};

}  // namespace

FORK1S_FUZZ_TARGET(mechanism, 800) {
  MechanismSource source(input);
  const Scene scene = source.Draw();
  const SimulationOptions options = source.Options();
  fuzz::Run(scene, options, 6);
}
