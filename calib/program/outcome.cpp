#include "calib/program/outcome.h"

#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <map>
#include <system_error>

#include "calib/gather/picture_source.h"
#include "calib/gather/progress_line.h"
#include "calib/gather/write_file.h"
#include "calib/model/rig_yaml.h"

namespace huetrack::program {
namespace {

namespace fs = std::filesystem;

// The report of a rig that is not replaced is not replaced either.
fs::path report_place(report::Verdict verdict, const OutputFiles& files) {
  std::error_code error;
  const bool replaces = verdict == report::Verdict::usable || (verdict == report::Verdict::doubtful && files.overwrite);
  if (files.report_was_named || replaces || !fs::exists(files.rig, error)) return files.report;
  return fs::path(files.rig).replace_extension("." + std::string(report::name(verdict)) + ".report.html");
}

}  // namespace

void require_folders(const OutputFiles& files) {
  for (const fs::path& file : {files.rig, files.report}) {
    std::error_code error;
    const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
    if (!fs::is_directory(folder, error))
      throw gather::InputError(folder.string() + ": no such folder; it is needed for " + file.filename().string() +
                               " into");
  }
}

calib::UtcTime utc_now() {
  return std::chrono::floor<std::chrono::seconds>(std::chrono::system_clock::now());
}

ExitStatus status_of(report::Verdict verdict) {
  static constexpr ExitStatus statuses[] = {ExitStatus::usable, ExitStatus::doubtful, ExitStatus::failed};
  return statuses[std::size_t(verdict)];
}

report::Reader reader() {
  return gather::ProgressLine::is_machine_readable() ? report::Reader::page : report::Reader::terminal;
}

report::ReportInput report_input(const gather::FoundBoards& found, const std::vector<std::string>& inputs) {
  report::ReportInput input;
  for (const gather::PictureTally& camera : found.cameras)
    input.cameras.push_back({camera.pictures, camera.boards, camera.motion_blurred()});
  input.warnings = found.warnings;
  input.board_doubt = found.board_doubt;
  input.reader = reader();
  input.made_of.emplace_back("tool", "huetrack-calibrate " HUETRACK_VERSION);
  if (!inputs.empty()) input.made_of.emplace_back("inputs", fmt::to_string(fmt::join(inputs, " ")));
  std::string sets = std::to_string(found.set_at_s.size()) + " moments used, " + std::to_string(found.sets_looked_at) +
                     " of " + std::to_string(found.sets_seen) + " looked at";
  if (found.duplicates > 0) sets += "; " + std::to_string(found.duplicates) + " left out: the board had not moved";
  if (found.thinned > 0) sets += "; " + std::to_string(found.thinned) + " left out: there were more than enough";
  input.made_of.emplace_back("pictures", sets);
  return input;
}

void send_verdict(report::Verdict verdict, const std::string& summary) {
  if (gather::ProgressLine::is_machine_readable())
    gather::send_to_program("verdict", {std::string(report::name(verdict)), summary});
}

void write_document(const report::Document& document, const fs::path& name) {
  const fs::path html = page_name(name);
  gather::write_files(
      {{html, report::to_html(document)}, {fs::path(html).replace_extension(".pdf"), report::to_pdf(document)}});
}

fs::path page_name(fs::path name) {
  if (name.extension() != ".html" && name.extension() != ".htm") name += ".html";
  return name;
}

fs::path place_for(report::Verdict verdict, const fs::path& rig, bool overwrite) {
  std::error_code error;
  if (verdict == report::Verdict::usable || overwrite || !fs::exists(rig, error)) return rig;
  const fs::path beside = fs::path(rig).replace_extension(".doubtful.yaml");
  std::fprintf(stderr, "huetrack-calibrate: doubtful: %s is kept; the new rig is %s (--overwrite replaces it)\n",
               rig.c_str(), beside.c_str());
  return beside;
}

ExitStatus put_out(const report::CalibrationReport& report, calib::CameraRig rig, const gather::FoundBoards& found,
                   const OutputFiles& files) {
  std::map<std::pair<int, std::string>, const report::EmbeddedPicture*> pictures;
  for (std::size_t v = 0; v < found.views.size() && v < found.thumbnails.size(); ++v) {
    pictures[{found.views[v].camera, found.views[v].image}] = &found.thumbnails[v];
  }
  const auto picture_of = [&](int camera, const std::string& image) -> const report::EmbeddedPicture* {
    const auto known = pictures.find({camera, image});
    return known == pictures.end() ? nullptr : known->second;
  };
  const std::string text = report::to_text(report);
  const fs::path report_file = report_place(report.verdict, files);
  gather::write_files(
      {{report_file, report::to_html(report, picture_of)}, {fs::path(report_file).replace_extension(".txt"), text}});
  if (!files.quiet) std::fputs(text.c_str(), stdout);
  send_verdict(report.verdict, report::summary(report));

  rig.made = {.at = utc_now(), .temperature_c = files.temperature_c, .checks = {}};
  rig.made_by.clear();
  for (const auto& [key, value] : report.made_of) rig.made_by.emplace_back(key, value);
  rig.made_by.emplace_back("board", report.board);
  rig.made_by.emplace_back("rms_px", fmt::format("{:.4g}", report.rms_px));
  if (report.volume && report.volume->covered > 0)
    rig.made_by.emplace_back("expected_mm", fmt::format("{:.3g}", 1000 * report.volume->median_by_calibration_m));
  rig.made_by.emplace_back("verdict", std::string(report::name(report.verdict)));

  std::error_code error;
  const bool is_there = fs::exists(files.rig, error);
  if (report.verdict == report::Verdict::failed) {
    std::fprintf(stderr, "huetrack-calibrate: failed: %s %s; see %s\n", files.rig.c_str(),
                 is_there ? "is kept" : "is not written", report_file.c_str());
    return ExitStatus::failed;
  }
  const fs::path written = place_for(report.verdict, files.rig, files.overwrite);
  calib::write_rig(rig, written);
  if (!files.quiet) std::printf("\nwritten: %s; the report: %s\n", written.c_str(), report_file.c_str());
  return status_of(report.verdict);
}

}  // namespace huetrack::program
