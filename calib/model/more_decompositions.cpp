#include "calib/model/decompositions.h"

namespace Eigen::internal {
HUETRACK_SMALL_LLT_DEFINITION(10)
HUETRACK_SMALL_LLT_DEFINITION(18)

using huetrack::calib::DecomposedMatrix6;
void compute_inverse<DecomposedMatrix6, DecomposedMatrix6, 6>::run(const DecomposedMatrix6& matrix,
                                                                   DecomposedMatrix6& result) {
  result = matrix.partialPivLu().inverse();
}
}  // namespace Eigen::internal

HUETRACK_MORE_DECOMPOSITIONS();
