// How accurate the method itself is: statics, gaps, frequencies and transients against the full mechanism.
#pragma once

#include <fork1s/mechanism/scene.hpp>
#include <fork1s/reduction/reduced_model.hpp>
#include <fork1s/sim/simulation.hpp>
#include <memory>
#include <string>
#include <vector>

namespace fork1s {

/// How body poses follow from the reduced coordinates z, and which forces balance there.
enum class StaticMode {
  kTwist,        ///< RecoverPosesTwist; springs linear in z, loads through T_B: `--recovery twist`
  kSecondOrder,  ///< RecoverPosesTwistSecondOrder; springs linear in z, loads through its derivative
  kOpen,         ///< product of exponentials, loops as z leaves them
  kExact,        ///< product of exponentials, loops closed: `--recovery exact`, reference never moved
  kRefreshed,    ///< the same, the reference moved wherever a joint has turned by 15 degrees since
  kCurved,  ///< product of exponentials, loops by their curvature: `--recovery curved`, reference never moved
};
const char* Name(StaticMode mode);

/// A mechanism at rest, its base held, and the interface body that a dead force pulls at its origin.
struct StaticCase {
  std::string name;
  std::shared_ptr<const Mechanism> mechanism;
  VectorX q0;  // unloaded, loops closed
  BodyIndex body;
  Vector3 direction_R = Vector3::UnitZ();  // of the force
};

/// Hand, hexapod, four-bar, firemen and chain. The scenes are read from `folder`; four-bar and chain are
/// built.
Expected<std::vector<StaticCase>> MakeStaticCases(const std::string& folder);

/// Equilibria at growing force: the full mechanism's (SolveStatics), and the reduced model's in each mode.
struct StaticCurve {
  struct Point {
    double angle_deg = 0;  // largest turn of any joint in the exact equilibrium
    double force_N = 0;
    double moved_mm = 0;              // of the loaded body's origin, exact
    std::vector<double> percent;      // per mode: position error over `moved_mm`; NaN without equilibrium
    std::vector<double> loop_gap_mm;  // per mode
  };
  std::string name;
  std::vector<StaticMode> modes;
  std::vector<Point> points;
  std::string end;  // why there are no more points; empty if all angles were reached
};
/// The force is chosen so that the exact equilibrium has each of `angles_deg` (increasing) as largest joint
/// rotation, within 1e-6 of it.
Expected<StaticCurve> MeasureStatics(const StaticCase& c, const std::vector<double>& angles_deg,
                                     const std::vector<StaticMode>& modes);
/// Deflection [degrees] at which a mode's error passes `percent`, between points linear in logarithms;
/// infinite if it never does.
double DeflectionAtError(const StaticCurve& curve, std::size_t mode, double percent);

/// A mechanism whose simulation comes to rest under a load: base held, without contact, dry friction, stops
/// and bounds of forces.
struct RestCase {
  std::string name;
  std::shared_ptr<const Mechanism> mechanism;
  BodyIndex interface;  // is pulled
  BodyIndex interior;   // likewise; no interface body
};

/// Hexapod, firemen, two-link arm, arm and hand, excavator, a chain of 24 hinges, and random trees and loops
/// of 24 links. The scenes are read from `folder`.
Expected<std::vector<RestCase>> MakeRestCases(const std::string& folder);

enum class DeflectionLoad { kWeight, kInterfacePull, kInteriorPull, kSetPoints };
constexpr DeflectionLoad kDeflectionLoads[] = {DeflectionLoad::kWeight, DeflectionLoad::kInterfacePull,
                                               DeflectionLoad::kInteriorPull, DeflectionLoad::kSetPoints};
const char* Name(DeflectionLoad load);

/// Where the simulation by default options rests, beside the equilibrium of all joints (SolveStatics).
struct RestCurve {
  struct Point {
    double angle_deg = 0;          // largest turn of any joint in the equilibrium
    double load = 0;               // m/s², N, or rad and m of the set-points
    double interface_percent = 0;  // largest error of an interface body, of the largest motion of one
    double inside = 0;             // largest error of a body, of the mechanism's size
    int size = 0;                  // reduced coordinates at the end
    int refreshes = 0;
    double speed = 0;  // at the end, of the fastest joint [rad/s or m/s]
  };
  std::string name;
  DeflectionLoad load = DeflectionLoad::kWeight;
  int coordinates = 0;  // independent ones of all joints
  std::vector<Point> points;
  std::string end;  // why there are no more points; empty if all angles were reached
};
/// Positions are those of centres of mass; the size is the diagonal of the box around them. The load grows
/// for 1.5 s in steps of 1/60 s and stays; backward Euler steps then grow to 20 s. Set-points are those of
/// all servos that act on more than the interface bodies' own joints, moved by the same amount in turn up and
/// down.
Expected<RestCurve> MeasureRest(const RestCase& c, DeflectionLoad load,
                                const std::vector<double>& angles_deg);

/// Largest opening of any joint or loop, as a share of the mean link length, in the linear response to the
/// case's force scaled to each deflection.
struct GapCurve {
  std::string name;
  std::vector<double> angles_deg;
  std::vector<double> twist, second_order, open, curved, exact;  // percent of the mean link length
};
Expected<GapCurve> MeasureGaps(const StaticCase& c, const std::vector<double>& angles_deg);
/// Least-squares slope of log y over log x, points within [low, high] of x.
double LogSlope(const std::vector<double>& x, const std::vector<double>& y, double low, double high);

/// Lowest natural frequencies with k fixed-interface modes against those of the full mechanism.
struct FrequencyCurve {
  struct Point {
    int modes = 0;                // kept; fewer than asked for where there are no more
    int size = 0;                 // reduced coordinates
    std::vector<double> percent;  // error of each of the lowest frequencies
  };
  std::string name;
  ModeChoice choice = ModeChoice::kLowest;
  std::vector<double> full_hz;
  std::vector<Point> points;
};
/// Firemen, hand with a free palm, arm and hand, chain of 20 links.
Expected<std::vector<StaticCase>> MakeFrequencyCases(const std::string& folder);
/// Reduced to `c.body` alone.
Expected<FrequencyCurve> MeasureFrequencies(const StaticCase& c, const std::vector<int>& modes,
                                            ModeChoice choice, int count = 4);
/// Largest error of a point's frequencies.
double Worst(const FrequencyCurve::Point& point);

/// A scene in motion.
struct TransientCase {
  std::string name;
  Scene scene;
  ControlTrack controls;
  double time = 1;  // s
  int initial_keyframe = -1;
};
Expected<std::vector<TransientCase>> MakeTransientCases(const std::string& folder);

/// Paths of interface and free bodies at equal and at ever smaller steps, by backward Euler unless said.
struct TransientCurve {
  struct Point {
    double dt_s = 0;
    double reduced_percent = 0;    // reduced against the truth
    double full_percent = 0;       // full at the same step against the truth
    double between_percent = 0;    // reduced against full at the same step
    double two_stage_percent = 0;  // reduced by Integrator::kTwoStage against the truth
  };
  std::string name;
  double motion_mm = 0;      // RMS displacement from the start: what the percentages are of
  double truth_percent = 0;  // how far the truth may still be off: it against the next coarser estimate
  std::vector<Point> points;
};
/// Steps 1/60 s, halved `halvings` times; samples every 1/60 s. The truth is Richardson's extrapolation
/// 2 x(h) − x(2h) of two full runs, h half of the smallest step: implicit Euler is of first order.
Expected<TransientCurve> MeasureTransient(const TransientCase& c, int halvings);

/// The live error estimate (diagnostics/error_estimate.hpp) beside the error itself, at 1/60 s.
struct ErrorEstimateCurve {
  struct Point {
    double time_s = 0;
    double shown_mm = 0;   // the estimate, largest of the last quarter of a second
    double true_mm = 0;    // the error, likewise
    double motion_mm = 0;  // largest way so far
  };
  std::string name, body;
  Integrator integrator = Integrator::kEuler;
  std::vector<Point> points;
};
/// Every interface and free body under every integrator. The truth is Richardson's extrapolation of two full
/// runs at 1/60 s over `substeps` and over twice that.
Expected<std::vector<ErrorEstimateCurve>> MeasureErrorEstimate(const TransientCase& c,
                                                               const std::vector<Integrator>& integrators,
                                                               int substeps);
/// Of the frames that count, those in which what is shown is between half and three times the truth. Errors
/// below 0.02 % of the motion do not count. Above 10 % of the motion the program says only that it is more:
/// right where the truth is above 5 %.
struct EstimateShare {
  int inside = 0, all = 0;
};
EstimateShare ShareInside(const ErrorEstimateCurve& curve);

/// Measures all of the above and writes the page `folder`/accuracy.md with its plots and tables in
/// `folder`/accuracy/.
Expected<void> WriteAccuracyPage(const std::string& scenes, const std::string& folder);

}  // namespace fork1s
