// Which settings a wanted accuracy leads to, with runs whose error is a power of the step in place of simulations.
#include "study/accuracy_choice.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace fork1s::test {
namespace {

constexpr double kDt = 1.0 / 64;  // s: its halves are exact numbers
constexpr double kRounding = 1e-9;

// Runs that are off by first (dt / kDt)^order along x, estimated as ErrorEstimate does: from a quarter of the step, by
// the order of the integrator.
struct PowerLaw {
  double first = 1e-3;  // m
  double order = 2;
  double Error(double dt) const { return first * std::pow(dt / kDt, order); }
  double Estimate(const AccuracySetting& s) const {
    const double power = s.integrator == Integrator::kEuler ? 4 : 16;
    return power / (power - 1) * (Error(s.dt) - Error(s.dt / 4));
  }
  Expected<AccuracyTrial> operator()(const AccuracySetting& s) const {
    AccuracyTrial trial;
    trial.setting = s;
    trial.error.total = trial.error.time = Estimate(s);
    trial.error.motion = 1;
    trial.positions = {Vector3::Zero(), Vector3(Error(s.dt), 0, 0)};
    return trial;
  }
};

AccuracyChoice Choose(double metres,
                      const std::function<Expected<AccuracyTrial>(const AccuracySetting&)>& run,
                      Integrator integrator = Integrator::kTwoStage, bool may_change = false) {
  WantedAccuracy wanted;
  wanted.metres = metres;
  auto choice = ChooseForAccuracy(wanted, {kDt, integrator, -1, 0.1}, may_change, run);
  EXPECT_TRUE(choice.has_value());
  return *choice;
}

const AccuracyTrial& Chosen(const AccuracyChoice& c) { return c.trials[c.chosen]; }

TEST(AccuracyChoice, FirstTrialThatMeetsIsTakenAfterARunByHalfItsStep) {
  const PowerLaw run{1e-3, 2};
  const AccuracyChoice c = Choose(1e-3 * (1 + kRounding), run);
  EXPECT_TRUE(c.met());
  EXPECT_EQ(c.chosen, 0u);
  ASSERT_EQ(c.trials.size(), 2u);
  EXPECT_EQ(c.trials[1].setting.dt, kDt / 2);
  EXPECT_NEAR(c.trials[0].order, 2, kRounding);
  EXPECT_NEAR(c.trials[0].apart, 0.75e-3, kRounding * 1e-3);
  EXPECT_EQ(Choose(1e-3 * (1 - kRounding), run).chosen, 1u);
}

// Each halving divides the error by 2^order, so the step is known in closed form: the first (1/2)^k with
// first 2^(-k order) within what is wanted. For both orders the estimate after the run by half the step is the error.
TEST(AccuracyChoice, StepFollowsFromTheOrder) {
  for (const double order : {1.0, 2.0})
    for (const int k : {1, 3, 5, 6}) {
      const PowerLaw run{1e-3, order};
      const AccuracyChoice c = Choose(run.Error(std::ldexp(kDt, -k)) * (1 + kRounding), run);
      ASSERT_TRUE(c.met()) << order << " " << k;
      EXPECT_EQ(Chosen(c).setting.dt, std::ldexp(kDt, -k)) << order;
      EXPECT_EQ(c.trials.size(), c.chosen + 2);
      EXPECT_NEAR(Chosen(c).order, order, 1e-6);
      EXPECT_NEAR(Chosen(c).off(), run.Error(Chosen(c).setting.dt), 1e-6 * run.Error(Chosen(c).setting.dt));
    }
}

// By a quarter of the step and second order, an error e of first order is estimated as 16/15 (1 - 1/4) e = 0.8 e. Only
// the run by half the step shows e.
TEST(AccuracyChoice, ErrorOfFirstOrderIsNotMetByItsEstimateAlone) {
  const PowerLaw run{1e-3, 1};
  ASSERT_NEAR(run(AccuracySetting{kDt, Integrator::kTwoStage, -1, 0})->error.total, 0.8e-3, 1e-12);
  const AccuracyChoice c = Choose(0.9e-3, run);
  EXPECT_TRUE(c.met());
  EXPECT_EQ(c.chosen, 1u);
  EXPECT_EQ(c.trials.size(), 3u);
  EXPECT_NEAR(c.trials[0].off(), 1e-3, 1e-9);
}

// An order below the least is taken as the least, 1/2: 1 - 2^(-p) and 1 - 4^(-p) of p = 0.3 over those of 1/2.
TEST(AccuracyChoice, OrderBelowTheLeastIsBoundedByIt) {
  const PowerLaw run{1e-3, 0.3};
  const AccuracyChoice c = Choose(0.7e-3, run);
  ASSERT_TRUE(c.met());
  EXPECT_EQ(c.trials[0].order, kMinErrorOrder);
  const double by_estimate = (1 - std::pow(4, -0.3)) / (1 - std::pow(4, -0.5)),
               by_distance = (1 - std::pow(2, -0.3)) / (1 - std::pow(2, -0.5));
  EXPECT_NEAR(c.trials[0].off(), 1e-3 * std::max(by_estimate, by_distance), 1e-9);
  EXPECT_EQ(c.chosen, 0u);
  EXPECT_GT(Choose(0.67e-3, run).chosen, 0u);
}

TEST(AccuracyChoice, OrderAboveTheMostIsBoundedByIt) {
  const AccuracyChoice c = Choose(2e-3, PowerLaw{1e-3, 4});
  ASSERT_TRUE(c.met());
  EXPECT_EQ(c.trials[0].order, kMaxErrorOrder);
}

// Six halvings and no more: the last step tried is 1/64 of the first, and that of the smallest estimate is chosen.
TEST(AccuracyChoice, NeverMetEndsAtTheShortestStepWithTheBest) {
  for (const double order : {2.0, 1.0, 0.3}) {
    const AccuracyChoice c = Choose(1e-12, PowerLaw{1e-3, order});
    EXPECT_EQ(c.end, AccuracyChoice::End::kSmallestStep);
    ASSERT_EQ(c.trials.size(), 7u) << order;
    EXPECT_EQ(c.trials.back().setting.dt, kMinStepShare * kDt);
    EXPECT_EQ(c.chosen, 6u);
  }
}

TEST(AccuracyChoice, ErrorWithoutAnOrderIsNeverMetAndTheSmallestIsChosen) {
  int runs = 0;
  const double estimates[] = {5e-3, 7e-3, 4e-3, 2e-3, 6e-3, 3e-3, 8e-3};
  const AccuracyChoice c = Choose(1e-3, [&](const AccuracySetting& s) -> Expected<AccuracyTrial> {
    AccuracyTrial trial;
    trial.setting = s;
    trial.error.total = trial.error.time = estimates[runs++];
    return trial;
  });
  EXPECT_EQ(c.end, AccuracyChoice::End::kSmallestStep);
  EXPECT_EQ(c.trials.size(), std::size(estimates));
  EXPECT_EQ(c.chosen, 3u);
}

// Estimates within what is wanted, and every run elsewhere: ten trials and a run by half the step of the last.
TEST(AccuracyChoice, RunsThatDisagreeWithTheirHalvesAreNeverMet) {
  double place = 0;
  const AccuracyChoice c = Choose(1e-3, [&](const AccuracySetting& s) -> Expected<AccuracyTrial> {
    AccuracyTrial trial;
    trial.setting = s;
    trial.error.total = trial.error.time = 0.9e-3;
    trial.positions = {Vector3(place += 1, 0, 0)};
    return trial;
  });
  EXPECT_EQ(c.end, AccuracyChoice::End::kTrials);
  EXPECT_EQ(c.trials.size(), kMaxAccuracyTrials + 1);
  EXPECT_EQ(c.trials.back().setting.dt, std::ldexp(kDt, -static_cast<int>(kMaxAccuracyTrials)));
  // 1 m apart and an estimate that does not fall: by the least order, 1/(1 - 2^-0.5) m.
  EXPECT_EQ(c.trials[0].order, kMinErrorOrder);
  EXPECT_NEAR(c.trials[0].off(), 1 / (1 - std::sqrt(0.5)), 1e-12);
}

TEST(AccuracyChoice, RunThatBlowsUpIsNeitherMetNorChosen) {
  const PowerLaw law{1e-3, 1};
  const AccuracyChoice c = Choose(0.3e-3, [&](const AccuracySetting& s) {
    auto trial = law(s);
    trial->finite = s.dt < kDt / 2;
    if (!trial->finite) trial->error.total = 0;
    return trial;
  });
  EXPECT_TRUE(c.met());
  EXPECT_EQ(Chosen(c).setting.dt, kDt / 4);
  // Half a step that blows up says that the whole one is not within anything.
  const AccuracyChoice never = Choose(10, [&](const AccuracySetting& s) {
    auto trial = law(s);
    trial->finite = s.dt == kDt;
    return trial;
  });
  EXPECT_FALSE(never.met());
  EXPECT_TRUE(Chosen(never).finite == (never.chosen == 0));
  EXPECT_TRUE(std::isinf(never.trials[0].apart));
}

// Of the truth the estimate by backward Euler is exact for errors of first order.
TEST(AccuracyChoice, IntegratorChangesWhereItMayAndOnlyOnce) {
  const PowerLaw run{1e-3, 1};
  const AccuracyChoice kept = Choose(0.3e-3, run, Integrator::kEuler, false);
  EXPECT_EQ(Chosen(kept).setting.integrator, Integrator::kEuler);
  EXPECT_EQ(Chosen(kept).setting.dt, kDt / 4);
  const AccuracyChoice changed = Choose(0.3e-3, run, Integrator::kEuler, true);
  EXPECT_TRUE(changed.met());
  EXPECT_EQ(changed.trials[1].setting.integrator, Integrator::kTwoStage);
  EXPECT_EQ(changed.trials[1].setting.dt, kDt);
  EXPECT_EQ(Chosen(changed).setting.dt, kDt / 4);
}

// 4 modes first, then twice those that were kept, as long as more modes change something and lead the error.
TEST(AccuracyChoice, ModesDoubleWhereTheInteriorLeads) {
  const AccuracyChoice c = Choose(0.22e-3, [&](const AccuracySetting& s) -> Expected<AccuracyTrial> {
    AccuracyTrial trial;
    trial.setting = s;
    trial.modes_kept = std::max(0, s.modes);
    trial.leaves_something = trial.modes_kept < 16;
    trial.error.interior = 1e-3 / (1 + trial.modes_kept);
    trial.error.time = 0.01e-3 * s.dt / kDt;
    trial.error.total = trial.error.interior;
    trial.positions = {Vector3::Zero()};
    return trial;
  });
  EXPECT_TRUE(c.met());
  EXPECT_EQ(c.trials[1].setting.modes, 4);
  EXPECT_EQ(Chosen(c).setting.modes, 4);  // 1 mm / 5 = 0.2 mm, whatever the step
  EXPECT_EQ(Chosen(c).setting.dt, kDt);
}

TEST(AccuracyChoice, RefreshAngleHalvesDownToAHundredthWhereScrewsAreSummed) {
  const AccuracyChoice c = Choose(1e-6, [&](const AccuracySetting& s) -> Expected<AccuracyTrial> {
    AccuracyTrial trial;
    trial.setting = s;
    trial.exact = false;
    trial.error.total = trial.error.interior = 1e-3;
    return trial;
  });
  EXPECT_EQ(c.end, AccuracyChoice::End::kTrials);
  // 0.1, 0.05, 0.025, 0.0125, 0.00625 rad, then the step.
  EXPECT_EQ(c.trials[4].setting.refresh_angle, 0.1 / 16);
  EXPECT_EQ(c.trials.back().setting.refresh_angle, 0.1 / 16);
  EXPECT_EQ(c.trials.size(), kMaxAccuracyTrials);
}

TEST(AccuracyChoice, ShareIsOfTheMotionAndErrorsOfARunAreHandedOn) {
  WantedAccuracy wanted;
  wanted.share = 1.01e-3;  // of 1 m of motion
  const auto choice =
      ChooseForAccuracy(wanted, {kDt, Integrator::kTwoStage, -1, 0.1}, false, PowerLaw{1e-3, 2});
  ASSERT_TRUE(choice.has_value());
  EXPECT_TRUE(choice->met());
  EXPECT_EQ(choice->chosen, 0u);
  const auto failed = ChooseForAccuracy(wanted, {kDt, Integrator::kTwoStage, -1, 0.1}, false,
                                        [](const AccuracySetting&) -> Expected<AccuracyTrial> {
                                          return Fail(ErrorCode::kModel, "model", "cannot run");
                                        });
  ASSERT_FALSE(failed.has_value());
  EXPECT_EQ(failed.error().code, ErrorCode::kModel);
}

}  // namespace
}  // namespace fork1s::test
