// Report on `huetrack-calibrate wave`.
#pragma once

#include <string>
#include <vector>

#include "calib/report/calibration_report.h"
#include "calib/report/document.h"
#include "calib/wave/wave.h"

namespace huetrack::report {

struct WaveReport {
  Verdict verdict = Verdict::usable;  // doubtful: there are doubts
  std::vector<std::string> doubts;    // each with advice
  std::vector<std::string> notes;
  std::string scale_from;  // "the distance between cam0 and cam1, 4.020 m"
};

WaveReport report_on(const wave::WaveResult& result, Reader reader = Reader::terminal);

// Of positions, with the scale's part, in metres rms: in the configured volume, otherwise where the ball was.
double expected_error_m(const wave::WaveResult& result);

// Lines for the end: what a configuration needs to search where the ball was.
std::string next_step_text(const wave::WaveResult& result);

std::string to_text(const WaveReport& report, const wave::WaveResult& result);
// One clause: the expected error of positions, once, and the first doubt.
std::string summary(const WaveReport& report, const wave::WaveResult& result);
Document document_of(const WaveReport& report, const wave::WaveResult& result);

}  // namespace huetrack::report
