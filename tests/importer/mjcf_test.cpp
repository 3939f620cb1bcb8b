// Models written as MJCF: MuJoCo and the importer read the file as they read the model.
#include <fmt/format.h>

#include "helpers.hpp"
#include "importer/mjcf.hpp"
#include "urdf_text.hpp"

namespace fork1s::testing_importer {
namespace {

struct Written {
  MjcfModel model;
  ImportedScene again;
  std::unique_ptr<mjModel, void (*)(mjModel*)> mujoco{nullptr, mj_deleteModel};
};

Written MustWrite(const std::string& path, const ImportOptions& options = {}) {
  Written out;
  auto model =
      ModelAsMjcf(path, options, std::filesystem::path(WriteFile("out/folder", "")).parent_path(), "meshes");
  if (!model) throw std::runtime_error(model.error().Text());
  for (const auto& [name, content] : model->meshes) WriteFile("out/meshes/" + name, content);
  const std::string file = WriteFile("out/model.xml", model->text);
  ImportOptions start;
  start.keyframe = model->start;
  auto again = LoadMechanism(file, start);
  if (!again) throw std::runtime_error(again.error().Text() + "\n" + model->text);
  char message[1000] = "";
  out.mujoco.reset(mj_loadXML(file.c_str(), nullptr, message, sizeof message));
  if (!out.mujoco) throw std::runtime_error(message);
  out.model = std::move(*model);
  out.again = std::move(*again);
  return out;
}

// M(q) of all joints of MuJoCo's model, in the order of the mechanism's coordinates.
MatrixX MassMatrix(const mjModel& m, const Mechanism& mechanism, const VectorX& q) {
  const std::unique_ptr<mjData, void (*)(mjData*)> d(mj_makeData(&m), mj_deleteData);
  std::vector<int> dofs;
  for (const auto& joint : mechanism.joints()) {
    const int id = mj_name2id(&m, mjOBJ_JOINT, joint.name.c_str());
    EXPECT_GE(id, 0) << joint.name;
    EXPECT_EQ(joint.size, 1) << joint.name;
    d->qpos[m.jnt_qposadr[id]] += q[joint.offset];
    dofs.push_back(m.jnt_dofadr[id]);
  }
  mj_forward(&m, d.get());
  std::vector<double> full(static_cast<std::size_t>(m.nv * m.nv));
  mj_fullM(&m, d.get(), full.data());
  MatrixX M(dofs.size(), dofs.size());
  for (std::size_t i = 0; i < dofs.size(); ++i)
    for (std::size_t j = 0; j < dofs.size(); ++j)
      M(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
          full[static_cast<std::size_t>(dofs[i] * m.nv + dofs[j])];
  return M;
}

// M(q) = Σ J_bᵀ I_b J_b + armature.
MatrixX MassMatrix(const Mechanism& mechanism, const VectorX& q) {
  Kinematics kinematics(mechanism);
  ComputeKinematics(mechanism, q, kinematics);
  MatrixX M = MatrixX::Zero(q.size(), q.size());
  for (int b = 0; b < mechanism.num_bodies(); ++b) {
    const RigidTransform& X_RB = kinematics.X_RB[static_cast<std::size_t>(b)];
    // Twists of the Jacobian are about R's origin, in its axes.
    MatrixX J = BodyJacobian(mechanism, kinematics, BodyIndex(b));
    for (Eigen::Index i = 0; i < J.cols(); ++i) J.col(i) = AdjointApply(X_RB.inverse(), Vector6(J.col(i)));
    M += J.transpose() * mechanism.definition().bodies[static_cast<std::size_t>(b)].inertia.Matrix() * J;
  }
  for (const auto& joint : mechanism.definition().joints)
    for (std::size_t i = 0; i < mechanism.joints().size(); ++i)
      if (mechanism.joints()[i].name == joint.name)
        M(mechanism.joints()[i].offset, mechanism.joints()[i].offset) += joint.freedoms[0].armature;
  return M;
}

void ExpectSameMechanism(const MechanismDef& a, const MechanismDef& b) {
  EXPECT_EQ(a.base, b.base);
  EXPECT_EQ(a.interfaces, b.interfaces);
  EXPECT_LT(PoseDifference(a.X_WR, b.X_WR), 1e-12);
  ASSERT_EQ(a.bodies.size(), b.bodies.size());
  for (std::size_t i = 0; i < a.bodies.size(); ++i) {
    EXPECT_EQ(a.bodies[i].name, b.bodies[i].name);
    EXPECT_NEAR(a.bodies[i].inertia.mass, b.bodies[i].inertia.mass, 1e-11);
    ASSERT_EQ(a.bodies[i].geometries.size(), b.bodies[i].geometries.size()) << a.bodies[i].name;
    for (std::size_t g = 0; g < a.bodies[i].geometries.size(); ++g) {
      const GeometryDef &of_a = a.bodies[i].geometries[g], &of_b = b.bodies[i].geometries[g];
      EXPECT_LT(PoseDifference(of_a.X_BG, of_b.X_BG), 1e-6) << a.bodies[i].name;
      EXPECT_EQ(of_a.shape.index(), of_b.shape.index());
      EXPECT_EQ(of_a.contype, of_b.contype);
      EXPECT_NEAR(of_a.friction, of_b.friction, 1e-12);
    }
  }
  ASSERT_EQ(a.joints.size(), b.joints.size());
  for (std::size_t j = 0; j < a.joints.size(); ++j) {
    ASSERT_EQ(a.joints[j].freedoms.size(), b.joints[j].freedoms.size());
    for (std::size_t i = 0; i < a.joints[j].freedoms.size(); ++i) {
      const FreedomDef &f = a.joints[j].freedoms[i], &g = b.joints[j].freedoms[i];
      EXPECT_LT((f.screw_B - g.screw_B).norm(), 1e-12);
      for (const auto& [x, y] : {std::pair{f.stiffness, g.stiffness}, std::pair{f.damping, g.damping},
                                 std::pair{f.armature, g.armature}, std::pair{f.rest, g.rest}})
        EXPECT_NEAR(x, y, 1e-12 * (1 + std::abs(x))) << a.joints[j].name;
      for (const auto& [x, y] : {std::pair{f.lower, g.lower}, std::pair{f.upper, g.upper}})
        EXPECT_TRUE(x == y || std::abs(x - y) < 1e-12) << a.joints[j].name << " " << x << " " << y;
    }
  }
  ASSERT_EQ(a.closures.size(), b.closures.size());
  for (std::size_t i = 0; i < a.closures.size(); ++i) {
    EXPECT_LT(PoseDifference(a.closures[i].X_AJ, b.closures[i].X_AJ), 1e-12);
    EXPECT_LT(PoseDifference(a.closures[i].X_BJ, b.closures[i].X_BJ), 1e-12);
    EXPECT_EQ(a.closures[i].rigid, b.closures[i].rigid);
  }
  ASSERT_EQ(a.couplings.size(), b.couplings.size());
  for (std::size_t i = 0; i < a.couplings.size(); ++i) {
    for (int k = 0; k < 5; ++k)
      EXPECT_NEAR(a.couplings[i].polynomial[k], b.couplings[i].polynomial[k], 1e-15);
    ASSERT_EQ(a.couplings[i].terms.size(), b.couplings[i].terms.size());
    for (std::size_t k = 0; k < a.couplings[i].terms.size(); ++k)
      EXPECT_NEAR(a.couplings[i].terms[k].second, b.couplings[i].terms[k].second, 1e-15);
  }
  ASSERT_EQ(a.controls.size(), b.controls.size());
  for (std::size_t i = 0; i < a.controls.size(); ++i) {
    EXPECT_EQ(a.controls[i].name, b.controls[i].name);
    EXPECT_NEAR(a.controls[i].gain, b.controls[i].gain, 1e-12 * std::abs(a.controls[i].gain));
  }
  EXPECT_EQ(a.springs.size(), b.springs.size());
  EXPECT_EQ(a.force_limits.size(), b.force_limits.size());
}

// Same scene when it is read again; mass matrices of MuJoCo's model at 20 random poses.
void ExpectSame(const Written& w) {
  const Scene &a = w.model.imported.scene, &b = w.again.scene;
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.world.size(), b.world.size());
  EXPECT_EQ(a.free_bodies.size(), b.free_bodies.size());
  EXPECT_LT((a.gravity - b.gravity).norm(), 1e-15);
  ASSERT_EQ(a.mechanisms.size(), b.mechanisms.size());
  std::mt19937 random(7);
  std::uniform_real_distribution<double> angle(-1.5, 1.5);
  int coordinates = 6 * static_cast<int>(a.free_bodies.size());
  for (std::size_t i = 0; i < a.mechanisms.size(); ++i) {
    ExpectSameMechanism(a.mechanisms[i], b.mechanisms[i]);
    const Mechanism built = MustBuild(a.mechanisms[i]);
    coordinates += built.num_coordinates() + (a.mechanisms[i].base == BaseKind::kFloating ? 6 : 0);
    for (int pose = 0; pose < 20; ++pose) {
      VectorX q(built.num_coordinates());
      for (double& x : q) x = angle(random);
      const MatrixX M = MassMatrix(built, q);
      EXPECT_LT((MassMatrix(*w.mujoco, built, q) - M).norm(), 1e-9 * M.norm());
    }
  }
  EXPECT_EQ(w.mujoco->nv, coordinates);
  ASSERT_EQ(w.model.imported.initial_keyframe < 0, w.again.initial_keyframe < 0);
  if (w.again.initial_keyframe < 0) return;
  const KeyframeDef &k = a.keyframes[static_cast<std::size_t>(w.model.imported.initial_keyframe)],
                    &l = b.keyframes[static_cast<std::size_t>(w.again.initial_keyframe)];
  for (std::size_t i = 0; i < k.mechanisms.size(); ++i) {
    EXPECT_LT((k.mechanisms[i].q - l.mechanisms[i].q).norm(), 1e-12);
    EXPECT_LT((k.mechanisms[i].controls - l.mechanisms[i].controls).norm(), 1e-12);
    EXPECT_LT(PoseDifference(k.mechanisms[i].X_WR, l.mechanisms[i].X_WR), 1e-12);
  }
}

// Two fingers of which one mimics the other, stops, dry friction, an effort and a mesh.
std::string GripperText() {
  WriteFile("wedge.obj", "v 0 0 0\nv .1 0 0\nv 0 .08 0\nv 0 0 .06\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
  const std::string box =
      Part("collision", "<box size=\".04 .02 .1\"/>", "<origin xyz=\"0 0 .2\" rpy=\".1 .2 .3\"/>");
  return Robot(
      Link("base", kInertial + box) + Link("left", kInertial + box) +
      Link("right", kInertial + MeshPart("collision", "wedge.obj", "1 1 -2")) + Link("massless", "") +
      Link("slider", kInertial + Part("visual", "<sphere radius=\".02\"/>")) +
      Joint("l", "revolute", "base", "left",
            "<origin xyz=\".1 .2 .3\" rpy=\".4 .5 .6\"/><axis xyz=\"0 .6 .8\"/><limit lower=\"-.7\" "
            "upper=\".9\" effort=\"12\" velocity=\"3\"/><dynamics damping=\".3\" friction=\".2\"/>") +
      Joint("r", "revolute", "base", "right",
            "<origin xyz=\"-.1 .2 .3\"/><axis xyz=\"0 1 0\"/><limit lower=\"-1\" upper=\"1\" "
            "effort=\"0\" velocity=\"0\"/><mimic joint=\"l\" multiplier=\"-1.5\" offset=\"0\"/>") +
      Joint("f", "fixed", "left", "massless", "<origin xyz=\"0 0 .3\"/>") +
      Joint("s", "prismatic", "massless", "slider",
            "<axis xyz=\"1 0 0\"/><limit lower=\"-.01\" upper=\".05\" effort=\"5\" velocity=\"1\"/>"));
}

TEST(Mjcf, OfAUrdfIsTheSameModel) {
  const std::string path = WriteFile("gripper.urdf", GripperText());
  const Written w = MustWrite(path);
  ExpectSame(w);
  EXPECT_EQ(w.model.meshes.size(), 1u);
  EXPECT_EQ(w.model.start, "");
}

TEST(Mjcf, HasBasePosesGainsInterfaceAndGround) {
  const std::string path = WriteFile("gripper.urdf", GripperText());
  for (const BaseKind base : {BaseKind::kFixed, BaseKind::kFloating, BaseKind::kDriven}) {
    ImportOptions options;
    options.base = base;
    options.base_pose = RigidTransform(Quaternion(.8, .6, 0, 0), Vector3(.1, .2, 1.5));
    options.pd = PdGains{40, 3};
    options.joint_pd["s"] = {500, 7};
    options.joint_coordinates["l"] = .4;
    options.interfaces = {"slider", "right"};
    options.modes = 3;
    options.ground = true;
    const Written w = MustWrite(path, options);
    ExpectSame(w);
    EXPECT_EQ(w.again.scene.mechanisms[0].force_limits.size(),
              w.model.imported.scene.mechanisms[0].force_limits.size());
    EXPECT_EQ(w.model.start, "start");
    EXPECT_EQ(w.again.scene.mechanisms[0].modes, 3);
    EXPECT_NEAR(w.model.imported.scene.world[0].X_BG.translation().z(),
                w.again.scene.world[0].X_BG.translation().z(), 1e-12);
  }
}

TEST(Mjcf, KeepsLinksFromTouchingTheirParents) {
  const std::string box = Part("collision", "<box size=\".1 .1 .1\"/>");
  const std::string path =
      WriteFile("boxes.urdf", Robot(Link("base", kInertial + box) + Link("a", kInertial + box) +
                                    Joint("j", "continuous", "base", "a")));
  const Written w = MustWrite(path);
  ASSERT_EQ(w.mujoco->nexclude, 1);
  EXPECT_EQ(w.mujoco->exclude_signature[0], (1 << 16) + 2);
}

// A motor gives way to PD control, keyframes get the new number of inputs, and nameless elements get names.
TEST(Mjcf, HasGainsInPlaceOfMotors) {
  const std::string path = WriteFile("arm.xml", R"(<mujoco><worldbody><body><freejoint/><geom size='.1'/>
      <body pos='.1 0 0'><joint name='a' axis='0 1 0' ref='10'/><geom size='.1' pos='.2 0 0'/>
      <body pos='.4 0 0'><joint axis='0 1 0' stiffness='3' springref='4'/><geom size='.1' pos='.2 0 0'/></body></body>
      </body></worldbody><actuator><motor name='m' joint='a'/></actuator>
      <keyframe><key qpos='0 0 1 1 0 0 0 .3 .4' qvel='1 2 3 4 5 6 7 8' ctrl='2'/></keyframe></mujoco>)");
  ImportOptions options;
  options.pd = PdGains{30, 2};
  options.keyframe = "key0";
  const Written w = MustWrite(path, options);
  ExpectSame(w);
  ASSERT_EQ(w.mujoco->nu, 1);
  EXPECT_STREQ(mj_id2name(w.mujoco.get(), mjOBJ_ACTUATOR, 0), "a");
  EXPECT_EQ(w.model.start, "key0");
  const KeyframeDef &k = w.model.imported.scene.keyframes[0], &l = w.again.scene.keyframes[0];
  EXPECT_LT((k.mechanisms[0].q_dot - l.mechanisms[0].q_dot).norm(), 1e-12);
  EXPECT_LT((k.mechanisms[0].V_R - l.mechanisms[0].V_R).norm(), 1e-12);
}

TEST(Mjcf, KeyframesWrittenAnew_KeepTimesAndActivations) {
  const auto text = [](const char* act) {
    return fmt::format(R"(<mujoco><worldbody><body><joint name='a'/><joint name='b' axis='0 1 0'/>
      <joint name='c' axis='1 0 0'/><geom size='.1'/></body></worldbody>
      <actuator><intvelocity name='v' joint='a' kp='20' actrange='-2 2'/>
        <general name='f' joint='b' dyntype='filter' dynprm='.1' gainprm='5'/></actuator>
      <keyframe><key name='k' time='2.5' qpos='.1 .2 .3' act='{}' ctrl='0 .4'/></keyframe></mujoco>)",
                       act);
  };
  ImportOptions options;
  options.joint_pd["c"] = {30, 2};
  const Written steady = MustWrite(WriteFile("steady.xml", text(".7 .4")), options);
  ASSERT_EQ(steady.mujoco->na, 2);
  EXPECT_EQ(steady.mujoco->key_time[0], 2.5);
  EXPECT_NEAR(steady.mujoco->key_act[0], .7, 1e-12);
  EXPECT_NEAR(steady.mujoco->key_act[1], .4, 1e-12);
  EXPECT_FALSE(HasNote(steady.model.imported.report, ImportNote::Kind::kChanged, "activations"));
  const Written lagging = MustWrite(WriteFile("lagging.xml", text(".7 0")), options);
  EXPECT_EQ(lagging.mujoco->key_act[1], 0);
  EXPECT_NEAR(lagging.mujoco->key_ctrl[1], .4, 1e-12);
  EXPECT_FALSE(HasNote(lagging.model.imported.report, ImportNote::Kind::kChanged, "keyframe 'k'"));
}

// Height fields and textures lie where the model's file says, seen from where the text will lie.
TEST(Mjcf, FindsTheFilesOfTheModel) {
  WriteFile("assets/wedge.obj",
            "v 0 0 0\nv .1 0 0\nv 0 .08 0\nv 0 0 .06\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
  const std::string path = WriteFile("mesh.xml", R"(<mujoco><compiler meshdir='assets'/>
      <asset><mesh name='w' file='wedge.obj'/></asset><worldbody><body><joint name='a' axis='0 1 0'/>
      <geom type='mesh' mesh='w'/></body></worldbody></mujoco>)");
  ExpectSame(MustWrite(path));
}

TEST(Mjcf, OfMjcfIsTheSameModel) {
  for (const char* scene : {"fourbar_gripper", "two_link_arm", "excavator"})
    ExpectSame(MustWrite(std::string(FORK1S_SOURCE_DIR) + "/scenes/" + scene + ".xml"));
}

TEST(Mjcf, RefusesWhatItCannotWrite) {
  const std::string path = WriteFile("gripper.urdf", GripperText());
  ImportOptions options;
  options.stiffness_scale = 2;
  const auto refused = ModelAsMjcf(path, options, ".", "meshes");
  ASSERT_FALSE(refused);
  EXPECT_CONTAINS(refused.error().Text(), "stiffness-scale");
}

TEST(Mjcf, RefusesABaseOfTreesBesideIt) {
  const std::string path =
      WriteFile("hand.xml", R"(<mujoco><worldbody><body name="palm"><geom size=".05"/></body>
    <body name="left"><joint name="l"/><geom size=".02"/></body>
    <body name="right"><joint name="r"/><geom size=".02"/></body></worldbody></mujoco>)");
  ImportOptions options;
  options.base = BaseKind::kFloating;
  ASSERT_TRUE(LoadMechanism(path, options));
  const auto refused = ModelAsMjcf(path, options, ".", "meshes");
  ASSERT_FALSE(refused);
  EXPECT_CONTAINS(refused.error().Text(), "option base: body 'palm' is the base of trees beside it");
}

// Vertices that stand still here do so in the file written: the same coordinates.
TEST(Mjcf, VerticesOfAFlexStandStill) {
  const std::string path = WriteFile("flex.xml", R"(<mujoco><worldbody>
    <flexcomp name="cloth" type="grid" count="2 2 1" spacing=".03 .03 .03" pos="0 0 1" radius=".002" dim="2" mass=".1"/>
    <body name="arm" pos="0 0 2"><joint name="j" axis="0 1 0"/><geom type="sphere" size=".1" mass="1"/></body>
    </worldbody></mujoco>)");
  const Written written = MustWrite(path);
  EXPECT_EQ(written.mujoco->nv, 1);
  EXPECT_EQ(written.mujoco->nflex, 1);
  EXPECT_EQ(written.again.scene.mechanisms.size(), 1u);
}

}  // namespace
}  // namespace fork1s::testing_importer
