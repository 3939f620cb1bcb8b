// Numbers tuned while it runs, and the past that it goes back to.
#include <fork1s/reduction/compliance.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <nlohmann/json.hpp>

#include "importer/model_copy.hpp"
#include "support.hpp"

namespace fork1s::test {
namespace {

constexpr const char* kArm = R"(<mujoco model="arm">
  <custom><text name="fork1s_interface" data="lower"/></custom>
  <worldbody>
    <body name="upper" pos="0 0 1">
      <joint name="shoulder" axis="0 1 0" range="-90 90" stiffness="3" springref="20" damping="0.4"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03" mass="0.5" friction="0.6 0.01"/>
      <body name="lower" pos="0.3 0 0">
        <joint name="elbow" axis="0 1 0" damping="0.3"/>
        <geom type="box" size="0.1 0.02 0.02" pos="0.1 0 0" mass="0.5"/>
      </body>
    </body>
    <body name="ball" pos="0 0 3"><freejoint/><geom size="0.1"/></body>
  </worldbody>
  <actuator>
    <position name="servo" joint="shoulder" gear="2" kp="20" kv="1" ctrlrange="-1 1"/>
    <general name="drive" joint="elbow" biastype="affine" gainprm="2" biasprm="0.2 -8 -0.1" forcerange="-3 3"/>
  </actuator>
</mujoco>)";

struct Loaded {
  Scene scene;
  std::vector<ServoShare> servos;
};

Loaded Load(const std::string& text) {
  auto imported = LoadMechanismFromString(text, "arm.xml");
  if (!imported) throw std::runtime_error(imported.error().Text());
  Loaded out{std::move(imported->scene), {}};
  for (const ServoGains& s : imported->report.servos)
    out.servos.push_back({s.mechanism, s.control, s.stiffness, s.damping, s.bias, s.at_reference});
  return out;
}

LiveSimulation Start(const Loaded& loaded) {
  ModelFile file;
  file.servos = loaded.servos;
  auto live = LiveSimulation::Create(loaded.scene, {}, "arm", file);
  if (!live) throw std::runtime_error(live.error().Text());
  return std::move(*live);
}

int Find(const LiveSimulation& live, const std::string& of, const std::string& owner,
         const std::string& quantity) {
  const auto& all = live.settings().tunables;
  for (std::size_t i = 0; i < all.size(); ++i)
    if (Name(all[i].of) == of && all[i].owner == owner && Name(all[i].quantity) == quantity)
      return static_cast<int>(i);
  throw std::runtime_error("no " + quantity + " of " + owner);
}

// Two methods: tuned while it runs, and imported from a text in which the number was changed.
TEST(Tuning, DoesWhatAChangedFileDoes) {
  using C = ModelChange;
  struct TuneCase {
    const char *of, *owner, *quantity;
    double value;
    C change;
  };
  const double degree = std::acos(-1.0) / 180;
  const std::vector<TuneCase> cases = {
      {"actuator", "servo", "stiffness", 50, {C::Of::kActuator, C::Quantity::kStiffness, "servo", 50, 0, {}}},
      {"actuator", "servo", "damping", 2.5, {C::Of::kActuator, C::Quantity::kDamping, "servo", 2.5, 0, {}}},
      {"actuator", "drive", "stiffness", 20, {C::Of::kActuator, C::Quantity::kStiffness, "drive", 20, 0, {}}},
      {"actuator", "drive", "damping", 0.7, {C::Of::kActuator, C::Quantity::kDamping, "drive", 0.7, 0, {}}},
      {"actuator",
       "drive",
       "force_upper",
       1,
       {C::Of::kActuator, C::Quantity::kForceRange, "drive", -3, 1, {}}},
      {"joint", "elbow", "stiffness", 4, {C::Of::kJoint, C::Quantity::kStiffness, "elbow", 4, 0, {}}},
      {"joint", "shoulder", "damping", 1.5, {C::Of::kJoint, C::Quantity::kDamping, "shoulder", 1.5, 0, {}}},
      {"joint",
       "shoulder",
       "upper",
       0.2,
       {C::Of::kJoint, C::Quantity::kRange, "shoulder", -90 * degree, 0.2, {}}},
      {"body", "upper", "friction", 0.3, {C::Of::kBody, C::Quantity::kFriction, "upper", 0.3, 0, {}}}};
  for (const TuneCase& c : cases) {
    SCOPED_TRACE(std::string(c.of) + ' ' + c.owner + ' ' + c.quantity);
    const Loaded before = Load(kArm);
    LiveSimulation tuned = Start(before);
    const int index = Find(tuned, c.of, c.owner, c.quantity);
    const auto refusal = tuned.Handle(Set("tune", c.value, index));
    ASSERT_FALSE(refusal) << refusal->sentence;
    const auto text = ChangeModelText("arm.xml", kArm, {c.change}, "");
    ASSERT_TRUE(text) << text.error().Text();
    EXPECT_TRUE(text->notes.empty());
    LiveSimulation file = Start(Load(text->text));
    EXPECT_NEAR(file.settings().tunables[static_cast<std::size_t>(index)].value, c.value, 1e-8);
    for (LiveSimulation* live : {&tuned, &file})
      for (int i = 0; i < 40; ++i) live->Advance(kNoLimit);
    for (const char* body : {"upper", "lower"}) {
      const RigidTransform X = tuned.simulation().Pose(body), Y = file.simulation().Pose(body);
      EXPECT_LT((X.translation() - Y.translation()).norm(), 1e-7) << body;
      EXPECT_LT((X.rotation() - Y.rotation()).norm(), 1e-6) << body;
    }
  }
}

// What a class says of an actuator is that of others as well, and what it says of its gain is not known.
TEST(Tuning, ParametersOfAClassAreNotWritten) {
  const std::string text =
      R"(<mujoco><default><default class="strong"><general biastype="affine" biasprm="0.2 -8 -0.1"/>
    </default></default><worldbody><body><joint name="j" axis="0 1 0"/><geom size="0.1"/></body></worldbody>
    <actuator><general class="strong" name="drive" joint="j" gainprm="2"/></actuator></mujoco>)";
  using C = ModelChange;
  const auto copy =
      ChangeModelText("arm.xml", text, {{C::Of::kActuator, C::Quantity::kStiffness, "drive", 20, 0, {}}}, "");
  ASSERT_TRUE(copy) << copy.error().Text();
  EXPECT_EQ(copy->text, text);
  ASSERT_EQ(copy->notes.size(), 1u);
  EXPECT_NE(copy->notes[0].find("its biasprm is that of a class"), std::string::npos) << copy->notes[0];
}

TEST(Tuning, MassBringsItsInertia) {
  LiveSimulation live = Start(Load(kArm));
  ASSERT_FALSE(live.Handle(Set("tune", 2, Find(live, "body", "ball", "mass"))));
  const FreeBody& ball = live.simulation().world().free_bodies()[0];
  EXPECT_NEAR(ball.inertia().mass, 2, 1e-12);
  EXPECT_NEAR(ball.inertia().rotational(0, 0), 0.4 * 2 * 0.01, 1e-12);
  EXPECT_TRUE(live.Handle(Set("tune", -1, Find(live, "body", "ball", "mass"))));
  EXPECT_TRUE(live.Handle(Set("tune", 1, 9999)));
}

TEST(Tuning, GoesBackToAMomentOfThePastBitByBit) {
  LiveSimulation live = Live("hand.xml", Recovery::kExact, "open");
  std::vector<std::uint64_t> hashes = {0};
  for (int i = 0; i < 60; ++i) {
    live.Advance(kNoLimit);
    live.Capture(1);
    hashes.push_back(live.simulation().HashState());
  }
  Command back = Of(Command::Kind::kResume);
  back.index = 33;  // kept are multiples of some small number
  ASSERT_FALSE(live.Handle(back));
  const auto at = std::find(hashes.begin(), hashes.end(), live.simulation().HashState()) - hashes.begin();
  EXPECT_LE(at, 33);
  EXPECT_GE(at, 24);
  live.Advance(kNoLimit);
  EXPECT_EQ(live.simulation().HashState(), hashes[static_cast<std::size_t>(at) + 1]);
  // Of a model that was built since: where it stood.
  ASSERT_FALSE(live.Handle(Set("friction", 0.5)));
  back.index = 50;
  ASSERT_FALSE(live.Handle(back));
  back.index = 1;
  EXPECT_TRUE(live.Handle(back));  // before the first that was kept
}

ControlTrack Table() { return {{"servo", "drive"}, {0, 0.3, 0.6}, {{0.1, 0}, {0.8, 0.4}, {-0.5, 0.2}}}; }

TEST(Table, MovesALiveSimulationAsARun) {
  const Loaded loaded = Load(kArm);
  SimulationOptions options;
  options.step.controls_move = true;
  auto push = PushTrack::Parse("lower:0,0,2:0.2..0.4", "--push");
  ASSERT_TRUE(push);
  const PushTrack pushes{{*push}};
  auto run = Simulation::Create(loaded.scene, options);
  ASSERT_TRUE(run);
  auto live = LiveSimulation::Create(loaded.scene, options, "arm");
  ASSERT_TRUE(live);
  Table().Start(*run);
  live->Play(Table(), pushes);
  for (int round = 0; round < 2; ++round) {
    while (live->simulation().steps() < 60) live->Advance(kNoLimit);
    if (round == 0) {
      for (std::int64_t i = 0; i < live->simulation().steps(); ++i) {
        const double end = static_cast<double>(i + 1) * run->dt();
        Table().Apply(end, *run);
        for (const PushNow& p : pushes.Over(end, run->dt(), *run))
          run->ApplyWrench(p.body, p.force_W, p.moment_W, p.point_W);
        run->Step();
      }
    }
    EXPECT_EQ(live->simulation().HashState(), run->HashState());
    ASSERT_FALSE(live->Handle(Of(Command::Kind::kReset)));
    EXPECT_EQ(live->simulation().controls()(0), 0.1);
  }
}

TEST(Table, DrivesABaseAsARun) {
  Loaded loaded = Load(kArm);
  loaded.scene.mechanisms[0].base = BaseKind::kDriven;
  SimulationOptions options;
  options.step.controls_move = true;
  auto run = Simulation::Create(loaded.scene, options);
  auto live = LiveSimulation::Create(loaded.scene, options, "arm");
  ASSERT_TRUE(run);
  ASSERT_TRUE(live);
  ControlTrack table{{}, {0, 0.4, 0.8}, {{0.1, 0}, {0.5, 0.3}, {-2.5, 0.6}}};  // at more than 1 m/s
  for (const std::string& name : run->control_names())
    if (name.ends_with(".z") || name.ends_with(".ry")) table.names.push_back(name);
  ASSERT_EQ(table.names.size(), 2u);
  table.Start(*run);
  live->Play(table, {});
  const int lower = run->FindBody("lower");
  for (int i = 0; i < 60; ++i) {
    table.Apply(static_cast<double>(i + 1) * run->dt(), *run);
    run->Step();
    while (live->simulation().steps() <= i) live->Advance(kNoLimit);
    EXPECT_LT((live->simulation().Pose(lower).translation() - run->Pose(lower).translation()).norm(), 1e-9)
        << i;
    // Built again, it counts from another pose and goes on along the same path.
    if (i == 30) {
      ASSERT_FALSE(live->Handle(Set("friction", 0.5)));
      break;
    }
  }
  while (live->simulation().time() < 0.6) live->Advance(kNoLimit);
  EXPECT_NEAR(
      live->simulation().BasePose(0).translation().z() - run->scene().mechanisms[0].X_WR.translation().z(),
      -2.5, 1e-9);
}

TEST(Table, LosesAControlToItsSliderUntilTheReset) {
  SimulationOptions options;
  options.step.controls_move = true;
  auto live = LiveSimulation::Create(Load(kArm).scene, options, "arm");
  ASSERT_TRUE(live);
  live->Play(Table(), {});
  ASSERT_FALSE(live->Handle(Set("control", 0.9, 0)));
  while (live->simulation().steps() < 60) live->Advance(kNoLimit);  // the table ends at 36
  EXPECT_EQ(live->simulation().controls()(0), 0.9);
  EXPECT_NEAR(live->simulation().controls()(1), 0.2, 1e-12);
  const auto settings = nlohmann::json::parse(*live->Capture(1).settings);
  EXPECT_NEAR(settings["controls"][0], 0.9, 1e-12);
  EXPECT_NEAR(settings["controls"][1], 0.2, 1e-12);
  // Built again it goes on where it stands.
  ASSERT_FALSE(live->Handle(Set("friction", 0.5)));
  EXPECT_EQ(live->simulation().start_controls()(0), 0.9);
  EXPECT_NEAR(live->simulation().start_controls()(1), 0.2, 1e-12);
  ASSERT_FALSE(live->Handle(Of(Command::Kind::kReset)));
  while (live->simulation().steps() < 60) live->Advance(kNoLimit);
  EXPECT_NEAR(live->simulation().controls()(0), -0.5, 1e-12);
}

// Pulled up, the shoulder's servo holds it there, through its gear; the drive has no set-point in radians but
// comes to rest in the same place.
TEST(Tuning, HoldMakesPresentPositionsTheSetPoints) {
  LiveSimulation live = Start(Load(kArm));
  const int lower = live.simulation().FindBody("lower");
  for (int i = 0; i < 60; ++i) {
    live.Handle(Pull(lower, Vector3::Zero(), Vector3(0.2, 0, 1.2)));
    live.Advance(kNoLimit);
  }
  const auto& configuration = live.simulation().world().mechanisms()[0].configuration();
  const VectorX q = configuration.q;
  EXPECT_GT(q.cwiseAbs().minCoeff(), 0.02);
  ASSERT_FALSE(live.Handle(Of(Command::Kind::kHold)));
  live.Advance(kNoLimit);
  const double servo = live.simulation().controls()(0), drive = live.simulation().controls()(1);
  EXPECT_NEAR(servo, std::clamp(2 * q(0), -1.0, 1.0), 1e-9);
  EXPECT_NEAR(2 * drive + 0.2 - 8 * q(1), 0, 1e-9);
  const auto settings = nlohmann::json::parse(*live.Capture(1).settings);
  EXPECT_NEAR(settings["controls"][0], servo, 1e-9);
  LiveSimulation none = Start(Load(R"(<mujoco><worldbody><body><joint name="j" axis="0 1 0" stiffness="1"/>
    <geom size="0.1"/></body></worldbody></mujoco>)"));
  EXPECT_TRUE(none.Handle(Of(Command::Kind::kHold)));
}

// ---- An ellipsoid of compliance that is dragged ----

// Three links that are bent, in a plane: what forces in it do at the tip's origin three servos decide.
constexpr const char* kFinger = R"(<mujoco model="finger">
  <custom><text name="fork1s_interface" data="tip"/></custom>
  <worldbody>
    <body name="first" pos="0 0 1" euler="0 0 40">
      <joint name="root" axis="0 1 0" damping="0.1"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03" mass="0.5"/>
      <body name="second" pos="0.3 0 0" euler="0 50 0">
        <joint name="middle" axis="0 1 0" stiffness="2" damping="0.1"/>
        <geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.03" mass="0.3"/>
        <body name="third" pos="0.2 0 0" euler="0 40 0">
          <joint name="end" axis="0 1 0" damping="0.1"/>
          <geom type="capsule" fromto="0 0 0 0.1 0 0" size="0.03" mass="0.2"/>
          <body name="tip" pos="0.1 0 0"><geom size="0.03"/></body>
        </body>
      </body>
    </body>
    <body name="ball" pos="0 0 3"><freejoint/><geom size="0.1"/></body>
  </worldbody>
  <actuator>
    <position name="root" joint="root" kp="30" gear="2"/>
    <position name="middle" joint="middle" kp="20"/>
    <position name="end" joint="end" kp="8"/>
  </actuator>
</mujoco>)";

Matrix3 ComplianceOfTip(const LiveSimulation& live) {
  const MechanismDynamics& m = live.simulation().world().mechanisms()[0];
  return WalkCompliance(m.mechanism(), m.configuration().q, m.model().interfaces).C.bottomRightCorner<3, 3>();
}

Command Shape(const LiveSimulation& live, const std::string& body, const Matrix3& C) {
  Command c;
  c.kind = Command::Kind::kShape;
  c.body = live.simulation().FindBody(body);
  c.compliance = C;
  c.factor = 1000;
  return c;
}

TEST(Shape, StiffnessesFollowTheEllipsoid) {
  LiveSimulation live = Start(Load(kFinger));
  const Matrix3 before = ComplianceOfTip(live),
                R = ExpRotation(Vector3(0, 0, 40 * 3.14159265358979323846 / 180));
  // Pulled out by a half along a direction in the plane, then pushed in across it.
  const Vector3 u = R * Vector3(0.6, 0, 0.8), v = R * Vector3(0.8, 0, -0.6);
  Matrix3 wished = before;
  for (const auto& [along, by] : {std::pair(u, 1.5), std::pair(v, 0.8)}) {
    const Matrix3 S = Matrix3::Identity() + (std::sqrt(by) - 1) * along * along.transpose();
    wished = S * wished * S;
    const auto refusal = live.Handle(Shape(live, "tip", wished));
    ASSERT_FALSE(refusal) << refusal->sentence;
    const Matrix3 now = ComplianceOfTip(live);
    EXPECT_LT((now - wished).cwiseAbs().maxCoeff(), 1e-3 * wished.cwiseAbs().maxCoeff()) << now << "\n\n"
                                                                                         << wished;
  }
  EXPECT_GT((wished - before).norm(), 0.1 * before.norm());
  // What was asked for is among the numbers that are tuned, and nothing else changed.
  int changed = 0;
  for (const Tunable& t : live.settings().tunables) {
    EXPECT_TRUE(t.value == t.original || t.quantity == Tunable::Quantity::kStiffness) << t.owner;
    changed += t.value != t.original;
  }
  EXPECT_EQ(changed, 4) << "three servos, and the spring beside one of them";
}

// It would stand still for minutes.
TEST(Shape, IsNotAskedOfAThousandJoints) {
  std::string text = "<mujoco><worldbody>", end;
  for (int i = 0; i < 70; ++i) {
    text += "<body pos='0.1 0 0'>";
    for (const char* axis : {"1 0 0", "0 1 0", "0 0 1"})
      text += std::string("<joint axis='") + axis + "' stiffness='5' damping='0.1'/>";
    text += "<geom size='0.02'/>";
    end += "</body>";
  }
  LiveSimulation live = Start(Load(text + end + "</worldbody></mujoco>"));
  Command c;
  c.kind = Command::Kind::kShape;
  c.body = static_cast<int>(live.simulation().bodies().size()) - 1;
  c.compliance = Matrix3::Identity();
  c.factor = 10;
  const auto refusal = live.Handle(c);
  ASSERT_TRUE(refusal);
  EXPECT_NE(refusal->sentence.find("210"), std::string::npos) << refusal->sentence;
}

TEST(Shape, ComesAsNearAsJointsCan) {
  LiveSimulation live = Start(Load(kFinger));
  const Matrix3 before = ComplianceOfTip(live);
  // Out of its plane nothing gives way.
  EXPECT_FALSE(live.Handle(Shape(live, "tip", before + 0.1 * before.trace() * Matrix3::Identity())));
  const Matrix3 now = ComplianceOfTip(live);
  EXPECT_TRUE(now.allFinite());
  EXPECT_LT((now - before).norm(), 2 * before.norm());
  EXPECT_TRUE(live.Handle(Shape(live, "ball", before))) << "no spring holds it";
  EXPECT_TRUE(live.Handle(Shape(live, "tip", Matrix3::Zero())));
  EXPECT_FALSE(ParseCommand(R"({"type":"shape","body":1,"compliance":[1,2,3],"factor":2})"));
  EXPECT_FALSE(ParseCommand(R"({"type":"shape","body":1,"compliance":[1,2,3,0,0,0]})"));
  EXPECT_TRUE(ParseCommand(R"({"type":"shape","body":1,"compliance":[1,2,3,0,0,0],"factor":2})"));
}

TEST(Shape, StiffnessesStayWithinTheFactor) {
  LiveSimulation live = Start(Load(kFinger));
  const Matrix3 before = ComplianceOfTip(live);
  for (const double by : {10.0, 0.01, 3.0}) {
    Command c = Shape(live, "tip", by * before);
    c.viewer = 4;
    c.factor = 2;
    ASSERT_FALSE(live.Handle(c));
    for (const Tunable& t : live.settings().tunables) {
      EXPECT_GE(t.value, std::min(t.original, t.original / 2)) << t.owner;
      EXPECT_LE(t.value, std::max(t.original, t.original * 2)) << t.owner;
    }
    // Every stiffness stands at a bound, and so the compliance does.
    const double reached = by > 1 ? 2 : 0.5;
    EXPECT_LT((ComplianceOfTip(live) - reached * before).norm(), 1e-3 * before.norm()) << by;
    const auto replies = live.PopReplies();
    ASSERT_EQ(replies.size(), 1u);
    EXPECT_EQ(replies[0].viewer, 4);
    const auto reply = nlohmann::json::parse(replies[0].message);
    const double xx = before(0, 0);
    EXPECT_NEAR(reply["asked"][0], by * xx, 1e-3 * xx);
    EXPECT_NEAR(reply["reached"][0], reached * xx, 1e-3 * xx);
    EXPECT_NEAR(reply["stiffest"][0], 0.5 * xx, 1e-3 * xx);
    EXPECT_NEAR(reply["softest"][0], 2 * xx, 1e-3 * xx);
    EXPECT_EQ(reply["stiffnesses"], 4);
    EXPECT_EQ(reply["at_bound"], 4);
  }
  Command c = Shape(live, "tip", before);
  c.factor = 1;
  const auto refusal = live.Handle(c);
  ASSERT_TRUE(refusal);
  EXPECT_NE(refusal->sentence.find("factor"), std::string::npos) << refusal->sentence;
}

}  // namespace
}  // namespace fork1s::test
