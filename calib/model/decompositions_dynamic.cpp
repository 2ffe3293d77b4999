// The dynamic sizes of decompositions.h.
#include "calib/model/decompositions.h"

HUETRACK_PRODUCTS();
HUETRACK_EIGENVALUES(, Eigen::MatrixXd);
HUETRACK_LDLT(, Eigen::MatrixXd, Eigen::VectorXd);
template void Eigen::HouseholderQR<Eigen::MatrixXd>::computeInPlace();
