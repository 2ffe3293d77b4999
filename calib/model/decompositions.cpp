// The small fixed sizes of decompositions.h. Three files share its list, because the time of GCC 12 grows with the
// square of the expression types that a file sees; what a file leaves out and a program uses is an undefined reference.
#include "calib/model/decompositions.h"

HUETRACK_EIGENVALUES(, Eigen::Matrix2d);
HUETRACK_EIGENVALUES(, Eigen::Matrix3d);
HUETRACK_LDLT(, Eigen::Matrix3d, Eigen::Vector3d);
HUETRACK_LLT(, Eigen::Matrix3d, Eigen::Vector3d);
HUETRACK_SVD(, Eigen::Matrix3d);
template Eigen::AngleAxisd& Eigen::AngleAxisd::operator=
    <Eigen::Quaterniond>(const Eigen::QuaternionBase<Eigen::Quaterniond>&);
