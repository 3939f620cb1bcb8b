#include <hdf5.h>

#include <fork1s/record/reduced_model_file.hpp>
#include <fork1s/recovery/recover.hpp>

#include "support.hpp"

namespace fork1s::testing {
namespace {

template <class A, class B>
bool SameBits(const A& a, const B& b) {
  if (a.rows() != b.rows() || a.cols() != b.cols()) return false;
  for (Eigen::Index i = 0; i < a.rows(); ++i)
    for (Eigen::Index k = 0; k < a.cols(); ++k)
      if (std::bit_cast<std::uint64_t>(double(a(i, k))) != std::bit_cast<std::uint64_t>(double(b(i, k))))
        return false;
  return true;
}

void ExpectSame(const ReducedModel& a, const ReducedModel& b) {
  EXPECT_EQ(a.interfaces, b.interfaces);
  EXPECT_EQ(a.promoted, b.promoted);
  EXPECT_EQ(a.warnings, b.warnings);
  EXPECT_EQ(a.num_free, b.num_free);
  EXPECT_EQ(a.num_elastic, b.num_elastic);
  EXPECT_EQ(a.num_modes, b.num_modes);
  EXPECT_EQ(a.has_complement, b.has_complement);
  EXPECT_EQ(a.loop_rows, b.loop_rows);
  EXPECT_TRUE(SameBits(a.q_ref, b.q_ref));
  EXPECT_TRUE(SameBits(a.Q, b.Q));
  EXPECT_TRUE(SameBits(a.K_r, b.K_r));
  EXPECT_TRUE(SameBits(a.M, b.M));
  EXPECT_TRUE(SameBits(a.D, b.D));
  EXPECT_TRUE(SameBits(a.M_00, b.M_00));
  EXPECT_TRUE(SameBits(a.M_0z, b.M_0z));
  EXPECT_TRUE(SameBits(a.S_ref, b.S_ref));
  EXPECT_TRUE(SameBits(a.T, b.T));
  EXPECT_TRUE(SameBits(a.k_inverse, b.k_inverse));
  EXPECT_TRUE(SameBits(a.C_perp, b.C_perp));
  EXPECT_TRUE(SameBits(a.h_inverse, b.h_inverse));
  ASSERT_EQ(a.X_RB_ref.size(), b.X_RB_ref.size());
  for (std::size_t i = 0; i < a.X_RB_ref.size(); ++i) {
    EXPECT_TRUE(SameBits(a.X_RB_ref[i].rotation(), b.X_RB_ref[i].rotation()));
    EXPECT_TRUE(SameBits(a.X_RB_ref[i].translation(), b.X_RB_ref[i].translation()));
  }
}

ReducedModel Model(unsigned seed) {
  RandomMechanismOptions options;
  options.bodies = 12;
  options.rigid_closures = seed % 3 == 1;
  options.springs = seed % 3 == 2;
  options.controls = 1;
  auto mechanism = std::make_shared<const Mechanism>(RandomMechanism(seed, options));
  VectorX q = RandomCoordinates(*mechanism, seed, 0.2);
  CloseLoops(*mechanism, q);
  ReductionOptions reduction;
  reduction.modes = static_cast<int>(seed % 4);
  auto model = Reduce(mechanism, q, reduction);
  if (!model) throw std::runtime_error(model.error().Text());
  return std::move(*model);
}

TEST(ReducedModelFile, KeepsEveryBitAndRecoversTheSamePoses) {
  Folder folder;
  for (unsigned seed = 1; seed <= 9; ++seed) {
    const ReducedModel model = Model(seed);
    auto saved = SaveReducedModel(model, folder / "model.h5");
    ASSERT_TRUE(saved) << saved.error().Text();
    const auto loaded = LoadReducedModel(folder / "model.h5");
    ASSERT_TRUE(loaded) << loaded.error().Text();
    ExpectSame(model, *loaded);

    ReducedState state;
    state.z = RandomSource(seed).Vector(model.size(), 0.05);
    state.w = VectorX::Zero(model.size());
    Configuration before(model), after(*loaded);
    std::vector<RigidTransform> a, b;
    RecoverPosesExact(model, state, before, a);
    RecoverPosesExact(*loaded, state, after, b);
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t i = 0; i < a.size(); ++i) {
      EXPECT_TRUE(SameBits(a[i].rotation(), b[i].rotation()));
      EXPECT_TRUE(SameBits(a[i].translation(), b[i].translation()));
    }
    RecoverPosesTwist(model, state, a);
    RecoverPosesTwist(*loaded, state, b);
    for (std::size_t i = 0; i < a.size(); ++i) EXPECT_TRUE(SameBits(a[i].translation(), b[i].translation()));
  }
}

TEST(ReducedModelFile, DatasetsHaveTheShapesThatTheySay) {
  Folder folder;
  const ReducedModel model = Model(3);
  ASSERT_TRUE(SaveReducedModel(model, folder / "model.h5"));
  EXPECT_FALSE(std::filesystem::exists(folder / "model.h5.part"));
  const hid_t file = H5Fopen((folder / "model.h5").c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  const hid_t T = H5Dopen2(file, "T", H5P_DEFAULT);
  EXPECT_GT(H5Aexists(T, "description"), 0);
  const hid_t space = H5Dget_space(T);
  ASSERT_EQ(H5Sget_simple_extent_ndims(space), 3);
  hsize_t dims[3];
  H5Sget_simple_extent_dims(space, dims, nullptr);
  EXPECT_EQ(dims[0], static_cast<hsize_t>(model.mechanism->num_bodies()));
  EXPECT_EQ(dims[1], 6u);
  EXPECT_EQ(dims[2], static_cast<hsize_t>(model.size()));
  // As h5py sees it, T[body, row, column] is the twist of the body.
  std::vector<double> values(dims[0] * 6 * dims[2]);
  H5Dread(T, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
  EXPECT_EQ(values[(5 * 6 + 4) * dims[2] + 1], model.T_of(BodyIndex(5))(4, 1));
  H5Sclose(space);
  H5Dclose(T);
  H5Fclose(file);
}

// Rows of loops are places in arrays.
TEST(ReducedModelFile, LoopRowsThatRepeatAreRefused) {
  Folder folder;
  int tried = 0;
  for (unsigned seed = 1; seed <= 9; ++seed) {
    ReducedModel model = Model(seed);
    if (model.loop_rows.size() < 2) continue;
    ++tried;
    model.loop_rows[1] = model.loop_rows[0];
    ASSERT_TRUE(SaveReducedModel(model, folder / "model.h5"));
    const auto loaded = LoadReducedModel(folder / "model.h5");
    ASSERT_FALSE(loaded);
    EXPECT_NE(loaded.error().message.find("loop_rows"), std::string::npos) << loaded.error().message;
  }
  EXPECT_GT(tried, 0);
}

TEST(ReducedModelFile, DamagedFilesAreRefused) {
  Folder folder;
  ASSERT_TRUE(SaveReducedModel(Model(1), folder / "model.h5"));
  const std::string bytes = Bytes(folder / "model.h5");
  for (std::size_t i = 0; i < 30; ++i) {
    WriteBytes(folder / "cut.h5", bytes.substr(0, bytes.size() * i / 30));
    const auto cut = LoadReducedModel(folder / "cut.h5");
    ASSERT_FALSE(cut);
    EXPECT_NE(cut.error().where.find("cut.h5"), std::string::npos);
  }
  for (const char* name : {"Q", "T", "X_RB_ref", "interfaces", "definition", "K_r"}) {
    WriteBytes(folder / "bad.h5", bytes);
    const hid_t file = H5Fopen((folder / "bad.h5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    H5Ldelete(file, name, H5P_DEFAULT);
    H5Fclose(file);
    const auto bad = LoadReducedModel(folder / "bad.h5");
    ASSERT_FALSE(bad);
    EXPECT_NE(bad.error().message.find(name), std::string::npos) << bad.error().message;
  }
  EXPECT_FALSE(LoadReducedModel(folder / "none.h5"));
  const auto nowhere = SaveReducedModel(Model(1), folder / "no/folder/model.h5");
  ASSERT_FALSE(nowhere);
  EXPECT_EQ(nowhere.error().code, ErrorCode::kFile);
}

}  // namespace
}  // namespace fork1s::testing
