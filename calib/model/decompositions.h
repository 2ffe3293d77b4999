// Explicit instantiations of Eigen's common decompositions and dynamic-size product kernels, compiled once in
// decompositions.cpp: each saves a file up to three seconds of compile time. Part of the precompiled headers, so no
// file includes it; without them (preset debug) every file instantiates its own, with the same values.
//
// They are no specialisations: behaviour is Eigen's, and files with and without them may be linked together. The
// kernels' names are internal to Eigen 3.4, because the public ones (A * B, A.solve(b)) have one type per expression;
// another version of Eigen fails to compile.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>

#define HUETRACK_EIGENVALUES(EXTERN, M)                                                           \
  EXTERN template Eigen::SelfAdjointEigenSolver<M>& Eigen::SelfAdjointEigenSolver<M>::compute<M>( \
      const Eigen::EigenBase<M>&, int)
#define HUETRACK_LDLT(EXTERN, M, V)                                                       \
  EXTERN template Eigen::LDLT<M>& Eigen::LDLT<M>::compute<M>(const Eigen::EigenBase<M>&); \
  EXTERN template void Eigen::LDLT<M>::_solve_impl<V, V>(const V&, V&) const
#define HUETRACK_LLT(EXTERN, M, V)                                                      \
  EXTERN template Eigen::LLT<M>& Eigen::LLT<M>::compute<M>(const Eigen::EigenBase<M>&); \
  EXTERN template void Eigen::LLT<M>::_solve_impl<V, V>(const V&, V&) const
#define HUETRACK_INVERSE(EXTERN, M)                                                                                    \
  EXTERN template class Eigen::PartialPivLU<M>;                                                                        \
  EXTERN template void Eigen::PartialPivLU<M>::_solve_impl<M::IdentityReturnType, M>(const M::IdentityReturnType&, M&) \
      const
#define HUETRACK_SVD(EXTERN, M) \
  EXTERN template Eigen::JacobiSVD<M>& Eigen::JacobiSVD<M>::compute(const M&, unsigned int)

namespace huetrack::calib {
using DecomposedMatrix6 = Eigen::Matrix<double, 6, 6>;
using DecomposedVector6 = Eigen::Matrix<double, 6, 1>;
// Eigen's mappers for the operands of a product, by storage order, and for its result.
template <int storage>
using ProductOperand = Eigen::internal::const_blas_data_mapper<double, Eigen::Index, storage>;
using ProductResult = Eigen::internal::blas_data_mapper<double, Eigen::Index, Eigen::ColMajor, Eigen::Unaligned, 1>;
using ProductPacket = Eigen::internal::packet_traits<double>::type;
}  // namespace huetrack::calib

#define HUETRACK_MATRIX_PRODUCT(EXTERN, LHS, RHS)                                                                      \
  EXTERN template struct Eigen::internal::general_matrix_matrix_product<Eigen::Index, double, LHS, false, double, RHS, \
                                                                        false, Eigen::ColMajor, 1>
#define HUETRACK_VECTOR_PRODUCT(EXTERN, LHS, RHS)                                     \
  EXTERN template struct Eigen::internal::general_matrix_vector_product<              \
      Eigen::Index, double, huetrack::calib::ProductOperand<LHS>, LHS, false, double, \
      huetrack::calib::ProductOperand<RHS>, false, 0>
#define HUETRACK_TRIANGULAR_SOLVE(EXTERN, MODE, STORAGE)                                                               \
  EXTERN template struct Eigen::internal::triangular_solve_matrix<double, Eigen::Index, Eigen::OnTheLeft, MODE, false, \
                                                                  STORAGE, Eigen::ColMajor, 1>
#define HUETRACK_PACK_LEFT(EXTERN, STORAGE)                                                             \
  EXTERN template struct Eigen::internal::gemm_pack_lhs<double, Eigen::Index,                           \
                                                        huetrack::calib::ProductOperand<STORAGE>, 4, 2, \
                                                        huetrack::calib::ProductPacket, STORAGE, false, false>
#define HUETRACK_PRODUCTS(EXTERN)                                                                                      \
  EXTERN template struct Eigen::internal::gebp_kernel<double, double, Eigen::Index, huetrack::calib::ProductResult, 4, \
                                                      4, false, false>;                                                \
  HUETRACK_PACK_LEFT(EXTERN, Eigen::ColMajor);                                                                         \
  HUETRACK_PACK_LEFT(EXTERN, Eigen::RowMajor);                                                                         \
  EXTERN template struct Eigen::internal::gemm_pack_rhs<                                                               \
      double, Eigen::Index, huetrack::calib::ProductOperand<Eigen::ColMajor>, 4, Eigen::ColMajor, false, false>;       \
  EXTERN template struct Eigen::internal::gemm_pack_rhs<double, Eigen::Index, huetrack::calib::ProductResult, 4,       \
                                                        Eigen::ColMajor, false, true>;                                 \
  HUETRACK_MATRIX_PRODUCT(EXTERN, Eigen::ColMajor, Eigen::ColMajor);                                                   \
  HUETRACK_MATRIX_PRODUCT(EXTERN, Eigen::ColMajor, Eigen::RowMajor);                                                   \
  HUETRACK_MATRIX_PRODUCT(EXTERN, Eigen::RowMajor, Eigen::ColMajor);                                                   \
  HUETRACK_VECTOR_PRODUCT(EXTERN, Eigen::ColMajor, Eigen::ColMajor);                                                   \
  HUETRACK_VECTOR_PRODUCT(EXTERN, Eigen::ColMajor, Eigen::RowMajor);                                                   \
  HUETRACK_VECTOR_PRODUCT(EXTERN, Eigen::RowMajor, Eigen::ColMajor);                                                   \
  HUETRACK_TRIANGULAR_SOLVE(EXTERN, Eigen::Lower, Eigen::ColMajor);                                                    \
  HUETRACK_TRIANGULAR_SOLVE(EXTERN, Eigen::UnitLower, Eigen::ColMajor);                                                \
  HUETRACK_TRIANGULAR_SOLVE(EXTERN, Eigen::Upper, Eigen::ColMajor);                                                    \
  HUETRACK_TRIANGULAR_SOLVE(EXTERN, Eigen::UnitUpper, Eigen::RowMajor);                                                \
  EXTERN template void Eigen::internal::evaluateProductBlockingSizesHeuristic<double, double, 1, Eigen::Index>(        \
      Eigen::Index&, Eigen::Index&, Eigen::Index&, Eigen::Index);                                                      \
  EXTERN template void Eigen::internal::evaluateProductBlockingSizesHeuristic<double, double, 4, Eigen::Index>(        \
      Eigen::Index&, Eigen::Index&, Eigen::Index&, Eigen::Index)

#define HUETRACK_DECOMPOSITIONS(EXTERN)                                                             \
  HUETRACK_PRODUCTS(EXTERN);                                                                        \
  HUETRACK_EIGENVALUES(EXTERN, Eigen::Matrix2d);                                                    \
  HUETRACK_EIGENVALUES(EXTERN, Eigen::Matrix3d);                                                    \
  HUETRACK_EIGENVALUES(EXTERN, Eigen::MatrixXd);                                                    \
  HUETRACK_LDLT(EXTERN, Eigen::Matrix3d, Eigen::Vector3d);                                          \
  HUETRACK_LDLT(EXTERN, huetrack::calib::DecomposedMatrix6, huetrack::calib::DecomposedVector6);    \
  HUETRACK_LDLT(EXTERN, Eigen::MatrixXd, Eigen::VectorXd);                                          \
  HUETRACK_LLT(EXTERN, Eigen::Matrix2d, Eigen::Vector2d);                                           \
  HUETRACK_LLT(EXTERN, Eigen::Matrix3d, Eigen::Vector3d);                                           \
  HUETRACK_LLT(EXTERN, huetrack::calib::DecomposedMatrix6, huetrack::calib::DecomposedVector6);     \
  HUETRACK_INVERSE(EXTERN, huetrack::calib::DecomposedMatrix6);                                     \
  HUETRACK_SVD(EXTERN, Eigen::Matrix3d);                                                            \
  EXTERN template void Eigen::LDLT<Eigen::MatrixXd>::_solve_impl<Eigen::MatrixXd, Eigen::MatrixXd>( \
      const Eigen::MatrixXd&, Eigen::MatrixXd&) const;                                              \
  EXTERN template void Eigen::HouseholderQR<Eigen::MatrixXd>::computeInPlace();                     \
  EXTERN template Eigen::AngleAxisd& Eigen::AngleAxisd::operator=                                   \
      <Eigen::Quaterniond>(const Eigen::QuaternionBase<Eigen::Quaterniond>&)

HUETRACK_DECOMPOSITIONS(extern);
