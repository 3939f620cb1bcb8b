#include "modes.hpp"

#include <algorithm>

#include "inertia_along.hpp"
#include "linalg/cholesky.hpp"
#include "linalg/null_space.hpp"
#include "linalg/products.hpp"
#include "linalg/select.hpp"
#include "linalg/spectrum.hpp"

namespace fork1s::internal {
namespace {

// Beyond this many elastic coordinates the dense eigenproblem costs more than Lanczos on products with M: all
// of Reduce on a chain of 40 joints takes 0.09 and 0.06 ms, of 100 0.72 and 0.12, of 290 11 and 0.37. Modes
// of equal limbs, several at one frequency, are found by it too: to 1e-14 it does not end before rounding has
// shown them all. Where loops make V dense every product costs more: of the firemen's 36 coordinates Lanczos took
// 0.8 million instructions and the dense problem 0.4, which grows with their cube.
constexpr int kDenseLimit = 30;
constexpr int kDenseLimitWithLoops = 60;

// y -> P (VᵀMV - extra S⁻¹ extraᵀ) P y with P the projector off Y, in O(n) a product.
class MassOperator {
 public:
  MassOperator(const Mechanism& mechanism, const Kinematics& kinematics, const ElasticBasis& basis,
               const MatrixX& Y, const MatrixX& extra, const MatrixX& extra_mass)
      : mechanism_(mechanism), kinematics_(kinematics), basis_(basis), Y_(Y), extra_(extra) {
    if (extra.cols() > 0) factor_.Compute(extra_mass);
  }
  void operator()(const double* in, double* out) const {
    VectorX y = Eigen::Map<const VectorX>(in, basis_.num_elastic());
    Project(y);
    VectorX Mx;
    ApplyMass(mechanism_, kinematics_, basis_.ApplyV(y, mechanism_.num_coordinates()), Mx);
    VectorX r = basis_.ApplyVTransposed(Mx);
    if (extra_.cols() > 0) r -= extra_ * factor_.Solve(extra_.transpose() * y);
    Project(r);
    Eigen::Map<VectorX>(out, r.size()) = r;
  }

 private:
  void Project(VectorX& y) const {
    if (Y_.cols() > 0) y -= Y_ * (Y_.transpose() * y);
  }
  const Mechanism& mechanism_;
  const Kinematics& kinematics_;
  const ElasticBasis& basis_;
  const MatrixX& Y_;
  const MatrixX& extra_;
  SymmetricFactor factor_;
};

// Vᵀ M V, less what follows without force.
MatrixX MassOfElastic(const Mechanism& mechanism, const Kinematics& kinematics, const ElasticBasis& basis,
                      const MatrixX& extra, const MatrixX& extra_mass, MatrixX& M) {
  MatrixX M_V;
  if (basis.diagonal) {
    if (M.size() == 0) MassMatrix(mechanism, kinematics, M);
    M_V = basis.TimesV(basis.TimesV(M).transpose());
  } else {
    M_V = ComputeInertiaAlong(mechanism, kinematics, basis.V).M;
  }
  if (extra.cols() > 0) M_V -= Times(extra, SolveSymmetric(extra_mass, extra.transpose()));
  return M_V;
}

Modes DenseModes(const MatrixX& M_V, const MatrixX& Y, int count) {
  const MatrixX complement =
      Y.cols() > 0 ? OrthogonalComplement(Y) : MatrixX(MatrixX::Identity(M_V.rows(), M_V.rows()));
  const MatrixX restricted = Congruence(M_V, complement);
  const SymmetricSpectrum spectrum = SpectrumOf(0.5 * (restricted + restricted.transpose()));
  return {Times(complement, spectrum.vectors.rightCols(count).rowwise().reverse()),
          spectrum.values.tail(count).reverse()};
}

// P M_V P with P the projector off Y has the same largest pairs, and 0 on Y.
Modes FewModes(const MatrixX& M_V, const MatrixX& Y, int count) {
  MatrixX restricted = M_V;
  if (Y.cols() > 0) {
    const MatrixX MY = Times(M_V, Y);
    const MatrixX half = MY - 0.5 * Times(Y, TransposedTimes(Y, MY));
    const MatrixX taken = TimesTransposed(half, Y);
    restricted -= taken + taken.transpose();
  }
  const SymmetricSpectrum spectrum = SpectrumOf(restricted);
  MatrixX vectors = spectrum.vectors.rightCols(count).rowwise().reverse();
  if (Y.cols() > 0) {
    const MatrixX shared = TransposedTimes(Y, vectors);  // rounding
    if (!(shared.cwiseAbs().maxCoeff() < 1e-6))
      return DenseModes(M_V, Y, count);  // of modes as small as rounding
    vectors -= Times(Y, shared);
  }
  return {std::move(vectors), spectrum.values.tail(count).reverse()};
}

// `M`: of all joints, made by the first that needs it.
Modes ModesOf(const Mechanism& mechanism, const Kinematics& kinematics, const ElasticBasis& basis,
              const MatrixX& Y, const MatrixX& extra, const MatrixX& extra_mass, int count, MatrixX& M) {
  const int e = basis.num_elastic();
  count = std::min(count, e - static_cast<int>(Y.cols()));
  if (count <= 0) return {MatrixX(e, 0), VectorX(0)};
  const bool few = 4 * count < e;
  if (few && e > (basis.diagonal ? kDenseLimit : kDenseLimitWithLoops)) {
    const MassOperator op(mechanism, kinematics, basis, Y, extra, extra_mass);
    Modes modes;
    if (LargestEigenpairs(op, e, count, modes.mu, modes.vectors)) return modes;
  }
  const MatrixX M_V = MassOfElastic(mechanism, kinematics, basis, extra, extra_mass, M);
  return few ? FewModes(M_V, Y, count) : DenseModes(M_V, Y, count);
}

}  // namespace

Modes LowestModes(const Mechanism& mechanism, const Kinematics& kinematics, const ElasticBasis& basis,
                  const MatrixX& Y, const MatrixX& extra, const MatrixX& extra_mass, int count) {
  MatrixX M;
  if (basis.parts.size() <= 1 || extra.cols() > 0)
    return ModesOf(mechanism, kinematics, basis, Y, extra, extra_mass, count, M);
  // Parts are independent of each other: each has modes of its own, and the lowest of all are wanted.
  std::vector<Modes> of_part;
  for (const ElasticBasis::Part& part : basis.parts) {
    std::vector<int> own;
    for (Eigen::Index k = 0; k < Y.cols(); ++k)
      if (!Y.col(k).segment(part.elastic, part.num_elastic).isZero(0)) own.push_back(static_cast<int>(k));
    const MatrixX Y_part = Columns(Y.middleRows(part.elastic, part.num_elastic), own);
    of_part.push_back(ModesOf(mechanism, kinematics, basis.ElasticOf(part), Y_part,
                              MatrixX(part.num_elastic, 0), MatrixX(0, 0), count, M));
  }
  const int e = basis.num_elastic();
  count = std::min(count, e - static_cast<int>(Y.cols()));
  Modes modes{MatrixX::Zero(e, count), VectorX::Zero(count)};
  std::vector<Eigen::Index> next(of_part.size(), 0);
  for (int k = 0; k < count; ++k) {
    std::size_t lowest = of_part.size();
    for (std::size_t p = 0; p < of_part.size(); ++p) {
      if (next[p] == of_part[p].mu.size()) continue;
      // Of equals, as fingers of one kind have them, that of the first, whatever the last digits say.
      if (lowest == of_part.size() || of_part[p].mu(next[p]) > (1 + 1e-9) * of_part[lowest].mu(next[lowest]))
        lowest = p;
    }
    const ElasticBasis::Part& part = basis.parts[lowest];
    modes.mu(k) = of_part[lowest].mu(next[lowest]);
    modes.vectors.col(k).segment(part.elastic, part.num_elastic) =
        of_part[lowest].vectors.col(next[lowest]++);
  }
  return modes;
}

}  // namespace fork1s::internal
