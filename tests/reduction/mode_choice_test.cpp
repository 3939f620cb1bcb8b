// Modes chosen by what the interface would miss without them.
#include <gtest/gtest.h>
#include <fork1s/importer/importer.hpp>
#include <fork1s/reduction/reduced_model.hpp>
#include <random_mechanism.hpp>

#include <complex>

#include "linalg/products.hpp"
#include "linalg/solve.hpp"

namespace fork1s {
namespace {

using Complex = std::complex<double>;

// Displacement of the first interface body [6 x 6] under unit loads, rotations as arcs at the mechanism's
// length, for motion that implicit Euler at 1/60 s sees at this frequency [Hz]. Base held.
ComplexMatrix DynamicCompliance(const ReducedModel& model, double frequency) {
  const Complex s = 60.0 * (1.0 - std::polar(1.0, -2 * M_PI * frequency / 60)), s2 = s * s;
  ComplexMatrix A{s.real() * model.D + s2.real() * model.M, s.imag() * model.D + s2.imag() * model.M};
  A.re.diagonal() += model.K_r;
  const BodyIndex body = model.interfaces[0];
  Matrix6 about_body = Matrix6::Identity();
  about_body.bottomLeftCorner<3, 3>() = -Skew(model.X_RB_ref[body.u()].translation());
  MatrixX J = about_body * model.T_of(body);
  J.topRows<3>() *= model.mechanism->length_scale();
  const ComplexMatrix moved = SolveComplex(A, {J.transpose(), MatrixX::Zero(J.cols(), 6)});
  return {Times(J, moved.re), Times(J, moved.im)};
}

double Difference(const ComplexMatrix& a, const ComplexMatrix& b) {
  return std::hypot((a.re - b.re).norm(), (a.im - b.im).norm());
}

ReducedModel With(MechanismDef def, int modes, ModeChoice choice) {
  def.modes = modes;
  def.mode_choice = choice;
  auto built = BuildMechanism(def);
  EXPECT_TRUE(built) << built.error().Text();
  auto mechanism = std::make_shared<const Mechanism>(std::move(*built));
  auto model = Reduce(mechanism, VectorX::Zero(mechanism->num_coordinates()));
  EXPECT_TRUE(model) << model.error().Text();
  return std::move(*model);
}

// Half of the men's lowest modes are mirror images that leave the sheet alone.
TEST(ModeChoice, FewThatCountAreWorthMoreThanFewThatAreLow) {
  auto imported = LoadMechanism(FORK1S_SOURCE_DIR "/scenes/firemen.xml");
  ASSERT_TRUE(imported) << imported.error().Text();
  const MechanismDef& def = imported->scene.mechanisms[0];
  const ReducedModel all = With(def, 1000, ModeChoice::kLowest);
  auto error = [&](int modes, ModeChoice choice) {
    const ReducedModel model = With(def, modes, choice);
    double worst = 0;
    for (double f = 0.1; f < 30; f *= 1.05)
      worst = std::max(worst, Difference(DynamicCompliance(model, f), DynamicCompliance(all, f)));
    return worst;
  };
  // Scores are first-order: the choice may miss by a little what it could have been.
  for (int k : {2, 4}) EXPECT_LT(error(k, ModeChoice::kContribution), 1.01 * error(k, ModeChoice::kLowest));
  EXPECT_LT(error(8, ModeChoice::kContribution), 0.7 * error(8, ModeChoice::kLowest));
}

TEST(ModeChoice, AllModesAreTheSameEitherWay) {
  testing::RandomMechanismOptions options;
  options.bodies = 12;
  options.interfaces = 1;
  for (unsigned seed = 0; seed < 10; ++seed) {
    SCOPED_TRACE(seed);
    options.base = seed % 2 ? BaseKind::kFloating : BaseKind::kFixed;
    const MechanismDef def = testing::RandomMechanismDef(seed, options);
    const ReducedModel a = With(def, 1000, ModeChoice::kLowest),
                       b = With(def, 1000, ModeChoice::kContribution);
    EXPECT_TRUE(a.Q == b.Q);
    const ReducedModel two = With(def, 2, ModeChoice::kContribution);
    EXPECT_LE(two.num_modes, 2);
    EXPECT_TRUE(two.M.allFinite());
    if (a.num_modes <= 2) continue;
    // Kept modes are columns of all modes, in order of frequency. All of them are no longer modes but single
    // joints, so that the highest is not there to be found.
    const ReducedModel most = With(def, a.num_modes - 1, ModeChoice::kLowest);
    int at = 0, missing = 0;
    for (int i = 0; i < two.size(); ++i) {
      int found = at;
      while (found < most.size() && !most.Q.col(found).isApprox(two.Q.col(i), 1e-9)) ++found;
      missing += found == most.size() ? 1 : 0;
      if (found < most.size()) at = found + 1;
    }
    EXPECT_LE(missing, 1);
  }
}

}  // namespace
}  // namespace fork1s
