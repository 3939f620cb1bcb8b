// The exponential of shaders/rigid.glsl alone, joint by joint and turn by turn.
#include <gpu/support.hpp>
#include <mechanisms.hpp>

namespace fork1s::test {
namespace {

// Many bodies on one base, each on a hinge of its own, far from and across the axes of the root.
Scene Fan(int bodies) {
  MechanismBuilder builder("fan");
  std::vector<std::string> names;
  for (int i = 0; i < bodies; ++i) {
    const double t = 0.7 * i;
    const Vector3 axis = Vector3(std::sin(t), std::cos(2 * t), std::sin(3 * t) + 0.2).normalized();
    BodyDef body;
    body.name = "b" + std::to_string(i);
    body.parent = builder.base();
    body.X_PB =
        RigidTransform(ExpRotation(Vector3(0.1 * i, 0.3, -0.2 * i)), Vector3(std::cos(t), std::sin(t), 0.1));
    body.inertia = testing::Ball(1, 0.1);
    const BodyIndex index = builder.AddBody(body);
    builder.AddJoint(
        JointDef::Hinge("j" + std::to_string(i), index, axis, Vector3(0.1, -0.2, 0.05)).WithSpring(100));
    names.push_back(body.name);
  }
  builder.SetInterfaces(names);
  Scene scene;
  scene.gravity.setZero();
  scene.mechanisms.push_back(builder.definition());
  return scene;
}

TEST_F(GpuPoses, ExponentialAtAnyTurn) {
  std::vector<double> turns = {0,    1e-8, 1e-6,   1e-4,   0.01,   0.3,    0.59, 0.6,
                               0.61, 1.2,  1.5707, 1.5709, 3.1415, 3.1417, 6.28, 9.9};
  for (const double t : std::vector<double>(turns.begin() + 1, turns.end())) turns.push_back(-t);
  const std::size_t near = turns.size();
  for (const double t : {20.0, 50.0, -100.0}) turns.push_back(t);
  const Simulation simulation = SimulationOf(Fan(static_cast<int>(turns.size())));
  const ReducedModel& model = simulation.world().mechanisms()[0].model();
  const RecoveryBuffers buffers(simulation);
  std::vector<float> frame;
  buffers.WriteFrame(simulation, frame);
  // z of the joint displacements asked for, and the poses of what a float makes of them.
  VectorX q(static_cast<Eigen::Index>(turns.size()));
  for (Eigen::Index i = 0; i < q.size(); ++i) q(i) = turns[static_cast<std::size_t>(i)];
  for (int i = 0; i < q.size(); ++i)
    for (int k = 0; k < q.size(); ++k)  // each z moves one hinge
      if (model.Q(i, k) != 0)
        frame[static_cast<std::size_t>(8 + k)] = static_cast<float>(q(i) / model.Q(i, k));
  PoseShaders shaders(kShaders);
  shaders.SetModel(buffers.tables(), buffers.numbers());
  shaders.SetFrame(frame);
  for (const bool twist : {false, true}) {
    if (twist)
      shaders.RunTwist();
    else
      shaders.RunExact(0);
    const std::vector<RigidTransform> poses = PosesOf(shaders.Read());
    double off_near = 0, off_far = 0;
    for (std::size_t b = 1; b < poses.size(); ++b) {
      const auto i = static_cast<Eigen::Index>(b - 1);
      const Vector6 S = model.mechanism->screws().col(i);
      const RigidTransform X =
          Exp(Vector6(S * q(i))) * model.mechanism->body(BodyIndex(static_cast<int>(b))).X_RB0;
      const double off = LogRotation(poses[b].rotation().transpose() * X.rotation()).norm();
      const double away = (poses[b].translation() - X.translation()).norm();  // within 2 m
      if (b <= near)
        off_near = std::max({off_near, off, away / 2});
      else
        off_far = std::max({off_far, off / std::abs(q(i)), away / 2 / std::abs(q(i))});
    }
    std::printf("%s: %.2e rad up to 10 rad, %.2e of the turn beyond\n", twist ? "twist" : "joints", off_near,
                off_far);
    EXPECT_LT(off_near, 1e-6);
    EXPECT_LT(off_far, 1e-7);
  }
}

}  // namespace
}  // namespace fork1s::test
