#include "modes.hpp"

#include <algorithm>
#include <fork1s/linalg/cholesky.hpp>
#include <fork1s/linalg/null_space.hpp>
#include <fork1s/linalg/spectrum.hpp>

namespace fork1s::internal {
namespace {

// Beyond this many elastic coordinates the dense eigenproblem costs more than Lanczos on products with M.
constexpr int kDenseLimit = 300;

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

Modes DenseModes(const Mechanism& mechanism, const Kinematics& kinematics, const ElasticBasis& basis,
                 const MatrixX& Y, const MatrixX& extra, const MatrixX& extra_mass, int count) {
  const int e = basis.num_elastic();
  MatrixX M;
  MassMatrix(mechanism, kinematics, M);
  const MatrixX MV = basis.TimesV(M);
  MatrixX M_V = basis.TimesV(MV.transpose());
  if (extra.cols() > 0) M_V -= extra * SolveSymmetric(extra_mass, extra.transpose());
  const MatrixX complement = Y.cols() > 0 ? OrthogonalComplement(Y) : MatrixX(MatrixX::Identity(e, e));
  const MatrixX restricted = complement.transpose() * M_V * complement;
  const SymmetricSpectrum spectrum = SpectrumOf(0.5 * (restricted + restricted.transpose()));
  return {complement * spectrum.vectors.rightCols(count).rowwise().reverse(),
          spectrum.values.tail(count).reverse()};
}

}  // namespace

Modes LowestModes(const Mechanism& mechanism, const Kinematics& kinematics, const ElasticBasis& basis,
                  const MatrixX& Y, const MatrixX& extra, const MatrixX& extra_mass, int count) {
  const int e = basis.num_elastic();
  count = std::min(count, e - static_cast<int>(Y.cols()));
  if (count <= 0) return {MatrixX(e, 0), VectorX(0)};
  if (e > kDenseLimit && 4 * count < e) {
    const MassOperator op(mechanism, kinematics, basis, Y, extra, extra_mass);
    Modes modes;
    if (LargestEigenpairs(op, e, count, modes.mu, modes.vectors)) return modes;
  }
  return DenseModes(mechanism, kinematics, basis, Y, extra, extra_mass, count);
}

}  // namespace fork1s::internal
