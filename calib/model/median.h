#pragma once

#include "calib/files/median.h"

namespace huetrack::calib {

using files::median;
using files::median_in_place;
using files::quantile_in_place;

}  // namespace huetrack::calib
