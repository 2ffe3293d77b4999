// What only calibration and the camera tracker use of decompositions.h: a build without them leaves this file out.
#include "calib/model/decompositions.h"

HUETRACK_LDLT(, huetrack::calib::DecomposedMatrix6, huetrack::calib::DecomposedVector6);
HUETRACK_LLT(, Eigen::Matrix2d, Eigen::Vector2d);
HUETRACK_LLT(, huetrack::calib::DecomposedMatrix6, huetrack::calib::DecomposedVector6);
HUETRACK_INVERSE(, huetrack::calib::DecomposedMatrix6);
template void Eigen::LDLT<Eigen::MatrixXd>::_solve_impl<Eigen::MatrixXd, Eigen::MatrixXd>(const Eigen::MatrixXd&,
                                                                                          Eigen::MatrixXd&) const;
