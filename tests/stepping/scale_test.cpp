// The same scene in other units of length, mass and time: nothing in a step knows how large a metre is.
#include <stepping/support.hpp>

namespace fork1s {
namespace {

// Factors on lengths, masses and times.
struct Scale {
  double length = 1, mass = 1, time = 1;

  double speed() const { return length / time; }
  double force() const { return mass * speed() / time; }
  double torque() const { return force() * length; }
  double inertia() const { return mass * length * length; }
};

// Two fingers of two hinges each on a fixed palm above the ground. They close on a box that stands there and
// press it up; a ball falls beside them and rolls away.
MechanismDef Finger(const Scale& s, const std::string& name, double side) {
  MechanismBuilder builder(name);
  BodyIndex parent = builder.base();
  std::vector<JointIndex> joints;
  for (const char* part : {"_upper", "_lower"}) {
    BodyDef link;
    link.name = name + part;
    link.parent = parent;
    link.X_PB = RigidTransform(s.length * Vector3(0, 0, joints.empty() ? 0 : -0.05));
    link.inertia.mass = s.mass * 0.02;
    link.inertia.center = s.length * Vector3(0, 0, -0.025);
    link.inertia.rotational = s.inertia() * Vector3(5e-6, 5e-6, 1e-6).asDiagonal();
    if (!joints.empty())
      link.geometries.push_back(testing::Geometry(name + "_tip", Sphere{s.length * 0.008}, 0.8,
                                                  RigidTransform(s.length * Vector3(0, 0, -0.05))));
    parent = builder.AddBody(link);
    joints.push_back(builder.AddJoint(JointDef::Hinge(name + part, parent, -side * Vector3::UnitY())
                                          .WithSpring(s.torque() * 0.8, s.torque() * s.time * 0.01)
                                          .WithLimits(-1, 0.9)));
    ControlDef control;
    control.name = name + part;
    control.terms.emplace_back(FreedomRef{joints.back(), 0}, 1.0);
    control.gain = s.torque() * 0.8;
    control.is_setpoint = true;
    builder.AddControl(control);
  }
  builder.SetInterfaces({name + "_lower"});
  MechanismDef def = builder.definition();
  def.bodies[0].name = name + "_base";
  def.X_WR = RigidTransform(s.length * Vector3(-side * 0.045, 0, 0.12));
  return def;
}

// Places of all bodies in lengths of the scene, after every step.
std::vector<double> Places(const Scale& s, Integrator integrator) {
  Scene scene;
  scene.world.push_back(testing::Geometry("ground", Plane{}, 0.6));
  for (const double side : {-1.0, 1.0})
    scene.mechanisms.push_back(Finger(s, side < 0 ? "right" : "left", side));
  scene.free_bodies.push_back(testing::BoxBody("box", s.mass * 0.05, s.length * Vector3(0.02, 0.02, 0.03),
                                               s.length * Vector3(0, 0, 0.0301), 0.8));
  scene.free_bodies.push_back(
      testing::BallBody("ball", s.mass * 0.01, s.length * 0.01, s.length * Vector3(0.01, 0.05, 0.1), 0.3));
  World::Options create;
  create.collision.margin *= s.length;
  World world = testing::MustCreate(scene, create);
  StepOptions step = testing::TwoStage(s.time / 60, s.length / (s.time * s.time) * testing::kDown);
  step.integrator = integrator;
  world.free_bodies()[1].SetState(world.free_bodies()[1].pose(), Vector3(0, 0, 0),
                                  s.speed() * Vector3(0, 1, 0));
  step.material.stiffness *= s.force() / s.length;
  step.material.depth *= s.length;
  step.material.max_push_speed *= s.speed();
  std::vector<double> out;
  for (int i = 0; i < 90; ++i) {
    for (MechanismDynamics& finger : world.mechanisms())
      finger.controls() << std::min(0.6, i / 30.0), std::min(0.4, i / 40.0);
    const StepReport report = world.Step(step);
    EXPECT_TRUE(report.finite && report.stages_converged) << i;
    for (const FreeBody& body : world.free_bodies())
      for (const double x : body.pose().translation()) out.push_back(x / s.length);
    for (const MechanismDynamics& finger : world.mechanisms())
      for (const double q : finger.configuration().q) out.push_back(q);
  }
  EXPECT_GT(world.free_bodies()[0].pose().translation().z(), s.length * 0.0302);  // lifted
  EXPECT_GT(world.free_bodies()[1].pose().translation().y(), s.length * 0.2);     // rolled
  return out;
}

TEST(Scale, AScenesMotionIsScaledWithIt) {
  for (const Integrator integrator : {Integrator::kTwoStage, Integrator::kEuler}) {
    const std::vector<double> truth = Places({}, integrator);
    for (const Scale& s : {Scale{1e-3, 1e-9, 1}, Scale{1e3, 1e9, 1}, Scale{1, 1e6, 1}, Scale{1, 1, 1e-3},
                           Scale{1e-3, 1e-6, 0.03}, Scale{1e3, 1e6, 30}}) {
      SCOPED_TRACE(::testing::Message()
                   << s.length << " " << s.mass << " " << s.time << " " << Name(integrator));
      const std::vector<double> scaled = Places(s, integrator);
      double off = 0;
      for (std::size_t i = 0; i < truth.size(); ++i) off = std::max(off, std::abs(scaled[i] - truth[i]));
      EXPECT_LT(off,
                1e-6);  // of a metre in the scene of a decimetre: the tolerance of a stage, some 1e-8 a step
    }
  }
}

}  // namespace
}  // namespace fork1s
