// Calibrations of other tools: read into our rig, and our rig written as theirs.
//
// Nothing is dropped in silence. Reading: what the file says and a rig cannot hold is a note; what cannot be understood
// (a distortion model that we do not have, a wrong count of coefficients, a matrix that is not a rotation) is a
// ConfigError with file and, where the format's reader tells it, line. Writing: what the format cannot hold and the
// positions do not depend on (names, the choice of the world's frame) is a note; a lens that it cannot hold is an
// ExchangeError.
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "calib/model/camera_rig.h"

namespace huetrack::exchange {

enum class ExchangeFormat : std::uint8_t {
  ros,         // camera_info YAML (camera_calibration_parsers): one camera, no pose
  opencv,      // FileStorage, .yml .xml .json: one camera per file, or a stereo pair (M1 D1 M2 D2 R T)
  kalibr,      // camchain YAML: pinhole with radtan, equidistant or none; poses from camera to camera; timing
  aniposelib,  // TOML: [cam_0] name, matrix, distortions, rotation vector, translation
  caliscope,   // TOML: [cameras.0], and the [cam_0] of its older config.toml
};
std::string_view name(ExchangeFormat format);  // "ros", ...
std::optional<ExchangeFormat> exchange_format_of(std::string_view name);

class ExchangeError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct ImportOptions {
  std::optional<ExchangeFormat> format{};        // nullopt: by what the file looks like
  std::optional<calib::ImageSize> image_size{};  // for files that do not say it; of every camera
  std::vector<std::string> cameras{};            // only these; empty: all
  double metres_per_unit = 1;  // > 0; of the file's lengths, which no format but Kalibr's and ours fixes
};

struct Imported {
  calib::CameraRig rig;
  std::vector<std::string> notes;  // what was not taken over, or has to be known; one line each
};

// files: one; opencv: one or more, which together describe one camera, a stereo pair, or one camera each.
// throws ConfigError
Imported import_rig(std::span<const std::filesystem::path> files, const ImportOptions& options = {});

struct ExportOptions {
  ExchangeFormat format = ExchangeFormat::ros;
  // opencv: yml, xml or json; with stereo a rig of two is one file with M1 D1 M2 D2 R T, otherwise each camera has its
  // own.
  std::string extension = "yml";
  bool stereo = false;
};

struct Exported {
  std::vector<std::pair<std::string, std::string>> files;  // name, contents; one, or one per camera
  std::vector<std::string> notes;
};

// throws ExchangeError
Exported export_rig(const calib::CameraRig& rig, const ExportOptions& options);

// By its name and contents. throws ConfigError: unreadable, or none that we know.
ExchangeFormat detect_format(const std::filesystem::path& file);

}  // namespace huetrack::exchange
