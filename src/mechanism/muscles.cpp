// Curves of a muscle, as MuJoCo has them, by the normalized length L and rate V:
//
//   F_L: 0 outside [lmin, lmax], 1 at L = 1; parabolas that meet with equal slopes at 1/2, half way to 1 on either side
//   F_V: 0 for V <= -1;  (1 + V)² for V <= 0;  fvmax - (y - V)²/y for V <= y = fvmax - 1;  fvmax beyond
#include <fork1s/mechanism/mechanism.hpp>

namespace fork1s {
namespace {

// A function of one number, and its derivative.
struct Curve {
  double value, slope;
};

// From 0 at x = 0 to 1 at x = 1.
Curve Rise(double x) {
  if (x < 0.5) return {2 * x * x, 4 * x};
  return {1 - 2 * (1 - x) * (1 - x), 4 * (1 - x)};
}

Curve LengthCurve(const Mechanism::Muscle& m, double L) {
  if (!(L > m.lmin && L < m.lmax)) return {0, 0};
  const double width = L < 1 ? 1 - m.lmin : m.lmax - 1;
  const Curve rise = Rise(L < 1 ? (L - m.lmin) / width : (m.lmax - L) / width);
  return {rise.value, (L < 1 ? rise.slope : -rise.slope) / width};
}

Curve RateCurve(const Mechanism::Muscle& m, double V) {
  const double y = m.fvmax - 1;
  if (V <= -1) return {0, 0};
  if (V <= 0) return {(1 + V) * (1 + V), 2 * (1 + V)};
  if (V < y) return {m.fvmax - (y - V) * (y - V) / y, 2 * (y - V) / y};
  return {m.fvmax, 0};
}

}  // namespace

double Mechanism::Muscle::Force(double at, double rate) const {
  return -force * LengthCurve(*this, (at - zero) / optimum).value *
         RateCurve(*this, rate / (optimum * vmax)).value;
}

double Mechanism::Muscle::ForceByLength(double at, double rate) const {
  return -force * LengthCurve(*this, (at - zero) / optimum).slope / optimum *
         RateCurve(*this, rate / (optimum * vmax)).value;
}

double Mechanism::Muscle::ForceByRate(double at, double rate) const {
  return -force * LengthCurve(*this, (at - zero) / optimum).value *
         RateCurve(*this, rate / (optimum * vmax)).slope / (optimum * vmax);
}

}  // namespace fork1s
