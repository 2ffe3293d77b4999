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
#include "capture/v4l2_source.h"
#include "config/camera_tracking_config.h"
#include "config/room_file.h"
#include "object_tracking/tracker_options.h"
#include "publish/estimate_publisher.h"
#include "recordings/recording_writer.h"

namespace huetrack::config {

enum class LogLevel : std::uint8_t { debug, info, warning, error };

struct DdsConfig {
  bool enabled = true;
  publish::EstimatePublisherOptions publisher;  // targets and cameras are those of the configuration and the rig
};

// What a camera host sends of a camera.
enum class Sent : std::uint8_t {
  frames,   // its own bytes
  matches,  // which pixels have a target's colour, and now and then a picture
};

// How `run` reaches one camera of the rig.
struct LiveCameraConfig {
  std::string name;  // in the rig
  std::string host;  // the camera host that has it (`huetrackd capture`), as it calls itself; empty: this machine
  std::string camera_there;  // its name there; empty: the same
  const std::string& name_on_host() const { return camera_there.empty() ? name : camera_there; }
  Sent send = Sent::frames;      // of a camera that a host has
  double picture_every_s = 1;    // >= 0; with send: matches; 0: none
  std::filesystem::path device;  // as written, but an index: /dev/videoN; empty: there is a host
  std::optional<capture::CaptureFormat>
      format;                            // nullopt: the first of yuyv, nv12, mjpeg, grey that reaches size and rate
  std::optional<calib::ImageSize> size;  // nullopt: the rig's; another one is refused
  std::optional<double> fps;             // > 0, <= 10000; nullopt: the driver's choice
  std::vector<capture::ControlSetting> controls;  // in the order of the file
  std::optional<double> latency_offset_s;         // read into the rig: Camera::timing.latency_s
  bool restore_controls = false;
};

// What `run` records.
struct RecordConfig {
  std::filesystem::path folder;  // absolute; recordings become folders in it, named by their time; empty: none
  bool always = false;           // from the start to the end
  recordings::RawStorage raw_storage = recordings::RawStorage::uncompressed;
  int queue_frames = 32;  // >= 1, per camera: may wait for the disk
  double pre_roll_s = 0;  // 0: none
  int pre_roll_mb = 256;  // >= 1, of all cameras
  double after_s = 2;     // >= 0; what follows the pre-roll
  bool on_lost = true;    // save the pre-roll when a target is lost, not only on SIGUSR1
};

struct MetricsConfig {
  std::optional<int> port;            // 1..65535; nullopt: no endpoint
  std::string address = "127.0.0.1";  // of this host
};

// Small pictures for people who watch (`huetrack view`, RViz); made only while somebody subscribes.
struct PreviewConfig {
  bool enabled = true;
  double rate_hz = 8;   // > 0; at most so many per camera and second
  int width = 480;      // 16..4096 pixels; larger images are scaled down to it
  int quality = 70;     // 1..100, JPEG's
  int particles = 100;  // >= 0; at most about so many per target are drawn
};

// What may be asked of the running service over the bus.
struct ControlConfig {
  bool allow_teach = false;   // teach colours and ignore regions: changes what the taught file says
  bool allow_record = false;  // start and stop recordings in record.folder, list and read them
};

enum class CalibrationMode : std::uint8_t {
  tell,       // when a camera no longer stands where the rig says
  leave_out,  // and do not use it until it does again
  mend,       // and let its pose follow what it sees of the room and of the others' objects
};

// What is done about a calibration that is no longer right.
struct CalibrationConfig {
  CalibrationMode watch = CalibrationMode::tell;
  std::filesystem::path room_file;  // absolute; where the still room is kept over restarts; empty: nowhere
  std::vector<KeptRoom> room;       // what room_file says; empty: it is as at the start
};

// What `huetrackd capture` reads: a camera host's own settings. It knows no rig and no targets.
struct CaptureConfig {
  std::filesystem::path file;             // absolute
  std::string host;                       // how trackers call it; empty: as the machine is called
  std::vector<LiveCameraConfig> cameras;  // at least one; each with a size, none with a host
  DdsConfig dds;                          // of the publisher: domain, interfaces, profiles
  LogLevel log_level = LogLevel::info;
};

// Of which values the taught file says what they are, and which of the configuration's it takes away.
struct TaughtKeys {
  std::set<yaml::KeyPath> given, removed;
};

struct ServiceConfig {
  std::filesystem::path file;                           // absolute
  std::filesystem::path rig_file;                       // absolute; empty: the cameras are not calibrated yet
  calib::CameraRig rig;                                 // what rig_file says; before, names and sizes alone are true
  std::vector<object_tracking::TargetOptions> targets;  // in the order of the file; none only where a camera is tracked
  CameraTrackingConfig camera_tracking;                 // of one moving camera of the rig
  std::vector<LiveCameraConfig> cameras;                // for `run`, in the order of the file; empty: replay only
  std::optional<int> quorum;  // 0..cameras: how many must deliver before the service is ready; nullopt: all
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
  // Where values come from, for people: no value, and nothing that compares configurations looks at it.
  std::set<yaml::KeyPath> written;  // what `file` itself says
  TaughtKeys taught;
  std::set<std::string> unsized_targets;  // whose radius_m nobody has said, so that it is the default; no value either

  // Nothing can be tracked before: `run` shows the cameras, so that they can be set up, and the rest refuses.
  bool is_calibrated() const { return !rig_file.empty(); }
};

// The colour of a target to which nobody has given one: it matches nothing, as no pixel is at once as bright and as
// colourful as can be.
inline constexpr color::HsiRange untaught_color{.saturation_min = 1, .intensity_min = 1, .intensity_max = 1};
bool is_taught(const object_tracking::TargetOptions& target);
// What to do about a target that is not, for people. recording: to teach it from, as a word of the command line.
std::string teach_advice(const ServiceConfig& config, const object_tracking::TargetOptions& target,
                         const std::string& recording = "RECORDING");

// throws ConfigError for a configuration whose cameras are not calibrated yet.
void require_rig(const ServiceConfig& config);

// The file of what was taught to this configuration, whether there is one or not: my.taught.yaml beside my.yaml, where
// that lies itself when `config` is a link. It has the same keys, of which it needs none but version, and is read over
// the configuration as a JSON merge patch (RFC 7396): what it says takes the place of what the configuration says for
// that key, mappings are merged, and null takes a key away. Programs write it (taught_file.h), as a whole; whoever
// deletes it has the configuration alone again.
std::filesystem::path taught_file(const std::filesystem::path& config);

// The configuration, with the taught file read over it where there is one. throws ConfigError, for both files:
// unreadable, unknown key, wrong type, out of range, keys that contradict each other or the rig; or the taught file
// speaks of a target that the configuration does not have, and does not add it whole (taught_file.h). Relative paths
// start at the configuration's folder.
ServiceConfig load_service_config(const std::filesystem::path& file);
// load_service_config(), as if the taught file held this text.
ServiceConfig load_service_config(const std::filesystem::path& file, const std::string& taught);

// Whether this camera of the rig is one whose host sends which pixels match.
bool sends_matches(const ServiceConfig& config, std::string_view camera);
// The configuration, but every camera sends its frames: for who needs pictures, to record, teach or calibrate.
ServiceConfig with_frames(ServiceConfig config);

// By what it names: cameras with devices, and neither rig nor targets. No for what cannot be read.
bool is_capture_config(const std::filesystem::path& file);
// throws ConfigError as load_service_config() does.
CaptureConfig load_capture_config(const std::filesystem::path& file);
std::string to_yaml(const CaptureConfig& config);  // every key, as load_capture_config() reads it

// Beside the rig's cameras: when their rows are exposed, as the sources need it.
std::vector<capture::FrameTiming> frame_timing(const calib::CameraRig& rig);

// Every key, default or given, as YAML that loads back to the same configuration from any folder (paths are absolute).
std::string to_yaml(const ServiceConfig& config);
// to_yaml() with a comment at every value that comes from the taught file, and for a colour that a target does not
// have.
std::string to_yaml_with_origins(const ServiceConfig& config);
// What the taught file says, from version on: the values of config.taught.
std::string to_taught_yaml(const ServiceConfig& config);

// to_yaml() for another machine: `rig` is rig.yaml beside it, and what else is referred to are files_beside(). What a
// recording holds. A replay of it writes no map and no room.
std::string to_portable_yaml(const ServiceConfig& config);
// Name and content of the other files that to_portable_yaml() refers to: the board and the map of camera_tracking, the
// room. throws std::runtime_error: one cannot be read.
std::vector<std::pair<std::string, std::string>> files_beside(const ServiceConfig& config);

// Of what to_yaml() says but the rig's path: FNV-1a 64 as 16 hex digits. Published in the status sample.
std::string config_identity(const ServiceConfig& config);

// The targets, as indices, that have to be searched for anew when `after` takes the place of `before`: those whose
// options differ, or all. The configurations have the same targets.
std::vector<std::size_t> targets_that_differ(const ServiceConfig& before, const ServiceConfig& after);

// The keys of the first level whose values differ, in the order of to_yaml(); "rig" too when the rigs themselves do.
std::vector<std::string> differing_keys(const ServiceConfig& a, const ServiceConfig& b);

// What is allowed but probably not meant, one sentence each: targets of overlapping colours, much of the volume in
// nobody's sight, ...
std::vector<std::string> warnings_of(const ServiceConfig& config);
// Why its lengths cannot be metres, one sentence, which is one of the warnings, too; empty: they can.
std::string unit_mistake(const ServiceConfig& config);

// How much of the volume is seen by how many cameras, on a grid.
struct VolumeCoverage {
  std::vector<double> per_camera;  // share of the volume inside each camera's image
  double by_one = 0;               // share that one or more cameras see
  double by_two = 0;               // share that two or more see: where a position is fixed
};
VolumeCoverage volume_coverage(const calib::CameraRig& rig, const object_tracking::Volume& volume);

}  // namespace huetrack::config
