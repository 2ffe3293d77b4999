// The service's configuration file: YAML <-> the modules' option structs. configs/huetrackd.yaml documents every key.
// Pure functions, any thread.
#pragma once

#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/yaml/yaml_reader.h"
#include "capture/cropped_source.h"
#include "capture/frames/picture_layout.h"
#include "config/camera_tracking_config.h"
#include "config/room_file.h"
#include "object_tracking/tracker_options.h"
#include "publish/estimate_publisher.h"
#include "recordings/recording_writer.h"

namespace huetrack::config {

enum class LogLevel : std::uint8_t { debug, info, warning, error };

struct DdsConfig {
  bool enabled = true;
  publish::EstimatePublisherOptions publisher;  // targets and cameras: of the configuration and the rig
};

// What a camera host sends.
enum class Sent : std::uint8_t {
  frames,   // the camera's own bytes
  matches,  // matching pixels, and at intervals a picture
};

// A live camera of the rig, for `run`.
struct LiveCameraConfig {
  std::string name;          // in the rig
  std::string host;          // name of the camera host (`huetrackd capture`); empty: this machine
  std::string camera_there;  // its name there; empty: the same
  const std::string& name_on_host() const { return camera_there.empty() ? name : camera_there; }
  Sent send = Sent::frames;      // for remote cameras
  double picture_every_s = 1;    // >= 0; with send: matches; 0: none
  std::filesystem::path device;  // as written (an index as /dev/videoN); empty: remote
  std::optional<capture::CaptureFormat>
      format;                            // nullopt: the first of yuyv, nv12, mjpeg, grey with this size and rate
  std::optional<calib::ImageSize> size;  // of the device's picture; nullopt: the rig's, the only valid one without crop
  std::optional<capture::Crop> crop;     // the rig's image, as a part of that picture; nullopt: all of it
  std::optional<capture::FirstField> fields;      // interlaced: the field to play; nullopt: whole pictures
  std::optional<double> fps;                      // > 0, <= 10000; nullopt: the driver's choice
  std::vector<capture::ControlSetting> controls;  // in the order of the file
  std::optional<double> latency_offset_s;         // read into the rig: Camera::timing.latency_s
  bool restore_controls = false;

  // of_rig: size of the rig's image of this camera
  calib::ImageSize picture_size(calib::ImageSize of_rig) const { return size.value_or(of_rig); }
};

// What `run` records.
struct RecordConfig {
  std::filesystem::path folder;  // absolute; recordings are folders in it, named by their time; empty: none
  bool always = false;           // the whole run
  recordings::RawStorage raw_storage = recordings::RawStorage::uncompressed;
  int queue_frames = 32;  // >= 1, per camera, waiting for the disk
  double pre_roll_s = 0;  // 0: none
  int pre_roll_mb = 256;  // >= 1, of all cameras
  double after_s = 2;     // >= 0; recorded after the pre-roll
  bool on_lost = true;    // save the pre-roll when a target is lost, not only on SIGUSR1
};

struct MetricsConfig {
  std::optional<int> port;            // 1..65535; nullopt: no endpoint
  std::string address = "127.0.0.1";  // of this host
};

// Small pictures for `huetrack view` and RViz, made only while there are subscribers.
struct PreviewConfig {
  bool enabled = true;
  double rate_hz = 8;   // > 0; maximum per camera and second
  int width = 480;      // 16..4096 pixels; larger images are scaled down to it
  int quality = 70;     // 1..100, JPEG's
  int particles = 100;  // >= 0; approximate maximum per target
};

// What clients may request over DDS.
struct ControlConfig {
  bool allow_teach = false;   // teach colours and ignored regions: changes the taught file
  bool allow_record = false;  // make, list and read recordings in record.folder
};

enum class CalibrationMode : std::uint8_t {
  tell,       // report a moved camera
  leave_out,  // and do not use it until it stands where the rig says
  mend,       // and track its pose by the room and by objects that the others see
};

struct CalibrationConfig {
  CalibrationMode watch = CalibrationMode::tell;
  std::filesystem::path room_file;  // absolute; keeps the still room over restarts; empty: none
  std::vector<KeptRoom> room;       // read from room_file; empty: learnt at the start
};

// The configuration of a camera host (`huetrackd capture`): without rig and targets.
struct CaptureConfig {
  std::filesystem::path file;             // absolute
  std::string host;                       // its name for trackers; empty: the machine's name
  std::vector<LiveCameraConfig> cameras;  // at least one; each has a size and no host
  DdsConfig dds;                          // of the publisher: domain, interfaces, profiles
  LogLevel log_level = LogLevel::info;
};

// Keys that the taught file sets, and keys of the configuration that it removes.
struct TaughtKeys {
  std::set<yaml::KeyPath> given, removed;
};

struct ServiceConfig {
  std::filesystem::path file;      // absolute
  std::filesystem::path rig_file;  // absolute; empty: not calibrated yet
  calib::CameraRig rig;            // from rig_file; if not calibrated, only names and sizes are valid
  std::vector<object_tracking::TargetOptions> targets;  // in the order of the file
  CameraTrackingConfig camera_tracking;                 // one moving camera of the rig
  std::vector<LiveCameraConfig> cameras;                // for `run`, in the order of the file; empty: replay only
  std::optional<int> quorum;  // 0..cameras: number that must deliver before the service is ready; nullopt: all
  object_tracking::ObjectTrackerOptions object_tracking;  // the same for every target
  CalibrationConfig calibration;
  std::optional<double> set_tolerance_s;  // > 0; FrameSynchronizerOptions::tolerance; nullopt: from the frame rates
  int threads = 1;                        // >= 1; targets are tracked in parallel; no influence on the result
  DdsConfig dds;
  RecordConfig record;
  MetricsConfig metrics;
  PreviewConfig preview;
  ControlConfig control;
  object_tracking::IgnoredRegions ignored;  // also in every target
  LogLevel log_level = LogLevel::info;
  // Origin of values, for people; not compared.
  std::set<yaml::KeyPath> written;  // keys that `file` itself sets
  TaughtKeys taught;

  // If not, only `run` works: it shows the cameras.
  bool is_calibrated() const { return !rig_file.empty(); }
  std::vector<std::string> target_names() const {
    std::vector<std::string> names;
    for (const auto& target : targets) names.push_back(target.name);
    return names;
  }
};

// The colour of a target without one: it matches nothing, because no pixel has saturation 1 and intensity 1.
inline constexpr color::HsiRange untaught_color{.saturation_min = 1, .intensity_min = 1, .intensity_max = 1};
bool is_taught(const object_tracking::TargetOptions& target);
// Advice for an untaught target. recording: arguments of the command that replayed it; empty: nothing was replayed.
std::string teach_advice(const ServiceConfig& config, const object_tracking::TargetOptions& target,
                         const std::string& recording = {});

// throws ConfigError if the cameras are not calibrated yet.
void require_rig(const ServiceConfig& config);

// Path of the taught file, existing or not: my.taught.yaml next to my.yaml (links are followed). It has the same keys,
// all optional except version, and is applied to the configuration as a JSON merge patch (RFC 7396): its values replace
// those of the configuration, mappings are merged, null removes a key. Programs write it as a whole (taught_file.h).
std::filesystem::path taught_file(const std::filesystem::path& config);

// Loads the configuration and applies the taught file if there is one. throws ConfigError, for both files: unreadable,
// unknown key, wrong type, out of range, keys that contradict each other or the rig, or a taught target that the
// configuration does not have (unless added completely, taught_file.h). Relative paths start at the configuration's
// folder.
ServiceConfig load_service_config(const std::filesystem::path& file);
// As if the taught file had this text.
ServiceConfig load_service_config(const std::filesystem::path& file, const std::string& taught);

// Whether this camera of the rig has `send: matches`.
bool sends_matches(const ServiceConfig& config, std::string_view camera);
// The configuration with `send: frames` for every camera: to record, teach or calibrate.
ServiceConfig with_frames(ServiceConfig config);

// Whether the file has cameras with devices, and neither rig nor targets; false if unreadable.
bool is_capture_config(const std::filesystem::path& file);
// throws ConfigError as load_service_config() does.
CaptureConfig load_capture_config(const std::filesystem::path& file);
std::string to_yaml(const CaptureConfig& config);  // every key, as load_capture_config() reads it

// Row timing of the rig's cameras, for the sources.
std::vector<capture::FrameTiming> frame_timing(const calib::CameraRig& rig);

// Every key, default or given, as YAML that loads back to the same configuration from any folder (paths are absolute).
std::string to_yaml(const ServiceConfig& config);
// to_yaml() with comments on values of the taught file and on missing colours.
std::string to_yaml_with_origins(const ServiceConfig& config);
// The taught file from version on: the values of config.taught.
std::string to_taught_yaml(const ServiceConfig& config);

// to_yaml() for recordings, valid on any machine: `rig` is rig.yaml next to it, other references are files_beside(). A
// replay of it writes no map and no room.
std::string to_portable_yaml(const ServiceConfig& config);
// Name and content of the files that to_portable_yaml() refers to: board and map of camera_tracking, and the room.
// throws std::runtime_error if one cannot be read.
std::vector<std::pair<std::string, std::string>> files_beside(const ServiceConfig& config);

// FNV-1a 64 of to_yaml() without the rig's path, as 16 hex digits. Published in the status sample.
std::string config_identity(const ServiceConfig& config);

// Indices of the targets that need new trackers when `after` replaces `before`: those with other options, or all. Both
// have the same targets.
std::vector<std::size_t> targets_that_differ(const ServiceConfig& before, const ServiceConfig& after);

// Top-level keys with different values, in the order of to_yaml(); includes "rig" if the rigs differ.
std::vector<std::string> differing_keys(const ServiceConfig& a, const ServiceConfig& b);

// Valid but probably unintended settings, one sentence each: overlapping colours, a volume that few cameras see, ...
std::vector<std::string> warnings_of(const ServiceConfig& config);
// Why its lengths cannot be metres, one sentence, also one of the warnings; empty: they can.
std::string unit_mistake(const ServiceConfig& config);
// Why the rig's poses are probably inverted, world_from_cam where cam_from_world is expected; one sentence, also one of
// the warnings; empty: they are not. The test of huetrack-calibrate import.
std::string pose_mistake(const ServiceConfig& config);
// Why nothing of the volume is seen by two cameras, one sentence, also one of the warnings (instead of the latter);
// empty: some of it is, or there is one camera.
std::string coverage_mistake(const ServiceConfig& config);

// Visibility of the volume, sampled on a grid.
struct VolumeCoverage {
  std::vector<double> per_camera;  // share of the volume inside each camera's image
  double by_one = 0;               // share seen by at least one camera
  double by_two = 0;               // share seen by at least two: positions are determined there
};
VolumeCoverage volume_coverage(const calib::CameraRig& rig, const object_tracking::Volume& volume);

}  // namespace huetrack::config
