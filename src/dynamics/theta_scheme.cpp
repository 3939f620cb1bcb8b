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
// A mode with neither spring nor damper has no part in it.
bool LosesEnergy(const Modes& modes, const MatrixX& D, double h) {
  const VectorX root = modes.theta.cwiseSqrt(), spare = modes.theta.array() - 0.5;
  MatrixX C = D;
  for (int j = 0; j < C.cols(); ++j)
    C.col(j).array() *= h * root(j) * (root.array() - root(j)) / (2 * std::sqrt(spare(j)));
  MatrixX left = h * D - TimesTransposed(C, C);
  left.diagonal().array() += h * h * modes.squares.array() * spare.array();
  for (int i = 0; i < left.rows(); ++i)
    if (modes.squares(i) == 0 && D.col(i).isZero(0)) left(i, i) = 1;
  return Cholesky().Compute(left);
}

// Raises the least θ as far as the split of damping needs to take energy from any motion. At θ = 1 nothing is split.
void RaiseUntilEnergyFalls(const MatrixX& D, double h, Modes& modes) {
  const VectorX own = modes.theta;
  for (double spare = 1.0 / 1024; !LosesEnergy(modes, D, h) && spare <= 0.5; spare *= 2)
    modes.theta = own.cwiseMax(0.5 + spare);
}

}  // namespace

void ThetaScheme::Fill(const ReducedModel& model, const std::vector<VelocityRange>& ranges, double step,
                       bool euler, bool must_be_symmetric) {
  const int r = model.size();
  h = step;
  Th = MatrixX::Identity(r, r);
  MatrixX D_end = model.D;
  symmetric = true;
  if (!euler) {
    const MatrixX M = FeltInertia(model);
    for (const VelocityRange& run : ranges) {
      if (run.size == 0) continue;
      const auto own = [&](MatrixX& all) { return all.block(run.begin, run.begin, run.size, run.size); };
      Modes modes = ModesOf(M.block(run.begin, run.begin, run.size, run.size),
                            model.K_r.segment(run.begin, run.size), step);
      if (modes.V.size() == 0) continue;
      const MatrixX D = model.D.block(run.begin, run.begin, run.size, run.size);
      const MatrixX D_modes = Congruence(D, modes.V);
      const bool splits = D.isZero(0) || LosesEnergy(modes, D_modes, step);
      if (!splits && must_be_symmetric) RaiseUntilEnergyFalls(D_modes, step, modes);
      own(Th) = Times(modes.V, ScaledRows(modes.theta, modes.V_inverse));
      if (splits || must_be_symmetric) {
        own(D_end) = Congruence(D_modes, ScaledRows(VectorX(modes.theta.cwiseSqrt()), modes.V_inverse));
      } else {
        own(D_end) = Times(D, own(Th));
        symmetric = false;
      }
    }
  }
  const MatrixX K_Th = ScaledRows(model.K_r, Th), K_Th2 = Times(K_Th, Th);
  end = h * D_end + (h * h) * K_Th2;
  start = h * (model.D - D_end) + (h * h) * (K_Th - K_Th2);
}

}  // namespace fork1s
