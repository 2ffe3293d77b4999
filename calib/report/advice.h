// What to do about what a solver found at fault. Solvers state facts; what to do is added to them here, and only here.
#pragma once

#include <string>
#include <vector>

#include "calib/solver/calibration_error.h"

namespace huetrack::report {

// What to do: a clause, or sentences that begin with a capital letter; without a full stop. Empty: Fault::none.
std::string advice(const solver::Reason& reason);

// For people: each fact, and what to do about it. In one line.
std::string told(const std::vector<solver::Reason>& reasons);
std::string told(const solver::CalibrationError& error);

}  // namespace huetrack::report
