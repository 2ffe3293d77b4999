#include "calib/model/decompositions.h"

HUETRACK_DECOMPOSITIONS();
