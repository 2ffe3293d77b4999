#include "calib/exchange/exchange.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "calib/exchange/exchanged_camera.h"
#include "calib/files/config_error.h"
#include "calib/model/nearest_lens.h"
#include "recordings/bags/bag.h"

namespace huetrack::exchange {
namespace {

constexpr std::array<std::pair<ExchangeFormat, std::string_view>, 5> names{{{ExchangeFormat::ros, "ros"},
                                                                            {ExchangeFormat::opencv, "opencv"},
                                                                            {ExchangeFormat::kalibr, "kalibr"},
                                                                            {ExchangeFormat::aniposelib, "aniposelib"},
                                                                            {ExchangeFormat::caliscope, "caliscope"}}};

constexpr double widest_rig_m = 50;  // a wider rig is probably in millimetres

enum class Indent { none, any, some };

// Whether a line begins with `word`, blanks and `mark` (0: anything). Not a std::regex, which recurses once per
// character.
bool has_line(std::string_view text, Indent indent, std::string_view word, char mark = 0) {
  constexpr std::string_view blanks = " \t\n\v\f\r", line_ends = "\n\r";
  for (auto at = text.find(word); at != std::string_view::npos; at = text.find(word, at + 1)) {
    const auto next = text.find_first_not_of(blanks, at + word.size());
    if (mark != 0 && (next == std::string_view::npos || text[next] != mark)) continue;
    if (indent == Indent::none) {
      if (at == 0 || line_ends.find(text[at - 1]) != std::string_view::npos) return true;
      continue;
    }
    // Only blanks may precede the word on its line.
    const std::string_view before = text.substr(0, at);
    const std::string_view blank = before.substr(before.find_last_not_of(blanks) + 1);
    const auto line_end = blank.find_first_of(line_ends);
    const std::size_t least = indent == Indent::some ? 1 : 0;
    if (blank.size() == at ? at >= least : line_end != std::string_view::npos && line_end + 1 + least <= blank.size())
      return true;
  }
  return false;
}

}  // namespace

std::string_view name(ExchangeFormat format) {
  for (const auto& [f, text] : names) {
    if (f == format) return text;
  }
  return "";
}

std::optional<ExchangeFormat> exchange_format_of(std::string_view word) {
  for (const auto& [format, text] : names) {
    if (text == word) return format;
  }
  return std::nullopt;
}

ExchangeFormat detect_format(const std::filesystem::path& file) {
  if (bags::is_bag(file)) return ExchangeFormat::ros;
  const std::string text = text_of(file);
  const std::string extension = file.extension().string();
  if (extension == ".xml" || extension == ".json" || text.starts_with("%YAML:1.0") ||
      text.find("opencv-matrix") != std::string::npos)
    return ExchangeFormat::opencv;
  if (extension == ".toml") {
    const auto has_key = [&](std::string_view key) { return has_line(text, Indent::any, key, '='); };
    if (has_line(text, Indent::any, "[cameras.") || has_key("cam_id") || has_key("port") || has_key("rotation_count"))
      return ExchangeFormat::caliscope;
    if (has_line(text, Indent::any, "[cam")) return ExchangeFormat::aniposelib;
  }
  if (has_line(text, Indent::none, "cam0", ':') && has_line(text, Indent::some, "camera_model", ':'))
    return ExchangeFormat::kalibr;
  if (has_line(text, Indent::none, "distortion_model", ':') && has_line(text, Indent::none, "camera_matrix", ':'))
    return ExchangeFormat::ros;
  throw files::ConfigError(
      file, 0, "has no known calibration format; give it with --from: ros, opencv, kalibr, aniposelib or caliscope");
}

Imported import_rig(std::span<const std::filesystem::path> files, const ImportOptions& options) {
  if (files.empty()) throw ExchangeError("no file to import");
  const ExchangeFormat format = options.format ? *options.format : detect_format(files.front());
  if (format != ExchangeFormat::opencv && files.size() > 1) {
    throw ExchangeError(
        format == ExchangeFormat::ros
            ? "a camera_info file holds one camera and no pose: import each into its own file, then find the poses "
              "with extrinsics or wave"
            : "a file of this format holds all cameras: give only one");
  }
  const std::filesystem::path& file = files.front();
  Imported out;
  switch (format) {
    case ExchangeFormat::ros:
      out = bags::is_bag(file) ? import_bag(file, options) : import_camera_info(file, options);
      break;
    case ExchangeFormat::opencv:
      out = import_opencv(files, options);
      break;
    case ExchangeFormat::kalibr:
      out = import_kalibr(file, options);
      break;
    case ExchangeFormat::aniposelib:
      out = import_aniposelib(file, options);
      break;
    case ExchangeFormat::caliscope:
      out = import_caliscope(file, options);
      break;
  }
  for (calib::Camera& camera : out.rig.cameras) camera.cam_from_world.translation *= options.metres_per_unit;
  double widest = 0;
  for (const calib::Camera& a : out.rig.cameras) {
    for (const calib::Camera& b : out.rig.cameras) widest = std::max(widest, (a.centre() - b.centre()).norm());
  }
  if (widest > widest_rig_m) {
    throw files::ConfigError(
        file, 0,
        fmt::format("the cameras are up to {:.0f} m apart: if the file is in millimetres, give --unit mm", widest));
  }
  if (out.rig.cameras.size() > 1) {
    out.notes.push_back(fmt::format("the cameras are up to {:.3f} m apart: if that is wrong, give --unit", widest));
  }
  if (out.rig.made_by.empty()) {
    out.rig.made_by.emplace_back("imported_from", file.filename().string());
    out.rig.made_by.emplace_back("format", std::string(name(format)));
  }
  if (!options.cameras.empty()) {
    for (const std::string& name : options.cameras) {
      if (!out.rig.index_of(name)) throw files::ConfigError(file, 0, "has no camera " + name);
    }
    std::erase_if(out.rig.cameras, [&](const calib::Camera& camera) {
      return std::ranges::find(options.cameras, camera.name) == options.cameras.end();
    });
  }
  require_valid(out.rig, file);
  return out;
}

namespace {

Exported exported_as(const calib::CameraRig& rig, const ExportOptions& options) {
  switch (options.format) {
    case ExchangeFormat::ros:
      return export_camera_info(rig);
    case ExchangeFormat::opencv:
      return export_opencv(rig, options);
    case ExchangeFormat::kalibr:
      return export_kalibr(rig);
    case ExchangeFormat::aniposelib:
      return export_aniposelib(rig);
    case ExchangeFormat::caliscope:
      return export_caliscope(rig);
  }
  throw ExchangeError("unknown format");
}

}  // namespace

namespace {

// Other tools have pinhole and fisheye lenses only: approximates any other by the nearest of these.
calib::CameraRig with_their_lenses(calib::CameraRig rig, ExchangeFormat format, std::vector<std::string>& notes) {
  // kalibr reads four coefficients, the TOML formats five.
  const bool reads_rational = format == ExchangeFormat::ros || format == ExchangeFormat::opencv;
  const int radtan = format == ExchangeFormat::kalibr ? 8 : reads_rational ? 12 : 9;
  for (calib::Camera& camera : rig.cameras) {
    if (!std::holds_alternative<calib::Stereographic>(camera.model.lens())) continue;
    const calib::NearestLens pinhole =
        calib::nearest_lens(camera.model, camera.image_size, calib::CameraModel(calib::PinholeRadtan{}), radtan);
    const calib::NearestLens fisheye =
        calib::nearest_lens(camera.model, camera.image_size, calib::CameraModel(calib::FisheyeKannalaBrandt{}), 8);
    const bool use_fisheye = !pinhole.covers_image || (fisheye.covers_image && fisheye.p95_px < pinhole.p95_px);
    const calib::NearestLens& nearest = use_fisheye ? fisheye : pinhole;
    notes.push_back(
        fmt::format("{}: {} has no stereographic lens: written as the nearest {}, with an error of {:.2g} px (95 % of "
                    "the image), at most {:.2g} px",
                    camera.name, name(format), use_fisheye ? "fisheye" : "pinhole", nearest.p95_px, nearest.worst_px));
    camera.model = nearest.model;
  }
  return rig;
}

}  // namespace

Exported export_rig(const calib::CameraRig& given, const ExportOptions& options) {
  std::vector<std::string> notes;
  const calib::CameraRig rig = with_their_lenses(given, options.format, notes);
  Exported out = exported_as(rig, options);
  out.notes.insert(out.notes.begin(), notes.begin(), notes.end());
  const bool is_timed = std::ranges::any_of(rig.cameras, [](const calib::Camera& c) { return c.timing.is_known(); });
  if (is_timed && options.format != ExchangeFormat::kalibr)
    out.notes.push_back(
        fmt::format("{} has no place for the cameras' timing (latency, readout)", name(options.format)));
  if (rig.uncertainty)
    out.notes.push_back(fmt::format("{} has no place for the calibration's uncertainty", name(options.format)));
  return out;
}

}  // namespace huetrack::exchange
