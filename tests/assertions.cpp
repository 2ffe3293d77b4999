#include "assertions.h"

HUETRACK_ASSERTIONS();
