// Imports calibrations of other tools into a rig, and exports a rig to their formats.
//
// Nothing is dropped silently. Import: what a rig cannot hold is reported as a note; what is unsupported or wrong
// (distortion model, number of coefficients, a matrix that is not a rotation) is a files::ConfigError with file and, if
// the parser reports it, line. Export: what the format cannot hold and positions do not depend on (names, world frame)
// is a note; a lens that it cannot hold is an ExchangeError.
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
  ros,     // camera_info YAML (camera_calibration_parsers), or of `ros2 topic echo`: one camera, no pose; ost.ini; or a
           // bag
  opencv,  // FileStorage, .yml .xml .json: one camera per file, or a stereo pair (M1 D1 M2 D2 R T)
  kalibr,  // camchain YAML: pinhole with radtan, equidistant or none; relative poses, timing
  aniposelib,  // TOML: [cam_0] name, matrix, distortions, rotation vector, translation; Pose2Sim's, too
  caliscope,   // TOML: [cameras.0]; older config.toml: [cam_0]
  // Import only:
  openvins,      // kalibr_imucam_chain.yaml: poses in the IMU's frame
  freemocap,     // TOML: as aniposelib's, with world_position
  easymocap,     // intri.yml and extri.yml
  mccalib,       // calibrated_cameras_data.yml
  photonvision,  // JSON of one camera
  panoptic,      // CMU Panoptic's JSON: a list of cameras
};
std::string_view name(ExchangeFormat format);  // "ros", ...
std::optional<ExchangeFormat> exchange_format_of(std::string_view name);
std::vector<std::string> exchange_format_names(bool for_export);

class ExchangeError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct ImportOptions {
  std::optional<ExchangeFormat> format{};        // nullopt: any; otherwise a file of another layout is an error
  std::optional<calib::ImageSize> image_size{};  // of every camera, for files without it
  std::vector<std::string> cameras{};            // only these, and nothing is asked of the others; empty: all
  double metres_per_unit = 1;                    // > 0; unit of the file's lengths: only Kalibr fixes it
  // The file's own keys for those that import knows: {"my_K", "K"}. In mappings of any depth.
  std::vector<std::pair<std::string, std::string>> keys{};
  std::string distortion_model{};  // replaces the file's, as radtan or equidistant; empty: the file's, else radtan
  bool inverts_poses = false;      // the file's poses are world_from_cam where cam_from_world is expected
  bool has_opengl_axes = false;    // its cameras look along -z, with y up, as those of OpenGL, Blender and NeRF
};

struct Imported {
  calib::CameraRig rig;
  std::vector<std::string> notes;  // ignored content and other remarks, one line each
  bool is_doubtful = false;        // the poses are probably inverted, or of OpenGL's axes; a note says so
};

// files: one, or those that belong together (intrinsics and extrinsics, or one per camera). The tool is recognised by
// the keys and where they are, not by names and headers. throws files::ConfigError, ExchangeError
Imported import_rig(std::span<const std::filesystem::path> files, const ImportOptions& options = {});

struct ExportOptions {
  ExchangeFormat format = ExchangeFormat::ros;  // not one for import only
  // opencv: yml, xml or json; stereo: two cameras in one file with M1 D1 M2 D2 R T, otherwise one file per camera.
  std::string extension = "yml";
  bool stereo = false;
};

struct Exported {
  std::vector<std::pair<std::string, std::string>> files;  // name, content
  std::vector<std::string> notes;
};

// throws ExchangeError
Exported export_rig(const calib::CameraRig& rig, const ExportOptions& options);

// By content. throws files::ConfigError: unreadable, or an unknown format; the message has the keys that were seen.
ExchangeFormat detect_format(const std::filesystem::path& file);

}  // namespace huetrack::exchange
