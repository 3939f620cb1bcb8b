// The oracle's quantities by three methods.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fork1s/importer/importer.hpp>
#include <fork1s/reduction/frequencies.hpp>
#include <fork1s/reference/full_simulation.hpp>
#include <fstream>
#include <lab/oracle.hpp>
#include <numbers>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "linalg/products.hpp"
#include "mujoco_model.hpp"

namespace fork1s {
namespace {

using internal::MuJoCoModel;
using internal::RestLoad;
using nlohmann::json;

const char* const kNoReduction = "a reduction is nothing that this method computes";
const char* const kNoRefusal = "knows no interface bodies, so that no joint is hidden from them";

Vector3 Vec3(const json& v) { return {v[0].get<double>(), v[1].get<double>(), v[2].get<double>()}; }

MatrixX Matrix(const json& v) {
  MatrixX m(static_cast<Eigen::Index>(v.size()), static_cast<Eigen::Index>(v.at(0).size()));
  for (Eigen::Index i = 0; i < m.rows(); ++i)
    for (Eigen::Index k = 0; k < m.cols(); ++k)
      m(i, k) = v[static_cast<std::size_t>(i)][static_cast<std::size_t>(k)].get<double>();
  return m;
}

double Apart(const MatrixX& a, const MatrixX& b) {
  if (a.rows() != b.rows() || a.cols() != b.cols()) return INFINITY;
  return (a - b).cwiseAbs().maxCoeff() / b.cwiseAbs().maxCoeff();
}

double Apart(const std::vector<double>& a, const json& expected) {
  if (a.size() < expected.size()) return INFINITY;
  double largest = 0;
  for (std::size_t i = 0; i < expected.size(); ++i)
    largest = std::max(largest, std::abs(a[i] / expected[i].get<double>() - 1));
  return largest;
}

class Case {
 public:
  Case(std::string name, json expected, MechanismDef definition, Mechanism mechanism, MuJoCoModel mujoco)
      : name_(std::move(name)),
        expected_(std::move(expected)),
        definition_(std::move(definition)),
        mechanism_(std::make_shared<const Mechanism>(std::move(mechanism))),
        mujoco_(std::move(mujoco)) {}

  Expected<std::vector<OracleRow>> Compare() {
    if (!expected_["refused"].is_null()) {
      Refusal();
      return rows_;
    }
    for (auto compare : {&Case::MassMatrices, &Case::Compliances, &Case::Frequencies, &Case::Statics})
      if (auto done = (this->*compare)(); !done) return tl::unexpected(done.error());
    return rows_;
  }

 private:
  VectorX Reference() const { return VectorX::Zero(mechanism_->num_coordinates()); }
  Expected<ReducedModel> Reduced(int modes) const {
    ReductionOptions options;
    options.modes = modes;
    return Reduce(mechanism_, Reference(), options);
  }

  void Refusal() {
    const auto model = Reduced(-1);
    bool named = false;
    std::string names;
    for (const json& joint : expected_["refused"]["acceptable_joint_names"]) {
      names += (names.empty() ? "" : " or ") + joint.get<std::string>();
      named = named || (!model && model.error().where == "joint '" + joint.get<std::string>() + "'");
    }
    rows_.push_back({name_,
                     "refused, with the name of the joint",
                     names,
                     {named ? 0 : INFINITY, ""},
                     {{}, kNoRefusal},
                     {{}, kNoRefusal}});
  }

  // Rates [base twist; joint rates] of the reduced coordinates' motions to MuJoCo's velocities.
  Expected<MatrixX> ToMuJoCo() const {
    const int n = mechanism_->num_coordinates(), base = mechanism_->base() == BaseKind::kFloating ? 6 : 0;
    MatrixX P = MatrixX::Zero(mujoco_.MassMatrix().rows(), base + n);
    if (base > 0) {
      // A free joint: velocity of the origin in world axes, then the angular one in body axes.
      P.block<3, 3>(0, 3) = definition_.X_WR.rotation();
      P.block<3, 3>(3, 0).setIdentity();
    }
    for (const Mechanism::Joint& joint : mechanism_->joints()) {
      const int at = mujoco_.JointVelocity(joint.name);
      if (at < 0) return Fail(ErrorCode::kModel, name_, "MuJoCo knows no joint '" + joint.name + "'");
      for (int i = 0; i < joint.size; ++i) P(at + i, base + joint.offset + i) = 1;
    }
    return P;
  }

  // M of rates G [base twist; joint rates] by kinetic energies of the full simulator: products of neighbours,
  // or of all in small mechanisms; the entries that were left out are set to `otherwise`.
  Expected<MatrixX> MassByEnergy(const MatrixX& G, const MatrixX& otherwise) const {
    constexpr Eigen::Index kSmall = 24;
    Scene scene;
    scene.gravity.setZero();
    scene.mechanisms = {definition_};
    auto energy = [&](const VectorX& rates) -> Expected<double> {
      KeyframeDef key;
      key.mechanisms.emplace_back();
      key.mechanisms[0].q = Reference();
      key.mechanisms[0].q_dot = rates.tail(mechanism_->num_coordinates());
      key.mechanisms[0].X_WR = definition_.X_WR;
      if (definition_.base == BaseKind::kFloating) key.mechanisms[0].V_R = rates.head<6>();
      scene.keyframes = {key};
      FullSimulationOptions options;
      options.initial_keyframe = 0;
      auto simulation = FullSimulation::Create(scene, options);
      if (!simulation) return tl::unexpected(simulation.error());
      return simulation->KineticEnergy();
    };
    MatrixX M = otherwise;
    VectorX own(G.cols());
    for (Eigen::Index i = 0; i < G.cols(); ++i) {
      const auto e = energy(G.col(i));
      if (!e) return tl::unexpected(e.error());
      own(i) = *e;
      M(i, i) = 2 * *e;
    }
    for (Eigen::Index i = 0; i < G.cols(); ++i)
      for (Eigen::Index k = i + 1; k < (G.cols() <= kSmall ? G.cols() : std::min(G.cols(), i + 2)); ++k) {
        const auto e = energy(G.col(i) + G.col(k));
        if (!e) return tl::unexpected(e.error());
        M(i, k) = M(k, i) = *e - own(i) - own(k);
      }
    return M;
  }

  Expected<void> MassMatrices() {
    const auto model = Reduced(-1);
    if (!model) return tl::unexpected(model.error());
    const auto P = ToMuJoCo();
    if (!P) return tl::unexpected(P.error());
    const int r = model->size(), base = mechanism_->base() == BaseKind::kFloating ? 6 : 0;
    MatrixX G = MatrixX::Zero(P->cols(), base + r), M(base + r, base + r);
    G.topLeftCorner(base, base).setIdentity();
    G.bottomRightCorner(P->cols() - base, r) = model->Q;
    if (base > 0) M << model->M_00, model->M_0z, model->M_0z.transpose(), model->M;
    if (base == 0) M = model->M;
    const MatrixX PG = Times(*P, G), known = Congruence(mujoco_.MassMatrix(), PG);
    const auto full = MassByEnergy(G, known);
    if (!full) return tl::unexpected(full.error());
    rows_.push_back({name_,
                     "mass matrix",
                     fmt::format("{0} x {0}, of MuJoCo", base + r),
                     {Apart(M, known), ""},
                     {Apart(*full, known), ""},
                     {{},
                      "the case has no mass matrix in its table; mj_fullM, projected on the reduced "
                      "coordinates, stands in for it"}});
    return {};
  }

  Expected<void> Compliances() {
    const char* key =
        expected_["compliance_world"].is_null() ? "compliance_world_base_held" : "compliance_world";
    if (!expected_.contains(key) || expected_[key].is_null()) return {};
    const MatrixX C = Matrix(expected_[key]);
    const auto model = Reduced(-1);
    if (!model) return tl::unexpected(model.error());
    const auto reduced = internal::ComplianceOfReduced(*model);
    if (!reduced) return tl::unexpected(reduced.error());
    const auto full = internal::ComplianceOfFull(definition_, C);
    if (!full) return tl::unexpected(full.error());
    rows_.push_back({name_,
                     "compliance of the interfaces",
                     fmt::format("{0} x {0}, up to {1:.4g}", C.rows(), C.cwiseAbs().maxCoeff()),
                     {Apart(*reduced, C), ""},
                     {Apart(*full, C), ""},
                     {Apart(mujoco_.Compliance(definition_.interfaces), C), ""}});
    return {};
  }

  Expected<void> Frequencies() {
    const json& expected = expected_["frequencies_hz"];
    auto text = [](const json& f) {
      return fmt::format("{} from {:.5g} Hz", f.size(), f.at(0).get<double>());
    };
    Scene scene;
    scene.mechanisms = {definition_};
    const auto full = FullSimulation::Create(scene);
    if (!full) return tl::unexpected(full.error());
    // All modes that there are: the reduced coordinates are then all coordinates.
    const auto whole = Reduced(mechanism_->num_coordinates());
    if (!whole) return tl::unexpected(whole.error());
    rows_.push_back({name_,
                     "frequencies, all coordinates",
                     text(expected["full"]),
                     {Apart(ReducedFrequencies(*whole, 8), expected["full"]), ""},
                     {Apart(full->Frequencies(0, 8), expected["full"]), ""},
                     {Apart(mujoco_.Frequencies(8), expected["full"]), ""}});
    for (const auto& [modes, key] : {std::pair{0, "interface_only"}, {4, "modes_4"}, {8, "modes_8"}}) {
      const auto model = Reduced(modes);
      if (!model) return tl::unexpected(model.error());
      rows_.push_back({name_,
                       fmt::format("frequencies, reduced with {} modes", modes),
                       text(expected[key]),
                       {Apart(ReducedFrequencies(*model, 8), expected[key]), ""},
                       {{}, kNoReduction},
                       {{}, kNoReduction}});
    }
    return {};
  }

  struct Expectation {
    std::vector<std::string> bodies;
    std::vector<RigidTransform> X_WB;
  };

  // Largest error of position and rotation, each as a share of the largest motion.
  double Apart(const std::vector<RigidTransform>& found, const Expectation& expected) const {
    double moved = 0, turned = 0, p_error = 0, R_error = 0;
    for (std::size_t i = 0; i < found.size(); ++i) {
      const RigidTransform X_ref =
          definition_.X_WR * mechanism_->body(definition_.FindBody(expected.bodies[i])).X_RB0;
      const RigidTransform& X = expected.X_WB[i];
      moved = std::max(moved, (X.translation() - X_ref.translation()).norm());
      turned = std::max(turned, LogRotation(X.rotation() * X_ref.rotation().transpose()).norm());
      p_error = std::max(p_error, (found[i].translation() - X.translation()).norm());
      R_error = std::max(R_error, LogRotation(X.rotation().transpose() * found[i].rotation()).norm());
    }
    return std::max(moved > 0 ? p_error / moved : p_error, turned > 1e-6 ? R_error / turned : R_error);
  }
  double Apart(const MatrixX& a, const MatrixX& b) const { return fork1s::Apart(a, b); }
  double Apart(const std::vector<double>& a, const json& b) const { return fork1s::Apart(a, b); }

  RigidTransform ExpectedPose(const std::string& body, const json& pose) const {
    const Matrix3 R_ref = (definition_.X_WR * mechanism_->body(definition_.FindBody(body)).X_RB0).rotation();
    return {Matrix3(ExpRotation(Vec3(pose["rotation_vector_rad"])) * R_ref), Vec3(pose["position_m"])};
  }

  // Adds the deviations of one load to the largest so far; a method that finds no rest says so.
  void AddRest(const RestLoad& load, const Expectation& expected, OracleRow& row) const {
    auto add = [&](OracleDeviation& out, const Expected<std::vector<RigidTransform>>& found) {
      if (!out.why_not.empty()) return;
      if (!found) {
        out = {{}, found.error().message};
        return;
      }
      out.value = std::max(out.value.value_or(0), Apart(*found, expected));
    };
    auto pick = [&](Expected<std::vector<RigidTransform>> all) -> Expected<std::vector<RigidTransform>> {
      if (!all) return all;
      std::vector<RigidTransform> some;
      for (const std::string& body : expected.bodies)
        some.push_back((*all)[static_cast<std::size_t>(definition_.FindBody(body).value())]);
      return some;
    };
    add(row.reduced, pick(internal::RestOfReduced(definition_, load)));
    add(row.full, pick(internal::RestOfFull(definition_, load)));
    add(row.mujoco, mujoco_.Rest(load, expected.bodies));
  }

  Expected<void> Statics() {
    OracleRow row{name_, fmt::format("statics, {} end loads", expected_["statics"].size()), "", {}, {}, {}};
    double turn = 0;
    for (const json& load : expected_["statics"]) {
      const std::string body = load["body"];
      AddRest({body, Vec3(load["force_N"]), Vector3::Zero()}, {{body}, {ExpectedPose(body, load)}}, row);
      turn = std::max(turn, load["max_joint_rotation_deg"].get<double>());
    }
    row.oracle = fmt::format("joints turn by {:.3g}° at most", turn);
    rows_.push_back(row);
    const json& gravity = expected_["gravity_static"];
    if (gravity.is_null()) return {};
    OracleRow weight{name_, "statics under gravity", "", {}, {}, {}};
    Expectation expected;
    for (const auto& [body, pose] : gravity["interfaces"].items()) {
      expected.bodies.push_back(body);
      expected.X_WB.push_back(ExpectedPose(body, pose));
    }
    AddRest({std::nullopt, Vector3::Zero(), Vec3(gravity["gravity_m_per_s2"])}, expected, weight);
    weight.oracle =
        fmt::format("joints turn by {:.3g}° at most", gravity["max_joint_rotation_deg"].get<double>());
    rows_.push_back(weight);
    return {};
  }

  std::string name_;
  json expected_;
  MechanismDef definition_;
  std::shared_ptr<const Mechanism> mechanism_;
  MuJoCoModel mujoco_;
  std::vector<OracleRow> rows_;
};

}  // namespace

std::vector<std::string> OracleCases(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(folder, ignored))
    if (entry.path().extension() == ".json") names.push_back(entry.path().stem().string());
  std::sort(names.begin(), names.end());
  return names;
}

Expected<std::vector<OracleRow>> CompareWithOracle(const std::string& folder, const std::string& case_name) {
  const auto stem = std::filesystem::path(folder) / case_name;
  std::ifstream file(stem.string() + ".json");
  if (!file) return Fail(ErrorCode::kFile, stem.string() + ".json", "cannot be read");
  try {
    json expected;
    file >> expected;
    auto loaded = LoadMechanism(stem.string() + ".xml");
    if (!loaded) return tl::unexpected(loaded.error());
    if (loaded->scene.mechanisms.size() != 1)
      return Fail(ErrorCode::kModel, stem.string(), "a case holds one mechanism");
    auto mechanism = BuildMechanism(loaded->scene.mechanisms[0]);
    if (!mechanism) return tl::unexpected(mechanism.error());
    auto mujoco = MuJoCoModel::Load(stem.string() + ".xml");
    if (!mujoco) return tl::unexpected(mujoco.error());
    MechanismDef definition = mechanism->definition();
    return Case(case_name, std::move(expected), std::move(definition), std::move(*mechanism),
                std::move(*mujoco))
        .Compare();
  } catch (const json::exception& fault) {
    return Fail(ErrorCode::kFormat, stem.string() + ".json", fault.what());
  }
}

}  // namespace fork1s
