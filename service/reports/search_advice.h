// Advice to a user whose target is not found, or was found late, by the evidence of the search.
#pragma once

#include <string>
#include <vector>

#include "object_tracking/objects/search_findings.h"

namespace huetrack::reports {

// One sentence; empty when nothing was searched. cameras: their names, in the order of the rig.
std::string search_advice(const objects::SearchFindings& findings, const object_tracking::TargetOptions& target,
                          const std::vector<std::string>& cameras);
// Of a target that was found, but late; empty where there is no evidence why.
std::string late_advice(const objects::SearchFindings& findings, const object_tracking::TargetOptions& target);

}  // namespace huetrack::reports
