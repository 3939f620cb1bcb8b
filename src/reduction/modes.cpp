#include "modes.hpp"

#include <algorithm>

#include <Spectra/SymEigsSolver.h>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>

namespace fork1s::internal {
namespace {

// Beyond this many elastic coordinates the dense eigenproblem costs more than Lanczos on products with M.
constexpr int kDenseLimit = 300;

// y -> P (VᵀMV - extra S⁻¹ extraᵀ) P y with P the projector off Y, in O(n) a product.
class MassOperator {
 public:
  using Scalar = double;
  MassOperator(const Mechanism& mechanism, const Kinematics& kinematics, const ElasticBasis& basis,
               const MatrixX& Y, const MatrixX& extra, const MatrixX& extra_mass)
      : mechanism_(mechanism), kinematics_(kinematics), basis_(basis), Y_(Y), extra_(extra) {
    if (extra.cols() > 0) factor_.compute(extra_mass);
  }
  Eigen::Index rows() const { return basis_.num_elastic(); }
  Eigen::Index cols() const { return rows(); }
  void perform_op(const double* in, double* out) const {
    VectorX y = Eigen::Map<const VectorX>(in, rows());
    Project(y);
    VectorX Mx;
    ApplyMass(mechanism_, kinematics_, basis_.ApplyV(y, mechanism_.num_coordinates()), Mx);
    VectorX r = basis_.ApplyVTransposed(Mx);
    if (extra_.cols() > 0) r -= extra_ * factor_.solve(extra_.transpose() * y);
    Project(r);
    Eigen::Map<VectorX>(out, rows()) = r;
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
  Eigen::LDLT<MatrixX> factor_;
};

Modes DenseModes(const Mechanism& mechanism, const Kinematics& kinematics, const ElasticBasis& basis,
                 const MatrixX& Y, const MatrixX& extra, const MatrixX& extra_mass, int count) {
  const int e = basis.num_elastic();
  MatrixX M;
  MassMatrix(mechanism, kinematics, M);
  const MatrixX MV = basis.TimesV(M);
  MatrixX M_V = basis.TimesV(MV.transpose());
  if (extra.cols() > 0) M_V -= extra * extra_mass.ldlt().solve(extra.transpose());
  MatrixX complement = MatrixX::Identity(e, e);
  if (Y.cols() > 0) {
    Eigen::HouseholderQR<MatrixX> qr(Y);
    complement = (qr.householderQ() * MatrixX::Identity(e, e)).rightCols(e - Y.cols());
  }
  const MatrixX restricted = complement.transpose() * M_V * complement;
  Eigen::SelfAdjointEigenSolver<MatrixX> eigen(0.5 * (restricted + restricted.transpose()));
  return {complement * eigen.eigenvectors().rightCols(count).rowwise().reverse(),
          eigen.eigenvalues().tail(count).reverse()};
}

}  // namespace

Modes LowestModes(const Mechanism& mechanism, const Kinematics& kinematics, const ElasticBasis& basis,
                  const MatrixX& Y, const MatrixX& extra, const MatrixX& extra_mass, int count) {
  const int e = basis.num_elastic();
  count = std::min(count, e - static_cast<int>(Y.cols()));
  if (count <= 0) return {MatrixX(e, 0), VectorX(0)};
  if (e > kDenseLimit && 4 * count < e) {
    MassOperator op(mechanism, kinematics, basis, Y, extra, extra_mass);
    Spectra::SymEigsSolver<MassOperator> solver(op, count, std::min(e, std::max(2 * count + 8, 20)));
    solver.init();
    // The wanted end of the spectrum is well separated (1/ω² falls with the fourth power on chains), so
    // rounding-level convergence takes few restarts.
    const auto found = solver.compute(Spectra::SortRule::LargestAlge, 1000, 1e-14);
    if (found == count) return {solver.eigenvectors(), solver.eigenvalues()};
  }
  return DenseModes(mechanism, kinematics, basis, Y, extra, extra_mass, count);
}

}  // namespace fork1s::internal
