// What becomes of a calibration: the report, the rig file, and what the program ends with.
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

// Of what was looked at, for the report.
report::ReportInput report_input(const gather::FoundBoards& found, const std::vector<std::string>& inputs);

struct OutputFiles {
  std::filesystem::path rig;
  std::filesystem::path report;  // .html; a .txt of the same name is written beside it
  bool overwrite = false;        // a doubtful result may replace a rig that is there
  bool quiet = false;
  bool report_was_named = false;          // otherwise it stands beside the rig that it is of, and has its name
  std::optional<double> temperature_c{};  // while the pictures were taken, if somebody told
};

// throws InputError: the rig or the report has no folder to be written into: better now than after all the work.
void require_folders(const OutputFiles& files);

calib::UtcTime utc_now();

// Prints the report, writes it, and the rig when the verdict allows: a failed result is not written; a doubtful one
// does not replace a rig that is there but goes beside it, as NAME.doubtful.yaml; nor does its report replace that of
// the rig that is there. made_by of the rig is filled.
// throws std::system_error, std::runtime_error: a file cannot be written
ExitStatus put_out(const report::CalibrationReport& report, calib::CameraRig rig, const gather::FoundBoards& found,
                   const OutputFiles& files);

// Where programs are told: "verdict", its name and a sentence.
void tell_verdict(report::Verdict verdict, const std::string& summary);

// Writes it as HTML there, and as PDF beside it. throws std::system_error, std::runtime_error
void write_document(const report::Document& document, const std::filesystem::path& name);
// With .html at its end where it has neither that nor .htm.
std::filesystem::path page_name(std::filesystem::path name);

// Where a rig of this verdict (usable, doubtful) goes: NAME.doubtful.yaml where it must not replace what is there.
std::filesystem::path place_for(report::Verdict verdict, const std::filesystem::path& rig, bool overwrite);

}  // namespace huetrack::program
