#include "calib/model/decompositions.h"

HUETRACK_MORE_DECOMPOSITIONS();
