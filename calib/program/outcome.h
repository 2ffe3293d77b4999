// Output of a calibration: report, rig file, exit status.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "calib/gather/find_boards.h"
#include "calib/model/camera_rig.h"
#include "calib/program/commands.h"
#include "calib/report/calibration_report.h"
#include "calib/report/document.h"

namespace huetrack::program {

ExitStatus status_of(report::Verdict verdict);

report::Reader reader();  // of this program's report

// Input of the report.
report::ReportInput report_input(const gather::FoundBoards& found, const std::vector<std::string>& inputs);

struct OutputFiles {
  std::filesystem::path rig;
  std::filesystem::path report;  // .html; a .txt of the same name is written, too
  bool overwrite = false;        // a doubtful result may replace an existing rig
  bool quiet = false;
  bool report_was_named = false;          // false: next to its rig, with its name
  std::optional<double> temperature_c{};  // during the recording, if known
};

// throws InputError if the folder of the rig or the report is missing: to be called before the work.
void require_folders(const OutputFiles& files);

calib::UtcTime utc_now();

// Prints and writes the report, and the rig as far as the verdict allows: a failed one is not written; a doubtful one
// does not replace an existing rig, but is written as NAME.doubtful.yaml, with its own report. Fills made_by of the
// rig. throws std::system_error, std::runtime_error: a file cannot be written
ExitStatus put_out(const report::CalibrationReport& report, calib::CameraRig rig, const gather::FoundBoards& found,
                   const OutputFiles& files);

// Sends "verdict" with its name and a sentence to a calling program, if there is one.
void send_verdict(report::Verdict verdict, const std::string& summary);

// Writes `name` as HTML, and a PDF of the same name. throws std::system_error, std::runtime_error
void write_document(const report::Document& document, const std::filesystem::path& name);
// Appends .html unless it ends in .html or .htm.
std::filesystem::path page_name(std::filesystem::path name);

// The file for a rig of this verdict (usable, doubtful): NAME.doubtful.yaml if it must not replace an existing one.
std::filesystem::path place_for(report::Verdict verdict, const std::filesystem::path& rig, bool overwrite);

}  // namespace huetrack::program
