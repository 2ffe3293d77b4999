// Advice for each fault that a solver reports. Solvers state facts; only this module adds advice.
#pragma once

#include <string>
#include <vector>

#include "calib/solver/calibration_error.h"

namespace huetrack::report {

// A clause, or sentences starting with a capital letter, without a full stop. Empty: Fault::none.
std::string advice(const solver::Reason& reason);

// Each fact with its advice, in one line.
std::string with_advice(const std::vector<solver::Reason>& reasons);
std::string with_advice(const solver::CalibrationError& error);

}  // namespace huetrack::report
