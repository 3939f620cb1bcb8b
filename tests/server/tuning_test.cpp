// Numbers tuned while it runs, and the past that it goes back to.
#include <fork1s/importer/model_copy.hpp>
#include <nlohmann/json.hpp>

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
    <general name="drive" joint="elbow" biastype="affine" gainprm="8" biasprm="0.2 -8 -0.1" forcerange="-3 3"/>
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

// Two roads: tuned while it runs, and imported from a text in which the number was changed.
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

}  // namespace
}  // namespace fork1s::test
