// Eigen's decompositions of the matrices that are met all over the house, instantiated once, in decompositions.cpp: a
// file that instantiates one by itself compiles for up to three seconds longer. It is part of the precompiled headers,
// so nobody includes it; without them (preset debug) every file has its own, and the values are the same.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>

#define HUETRACK_EIGENVALUES(EXTERN, M)                                                           \
  EXTERN template Eigen::SelfAdjointEigenSolver<M>& Eigen::SelfAdjointEigenSolver<M>::compute<M>( \
      const Eigen::EigenBase<M>&, int)
#define HUETRACK_LDLT(EXTERN, M, V)                                                       \
  EXTERN template Eigen::LDLT<M>& Eigen::LDLT<M>::compute<M>(const Eigen::EigenBase<M>&); \
  EXTERN template void Eigen::LDLT<M>::_solve_impl<V, V>(const V&, V&) const
#define HUETRACK_LLT(EXTERN, M) EXTERN template Eigen::LLT<M>& Eigen::LLT<M>::compute<M>(const Eigen::EigenBase<M>&)

namespace huetrack::calib {
using DecomposedMatrix6 = Eigen::Matrix<double, 6, 6>;
using DecomposedVector6 = Eigen::Matrix<double, 6, 1>;
}  // namespace huetrack::calib

#define HUETRACK_DECOMPOSITIONS(EXTERN)                                                          \
  HUETRACK_EIGENVALUES(EXTERN, Eigen::Matrix2d);                                                 \
  HUETRACK_EIGENVALUES(EXTERN, Eigen::Matrix3d);                                                 \
  HUETRACK_LDLT(EXTERN, Eigen::Matrix3d, Eigen::Vector3d);                                       \
  HUETRACK_LDLT(EXTERN, huetrack::calib::DecomposedMatrix6, huetrack::calib::DecomposedVector6); \
  HUETRACK_LDLT(EXTERN, Eigen::MatrixXd, Eigen::VectorXd);                                       \
  HUETRACK_LLT(EXTERN, Eigen::Matrix3d)

HUETRACK_DECOMPOSITIONS(extern);
