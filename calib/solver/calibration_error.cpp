#include "calib/solver/calibration_error.h"

#include <utility>

namespace huetrack::solver {

std::string facts(const std::vector<Reason>& reasons) {
  std::string text;
  for (const Reason& reason : reasons) text += reason.fact;
  return text;
}

std::vector<Reason> after(const std::string& words, std::vector<Reason> reasons) {
  if (reasons.empty()) reasons.emplace_back();
  reasons.front().fact.insert(0, words);
  return reasons;
}

CalibrationError::CalibrationError(const std::string& fact, Fault fault)
    : CalibrationError(std::vector<Reason>{{.fact = fact, .fault = fault}}) {}

CalibrationError::CalibrationError(std::vector<Reason> reasons)
    : std::runtime_error(facts(reasons)), reasons_(std::move(reasons)) {}

Fault CalibrationError::fault() const {
  for (const Reason& reason : reasons_) {
    if (reason.fault != Fault::none) return reason.fault;
  }
  return Fault::none;
}

}  // namespace huetrack::solver
