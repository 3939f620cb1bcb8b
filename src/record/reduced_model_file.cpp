#include <cstdio>
#include <fork1s/record/reduced_model_file.hpp>
#include <new>

#include "columns.hpp"
#include "hdf5_disk.hpp"
#include "hdf5_file.hpp"
#include "model_store.hpp"
#include "record/output_file.hpp"

namespace fork1s {
namespace {

using namespace internal;

constexpr const char* kModelFormat = "fork1s reduced model";
constexpr int kModelVersion = 7;
constexpr int kOldestModelVersion = 3;  // controls have no activations

std::vector<int> Numbers(const std::vector<BodyIndex>& bodies) {
  std::vector<int> numbers;
  for (BodyIndex b : bodies) numbers.push_back(b.value());
  return numbers;
}

std::vector<BodyIndex> Bodies(const std::vector<int>& numbers, const Mechanism& mechanism, const char* what) {
  std::vector<BodyIndex> bodies;
  for (int i : numbers) {
    if (i < 0 || i >= mechanism.num_bodies())
      throw Hdf5Fault(std::string(what) + " name a body that does not exist");
    bodies.emplace_back(i);
  }
  return bodies;
}

void WriteAll(hid_t file, const ReducedModel& model) {
  const Mechanism& m = *model.mechanism;
  const auto r = static_cast<hsize_t>(model.size());
  const auto b = static_cast<hsize_t>(m.num_bodies());
  WriteAttribute(file, "format", std::string(kModelFormat));
  WriteAttribute(file, "format_version", kModelVersion);
  WriteAttribute(file, "program", std::string("fork1s " FORK1S_VERSION));
  WriteAttribute(
      file, "description",
      std::string("q = q_ref + Q z; M z'' + D z' + diag(K_r) z = Q' f; twist of body B in the root "
                  "frame R about its origin, angular first: T[B] z'; pose of B: exp(T[B] z) X_RB_ref[B]"));
  WriteAttribute(file, "mechanism", m.name());
  WriteAttribute(file, "num_free", model.num_free);
  WriteAttribute(file, "num_elastic", model.num_elastic);
  WriteAttribute(file, "num_modes", model.num_modes);
  WriteAttribute(file, "num_loads", model.num_loads);
  WriteAttribute(file, "has_complement", model.has_complement ? 1 : 0);

  WriteMatrix(file, "Q", model.Q, {"rad or m", "n x r: joint displacements per reduced coordinate"});
  WriteVector(file, "K_r", model.K_r, {"J", "r: diagonal of the stiffness: 0 for free directions, 1 else"});
  WriteMatrix(file, "M", model.M, {"kg m^2", "r x r: mass, with z of unit 1"});
  WriteMatrix(file, "D", model.D, {"J s", "r x r: damping"});
  WriteMatrix(file, "M_00", model.M_00, {"kg, kg m, kg m^2", "6 x 6: inertia of the whole about R's origin"});
  WriteMatrix(file, "M_0z", model.M_0z, {"", "6 x r: inertia that couples base and reduced coordinates"});
  WriteMatrix(file, "S_ref", model.S_ref,
              {"", "6 x n: screws of the joint coordinates at q_ref in R, angular first"});
  WriteVector(file, "q_ref", model.q_ref,
              {"rad or m", "n: joint displacements about which the model is linear"});

  std::vector<double> T;
  T.reserve(static_cast<std::size_t>(b * 6 * r));
  for (int body = 0; body < m.num_bodies(); ++body)
    for (Eigen::Index i = 0; i < 6; ++i)
      for (Eigen::Index k = 0; k < model.size(); ++k) T.push_back(model.T(i, body * model.size() + k));
  WriteArray(file, "T", {b, 6, r}, T.data(), {"", "bodies x 6 x r: twist of each body per rate of z"});
  std::vector<double> X;
  for (const RigidTransform& pose : model.X_RB_ref) {
    for (int i = 0; i < 3; ++i) {
      for (int k = 0; k < 3; ++k) X.push_back(pose.rotation()(i, k));
      X.push_back(pose.translation()(i));
    }
    X.insert(X.end(), {0, 0, 0, 1});
  }
  WriteArray(file, "X_RB_ref", {b, 4, 4}, X.data(), {"m", "bodies x 4 x 4: pose of each body in R at q_ref"});

  WriteVector(file, "k_inverse", model.k_inverse, {"", "n or empty: C_perp = diag(k_inverse) - Q_e Q_e'"});
  WriteMatrix(file, "C_perp", model.C_perp,
              {"", "n x n or empty: static response that the interface does not feel"});
  WriteVector(file, "h_inverse", model.h_inverse, {"", "n: inverse metric of the loop correction"});
  WriteArray(file, "loop_rows", model.loop_rows, {"", "independent rows of the closure Jacobian, from 0"});

  std::vector<std::string> names, interfaces, coordinates;
  for (const auto& body : m.bodies()) names.push_back(body.name);
  for (BodyIndex i : model.interfaces) interfaces.push_back(m.body(i).name);
  for (int i = 0; i < m.num_coordinates(); ++i) coordinates.push_back(m.CoordinateName(i));
  WriteTexts(file, "body_names", names, {});
  WriteTexts(file, "coordinate_names", coordinates, {});
  WriteTexts(file, "column_names", model.column_names, {"", "r: what each column of Q is"});
  WriteTexts(file, "interface_names", interfaces, {"", "bodies that touch the world"});
  WriteArray(file, "interfaces", Numbers(model.interfaces), {"", "their places in body_names, from 0"});
  WriteArray(file, "promoted", Numbers(model.promoted),
             {"", "interfaces added because a joint without spring needs them"});
  WriteTexts(file, "warnings", model.warnings, {});
  const Hdf5 definition = CreateGroup(file, "definition");
  WriteModel(definition.id(), WriteMechanism(m.definition()));
}

void Require(bool good, const char* what) {
  if (!good)
    throw Hdf5Fault(std::string("'") + what + "' does not have the size that the mechanism asks for");
}

Expected<ReducedModel> ReadAll(hid_t file, const std::string& path, std::size_t most) {
  if (!HasAttribute(file, "format") || ReadTextAttribute(file, "format") != kModelFormat)
    return Fail(ErrorCode::kFormat, path, "is an HDF5 file, but no reduced model of fork1s");
  if (const auto version = ReadNumberAttribute(file, "format_version");
      version < kOldestModelVersion || version > kModelVersion)
    return Fail(ErrorCode::kFormat, path,
                "has format version " + std::to_string(version) + ", and this program reads version " +
                    std::to_string(kModelVersion) + "; save the model again");
  const Hdf5 group = OpenGroup(file, "definition");
  auto definition = ReadMechanism(ReadModel(group.id(), most), path);
  if (!definition) return tl::unexpected(definition.error());
  auto built = BuildMechanism(std::move(*definition));
  if (!built) return tl::unexpected(built.error());

  ReducedModel model;
  model.mechanism = std::make_shared<const Mechanism>(std::move(*built));
  const Mechanism& m = *model.mechanism;
  const Eigen::Index n = m.num_coordinates(), b = m.num_bodies();
  model.interfaces = Bodies(ReadList<int>(file, "interfaces", most), m, "interfaces");
  model.promoted = Bodies(ReadList<int>(file, "promoted", most), m, "promoted interfaces");
  model.warnings = ReadTexts(file, "warnings", most);
  model.num_free = static_cast<int>(ReadNumberAttribute(file, "num_free"));
  model.num_elastic = static_cast<int>(ReadNumberAttribute(file, "num_elastic"));
  model.num_modes = static_cast<int>(ReadNumberAttribute(file, "num_modes"));
  model.num_loads = static_cast<int>(ReadNumberAttribute(file, "num_loads"));
  model.column_names = ReadTexts(file, "column_names", most);
  model.has_complement = ReadNumberAttribute(file, "has_complement") != 0;

  model.K_r = ReadVector(file, "K_r", most);
  const Eigen::Index r = model.K_r.size();
  Require(model.num_free >= 0 && model.num_elastic >= 0 && model.num_modes >= 0 && model.num_loads >= 0 &&
              r == Eigen::Index{model.num_free} + model.num_elastic + model.num_modes + model.num_loads,
          "K_r");
  Require(model.column_names.size() == static_cast<std::size_t>(r), "column_names");
  auto matrix = [&](const char* name, Eigen::Index rows, Eigen::Index cols) {
    MatrixX v = ReadMatrix(file, name, most);
    Require(v.rows() == rows && v.cols() == cols, name);
    return v;
  };
  auto vector = [&](const char* name, Eigen::Index size) {
    VectorX v = ReadVector(file, name, most);
    Require(v.size() == size, name);
    return v;
  };
  model.Q = matrix("Q", n, r);
  model.M = matrix("M", r, r);
  model.D = matrix("D", r, r);
  model.M_00 = matrix("M_00", 6, 6);
  model.M_0z = matrix("M_0z", 6, r);
  model.S_ref = matrix("S_ref", 6, n);
  model.q_ref = vector("q_ref", n);
  model.h_inverse = ReadVector(file, "h_inverse", most);
  Require(model.h_inverse.size() == n || model.h_inverse.size() == 0, "h_inverse");
  model.k_inverse = ReadVector(file, "k_inverse", most);
  Require(model.k_inverse.size() == n || model.k_inverse.size() == 0, "k_inverse");
  model.C_perp = ReadMatrix(file, "C_perp", most);
  Require(model.C_perp.size() == 0 || (model.C_perp.rows() == n && model.C_perp.cols() == n), "C_perp");
  Require(!model.has_complement || model.C_perp.size() > 0 || model.k_inverse.size() == n, "k_inverse");
  model.loop_rows = ReadList<int>(file, "loop_rows", most);
  for (std::size_t i = 0; i < model.loop_rows.size(); ++i) {
    const int row = model.loop_rows[i];
    Require(row >= 0 && row < m.num_constraints() && (i == 0 || row > model.loop_rows[i - 1]), "loop_rows");
  }
  Require(model.loop_rows.empty() || model.h_inverse.size() == n, "h_inverse");

  Dims dims;
  const auto T = ReadArray<double>(file, "T", dims, most);
  Require(dims == Dims{static_cast<hsize_t>(b), 6, static_cast<hsize_t>(r)}, "T");
  model.T.resize(6, b * r);
  for (Eigen::Index body = 0; body < b; ++body)
    for (Eigen::Index i = 0; i < 6; ++i)
      for (Eigen::Index k = 0; k < r; ++k)
        model.T(i, body * r + k) = T[static_cast<std::size_t>((body * 6 + i) * r + k)];
  const auto X = ReadArray<double>(file, "X_RB_ref", dims, most);
  Require(dims == Dims{static_cast<hsize_t>(b), 4, 4}, "X_RB_ref");
  for (Eigen::Index body = 0; body < b; ++body) {
    const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> H(X.data() + 16 * body);
    model.X_RB_ref.emplace_back(Matrix3(H.topLeftCorner<3, 3>()), Vector3(H.topRightCorner<3, 1>()));
  }
  if (!model.Q.allFinite() || !model.M.allFinite() || !model.q_ref.allFinite() || !model.T.allFinite())
    throw Hdf5Fault("holds numbers that are not finite");
  FillDerived(model);
  return model;
}

}  // namespace

Expected<void> SaveReducedModel(const ReducedModel& model, const std::string& path) {
  FORK1S_REQUIRE(model.mechanism != nullptr);
  const QuietHdf5 quiet;
  auto output = OutputFile::Create(path, kHdf5File);
  if (!output) return tl::unexpected(output.error());
  DiskState disk;
  try {
    const Hdf5 access = DiskAccess(disk);
    Hdf5 file(H5Fcreate(output->part().c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access.id()), H5Fclose);
    if (!file) throw Hdf5Fault("cannot be written (" + LastHdf5Message() + ')');
    WriteAll(file.id(), model);
    if (!file.Close()) throw Hdf5Fault("cannot be written (" + LastHdf5Message() + ')');
  } catch (const Hdf5Fault& e) {
    if (!disk.failed()) return Fail(ErrorCode::kFile, path, e.what());
  }
  if (disk.failed()) return Fail(ErrorCode::kFile, path, "cannot be written: " + disk.Reason());
  return output->Commit();
}

Expected<ReducedModel> LoadReducedModel(const std::string& path) {
  const QuietHdf5 quiet;
  try {
    const FileFacts facts = InspectFile(path);
    if (!facts.is_hdf5)
      return Fail(ErrorCode::kFormat, path,
                  "is no HDF5 file; reduced models are written by SaveReducedModel");
    const Hdf5 file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
    if (!file)
      return Fail(ErrorCode::kFile, path,
                  "cannot be opened as HDF5 (" + LastHdf5Message() +
                      "); it is cut off or damaged, copy or save it again");
    return ReadAll(file.id(), path, facts.size + (std::size_t{1} << 20));
  } catch (const Hdf5Fault& e) {
    return Fail(e.code(), path, std::string(e.what()) + "; copy or save the file again");
  } catch (const std::bad_alloc&) {
    return Fail(ErrorCode::kFile, path, "does not fit into memory");
  } catch (const std::exception& e) {
    return Fail(ErrorCode::kFormat, path,
                std::string("cannot be read (") + e.what() + "); the file is damaged");
  }
}

}  // namespace fork1s
