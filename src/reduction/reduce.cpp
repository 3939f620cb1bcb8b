#include "reduction/reduce_again.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <fmt/format.h>

#include "base/dot_by_fours.hpp"
#include "branch_order.hpp"
#include "elastic_basis.hpp"
#include "hidden_motions.hpp"
#include "inertia_along.hpp"
#include "interior_stops.hpp"
#include "linalg/null_space.hpp"
#include "linalg/products.hpp"
#include "linalg/select.hpp"
#include "linalg/spectrum.hpp"
#include "load_columns.hpp"
#include "mode_choice.hpp"
#include "modes.hpp"

namespace fork1s {
namespace {

// How many elastic directions of each part the interface feels, J_V: 6e x elastic.
std::vector<int> CountFelt(const MatrixX& J_V, const internal::ElasticBasis& basis, double tolerance) {
  std::vector<VectorX> sigma(basis.parts.size());
  double most = 0;
  for (std::size_t p = 0; p < sigma.size(); ++p) {
    const auto& part = basis.parts[p];
    if (part.num_elastic == 0) continue;
    const MatrixX own = J_V.middleCols(part.elastic, part.num_elastic);
    // Squares know the root of rounding, far below every tolerance that is asked for.
    if (tolerance < 1e-6)
      sigma[p] = SingularValues(own);
    else
      sigma[p] =
          EigenvaluesOf(own.rows() < own.cols() ? TimesTransposed(own, own) : TransposedTimes(own, own))
              .cwiseMax(0)
              .cwiseSqrt();
    most = std::max(most, sigma[p].maxCoeff());
  }
  std::vector<int> felt;
  for (const VectorX& values : sigma)
    felt.push_back(static_cast<int>((values.array() > tolerance * most && values.array() > 0).count()));
  return felt;
}

// Those directions: orthonormal Y_r (e x r), part by part.
MatrixX FeltDirections(const MatrixX& J_V, const internal::ElasticBasis& basis,
                       const std::vector<int>& felt) {
  MatrixX Y = MatrixX::Zero(J_V.cols(), std::accumulate(felt.begin(), felt.end(), 0));
  Eigen::Index next = 0;
  for (std::size_t p = 0; p < felt.size(); ++p) {
    const auto& part = basis.parts[p];
    auto own = Y.block(part.elastic, next, part.num_elastic, felt[p]);
    if (felt[p] == part.num_elastic)
      own.setIdentity();
    else if (felt[p] > 0)
      own =
          LeftSingular(J_V.middleCols(part.elastic, part.num_elastic).transpose()).vectors.leftCols(felt[p]);
    next += felt[p];
  }
  return Y;
}

void FillInertia(ReducedModel& model, const Kinematics& kinematics) {
  const Mechanism& mechanism = *model.mechanism;
  internal::InertiaAlong inertia = internal::ComputeInertiaAlong(mechanism, kinematics, model.Q);
  const Eigen::Index r = model.size();
  model.T.setZero(6, mechanism.num_bodies() * r);
  for (int b = 0; b < mechanism.num_bodies(); ++b)
    if (const int last = mechanism.body(BodyIndex(b)).last_joint; last >= 0)
      model.T.middleCols(b * r, r) = inertia.T_of(last);
  model.M = std::move(inertia.M);
  model.M_0z = std::move(inertia.M_0z);
  model.M_00 = inertia.M_00;
}

// Elastic coordinates that are kept, orthonormal: Y = [Y_r, modes, load columns], e x ..
struct KeptColumns {
  MatrixX Y;
  int num_elastic = 0, num_modes = 0;
  std::vector<std::string> load_names;
};

// Q = [N, V Y] and its stiffness.
void FillBasis(ReducedModel& model, const internal::ElasticBasis& basis, const KeptColumns& kept) {
  const int n = model.num_coordinates();
  model.num_free = basis.num_free();
  model.num_elastic = kept.num_elastic;
  model.num_modes = kept.num_modes;
  model.num_loads = static_cast<int>(kept.load_names.size());
  const auto r = model.num_free + kept.Y.cols();
  model.Q.resize(n, r);
  if (model.num_free > 0) model.Q.leftCols(model.num_free) = basis.DenseFree(n);
  for (Eigen::Index i = 0; i < kept.Y.cols(); ++i)
    model.Q.col(model.num_free + i) = basis.ApplyV(kept.Y.col(i), n);
  model.K_r = VectorX::Ones(r);
  model.K_r.head(model.num_free).setZero();
}

// Names the columns of Q and puts them part by part, within each as they were.
void SortByPart(ReducedModel& model, const internal::ElasticBasis& basis, const KeptColumns& kept) {
  std::vector<std::string> names;
  const auto number = [&](const char* kind, int count) {
    for (int i = 1; i <= count; ++i) names.push_back(fmt::format("{} {}", kind, i));
  };
  number("free", model.num_free);
  number("elastic", model.num_elastic);
  number("mode", model.num_modes);
  names.insert(names.end(), kept.load_names.begin(), kept.load_names.end());
  std::vector<int> part, order(static_cast<std::size_t>(model.size()));
  const auto first_entry = [](const auto& column) {
    Eigen::Index i = 0;
    while (column(i) == 0) ++i;
    return i;
  };
  for (int i = 0; i < model.num_free; ++i) part.push_back(basis.PartOfFree(i));
  for (Eigen::Index i = 0; i < kept.Y.cols(); ++i)
    part.push_back(basis.PartOfElastic(first_entry(kept.Y.col(i))));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return part[static_cast<std::size_t>(a)] < part[static_cast<std::size_t>(b)];
  });
  model.Q = Columns(model.Q, order);
  model.K_r = Entries(model.K_r, order);
  model.column_names.clear();
  for (const int i : order) model.column_names.push_back(names[static_cast<std::size_t>(i)]);
}

// Inertia and damping in the coordinates of Q.
void FillOperators(ReducedModel& model, const Kinematics& kinematics) {
  const Mechanism& mechanism = *model.mechanism;
  FillInertia(model, kinematics);
  const auto damps = [](const ClosureDef& c) {
    return !c.rigid.select(Vector6::Zero(), c.damping).isZero(0);
  };
  const auto& closures = mechanism.closures();
  const bool is_diagonal = mechanism.springs().empty() && mechanism.rotations().empty() &&
                           std::none_of(closures.begin(), closures.end(), damps);
  model.D = is_diagonal ? DiagonalCongruence(mechanism.damping(), model.Q)
                        : Congruence(DampingMatrix(mechanism, kinematics, model.q_ref), model.Q);
}

// Modes among which `wanted` are chosen by contribution: all, while their dense eigenproblem stays cheap.
int CandidateModes(int elastic, int wanted) {
  constexpr int kAll = 300;
  return elastic <= kAll ? elastic : std::max(4 * wanted, 48);
}

void FillLoopMetric(ReducedModel& model) {
  const Mechanism& mechanism = *model.mechanism;
  model.h_inverse.resize(mechanism.num_coordinates());
  for (int i = 0; i < model.h_inverse.size(); ++i) {
    const double s = mechanism.Turns(i) ? 1.0 : mechanism.length_scale();
    model.h_inverse(i) = s * s;
  }
  FillDerived(model);
}

Expected<std::vector<BodyIndex>> ResolveInterfaces(const Mechanism& mechanism,
                                                   const ReductionOptions& options) {
  std::vector<BodyIndex> bodies = options.interfaces;
  if (bodies.empty())
    for (const std::string& name : mechanism.definition().interfaces)
      bodies.push_back(mechanism.FindBody(name));
  for (BodyIndex b : bodies)
    FORK1S_REQUIRE(b.valid() && b.value() < mechanism.num_bodies(), "interface body out of range");
  if (bodies.empty())
    return Fail(ErrorCode::kModel, fmt::format("mechanism '{}'", mechanism.name()),
                "names no interface body; say which bodies touch the world");
  for (std::size_t i = 0; i < bodies.size(); ++i)
    if (std::find(bodies.begin(), bodies.begin() + static_cast<std::ptrdiff_t>(i), bodies[i]) !=
        bodies.begin() + static_cast<std::ptrdiff_t>(i))
      return Fail(ErrorCode::kModel, fmt::format("interface '{}'", mechanism.body(bodies[i]).name),
                  "is named twice");
  return bodies;
}

// The directions that the interface feels, `felt` of each part, and modes: as of `last`, if any.
KeptColumns ChooseColumns(ReducedModel& model, const Kinematics& kinematics, const ReductionOptions& options,
                          const internal::ElasticBasis& basis, const MatrixX& J, const MatrixX& J_V,
                          const std::vector<int>& felt, const ReducedModel* last) {
  const Mechanism& mechanism = *model.mechanism;
  const int e = basis.num_elastic();
  KeptColumns kept;
  kept.num_elastic = std::accumulate(felt.begin(), felt.end(), 0);
  const int num_unobserved = e - kept.num_elastic;
  const MechanismDef& def = mechanism.definition();
  const MatrixX Y_r = FeltDirections(J_V, basis, felt);
  if (last)
    model.mode_selection = last->mode_selection;
  else if (options.modes < 0 && def.modes_by_step && options.step > 0)
    model.mode_selection = internal::SelectModesByStep(mechanism, kinematics, basis, Y_r, options.step);
  else
    model.mode_selection = {options.modes >= 0 ? options.modes : def.modes, def.mode_choice};
  const int wanted = model.mode_selection.count;
  if (wanted >= num_unobserved) {
    // All directions: then single joints, and what single loops leave, serve better than what the interface
    // feels most, and modes.
    kept.Y = basis.diagonal ? internal::BranchIdentity(mechanism, basis) : MatrixX(MatrixX::Identity(e, e));
    kept.num_modes = num_unobserved;
    return kept;
  }
  const bool by_contribution = model.mode_selection.choice == ModeChoice::kContribution;
  const auto keep = [&](const MatrixX& modes) {
    kept.num_modes = static_cast<int>(modes.cols());
    kept.Y.resize(e, kept.num_elastic + kept.num_modes);
    kept.Y << Y_r, modes;
  };
  const internal::Modes modes =
      internal::LowestModes(mechanism, kinematics, basis, Y_r, MatrixX(e, 0), MatrixX(0, 0),
                            by_contribution ? CandidateModes(e, wanted) : wanted);
  keep(modes.vectors);
  if (by_contribution && kept.num_modes > wanted) {
    FillBasis(model, basis, kept);
    FillOperators(model, kinematics);
    keep(Columns(modes.vectors, internal::ContributingModes(model, J, mechanism.length_scale(), wanted)));
  }
  return kept;
}

// C_perp of what Q leaves out.
void FillComplement(ReducedModel& model, const internal::ElasticBasis& basis) {
  const int e = basis.num_elastic();
  model.k_inverse.resize(0);
  model.C_perp.resize(0, 0);
  model.has_complement = model.size() - model.num_free < e;
  if (!model.has_complement) return;
  if (basis.diagonal) {
    model.k_inverse = VectorX::Zero(model.num_coordinates());
    for (int i = 0; i < e; ++i)
      model.k_inverse(basis.sprung[static_cast<std::size_t>(i)]) =
          basis.inverse_root(i) * basis.inverse_root(i);
  } else {
    const MatrixX Q_e = Columns(model.Q, model.SprungColumns());
    model.C_perp = DifferenceOfSquares(basis.V, Q_e);
  }
}

void AddLoadColumns(ReducedModel& model, const Kinematics& kinematics, const internal::ElasticBasis& basis,
                    const ReductionLoads& loads, const VectorX& reactions, KeptColumns& kept) {
  internal::LoadColumns columns = internal::ComputeLoadColumns(*model.mechanism, kinematics, model.q_ref,
                                                               basis, kept.Y, loads, reactions);
  if (columns.names.empty()) return;
  const Eigen::Index before = kept.Y.cols();
  kept.Y.conservativeResize(Eigen::NoChange, before + columns.vectors.cols());
  kept.Y.rightCols(columns.vectors.cols()) = columns.vectors;
  kept.load_names = std::move(columns.names);
  FillBasis(model, basis, kept);
  FillComplement(model, basis);
}

}  // namespace

namespace {

// `last`: of the same mechanism, or null.
Expected<ReducedModel> ReduceAt(std::shared_ptr<const Mechanism> mechanism_in, const VectorX& q_ref,
                                const Kinematics& kinematics, const ReductionOptions& options,
                                const ReductionLoads* loads, const VectorX& reactions,
                                const ReducedModel* last) {
  const Mechanism& mechanism = *mechanism_in;
  ReducedModel model;
  model.mechanism = mechanism_in;
  model.q_ref = q_ref;
  auto interfaces = ResolveInterfaces(mechanism, options);
  if (!interfaces) return tl::unexpected(interfaces.error());
  model.interfaces = *interfaces;
  if (!kinematics.S.allFinite())
    return Fail(ErrorCode::kNumerics, fmt::format("mechanism '{}'", mechanism.name()),
                "has a pose that is not finite");
  model.S_ref = kinematics.S;
  model.X_RB_ref = kinematics.X_RB;

  const internal::ElasticBasis basis =
      internal::ComputeElasticBasis(mechanism, kinematics, q_ref, internal::BasisBy::kQuick);
  model.loop_rows = basis.independent_rows;
  if (last && last->loop_rows == model.loop_rows) model.loops = last->loops;
  model.doubts = basis.doubts;

  const double L = mechanism.length_scale();
  MatrixX J = internal::ScaledInterfaceJacobian(mechanism, kinematics, model.interfaces, L);
  for (internal::Hidden hidden = internal::FindHidden(mechanism, kinematics.S, basis, J, model.doubts);
       hidden.count > 0; hidden = internal::FindHidden(mechanism, kinematics.S, basis, J, model.doubts)) {
    if (!options.promote_hidden) return tl::unexpected(internal::HiddenError(mechanism, hidden));
    if (hidden.count > internal::kMostHidden)
      return tl::unexpected(internal::TooManyHidden(mechanism, hidden));
    const BodyIndex body = hidden.body;
    if (!body.valid() ||
        std::find(model.interfaces.begin(), model.interfaces.end(), body) != model.interfaces.end())
      return tl::unexpected(internal::HiddenError(mechanism, hidden));
    model.interfaces.push_back(body);
    model.promoted.push_back(body);
    J = internal::ScaledInterfaceJacobian(mechanism, kinematics, model.interfaces, L);
  }

  // Bodies that loops hold still feel rounding of all springs; none of it is a direction.
  const MatrixX J_V = basis.TimesV(J);
  std::vector<int> felt = basis.HasElasticMotion(ScaledColumns(J, basis.scale / L))
                              ? CountFelt(J_V, basis, options.rank_tolerance)
                              : std::vector<int>(basis.parts.size(), 0);
  // A group of coordinates in which a stop acts on what would be condensed keeps all of its directions, at later
  // references too.
  const auto keep = [&](const std::vector<int>& stops) {
    const std::vector<char> parts = internal::PartsOfStops(mechanism, kinematics, basis, stops);
    for (std::size_t p = 0; p < parts.size(); ++p)
      if (parts[p]) felt[p] = basis.parts[p].num_elastic;
  };
  if (last) model.interior_stops = last->interior_stops;
  keep(model.interior_stops);
  KeptColumns kept;
  const auto choose = [&] {
    kept = ChooseColumns(model, kinematics, options, basis, J, J_V, felt, last);
    FillBasis(model, basis, kept);
    FillComplement(model, basis);
  };
  choose();
  if (const std::vector<int> stops = internal::FindInteriorStops(model, kinematics); !stops.empty()) {
    keep(stops);
    model.interior_stops.insert(model.interior_stops.end(), stops.begin(), stops.end());
    choose();
    model.warnings.push_back(fmt::format(
        "{}{} may act on motions that would be left to statics under weight and the largest actuator forces: the "
        "model keeps all motions of {}",
        internal::NameOfStop(mechanism, stops[0]),
        stops.size() == 1 ? ""
                          : fmt::format(" and {} other stops, bounds or dry frictions", stops.size() - 1),
        stops.size() == 1 ? "its group of joints" : "their groups of joints"));
  }
  // After the stops: load columns would take weight's own answer out of what they are sought in.
  if (loads) AddLoadColumns(model, kinematics, basis, *loads, reactions, kept);
  SortByPart(model, basis, kept);
  FillOperators(model, kinematics);
  FillLoopMetric(model);
  for (BodyIndex b : model.promoted)
    model.warnings.push_back(fmt::format(
        "body '{}' became an interface because a joint without spring before it moves unseen by the others",
        mechanism.body(b).name));
  for (const RankDoubt& doubt : model.doubts)
    model.warnings.push_back(fmt::format("mechanism '{}': {}", mechanism.name(), doubt.Text()));
  if (!model.M.allFinite() || !model.Q.allFinite())
    return Fail(ErrorCode::kNumerics, fmt::format("mechanism '{}'", mechanism.name()),
                "gives a reduced model that is not finite");
  return model;
}

}  // namespace

Expected<ReducedModel> Reduce(std::shared_ptr<const Mechanism> mechanism, const VectorX& q_ref,
                              const ReductionOptions& options, const ReductionLoads* loads) {
  FORK1S_REQUIRE(mechanism != nullptr);
  FORK1S_REQUIRE(q_ref.size() == mechanism->num_coordinates(), q_ref.size(), mechanism->num_coordinates());
  Kinematics kinematics(*mechanism);
  ComputeKinematics(*mechanism, q_ref, kinematics);
  return ReduceAt(mechanism, q_ref, kinematics, options, loads, {}, nullptr);
}

Expected<ReducedModel> ReduceAgain(const ReducedModel& last, const VectorX& q_ref,
                                   const Kinematics& kinematics, const ReductionOptions& options,
                                   const ReductionLoads* loads, const VectorX& reactions) {
  return ReduceAt(last.mechanism, q_ref, kinematics, options, loads, reactions, &last);
}

std::vector<int> ReducedModel::SprungColumns() const {
  std::vector<int> columns;
  for (int i = 0; i < size(); ++i)
    if (K_r(i) != 0) columns.push_back(i);
  return columns;
}

std::vector<int> ReducedModel::FreeColumns() const {
  std::vector<int> columns;
  for (int i = 0; i < size(); ++i)
    if (K_r(i) == 0) columns.push_back(i);
  return columns;
}

void ApplyComplement(const ReducedModel& model, const VectorX& g, VectorX& q_perp) {
  if (model.C_perp.size() > 0) {
    q_perp.noalias() = model.C_perp * g;
    return;
  }
  q_perp = model.k_inverse.cwiseProduct(g);
  const int n = model.num_coordinates();
  for (int i = 0; i < model.size(); ++i) {
    if (model.K_r(i) == 0) continue;
    const double* column = &model.Q(0, i);
    const double share = DotByFours(column, g.data(), n);
    ByFours(n, [&](const auto& at) { at(q_perp.data()) -= share * at(column); });
  }
}

}  // namespace fork1s
