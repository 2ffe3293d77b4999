// Results of the solvers in words: one clause each, without a full stop.
#pragma once

#include <string>

#include "calib/solver/extrinsics.h"

namespace huetrack::report {

// Why this lens model was chosen.
std::string choice_text(const solver::Intrinsics& lens);

// Whether and why the lenses were refined with all cameras.
std::string refinement_text(const solver::Extrinsics& result);

std::string contradiction_text(const solver::LensContradiction& contradiction, const std::string& camera);

std::string dropped_text(const solver::ViewMisfit& misfit);

// "latency 21.3 +- 0.4 ms, readout 28.1 +- 0.8 ms": as far as the views determine them; may be empty.
std::string timing_text(const solver::Adjustment& adjustment, const solver::AdjustedCamera& camera);

}  // namespace huetrack::report
