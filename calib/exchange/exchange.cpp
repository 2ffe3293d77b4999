#include "calib/exchange/exchange.h"

#include <array>
#include <cstdio>
#include <regex>

#include "calib/exchange/exchanged_camera.h"
#include "calib/yaml/yaml_reader.h"

namespace huetrack::exchange {
namespace {

constexpr std::array<std::pair<ExchangeFormat, std::string_view>, 5> names{{{ExchangeFormat::ros, "ros"},
                                                                            {ExchangeFormat::opencv, "opencv"},
                                                                            {ExchangeFormat::kalibr, "kalibr"},
                                                                            {ExchangeFormat::aniposelib, "aniposelib"},
                                                                            {ExchangeFormat::caliscope, "caliscope"}}};

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
  const std::string text = text_of(file);
  const std::string extension = file.extension().string();
  const auto has = [&](const char* pattern) {
    return std::regex_search(text, std::regex(pattern, std::regex::multiline));
  };
  if (extension == ".xml" || extension == ".json" || text.starts_with("%YAML:1.0") || has("opencv-matrix"))
    return ExchangeFormat::opencv;
  if (extension == ".toml") {
    if (has(R"(^\s*\[cameras\.)") || has(R"(^\s*(cam_id|port|rotation_count)\s*=)")) return ExchangeFormat::caliscope;
    if (has(R"(^\s*\[cam)")) return ExchangeFormat::aniposelib;
  }
  if (has(R"(^cam0\s*:)") && has(R"(^\s+camera_model\s*:)")) return ExchangeFormat::kalibr;
  if (has(R"(^distortion_model\s*:)") && has(R"(^camera_matrix\s*:)")) return ExchangeFormat::ros;
  throw yaml::ConfigError(
      file, 0,
      "is no calibration file that we know by its looks; say which with --from: ros, opencv, kalibr, "
      "aniposelib or caliscope");
}

Imported import_rig(std::span<const std::filesystem::path> files, const ImportOptions& options) {
  if (files.empty()) throw ExchangeError("no file to import");
  const ExchangeFormat format = options.format ? *options.format : detect_format(files.front());
  if (format != ExchangeFormat::opencv && files.size() > 1) {
    throw ExchangeError(
        format == ExchangeFormat::ros
            ? "a camera_info file holds one camera and no pose, so several make no rig: import each into a file of "
              "its own, and find the poses with extrinsics or wave"
            : "a file of this kind holds all cameras: give one");
  }
  const std::filesystem::path& file = files.front();
  Imported out;
  switch (format) {
    case ExchangeFormat::ros:
      out = import_camera_info(file, options);
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
  std::array<char, 160> text;
  if (widest > 50) {
    std::snprintf(text.data(), text.size(),
                  "the cameras are up to %.0f m apart: is the file in millimetres? Then give --unit mm", widest);
    throw yaml::ConfigError(file, 0, text.data());
  }
  if (out.rig.cameras.size() > 1) {
    std::snprintf(text.data(), text.size(), "the cameras are up to %.3f m apart: if that is not so, give --unit",
                  widest);
    out.notes.emplace_back(text.data());
  }
  if (out.rig.made_by.empty()) {
    out.rig.made_by.emplace_back("imported_from", file.filename().string());
    out.rig.made_by.emplace_back("format", std::string(name(format)));
  }
  require_valid(out.rig, file);
  return out;
}

Exported export_rig(const calib::CameraRig& rig, const ExportOptions& options) {
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

}  // namespace huetrack::exchange
