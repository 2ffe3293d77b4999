// Report on the expected error over a volume, before anything is recorded.
#pragma once

#include <string>
#include <vector>

#include "calib/report/document.h"
#include "calib/solver/volume_accuracy.h"

namespace huetrack::report {

struct MapInput {
  std::string rig_name;        // for the title
  std::string volume_is_from;  // "of the configuration", one clause
};

// next: places where another camera would help; may be empty. Verdict `doubtful`: two cameras see less than half of the
// volume.
struct MapReport {
  Verdict verdict = Verdict::usable;
  Document document;
};
MapReport map_report(const calib::CameraRig& rig, const solver::VolumeAccuracy& map,
                     const std::vector<solver::CameraPlace>& next, const MapInput& input);

}  // namespace huetrack::report
