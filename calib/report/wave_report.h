// What `huetrack-calibrate wave` found, for people.
#pragma once

#include <string>
#include <vector>

#include "calib/report/calibration_report.h"
#include "calib/report/document.h"
#include "calib/wave/wave.h"

namespace huetrack::report {

struct WaveReport {
  Verdict verdict = Verdict::usable;  // or doubtful: there are doubts
  std::vector<std::string> doubts;    // why it may not be usable, each with what to do
  std::vector<std::string> notes;
  std::string scale_from;  // "the distance between cam0 and cam1, 4.020 m"
};

WaveReport report_on(const wave::WaveResult& result);

std::string to_text(const WaveReport& report, const wave::WaveResult& result);
// In part of a sentence: how good it is, and the first of what speaks against it.
std::string summary(const WaveReport& report, const wave::WaveResult& result);
Document document_of(const WaveReport& report, const wave::WaveResult& result);  // the same

}  // namespace huetrack::report
