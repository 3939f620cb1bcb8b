// Kinds of Eigen's expressions that most files write, completed once for the precompiled header: naming one
// costs a file 25 ms, since every kind has its own two hundred members, and they are more than half of what a
// file of this project takes the front end. Taken from the classes that -fdump-lang-class lists for the files
// of a whole build: what fifteen units or more share. Types only, as every file would compile the functions
// that are called here.
#pragma once

#include <complex>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace fork1s::precompiled {

using namespace Eigen;
using namespace Eigen::internal;
using Vector3 = Eigen::Vector3d;
using Vector6 = Matrix<double, 6, 1>;
using VectorX = Eigen::VectorXd;
using Matrix3 = Eigen::Matrix3d;
using Matrix6 = Matrix<double, 6, 6>;
using Matrix36 = Matrix<double, 3, 6>;
using Matrix6X = Matrix<double, 6, Dynamic>;
using MatrixX = Eigen::MatrixXd;
template <class Left, class Right>
using Sum = CwiseBinaryOp<scalar_sum_op<double, double>, Left, Right>;
template <class Left, class Right>
using Difference = CwiseBinaryOp<scalar_difference_op<double, double>, Left, Right>;
template <class Left, class Right>
using Times = CwiseBinaryOp<scalar_product_op<double, double>, Left, Right>;
template <class Left, class Right>
using ConjugateProduct = CwiseBinaryOp<scalar_conj_product_op<double, double>, Left, Right>;
template <class Left, class Right>
using Quotient = CwiseBinaryOp<scalar_quotient_op<double, double>, Left, Right>;
template <class Left, class Right>
using Equal = CwiseBinaryOp<scalar_cmp_op<double, double, cmp_EQ>, Left, Right>;
template <class Number, class Plain>
using Constant = CwiseNullaryOp<scalar_constant_op<Number>, Plain>;
template <class Plain>
using Identity = CwiseNullaryOp<scalar_identity_op<double>, Plain>;
template <class Inner>
using Square = CwiseUnaryOp<scalar_abs2_op<double>, Inner>;
template <class Inner>
using Abs = CwiseUnaryOp<scalar_abs_op<double>, Inner>;
template <class Inner>
using Opposite = CwiseUnaryOp<scalar_opposite_op<double>, Inner>;

template <class... Kinds>
inline constexpr bool kComplete = ((sizeof(Kinds) > 0) && ...);

static_assert(
    kComplete<
        Matrix3, Matrix6, MatrixX, Vector3, Vector6, VectorX, Matrix36, Matrix6X, Vector2d, Matrix3Xd,
        Map<VectorX, 4>, Identity<Matrix3>, Matrix<bool, 6, 1>, Square<const Vector3>,
        Matrix<int, Dynamic, 1>, VectorBlock<Vector6, 3>, Transpose<const Matrix3>, CommaInitializer<Matrix3>,
        Constant<double, Matrix3>, Constant<double, Matrix6>, Constant<double, Vector3>,
        Constant<double, Vector6>, Constant<double, VectorX>, Transpose<const Matrix36>,
        Constant<double, Matrix36>, Constant<double, Vector2d>, Block<Vector6, 3, 1, false>,
        Product<Matrix3, Matrix3, 0>, Product<Matrix3, Matrix3, 1>, Product<Matrix3, Vector3, 0>,
        Product<Matrix3, Vector3, 1>, VectorBlock<const Vector6, 3>, Constant<double, const Matrix3>,
        Constant<double, const Vector3>, Constant<double, const VectorX>, Block<const Matrix3, 3, 1, true>,
        Block<const Vector3, 3, 1, true>, Block<const Matrix3, 1, 3, false>,
        Block<const Matrix36, 3, 3, true>, Block<const Vector6, 3, 1, false>,
        Sum<const Vector3, const Vector3>, Constant<bool, Matrix<bool, 6, 1>>,
        Block<const VectorX, Dynamic, 1, true>, Block<const Matrix6X, 6, Dynamic, true>,
        Block<const MatrixX, 1, Dynamic, false>, Difference<const Vector3, const Vector3>,
        Difference<const VectorX, const VectorX>, Matrix<std::complex<double>, Dynamic, 1>,
        Block<const Identity<Matrix3>, 3, 1, false>, Opposite<const Product<Matrix3, Vector3, 0>>,
        ConjugateProduct<const Vector3, const Vector3>, Matrix<std::complex<double>, Dynamic, Dynamic>,
        Product<Transpose<const Matrix36>, Vector3, 0>, Product<Transpose<const Matrix36>, Vector3, 1>,
        NoAlias<Block<Vector6, 3, 1, false>, MatrixBase>, Block<const Transpose<const Matrix3>, 1, 3, true>,
        Block<const Transpose<const Matrix36>, 1, 3, true>,
        Transpose<const Block<const Matrix3, 1, 3, false>>,
        Transpose<const Block<const Matrix36, 3, 3, true>>,
        Product<Matrix3, Block<const Vector6, 3, 1, false>, 0>,
        Product<Matrix3, Block<const Vector6, 3, 1, false>, 1>,
        Square<const Difference<const Vector3, const Vector3>>,
        Sum<const Product<Matrix3, Vector3, 0>, const Vector3>,
        Transpose<const Block<const MatrixX, 1, Dynamic, false>>,
        Block<const Block<const Vector6, 3, 1, false>, 3, 1, true>,
        Times<const Constant<double, const Vector3>, const Vector3>,
        ArrayWrapper<const Difference<const Vector3, const Vector3>>,
        Quotient<const Vector3, const Constant<double, const Vector3>>,
        Difference<const Block<const Vector6, 3, 1, false>, const Vector3>,
        Transpose<const Block<const Transpose<const Matrix3>, 1, 3, true>>,
        Times<const Constant<double, const VectorX>, const Map<VectorX, 4>>,
        Transpose<const Block<const Transpose<const Matrix36>, 1, 3, true>>,
        Product<Transpose<const Block<const Matrix36, 3, 3, true>>, Vector3, 0>,
        Product<Transpose<const Block<const Matrix36, 3, 3, true>>, Vector3, 1>,
        Product<Transpose<const Matrix3>, Block<const Vector6, 3, 1, false>, 0>,
        Product<Transpose<const Matrix3>, Block<const Vector6, 3, 1, false>, 1>,
        Block<const Transpose<const Block<const Matrix36, 3, 3, true>>, 1, 3, true>,
        Transpose<const Block<const Transpose<const Block<const Matrix36, 3, 3, true>>, 1, 3, true>>,
        Times<const Transpose<const Block<const Matrix3, 1, 3, false>>,
              const Block<const Matrix3, 3, 1, true>>,
        Times<const Transpose<const Block<const Matrix3, 1, 3, false>>,
              const Block<const Vector3, 3, 1, true>>,
        Product<Transpose<const Matrix3>, Difference<const Block<const Vector6, 3, 1, false>, const Vector3>,
                0>,
        Product<Transpose<const Matrix3>, Difference<const Block<const Vector6, 3, 1, false>, const Vector3>,
                1>,
        Times<const Transpose<const Block<const Transpose<const Matrix3>, 1, 3, true>>,
              const Block<const Vector3, 3, 1, true>>,
        Times<const Transpose<const Block<const Transpose<const Matrix36>, 1, 3, true>>,
              const Block<const Vector3, 3, 1, true>>,
        Times<const Transpose<const Block<const Matrix3, 1, 3, false>>,
              const Block<const Block<const Vector6, 3, 1, false>, 3, 1, true>>,
        Equal<const ArrayWrapper<const Difference<const Vector3, const Vector3>>,
              const ArrayWrapper<const Difference<const Vector3, const Vector3>>>,
        Times<const Transpose<
                  const Block<const Transpose<const Block<const Matrix36, 3, 3, true>>, 1, 3, true>>,
              const Block<const Vector3, 3, 1, true>>,
        Times<const Transpose<const Block<const Transpose<const Matrix3>, 1, 3, true>>,
              const Block<const Block<const Vector6, 3, 1, false>, 3, 1, true>>>);

}  // namespace fork1s::precompiled
