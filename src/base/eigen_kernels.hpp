// Eigen's large product kernels for double, compiled once (eigen_kernels.cpp) and not again in every file that
// multiplies two matrices. Only for the precompiled header: nothing depends on it but the time that a build takes,
// and users of the installed library need not know.
#pragma once

#include <Eigen/Core>

// The names are Eigen's insides, as they stand in 3.4.
#if EIGEN_WORLD_VERSION == 3 && EIGEN_MAJOR_VERSION == 4 && !defined(EIGEN_USE_BLAS)
#define FORK1S_EIGEN_KERNELS 1
#ifndef FORK1S_KERNEL
#define FORK1S_KERNEL extern template
#endif

namespace Eigen::internal {

using Fork1sTraits = gebp_traits<double, double>;
using Fork1sOutput = blas_data_mapper<double, Index, ColMajor, Unaligned, 1>;
template <int order>
using Fork1sInput = const_blas_data_mapper<double, Index, order>;

FORK1S_KERNEL struct gebp_kernel<double, double, Index, Fork1sOutput, Fork1sTraits::mr, Fork1sTraits::nr,
                                 false, false>;
FORK1S_KERNEL struct gemm_pack_lhs<double, Index, Fork1sInput<ColMajor>, Fork1sTraits::mr,
                                   Fork1sTraits::LhsProgress, Fork1sTraits::LhsPacket4Packing, ColMajor,
                                   false, false>;
FORK1S_KERNEL struct gemm_pack_lhs<double, Index, Fork1sInput<RowMajor>, Fork1sTraits::mr,
                                   Fork1sTraits::LhsProgress, Fork1sTraits::LhsPacket4Packing, RowMajor,
                                   false, false>;
FORK1S_KERNEL struct gemm_pack_rhs<double, Index, Fork1sInput<ColMajor>, Fork1sTraits::nr, ColMajor, false,
                                   false>;
FORK1S_KERNEL struct gemm_pack_rhs<double, Index, Fork1sInput<RowMajor>, Fork1sTraits::nr, RowMajor, false,
                                   false>;
FORK1S_KERNEL struct general_matrix_matrix_product<Index, double, ColMajor, false, double, ColMajor, false,
                                                   ColMajor, 1>;
FORK1S_KERNEL struct general_matrix_matrix_product<Index, double, ColMajor, false, double, RowMajor, false,
                                                   ColMajor, 1>;
FORK1S_KERNEL struct general_matrix_matrix_product<Index, double, RowMajor, false, double, ColMajor, false,
                                                   ColMajor, 1>;
FORK1S_KERNEL struct general_matrix_matrix_product<Index, double, RowMajor, false, double, RowMajor, false,
                                                   ColMajor, 1>;
FORK1S_KERNEL struct general_matrix_vector_product<Index, double, Fork1sInput<ColMajor>, ColMajor, false,
                                                   double, Fork1sInput<ColMajor>, false, 0>;
FORK1S_KERNEL struct general_matrix_vector_product<Index, double, Fork1sInput<ColMajor>, ColMajor, false,
                                                   double, Fork1sInput<RowMajor>, false, 0>;
FORK1S_KERNEL struct general_matrix_vector_product<Index, double, Fork1sInput<RowMajor>, RowMajor, false,
                                                   double, Fork1sInput<ColMajor>, false, 0>;
FORK1S_KERNEL struct general_matrix_vector_product<Index, double, Fork1sInput<RowMajor>, RowMajor, false,
                                                   double, Fork1sInput<RowMajor>, false, 0>;
FORK1S_KERNEL struct general_matrix_vector_product<Index, double, Fork1sInput<RowMajor>, RowMajor, false,
                                                   double, Fork1sInput<RowMajor>, false, 1>;
FORK1S_KERNEL void evaluateProductBlockingSizesHeuristic<double, double, 1, Index>(Index&, Index&, Index&,
                                                                                   Index);
FORK1S_KERNEL void evaluateProductBlockingSizesHeuristic<double, double, 4, Index>(Index&, Index&, Index&,
                                                                                   Index);

}  // namespace Eigen::internal

#endif
