#include <fork1s/dynamics/theta_scheme.hpp>

#include <cmath>
#include <fork1s/linalg/cholesky.hpp>
#include <fork1s/linalg/products.hpp>
#include <fork1s/linalg/solve.hpp>
#include <fork1s/linalg/spectrum.hpp>

namespace fork1s {
namespace {

// Step times frequency at which a mode is half way from the trapezoid to implicit Euler.
constexpr double kTurnover = 1.2;

double Theta(double y) {
  const double y4 = std::pow(y / kTurnover, 4);
  return y4 < 1e30 ? 0.5 + 0.5 * y4 / (1 + y4) : 1;
}

// Inertia that the coordinates feel: what floats gives way.
MatrixX FeltInertia(const ReducedModel& model) {
  if (model.mechanism->base() != BaseKind::kFloating) return model.M;
  return model.M - TransposedTimes(model.M_0z, SolveSymmetric(model.M_00, model.M_0z));
}

// Largest growth in a step of free motion at the reference, all modes together.
double Growth(const MatrixX& M, const VectorX& K, const MatrixX& D, const ThetaScheme& s,
              const VelocityRange& run) {
  const int n = run.size;
  auto of = [&](const MatrixX& A) { return MatrixX(A.block(run.begin, run.begin, n, n)); };
  const MatrixX one = MatrixX::Identity(n, n), Th = of(s.Th);
  const MatrixX K_z = K.segment(run.begin, n).asDiagonal();
  const double h = s.h;
  const MatrixX A = M + h * of(s.D_end) + h * h * of(s.K_Th2);
  MatrixX right(n, 2 * n);
  right << -h * K_z, M - h * h * of(s.K_Th_rest) - h * (D - of(s.D_end));
  const MatrixX v = SolveSquare(A, right);
  MatrixX map(2 * n, 2 * n), w = Times(Th, v);
  w.rightCols(n) += one - Th;
  map << MatrixX(h * w), v;
  map.topLeftCorner(n, n) += one;
  return GeneralSpectrumOf(map).values.cwiseAbs().maxCoeff();
}

// Modes of a range of coordinates: ω² and θ, V with VᵀMV = 1, and VᵀM.
struct Modes {
  VectorX squares, theta;
  MatrixX V, V_inverse;
};

// Empty where M is not positive: the step factors the same matrix, fails there and is reported.
Modes ModesOf(const MatrixX& M, const VectorX& K, double h) {
  Modes out;
  Cholesky factor;
  if (!factor.Compute(M)) return out;
  const MatrixX L = factor.L().triangularView<Eigen::Lower>();
  const MatrixX L_inverse = L.triangularView<Eigen::Lower>().solve(MatrixX::Identity(M.rows(), M.rows()));
  const SymmetricSpectrum spectrum = SpectrumOf(DiagonalCongruence(K, L_inverse.transpose()));
  out.squares = spectrum.values.cwiseMax(0);
  out.theta = out.squares.unaryExpr([h](double w2) { return Theta(h * std::sqrt(w2)); });
  out.V = TransposedTimes(L_inverse, spectrum.vectors);
  out.V_inverse = Times(L, spectrum.vectors).transpose();
  return out;
}

// Whether free motion at the reference loses energy in every step, with h ω = y and D of the modes, by damping √θ D √θ
// at its end: with δ = w⁺ - w it changes by
//     -δ·(θ - ½)δ - w̄·(y² (θ - ½) + h D) w̄ - h w̄·C δ,   C = √θ D √θ - D θ,
// and that is below 0 for any δ and w̄ where what is left of the second form is positive once the first has had its δ.
bool LosesEnergy(const Modes& modes, const MatrixX& D, double h) {
  const VectorX root = modes.theta.cwiseSqrt(), spare = modes.theta.array() - 0.5;
  MatrixX C = D;
  for (int j = 0; j < C.cols(); ++j)
    C.col(j).array() *= h * root(j) * (root.array() - root(j)) / (2 * std::sqrt(spare(j)));
  MatrixX left = h * D - TimesTransposed(C, C);
  left.diagonal().array() += h * h * modes.squares.array() * spare.array();
  return Cholesky().Compute(left);
}

void Multiply(const VectorX& K, ThetaScheme& s) {
  s.K_Th = ScaledRows(K, s.Th);
  s.K_Th2 = Times(s.K_Th, s.Th);
  s.K_Th_rest = s.K_Th - s.K_Th2;
}

}  // namespace

bool FollowsAnyMode(const ReducedModel& model, double h) {
  if (model.mechanism->base() == BaseKind::kFloating) return true;
  if (model.size() == 0) return false;
  const VectorX theta = ModesOf(model.M, model.K_r, h).theta;
  return theta.size() > 0 && theta.minCoeff() < 0.75;
}

void ThetaScheme::Fill(const ReducedModel& model, const std::vector<VelocityRange>& ranges, double step,
                       bool euler) {
  const int r = model.size();
  h = step;
  Th = MatrixX::Identity(r, r);
  D_end = model.D;
  D_start = MatrixX::Zero(r, r);
  if (!euler) {
    const MatrixX M = FeltInertia(model);
    std::vector<Modes> modes(ranges.size());
    for (std::size_t k = 0; k < ranges.size(); ++k) {
      const VelocityRange& run = ranges[k];
      if (run.size == 0) continue;
      Modes& own = modes[k];
      own = ModesOf(M.block(run.begin, run.begin, run.size, run.size),
                    model.K_r.segment(run.begin, run.size), step);
      if (own.V.size() == 0) continue;
      Th.block(run.begin, run.begin, run.size, run.size) =
          Times(own.V, ScaledRows(own.theta, own.V_inverse));
    }
    Multiply(model.K_r, *this);
    for (std::size_t k = 0; k < ranges.size(); ++k) {
      const VelocityRange& run = ranges[k];
      const Modes& own = modes[k];
      const int n = run.size;
      if (own.V.size() == 0) continue;
      const MatrixX D = model.D.block(run.begin, run.begin, n, n);
      if (D.isZero(0)) continue;
      const VectorX root = own.theta.cwiseSqrt();
      const MatrixX D_modes = Congruence(D, own.V), R = ScaledRows(root, own.V_inverse);
      const MatrixX middle = Congruence(D_modes, R);
      D_end.block(run.begin, run.begin, n, n) = middle;
      if (LosesEnergy(own, D_modes, step)) continue;
      for (const double a : {0.0, 0.25, 0.5, 0.75, 1.0}) {
        D_end.block(run.begin, run.begin, n, n) = (1 - a) * middle + a * D;
        // Rounding of eigenvalues that are double.
        if (Growth(M.block(run.begin, run.begin, n, n), model.K_r, D, *this, run) <= 1 + 1e-9) break;
      }
    }
    D_start = model.D - D_end;
  }
  if (euler) Multiply(model.K_r, *this);
}

}  // namespace fork1s
