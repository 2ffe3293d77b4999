// Report on the accuracy of lengths in a measuring volume: PASS or FAIL against a limit.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "calib/certify/certificate.h"
#include "calib/certify/one_color_bar.h"
#include "calib/report/document.h"

namespace huetrack::report {

// Tracking statistics of a target in the recording.
struct TargetTally {
  std::string name;
  std::size_t sets = 0, tracking = 0;  // frame sets; of these tracked
  std::size_t gaps = 0;                // interruptions of tracking after it was first found
  double longest_gap_s = 0;
  std::size_t rests = 0;
  double rest_scatter_m = 0;  // rms over the rests: repeatability of a position at rest
};

// Statistics of the frame sets for a bar whose balls have the same colour.
struct OneColorTally {
  certify::OneColorBar bar{};
  double length_m = 0;
  std::size_t sets = 0;
  double began_s = 0;  // the first one; origin of reported times
};

struct CertificateInput {
  std::string rig_name, what;  // "a bar of 500.00 mm between lime and pink", "5 marked places"
  bool is_of_places = false;   // else of a bar
  std::optional<double> limit_m{};
  std::vector<TargetTally> targets{};
  std::optional<OneColorTally> one_color{};
  std::vector<std::string> named{};  // mistakes reported during tracking (a camera moved, ...); one sentence each
  std::vector<std::pair<std::string, std::string>> cameras{};  // name; timing
  std::optional<double> set_ms{};                              // processing time of a frame set; nullopt: unknown
  bool has_incomplete_sets = false;
  double incomplete_share = 0;  // of frame sets without a camera's frame
  std::vector<std::pair<std::string, std::string>> made_of{};
};

struct CertificateReport {
  Verdict verdict = Verdict::usable;  // usable: PASS; failed: FAIL; doubtful: too few measurements, no limit, or doubts
  std::vector<std::string> doubts;    // one sentence each, with advice
  Document document;
};

CertificateReport report_on(const certify::Certificate& certificate,
                            const std::vector<certify::MeasuredLength>& lengths, const calib::CameraRig& rig,
                            const CertificateInput& input);

}  // namespace huetrack::report
