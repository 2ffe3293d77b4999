#include "config/service_config.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <span>
#include <string_view>

#include "calib/files/document_path.h"
#include "calib/files/nearest_word.h"
#include "calib/files/number_text.h"
#include "calib/files/text_file.h"
#include "calib/model/rig_yaml.h"
#include "calib/model/usual_lens.h"
#include "calib/yaml/hints.h"
#include "capture/network_source.h"
#include "config/config_check.h"
#include "config/view_volume.h"
#include "recordings/bags/bag.h"
#include "recordings/recording.h"

namespace huetrack::config {
namespace {

namespace fs = std::filesystem;

// Also false for a name that is too long for the system.
bool is_file(const fs::path& file) {
  std::error_code unknown;
  return fs::is_regular_file(file, unknown);
}

std::string no_file(const fs::path& file) {
  std::error_code unknown;
  if (file.native().find(": ") != std::string::npos)  // probably a text up to the next quotation mark
    return file.string() + " is no file: is a quotation mark missing after the name?";
  if (files::has_control_characters(file.native()))
    return file.string() + " is no file: a backslash in double quotes is an escape; write / instead";
  return fs::exists(file, unknown) ? file.string() + " is no file, but a folder, a device or a pipe"
                                   : "there is no file " + file.string();
}

template <typename T>
using Words = std::span<const std::pair<std::string_view, T>>;

constexpr std::pair<std::string_view, object_tracking::TimingMode> timing_words[] = {
    {"learn", object_tracking::TimingMode::learn},
    {"fixed", object_tracking::TimingMode::fixed},
};
constexpr std::pair<std::string_view, object_tracking::TargetShape> shape_words[] = {
    {"ball", object_tracking::TargetShape::ball},
    {"blob", object_tracking::TargetShape::blob},
    {"auto", object_tracking::TargetShape::automatic},
};
constexpr std::pair<std::string_view, object_tracking::Observation> observation_words[] = {
    {"huetrack", object_tracking::Observation::huetrack}, {"paper", object_tracking::Observation::paper}};
constexpr std::pair<std::string_view, CalibrationMode> calibration_words[] = {
    {"tell", CalibrationMode::tell}, {"leave out", CalibrationMode::leave_out}, {"mend", CalibrationMode::mend}};
constexpr std::pair<std::string_view, LogLevel> log_level_words[] = {
    {"debug", LogLevel::debug}, {"info", LogLevel::info}, {"warning", LogLevel::warning}, {"error", LogLevel::error}};
constexpr std::pair<std::string_view, capture::CaptureFormat> format_words[] = {
    {"yuyv", capture::CaptureFormat::yuyv},
    {"nv12", capture::CaptureFormat::nv12},
    {"mjpeg", capture::CaptureFormat::mjpeg},
    {"grey", capture::CaptureFormat::grey}};
constexpr std::pair<std::string_view, capture::FirstField> field_words[] = {{"top", capture::FirstField::top},
                                                                            {"bottom", capture::FirstField::bottom}};
constexpr std::pair<std::string_view, Sent> sent_words[] = {{"frames", Sent::frames}, {"matches", Sent::matches}};
constexpr std::pair<std::string_view, recordings::RawStorage> raw_storage_words[] = {
    {"uncompressed", recordings::RawStorage::uncompressed}, {"huffyuv", recordings::RawStorage::huffyuv}};
constexpr std::pair<std::string_view, camera_tracking::CameraMethod> camera_method_words[] = {
    {"huetrack", camera_tracking::CameraMethod::huetrack},
    {"pupilli", camera_tracking::CameraMethod::pupilli},
    {"lee", camera_tracking::CameraMethod::lee},
    {"herranz", camera_tracking::CameraMethod::herranz}};
constexpr yaml::Range share{.min = 0, .max = 1};
constexpr yaml::Range degrees{.min = 0, .max = 360};
// From the clock's microsecond to more than the offset of any two cameras.
constexpr yaml::Range tolerance{.min = 1e-6, .max = 10};
constexpr yaml::Range at_least_one{.min = 1, .max = 1e6};

enum class Need : std::uint8_t { optional, required };

// ---------------------------------------------------------------------------------------------------------------------
// The keys, described once for reading and printing: `io` is a Reader, which fills the structs, or a Printer. A new
// option is one line here (and one in configs/huetrackd.yaml).

template <typename Io, typename Color>
void describe_color(Io& io, Color& color, Need need) {
  io.interval("hue_deg", color.hue_min_deg, color.hue_max_deg, degrees, need,
              "[from, to]; from > to goes through 0, as in [340, 20] for red");
  io.interval("saturation", color.saturation_min, color.saturation_max, share, Need::optional, "[min, max], 0..1");
  io.interval("intensity", color.intensity_min, color.intensity_max, share, Need::optional,
              "[min, max], 0..1; darker and brighter pixels never match");
}

template <typename Io, typename Options>
void describe_object_tracking(Io& io, Options& o) {
  io.choice("observation", o.observation, Words<object_tracking::Observation>(observation_words),
            "the filter: huetrack (ours), or paper (Barrera et al., eqs. (1)-(6) only)");
  io.group("volume", "where targets may be; world frame, metres", [&](auto& in) {
    in.point("min", o.volume.min, "[x, y, z]");
    in.point("max", o.volume.max, "[x, y, z]");
  });
  io.integer("particle_count", o.particle_count, at_least_one, "while tracking; time per frame set is linear in it");
  io.integer("max_particle_count", o.max_particle_count, at_least_one, "while searching; >= particle_count");
  io.integer("seed", o.seed, yaml::Range{.min = 0, .max = 9e15},
             "same seed, same recording, same configuration: same track, byte for byte");
  io.number("position_noise_m", o.position_noise_m, yaml::positive,
            "paper only: sigma_m of the random walk, metres per frame set");
  io.choice("timing", o.timing, Words<object_tracking::TimingMode>(timing_words),
            "huetrack only: learn (latency and readout of each camera, from motion), or fixed (the rig's)");
  io.number("acceleration_m_s2", o.acceleration_m_s2, yaml::positive,
            "huetrack only: the largest usual acceleration, m/s^2");
  io.number("start_speed_m_s", o.start_speed_m_s, yaml::positive, "huetrack only: the highest usual speed, m/s");
  io.number("pixel_noise_px", o.pixel_noise_px, yaml::positive,
            "huetrack only: std. dev. of a colour region's centre in a view, pixels");
  io.number("max_tracking_sigma_m", o.max_tracking_sigma_m, yaml::positive,
            "huetrack only: a position with a larger sigma is coasting, metres; the uncertainty of the cameras' timing "
            "does not "
            "count");
  io.number(
      "max_tracking_share_along", o.max_tracking_share_along, yaml::positive,
      "huetrack only: with a single camera, the same along its ray, as a share of the distance, which is known by "
      "the ball's size");
  io.number("coast_s", o.coast_s, yaml::positive, "an object that coasts for longer is lost, seconds");
  io.number("max_coast_sigma_m", o.max_coast_sigma_m, yaml::positive,
            "an object with a larger position sigma is lost, metres");
}

template <typename Io, typename Tracking>
void describe_camera_tracking(Io& io, Tracking& t) {
  io.text_or("camera", "none", t.camera, "name of the tracked camera in the rig; none");
  io.choice("method", t.method, Words<camera_tracking::CameraMethod>(camera_method_words),
            "huetrack (ours), or pupilli, lee, herranz (as in their papers)");
  io.integer_or("particle_count", "auto", t.particle_count, at_least_one, "auto: the method's own");
  io.boolean("as_printed", t.as_printed, "pupilli and lee: the paper's filter without our additions");
  io.integer("seed", t.seed, yaml::Range{.min = 0, .max = 9e15},
             "same seed, recording and configuration: the same poses");
  io.path_or("load_map", "none", t.load_map, "a saved map in which the camera is localised; start may be left out");
  io.folder_or("save_map", "none", t.save_map, "file for the map at the end");
  io.group("start", "source of the first pose: exactly one of rectangle, points, board, leds", [&](auto& in) {
    const std::vector<CsvColumn> xyz{{"X", "x"}, {"Y", "y"}, {"Z", "z"}, {"u", "u_frame0"}, {"v", "v_frame0"}};
    in.table_or("rectangle", t.rectangle, xyz, 3, 5,
                "4 corners: CSV file, or [[x, y, z], ...]; with u, v: pixels in frame 0");
    in.table_or("points", t.points, xyz, 5, 5, "known points in frame 0: CSV file, or [[x, y, z, u, v], ...]");
    in.path_or("board", "none", t.board,
               "a board file (" + files::document_path("calib/README.md") + "): detected automatically");
    in.table_or("leds", t.leds, {xyz[0], xyz[1], xyz[2]}, 3, 3, "LED positions: CSV file, or [[x, y, z], ...]");
    in.table_or("led_schedule", t.led_schedule, {{"led", "led"}}, 1, 1,
                "which LED is lit, per slot (-1: none): CSV file, or [[0], [1], ...]; none: not identified");
    in.number("led_slot_s", t.led_slot_s, yaml::non_negative,
              "0: a slot is a frame; otherwise its length in capture time, seconds");
    in.point("led_room_min", t.led_room_min, "[x, y, z]: where the camera may be, metres");
    in.point("led_room_max", t.led_room_max, "[x, y, z]");
  });
}

// Of a remote camera.
template <typename Io, typename Camera>
void describe_hosted(Io& io, Camera& camera) {
  io.text_or("host", "this one", camera.host, "the camera host with this camera, where `huetrackd capture` runs");
  io.text_or("camera", "same", camera.camera_there, "its name on that host; same: the name here");
  io.choice("send", camera.send, Words<Sent>(sent_words),
            "what that host sends: frames, or matches (pixels of the targets' colours)");
  io.number("picture_every_s", camera.picture_every_s, yaml::Range{.min = 0, .max = 60},
            "with matches: seconds between pictures, for the page and for the room watch; 0: none");
}

template <typename Io, typename Camera>
void describe_device(Io& io, Camera& camera) {
  io.device("device", camera.device, camera.host,
            "/dev/v4l/by-path/... (a port), by-id/... (a camera), or an index (not stable); none: remote");
  io.choice_or("format", "auto", camera.format, Words<capture::CaptureFormat>(format_words),
               "auto, yuyv, nv12, mjpeg or grey; auto: the first of these with this size and fps, else the fastest");
  io.size_or("size", "rig", camera.size, "[width, height]; rig: that of the calibration");
  io.crop_or(
      "crop", "none", camera.crop,
      "[u, v, width, height]; the camera is this part of the device's picture, which others may share; none: all");
  io.choice_or("fields", "none", camera.fields, Words<capture::FirstField>(field_words),
               "of an interlaced camera: the field that is exposed first, top (that of row 0) or bottom; it is played");
  io.number_or("fps", "auto", camera.fps, yaml::Range{.min = 0, .max = 10000, .min_is_open = true},
               "frames per second; auto: the driver's choice");
  io.controls("controls", camera.controls, "by their V4L2 names; automatic controls are set first");
  io.number_or("latency_offset_s", "rig", camera.latency_offset_s, yaml::Range{.min = -1, .max = 1},
               "from mid-exposure to the driver's time stamp, seconds; rig: the rig's timing.latency_s");
  io.boolean("restore_controls", camera.restore_controls, "restore the camera's own values at the end");
}

template <typename Io, typename Camera>
void describe_camera(Io& io, Camera& camera) {
  describe_hosted(io, camera);
  describe_device(io, camera);
}

template <typename Io, typename Dds>
void describe_dds(Io& io, Dds& dds) {
  io.boolean("enabled", dds.enabled, "publish at all");
  io.integer_or("domain", "auto", dds.publisher.domain, yaml::Range{.min = 0, .max = 232},
                "DDS domain; auto: ROS_DOMAIN_ID, else 0");
  io.path_or("profile", "none", dds.publisher.profiles, "Fast DDS XML profiles that replace transport and QoS");
  io.strings("interfaces", dds.publisher.interfaces, "network interfaces to use (names or IPv4 addresses); empty: all");
  io.boolean("ros2", dds.publisher.ros2, "also publish rt/huetrack/<target>/pose and rt/tf for ROS 2");
  io.text("frame_id", dds.publisher.frame_id, "name of the world frame in the ROS 2 messages");
}

template <typename Io, typename Record>
void describe_record(Io& io, Record& record) {
  io.folder_or("folder", "none", record.folder,
               "recordings are folders in it, named by their time; none: no recording");
  io.boolean("always", record.always, "record the whole run");
  io.choice("raw_storage", record.raw_storage, Words<recordings::RawStorage>(raw_storage_words),
            "for raw cameras: uncompressed or huffyuv (half the size, more time); both lossless");
  io.integer("queue_frames", record.queue_frames, at_least_one, "per camera, waiting for the disk; beyond it, drops");
  io.number("pre_roll_s", record.pre_roll_s, yaml::Range{.min = 0, .max = 3600},
            "length kept in memory, saved on SIGUSR1; seconds, 0: none");
  io.integer("pre_roll_mb", record.pre_roll_mb, at_least_one, "memory of the pre-roll, all cameras, megabytes");
  io.number("after_s", record.after_s, yaml::Range{.min = 0, .max = 3600}, "recorded after the pre-roll, seconds");
  io.boolean("on_lost", record.on_lost, "also save the pre-roll when a target is lost");
}

template <typename Io, typename Config>
void describe(Io& io, Config& config) {
  io.version(1);
  io.rig("rig", config.rig_file, "the calibrated cameras; none: not calibrated yet, `run` only shows them");
  io.named("targets", config.targets, "what to track: name, size and colour of each", [&](auto& in, auto& target) {
    in.ball_radius("radius_m", target,
                   "of the ball (or of a ball about as large as the object), metres; auto: 0.04 is assumed");
    in.choice(
        "shape", target.shape, Words<object_tracking::TargetShape>(shape_words),
        "huetrack only: ball: fits the outline; blob: centre of the colour; auto: ball, unless outlines do not fit");
    in.object_count("count", target, "number of objects: 3, or up to 8");
    in.color("color", target.color, "HSI as in the paper; none: to be taught", [&](auto& color) {
      describe_color(color, target.color, Need::required);
      color.boolean("adapt", target.adapts_color, "huetrack only: the ranges slowly follow the object's colour");
    });
    in.named("camera_colors", target.camera_colors, "per-camera overrides of color", [&](auto& color, auto& range) {
      if constexpr (!std::is_const_v<std::remove_reference_t<decltype(range)>>)
        range = target.color == untaught_color ? color::HsiRange{} : target.color;  // defaults for missing values
      describe_color(color, range, Need::optional);
    });
  });
  io.boxes("ignore", config.ignored, "per camera, [u_min, v_min, u_max, v_max, ...]: rectangles that are ignored");
  io.group("camera_tracking", "the pose of one moving camera",
           [&](auto& in) { describe_camera_tracking(in, config.camera_tracking); });
  io.named("cameras", config.cameras, "the live cameras, for `run`; names as in the rig",
           [&](auto& in, auto& camera) { describe_camera(in, camera); });
  io.integer_or("quorum", "all", config.quorum, yaml::Range{.min = 0, .max = 1000},
                "number of cameras that must deliver before the service is ready");
  io.group("object_tracking", "", [&](auto& in) { describe_object_tracking(in, config.object_tracking); });
  io.group("calibration", "detection of cameras that moved", [&](auto& in) {
    in.choice("watch", config.calibration.watch, Words<CalibrationMode>(calibration_words),
              "tell: report a moved camera; leave out: do not use it; mend: track its pose");
    in.folder_or("room", "none", config.calibration.room_file,
                 "file that keeps the still room over restarts; none: learnt at each start");
  });
  io.group("frame_sets", "which frames belong together", [&](auto& in) {
    in.number_or("tolerance_s", "auto", config.set_tolerance_s, tolerance,
                 "first to last capture time in a set, seconds; auto: about half a frame period");
  });
  io.integer("threads", config.threads, yaml::Range{.min = 1, .max = 64},
             "targets are tracked in parallel; the result does not depend on it");
  io.group("dds", "", [&](auto& in) { describe_dds(in, config.dds); });
  io.group("record", "what `run` records", [&](auto& in) { describe_record(in, config.record); });
  io.group("metrics", "for Prometheus, while `run`", [&](auto& in) {
    in.integer_or("port", "none", config.metrics.port, yaml::Range{.min = 1, .max = 65535},
                  "GET /metrics; none: no endpoint");
    in.text("address", config.metrics.address, "to listen on; 127.0.0.1: this host only");
  });
  io.group("preview", "small pictures, made only while there are subscribers", [&](auto& in) {
    in.boolean("enabled", config.preview.enabled, "publish huetrack/preview at all");
    in.number("rate_hz", config.preview.rate_hz, yaml::Range{.min = 0, .max = 120, .min_is_open = true},
              "maximum pictures per camera and second");
    in.integer("width", config.preview.width, yaml::Range{.min = 16, .max = 4096},
               "pixels; larger images are scaled down");
    in.integer("quality", config.preview.quality, yaml::Range{.min = 1, .max = 100}, "of the JPEGs");
    in.integer("particles", config.preview.particles, yaml::Range{.min = 0, .max = 10000},
               "approximate number drawn per target");
  });
  io.group("control", "what clients may request over DDS", [&](auto& in) {
    in.boolean("allow_teach", config.control.allow_teach, "teach colours: writes the taught file next to this one");
    in.boolean("allow_record", config.control.allow_record,
               "make and download recordings: needs record: {folder: ...}");
  });
  io.choice("log_level", config.log_level, Words<LogLevel>(log_level_words), "debug, info, warning or error");
}

// Splits an entry of a mapping into its name and the rest.
template <typename Entry>
auto& name_of(Entry& entry) {
  if constexpr (requires { entry.name; }) {
    return entry.name;
  } else {
    return entry.first;
  }
}
template <typename Entry>
auto& value_of(Entry& entry) {
  if constexpr (requires { entry.second; }) {
    return entry.second;
  } else {
    return entry;
  }
}

// ---------------------------------------------------------------------------------------------------------------------
class Printer {
 public:
  enum class Show : std::uint8_t {
    all,          // every value
    all_origins,  // with its file of origin
    taught        // only those of the taught file
  };
  struct Style {
    Show show = Show::all;
    const TaughtKeys& taught;
    const std::set<yaml::KeyPath>* written = nullptr;  // keys of the configuration, for all_origins
    std::string written_name{}, taught_name{};         // of their files
    std::vector<yaml::KeyPath>* keys = nullptr;        // receives the printed keys
  };
  // path: of the printed mapping, empty at the root. style: outlives this.
  Printer(std::string& out, const Style& style, yaml::KeyPath path = {})
      : out_(out), style_(style), path_(std::move(path)) {}

  void version(int only) { write("version", std::to_string(only), ""); }
  void number(std::string_view key, double value, yaml::Range, std::string_view doc) {
    line(key, files::shortest_text(value), doc);
  }
  template <std::integral T>
  void integer(std::string_view key, T value, yaml::Range, std::string_view doc) {
    line(key, std::to_string(value), doc);
  }
  void boolean(std::string_view key, bool value, std::string_view doc) { line(key, value ? "true" : "false", doc); }
  void text(std::string_view key, const std::string& value, std::string_view doc) {
    line(key, files::in_yaml_quotes(value), doc);
  }
  void text_or(std::string_view key, const std::string& none, const std::string& value, std::string_view doc) {
    line(key, value.empty() ? none : files::in_yaml_quotes(value), doc);
  }
  void table_or(std::string_view key, const NumberRows& rows, const std::vector<CsvColumn>&, std::size_t, std::size_t,
                std::string_view doc) {
    std::vector<std::string> items;
    for (const auto& row : rows) {
      std::vector<std::string> numbers;
      for (const double number : row) numbers.push_back(files::shortest_text(number));
      items.push_back(list_of(numbers));
    }
    line(key, rows.empty() ? "none" : list_of(items), doc);
  }
  void strings(std::string_view key, const std::vector<std::string>& value, std::string_view doc) {
    std::vector<std::string> items;
    for (const auto& item : value) items.push_back(files::in_yaml_quotes(item));
    line(key, list_of(items), doc);
  }
  template <typename T>
  void choice(std::string_view key, T value, Words<T> words, std::string_view doc) {
    line(key, std::string(std::ranges::find(words, value, [](const auto& w) { return w.second; })->first), doc);
  }
  template <typename T>
  void choice_or(std::string_view key, std::string_view none, const std::optional<T>& value, Words<T> words,
                 std::string_view doc) {
    if (value) return choice(key, *value, words, doc);
    line(key, std::string(none), doc);
  }
  void rig(std::string_view key, const fs::path& value, std::string_view doc) { path_or(key, "none", value, doc); }
  void device(std::string_view key, const fs::path& value, const std::string&, std::string_view doc) {
    path_or(key, "none", value, doc);
  }
  void size_or(std::string_view key, std::string_view word, const std::optional<calib::ImageSize>& size,
               std::string_view doc) {
    line(key, size ? list_of({std::to_string(size->width), std::to_string(size->height)}) : std::string(word), doc);
  }
  void crop_or(std::string_view key, std::string_view word, const std::optional<capture::Crop>& crop,
               std::string_view doc) {
    line(key, crop ? text_of(*crop) : std::string(word), doc);
  }
  void controls(std::string_view key, const std::vector<capture::ControlSetting>& settings, std::string_view doc) {
    mapping(key, doc, [&](Printer& inner) {
      for (const auto& [name, value] : settings) {
        const auto* number = std::get_if<std::int64_t>(&value);
        inner.line(name, number ? std::to_string(*number) : files::in_yaml_quotes(std::get<std::string>(value)), "");
      }
      inner.names_taken_away();
    });
  }
  void path_or(std::string_view key, std::string_view none, const fs::path& value, std::string_view doc) {
    line(key, value.empty() ? std::string(none) : files::in_yaml_quotes(value.string()), doc);
  }
  void folder_or(std::string_view key, std::string_view none, const fs::path& value, std::string_view doc) {
    path_or(key, none, value, doc);
  }
  void number_or(std::string_view key, std::string_view word, std::optional<double> value, yaml::Range,
                 std::string_view doc) {
    line(key, value ? files::shortest_text(*value) : std::string(word), doc);
  }
  void integer_or(std::string_view key, std::string_view word, std::optional<int> value, yaml::Range,
                  std::string_view doc) {
    line(key, value ? std::to_string(*value) : std::string(word), doc);
  }
  void ball_radius(std::string_view key, const object_tracking::TargetOptions& target, std::string_view doc) {
    line(key, target.is_radius_assumed ? "auto" : files::shortest_text(target.radius_m), doc);
  }
  void object_count(std::string_view key, const object_tracking::TargetOptions& target, std::string_view doc) {
    line(key, (target.is_up_to ? "up to " : "") + std::to_string(target.count), doc);
  }
  void point(std::string_view key, const Eigen::Vector3d& p, std::string_view doc) {
    line(key, list_of({files::shortest_text(p.x()), files::shortest_text(p.y()), files::shortest_text(p.z())}), doc);
  }
  void interval(std::string_view key, double min, double max, yaml::Range, Need, std::string_view doc) {
    line(key, list_of({files::shortest_text(min), files::shortest_text(max)}), doc);
  }
  void boxes(std::string_view key, const object_tracking::IgnoredRegions& regions, std::string_view doc) {
    mapping(key, doc, [&](Printer& inner) {
      for (const auto& [camera, boxes] : regions) {
        std::vector<std::string> numbers;
        for (const color::PixelBox& box : boxes)
          for (const int value : {box.u_min, box.v_min, box.u_max, box.v_max}) numbers.push_back(std::to_string(value));
        inner.line(camera, list_of(numbers), "");
      }
      inner.names_taken_away();
    });
  }
  template <typename F>
  void group(std::string_view key, std::string_view doc, F&& describe_group) {
    mapping(key, doc, describe_group);
  }
  template <typename F>
  void color(std::string_view key, const color::HsiRange& range, std::string_view doc, F&& describe_range) {
    // Ranges that match nothing would look like a given colour.
    if (style_.show == Show::all_origins && range == untaught_color) {
      out_ += fmt::format("{}# {}: not taught yet (huetrackd teach, or a click on the page)\n", indentation(), key);
      return;
    }
    mapping(key, doc, describe_range);
  }
  template <typename T, typename F>
  void named(std::string_view key, const std::vector<T>& entries, std::string_view doc, F&& describe_entry) {
    mapping(key, doc, [&](Printer& inner) {
      for (const T& entry : entries)
        inner.mapping(name_of(entry), "", [&](Printer& fields) { describe_entry(fields, value_of(entry)); });
      inner.names_taken_away();
    });
  }

 private:
  yaml::KeyPath below(std::string_view key) const {
    yaml::KeyPath path = path_;
    path.emplace_back(key);
    return path;
  }
  void line(std::string_view key, const std::string& value, std::string_view doc) {
    const yaml::KeyPath here = below(key);
    const bool is_removed = style_.taught.removed.contains(here);
    const bool is_taught = is_removed || style_.taught.given.contains(here);
    if (style_.show == Show::taught) {
      if (is_taught) write(key, is_removed ? "null" : value, "");
    } else if (style_.show == Show::all_origins && (is_taught || style_.written->contains(here))) {
      write(key, value,
            fmt::format("from {}{}{}", is_taught ? style_.taught_name : style_.written_name, doc.empty() ? "" : "; ",
                        doc));
    } else {
      write(key, value, doc);
    }
  }
  // fill prints the entries.
  template <typename F>
  void mapping(std::string_view key, std::string_view doc, F&& fill) {
    std::string inside;
    Printer inner(inside, style_, below(key));
    fill(inner);
    if (style_.show == Show::taught) {
      if (style_.taught.removed.contains(inner.path_)) {
        write(key, "null", "");
      } else if (inner.has_entries_) {
        write(key, "", "");
      } else if (style_.taught.given.contains(inner.path_)) {
        write(key, "{}", "");
      }
    } else {
      write(key, inner.has_entries_ ? "" : "{}", doc);
    }
    out_ += inside;
  }
  // Entries that the taught file removes are not among the existing ones.
  void names_taken_away() {
    if (style_.show == Show::all) return;
    for (const yaml::KeyPath& removed : style_.taught.removed) {
      if (removed.size() != path_.size() + 1 || !std::equal(path_.begin(), path_.end(), removed.begin())) continue;
      if (style_.show == Show::taught) {
        write(removed.back(), "null", "");
      } else {
        out_ += fmt::format("{}# without {}: from {}\n", indentation(), removed.back(), style_.taught_name);
      }
    }
  }
  std::string indentation() const { return std::string(2 * path_.size(), ' '); }
  void write(std::string_view key, std::string_view value, std::string_view comment) {
    constexpr std::size_t comment_column = 44;
    std::string text = fmt::format("{}{}:", indentation(), quoted_key(std::string(key)));
    if (!value.empty()) text.append(" ").append(value);
    if (!comment.empty()) {
      text.resize(std::max(text.size() + 2, comment_column), ' ');
      text.append("# ").append(comment);
    }
    out_ += text + "\n";
    has_entries_ = true;
    if (style_.keys != nullptr) style_.keys->push_back(below(key));
  }
  static std::string list_of(const std::vector<std::string>& items) {
    return fmt::format("[{}]", fmt::join(items, ", "));
  }
  static std::string quoted_key(const std::string& name) {
    const bool plain = !name.empty() && std::isalpha(static_cast<unsigned char>(name.front())) != 0 &&
                       std::ranges::all_of(name, [](unsigned char c) { return std::isalnum(c) != 0 || c == '_'; });
    constexpr std::string_view words[] = {"true", "false", "null", "yes", "no", "on", "off", "y", "n"};
    return plain && std::ranges::find(words, name) == std::end(words) ? name : files::in_yaml_quotes(name);
  }

  std::string& out_;
  const Style& style_;
  yaml::KeyPath path_;
  bool has_entries_ = false;
};

// The printed keys, those of a mapping before its own.
template <typename F>
std::vector<yaml::KeyPath> keys_of(F&& print) {
  std::string text;
  std::vector<yaml::KeyPath> keys;
  const TaughtKeys none;
  const Printer::Style style{.taught = none, .keys = &keys};
  Printer printer(text, style);
  print(printer);
  return keys;
}

// "its keys belong below it, indented: min, max"; for a function that prints keys.
template <typename F>
std::string keys_below(F&& print) {
  std::vector<std::string> names;
  for (const yaml::KeyPath& path : keys_of(print))
    if (path.size() == 1) names.push_back(path.front());
  return fmt::format("its keys belong below it, indented, with a colon each: {}", fmt::join(names, ", "));
}

// ---------------------------------------------------------------------------------------------------------------------
// One mapping of the file; missing optional keys keep their defaults.
class Reader {
 public:
  // folder: start of relative paths
  // elsewhere: all keys, to recognise misplaced ones; outlives this
  Reader(yaml::YamlReader yaml, fs::path folder, std::span<const yaml::KeyPath> elsewhere = {})
      : yaml_(std::move(yaml)), folder_(std::move(folder)), elsewhere_(elsewhere) {}

  void version(int only) { yaml_.version(only); }
  void number(std::string_view key, double& value, yaml::Range range, std::string_view) {
    value = yaml_.number(key, range, value);
  }
  template <std::integral T>
  void integer(std::string_view key, T& value, yaml::Range range, std::string_view) {
    value = static_cast<T>(yaml_.integer(key, range, static_cast<std::int64_t>(value)));
  }
  void boolean(std::string_view key, bool& value, std::string_view) { value = yaml_.boolean(key, value); }
  void text(std::string_view key, std::string& value, std::string_view) { value = yaml_.string(key, value); }
  void text_or(std::string_view key, const std::string& none, std::string& value, std::string_view) {
    const std::string given = yaml_.string(key, none);
    value = given == none ? "" : given;
  }
  void table_or(std::string_view key, NumberRows& rows, const std::vector<CsvColumn>& columns, std::size_t min_columns,
                std::size_t max_columns, std::string_view) {
    if (!yaml_.has(key)) return;
    if (yaml_.is_list(key)) {
      rows = yaml_.table(key, min_columns, max_columns);
      if (rows.front().size() != min_columns && rows.front().size() != max_columns)
        yaml_.fail(key, fmt::format("must have {} or {} numbers per row", min_columns, max_columns));
      return;
    }
    const std::string given = yaml_.string(key);
    if (given == "none") return;
    if (!is_file(resolved(given))) yaml_.fail(key, no_file(resolved(given)));
    rows = read_number_rows(resolved(given), columns, min_columns);
  }
  void strings(std::string_view key, std::vector<std::string>& value, std::string_view) {
    if (yaml_.has(key)) value = yaml_.strings(key);
  }
  template <typename T>
  void choice(std::string_view key, T& value, Words<T> words, std::string_view) {
    if (!yaml_.has(key)) return;
    std::vector<std::string_view> allowed;
    for (const auto& [word, _] : words) allowed.push_back(word);
    const std::string given = yaml_.choice(key, allowed);
    value = std::ranges::find(words, given, [](const auto& w) { return w.first; })->second;
  }
  template <typename T>
  void choice_or(std::string_view key, std::string_view none, std::optional<T>& value, Words<T> words,
                 std::string_view) {
    if (!yaml_.has(key)) return;
    std::vector<std::string_view> allowed{none};
    for (const auto& [word, _] : words) allowed.push_back(word);
    const std::string given = yaml_.choice(key, allowed);
    if (given != none) value = std::ranges::find(words, given, [](const auto& w) { return w.first; })->second;
  }
  void rig(std::string_view key, fs::path& value, std::string_view) {
    if (!yaml_.has(key) && !files::nearest_word(key, yaml_.keys()))  // string() explains a misspelt key
      yaml_.fail("", "rig is missing: write rig: FILE (from huetrack-calibrate), or rig: none before the calibration");
    const std::string given = yaml_.string(key);
    value = given == "none" ? fs::path() : resolved(given);
  }
  // 0 is /dev/video0. host: empty: this machine.
  void device(std::string_view key, fs::path& value, const std::string& host, std::string_view) {
    if (!host.empty()) {
      if (yaml_.string(key, "none") != "none")
        yaml_.fail(key, "belongs to the camera's host: give it in the configuration of `huetrackd capture` there");
      return;
    }
    for (const std::string_view said : {"source", "path", "url", "address", "video", "index", "id"})
      if (!yaml_.has(key) && yaml_.has(said))
        yaml_.fail(said, "is not a known key: write device: /dev/v4l/by-path/..., an index, or rtsp://...");
    const std::string given = yaml_.string(key);
    const bool is_index = given.size() < 4 && std::ranges::all_of(given, files::is_digit);
    value = is_index ? fs::path("/dev/video" + given) : fs::path(given);
    if (!value.is_absolute() && !capture::is_network_address(given))
      yaml_.fail(key, "must be a path below /dev, an index, or an address like rtsp://..., got \"" + given +
                          "\": ls -l /dev/v4l/by-path/ lists the cameras");
  }
  void size_or(std::string_view key, std::string_view word, std::optional<calib::ImageSize>& value, std::string_view) {
    if (!yaml_.has(key)) return;
    if (!yaml_.is_list(key)) {
      if (yaml_.is_mapping(key))
        yaml_.fail(key, fmt::format("must be two numbers, width and height, as [640, 480], or the word {}", word));
      if (const std::string text = yaml_.string(key); text != word) {
        const std::string hint = yaml::list_hint(text, 2, 2);
        yaml_.fail(key, fmt::format("must be two numbers, as [640, 480], or the word {}, got \"{}\"{}{}", word, text,
                                    hint.empty() ? "" : ": ", hint));
      }
      return;
    }
    const auto sides = yaml_.numbers(key, 2, 2, yaml::Range{.min = 1, .max = 65535});
    for (const double side : sides)
      if (side != std::floor(side)) yaml_.fail(key, "must be whole numbers of pixels, as [640, 480]");
    value = calib::ImageSize{static_cast<int>(sides[0]), static_cast<int>(sides[1])};
  }
  void crop_or(std::string_view key, std::string_view word, std::optional<capture::Crop>& value, std::string_view) {
    if (!yaml_.has(key) || (!yaml_.is_list(key) && yaml_.string(key) == word)) return;
    value = recordings::crop_in(yaml_, key);
  }
  void controls(std::string_view key, std::vector<capture::ControlSetting>& settings, std::string_view) {
    // Common names of V4L2 controls.
    static constexpr std::pair<std::string_view, std::string_view> misplaced[] = {
        {"exposure", "exposure_time_absolute"},
        {"exposure_time_absolute", "exposure_time_absolute"},
        {"gain", "gain"},
        {"white_balance", "white_balance_temperature"},
        {"brightness", "brightness"},
        {"focus", "focus_absolute"}};
    const std::vector<std::string> given = yaml_.keys();
    for (const auto& [said, control] : misplaced)
      if (std::ranges::find(given, said) != given.end())
        yaml_.fail(said, fmt::format("is a control of the camera: write controls: {{{}: ...}} (`huetrackd doctor` "
                                     "lists those that it has)",
                                     control));
    const auto map = yaml_.optional_map(key);
    if (!map) return;
    for (const auto& name : map->keys())
      if (map->is_list(name) || map->is_mapping(name))
        map->fail(name, "must be one number, true, false, or a word of the control's menu");
    for (const auto& name : map->keys()) settings.push_back(capture::control_setting(name, map->string(name)));
  }
  void path_or(std::string_view key, const std::string& none, fs::path& value, std::string_view) {
    const std::string given = yaml_.string(key, none);
    value = given == none ? fs::path() : resolved(given);
    if (!value.empty() && !is_file(value)) yaml_.fail(key, no_file(value));
  }
  void folder_or(std::string_view key, const std::string& none, fs::path& value, std::string_view) {
    const std::string given = yaml_.string(key, none);
    value = given == none ? fs::path() : resolved(given);
  }
  void number_or(std::string_view key, std::string_view word, std::optional<double>& value, yaml::Range range,
                 std::string_view) {
    if (!is_word(key, word)) value = yaml_.number(key, range);
  }
  void integer_or(std::string_view key, std::string_view word, std::optional<int>& value, yaml::Range range,
                  std::string_view) {
    if (!is_word(key, word)) value = static_cast<int>(yaml_.integer(key, range));
  }
  void ball_radius(std::string_view key, object_tracking::TargetOptions& target, std::string_view) {
    target.is_radius_assumed = is_word(key, "auto");
    if (!target.is_radius_assumed) target.radius_m = yaml_.number(key, yaml::positive);
  }
  // A number, or "up to" a number.
  void object_count(std::string_view key, object_tracking::TargetOptions& target, std::string_view) {
    if (!yaml_.has(key)) return;
    static constexpr int most = object_tracking::TargetOptions::most_count;
    const auto must_be = [] {
      return fmt::format("must be a number from 1 to {}, or \"up to\" such a number, as in count: up to 3", most);
    };
    if (yaml_.is_list(key) || yaml_.is_mapping(key)) yaml_.fail(key, must_be() + ", without brackets");
    std::string given = yaml_.string(key);
    constexpr std::string_view up_to = "up to ";
    target.is_up_to = given.starts_with(up_to);
    if (target.is_up_to) given.erase(0, up_to.size());
    const char* const end = given.data() + given.size();
    const auto [parsed, error] = std::from_chars(given.data(), end, target.count);
    const bool is_number = error == std::errc{} && parsed == end;
    if (!is_number || target.count < 1) yaml_.fail(key, fmt::format("{}, got \"{}\"", must_be(), yaml_.string(key)));
    if (target.count > most)
      yaml_.fail(key, fmt::format("{}, got \"{}\": regions are shared out among all objects of a target in every view, "
                                  "and more than {} have not been measured",
                                  must_be(), yaml_.string(key), most));
  }
  void point(std::string_view key, Eigen::Vector3d& value, std::string_view) {
    if (yaml_.has(key)) value = Eigen::Vector3d(yaml_.numbers(key, 3, 3, yaml::any_number).data());
  }
  void interval(std::string_view key, double& min, double& max, yaml::Range range, Need need, std::string_view) {
    if (need == Need::optional && !yaml_.has(key)) return;
    if (yaml_.has(key) && !yaml_.is_list(key) && !yaml_.is_mapping(key))
      if (const std::string given = yaml_.string(key); yaml::list_hint(given, 2, 2).empty())
        yaml_.fail(key, fmt::format("must be two numbers, [from, to], got \"{}\"", files::printable(given)));
    const auto values = yaml_.numbers(key, 2, 2, yaml::any_number);
    refuse_other_scale(key, values, range);
    min = values[0];
    max = values[1];
  }
  void boxes(std::string_view key, object_tracking::IgnoredRegions& regions, std::string_view) {
    const auto cameras = yaml_.optional_map(key);
    if (!cameras) return;
    for (const std::string& camera : cameras->keys()) {
      const auto numbers = cameras->numbers(camera, 4, 400, yaml::Range{.min = -1e6, .max = 1e6});
      auto& boxes = regions.emplace_back(camera, std::vector<color::PixelBox>()).second;
      if (numbers.size() % 4 != 0)
        cameras->fail(camera, "must be four numbers per rectangle: u_min, v_min, u_max, v_max");
      for (std::size_t i = 0; i < numbers.size(); i += 4) {
        const auto at = [&](std::size_t k) { return int(std::lround(numbers[i + k])); };
        boxes.push_back({at(0), at(1), at(2), at(3)});
        if (boxes.back().empty()) cameras->fail(camera, fmt::format("rectangle {} ends before it begins", i / 4 + 1));
      }
    }
  }
  template <typename F>
  void group(std::string_view key, std::string_view, F&& describe_group) {
    if (yaml_.has(key) && !yaml_.is_mapping(key)) yaml_.fail(key, "is a group of keys: " + keys_below(describe_group));
    Reader inner(yaml_.map_or_empty(key), folder_,
                 elsewhere_);  // even if absent: something in it may be required
    describe_group(inner);
    inner.finish();
  }
  // If absent, the colour that matches nothing.
  template <typename F>
  void color(std::string_view key, color::HsiRange& range, std::string_view doc, F&& describe_range) {
    if (yaml_.has(key)) {
      group(key, doc, describe_range);
    } else {
      range = untaught_color;
    }
  }
  template <typename T, typename F>
  void named(std::string_view key, std::vector<T>& entries, std::string_view, F&& describe_entry) {
    if (!yaml_.has(key)) return;
    const auto keys_of_one = [&describe_entry] {
      const T one{};
      return keys_below([&](Printer& printer) { describe_entry(printer, value_of(one)); });
    };
    if (!yaml_.is_mapping(key))
      yaml_.fail(key,
                 "is a group of names, each on a line of its own below it, indented, with a colon and without a "
                 "dash: \"NAME:\"; and of each name " +
                     keys_of_one());
    const yaml::YamlReader names = yaml_.map(key);
    for (const std::string& name : names.keys())
      if (!names.is_mapping(name)) names.fail(name, "is read as a name: " + keys_of_one());
    for (auto& [name, yaml] : yaml_.named_maps(key)) {
      Reader inner(yaml, folder_, elsewhere_);
      T& entry = entries.emplace_back();
      name_of(entry) = name;
      describe_entry(inner, value_of(entry));
      inner.finish();
    }
  }
  void finish() const { yaml_.finish(elsewhere_); }

 private:
  fs::path resolved(const std::string& path) const { return fs::absolute(folder_ / path).lexically_normal(); }
  // Explains out-of-range values: per cent, 256 steps, or beyond the circle.
  void refuse_other_scale(std::string_view key, const std::vector<double>& values, yaml::Range range) const {
    const auto [low, high] = std::ranges::minmax(values);
    if (low >= range.min && high <= range.max) return;
    constexpr double per_cent = 100, byte = 255;
    std::string instead;
    if (range.max == degrees.max && low >= -degrees.max && high <= 2 * degrees.max) {
      const auto on_circle = [](double angle) { return std::fmod(angle + degrees.max, degrees.max); };
      instead =
          fmt::format(": write [{:.6g}, {:.6g}], the same on the circle", on_circle(values[0]), on_circle(values[1]));
    } else if (range.max == share.max && low >= 0 && high <= byte) {
      const double scale = high <= per_cent ? per_cent : byte;
      instead =
          fmt::format(": write [{:.2g}, {:.2g}] if these are of {:.0f}", values[0] / scale, values[1] / scale, scale);
    }
    yaml_.fail(key, fmt::format("must be from {:g} to {:g}, got [{:g}, {:g}]{}", range.min, range.max, values[0],
                                values[1], instead));
  }
  // Absent, or the word for "not a number".
  bool is_word(std::string_view key, std::string_view word) const {
    if (!yaml_.has(key)) return true;
    const std::string given = yaml_.string(key);
    if (given == word) return true;
    if (std::isalpha(static_cast<unsigned char>(given.front())) != 0) {
      yaml_.fail(key, "must be a number or the word " + std::string(word) + ", got \"" + given + "\"");
    }
    return false;
  }

  yaml::YamlReader yaml_;
  fs::path folder_;
  std::span<const yaml::KeyPath> elsewhere_;
};

// ---------------------------------------------------------------------------------------------------------------------
// All possible keys; NAME stands for user-defined names.
std::vector<yaml::KeyPath> all_keys() {
  ServiceConfig one_of_all;
  one_of_all.targets.emplace_back().name = "NAME";
  one_of_all.targets.front().camera_colors.emplace_back("NAME", color::HsiRange{});
  one_of_all.cameras.emplace_back().name = "NAME";
  return keys_of([&](Printer& printer) { describe(printer, one_of_all); });
}

ServiceConfig described(const yaml::YamlReader& root, const fs::path& file) {
  ServiceConfig config;
  config.file = fs::absolute(file).lexically_normal();
  const std::vector<yaml::KeyPath> keys = all_keys();
  Reader reader(root, root.path().parent_path(), keys);
  describe(reader, config);
  reader.finish();
  return config;
}

// A target was renamed or removed, and its taught values are left: only the user knows which.
// Objects of a target with `count` are named by its name and a number (object_tracking::object_name()).
void check_object_names(const yaml::YamlReader& root, const std::vector<object_tracking::TargetOptions>& targets) {
  for (const auto& several : targets) {
    if (several.count == 1) continue;
    for (const auto& other : targets) {
      if (!files::is_object_of(other.name, several.name)) continue;
      root.map("targets").fail(other.name, fmt::format("is the name of an object of {0}, which has a count: choose a "
                                                       "name other than {0} and a number",
                                                       several.name));
    }
  }
}

void check_taught_targets(const yaml::YamlReader& written, const yaml::YamlReader& taught) {
  const std::vector<std::string> known = written.map_or_empty("targets").keys();
  const yaml::YamlReader targets = taught.map_or_empty("targets");
  for (const std::string& name : targets.keys()) {
    if (std::ranges::find(known, name) != known.end()) continue;
    const yaml::YamlReader target = targets.map(name);
    if (target.has("shape") && target.has("count")) continue;  // added by an edit (taught_file.h)
    const auto nearest = files::nearest_word(name, known);
    targets.fail(name, fmt::format("{} has no such target{}: rename it here too, or take it out of this file",
                                   written.path().string(), nearest ? " (did you mean " + *nearest + "?)" : ""));
  }
}

// latency_offset_s replaces a missing latency of the rig; there are never two.
void take_latencies(ServiceConfig& config, const yaml::YamlReader& root) {
  for (const LiveCameraConfig& camera : config.cameras) {
    const auto index = config.rig.index_of(camera.name);
    if (!index || !camera.latency_offset_s) continue;
    std::optional<double>& latency_s = config.rig.cameras[std::size_t(*index)].timing.latency_s;
    if (latency_s && *latency_s != *camera.latency_offset_s) {
      root.map("cameras")
          .map(camera.name)
          .fail("latency_offset_s",
                fmt::format("is given although {} has timing.latency_s {:g} for this camera: say rig here, or take it "
                            "out there",
                            config.rig_file.filename().string(), *latency_s));
    }
    latency_s = *camera.latency_offset_s;
  }
}

// The default volume is for cameras around a room. The only camera's world often begins at the camera itself.
void search_where_one_camera_sees(ServiceConfig& config, const yaml::YamlReader& root) {
  const bool is_only_one = config.is_calibrated() && config.rig.cameras.size() == 1;
  if (!is_only_one || root.map_or_empty("object_tracking").has("volume")) return;
  const auto largest = std::ranges::max_element(config.targets, {}, &object_tracking::TargetOptions::radius_m);
  const double radius_m =
      largest != config.targets.end() ? largest->radius_m : object_tracking::TargetOptions().radius_m;
  config.object_tracking.volume = seen_volume(config.rig.cameras.front(), radius_m);
}

// A rig of the configuration's cameras with guessed lenses: names and sizes are known, and no pose.
calib::CameraRig rig_before_calibration(const std::vector<LiveCameraConfig>& cameras) {
  constexpr calib::ImageSize usual{640, 480};
  calib::CameraRig rig;
  for (const LiveCameraConfig& live : cameras) {
    const calib::ImageSize size =
        live.crop ? calib::ImageSize{live.crop->width, live.crop->height} : live.size.value_or(usual);
    rig.cameras.push_back(calib::guessed_camera(live.name, size));
  }
  return rig;
}

// The configuration must be valid by itself, so that the taught file hides no mistake and can be deleted.
ServiceConfig read_config(const fs::path& file, const yaml::YamlReader& written,
                          const std::optional<yaml::YamlReader>& taught) {
  ServiceConfig config = described(written, file);
  std::set<yaml::KeyPath> said;
  for (const auto& leaf : written.leaves()) said.insert(leaf.path);
  yaml::YamlReader root = written;
  if (taught) {
    taught->version(1);
    check_taught_targets(written, *taught);
    root = written.patched_with(*taught);
    config = described(root, file);
    for (const auto& [path, is_null] : taught->leaves())
      if (path != yaml::KeyPath{"version"}) (is_null ? config.taught.removed : config.taught.given).insert(path);
  }
  config.written = std::move(said);
  if (config.is_calibrated()) {
    if (!is_file(config.rig_file))
      root.fail("rig", no_file(config.rig_file) + "; rig: none shows cameras that are not calibrated yet");
    config.rig = calib::read_rig(config.rig_file);
    take_latencies(config, root);
  } else {
    if (config.cameras.empty()) root.fail("rig", "is none: then the configuration names the cameras, under cameras");
    config.rig = rig_before_calibration(config.cameras);
  }
  if (config.is_calibrated() && !config.calibration.room_file.empty())
    config.calibration.room = read_room(config.calibration.room_file, calib::rig_identity(config.rig));
  check_object_names(root, config.targets);
  for (const auto& target : config.targets) {
    config.dds.publisher.targets.push_back(target.name);
    config.dds.publisher.counts.push_back(target.count);
  }
  config.dds.publisher.cameras = config.rig.camera_names();
  config.dds.publisher.has_other_hosts =
      std::ranges::any_of(config.cameras, [](const LiveCameraConfig& camera) { return !camera.host.empty(); });
  config.dds.publisher.tracked_camera = config.camera_tracking.camera;
  search_where_one_camera_sees(config, root);
  check(config, root);
  for (auto& target : config.targets) {
    target.ignored = config.ignored;
    target.is_hue_taught = config.taught.given.contains({"targets", target.name, "color", "hue_deg"});
  }
  return config;
}

// A camera host's configuration.
template <typename Io, typename Config, typename OfCamera>
void describe_capture(Io& io, Config& config, const OfCamera& of_camera) {
  io.version(1);
  io.text_or("host", "auto", config.host, "name of this host for trackers; auto: the machine's name");
  io.named("cameras", config.cameras, "its cameras, by their names for trackers", of_camera);
  io.group("dds", "", [&](auto& in) { describe_dds(in, config.dds); });
  io.choice("log_level", config.log_level, Words<LogLevel>(log_level_words), "");
}

std::string printed(const ServiceConfig& config, Printer::Show show) {
  std::string out;
  Printer::Style style{.show = show, .taught = config.taught, .written = &config.written};
  if (show == Printer::Show::all_origins) {
    style.written_name = config.file.filename().string();
    style.taught_name = taught_file(config.file).filename().string();
  }
  Printer printer(out, style);
  describe(printer, config);
  return out;
}

// Names of the files next to a recording's configuration.
constexpr std::size_t largest_beside = 1U << 30;  // bytes: a map contains pictures
constexpr const char *board_beside = "camera_board.yaml", *map_beside = "camera.map", *room_beside = "room.yaml";

}  // namespace

fs::path taught_file(const fs::path& config) {
  const fs::path real = fs::weakly_canonical(config);
  return real.parent_path() / (real.stem().string() + ".taught" + real.extension().string());
}

bool is_taught(const object_tracking::TargetOptions& target) {
  return target.color != untaught_color || !target.camera_colors.empty();
}

void require_rig(const ServiceConfig& config) {
  if (config.is_calibrated()) return;
  throw files::ConfigError(config.file, 0,
                           "rig is none: calibrate the cameras first (huetrack-calibrate, " +
                               files::document_path("calib/tutorial.md") +
                               "), and set rig to the file that it writes; until then, huetrackd run shows them");
}

std::vector<capture::FrameTiming> frame_timing(const calib::CameraRig& rig) {
  std::vector<capture::FrameTiming> out;
  for (const calib::Camera& camera : rig.cameras)
    out.push_back({.latency = capture::duration_of(camera.timing.latency_s.value_or(0)),
                   .readout = capture::duration_of(camera.timing.readout_s.value_or(0))});
  return out;
}

namespace {

// A rig or a recording has `cameras`, too, and is easily mistaken for a configuration.
void refuse_other_files(const yaml::YamlReader& written) {
  if (written.has("rig") || !written.has("cameras")) return;
  for (const auto& [name, camera] : written.named_maps("cameras")) {
    if (camera.has("intrinsics"))
      written.fail("", "this is a rig, not a configuration: the configuration names it (rig: " +
                           written.path().filename().string() +
                           ") and the targets; configs/huetrackd.yaml has every key");
    if (camera.has("device"))
      written.fail(
          "", "this is a camera host's configuration, for huetrackd capture; a tracker's also has rig and targets");
    if (camera.has("frames"))
      written.fail("", "this is a recording, not a configuration: huetrackd replay CONFIGURATION RECORDING");
  }
}

}  // namespace

bool sends_matches(const ServiceConfig& config, std::string_view camera) {
  const auto live = std::ranges::find(config.cameras, camera, &LiveCameraConfig::name);
  return live != config.cameras.end() && live->send == Sent::matches;
}

ServiceConfig with_frames(ServiceConfig config) {
  for (LiveCameraConfig& camera : config.cameras) camera.send = Sent::frames;
  return config;
}

bool is_capture_config(const fs::path& file) {
  try {
    const yaml::YamlReader root = yaml::YamlReader::file(file);
    if (root.has("rig") || root.has("targets") || !root.has("cameras")) return false;
    return std::ranges::any_of(root.named_maps("cameras"),
                               [](const auto& camera) { return camera.second.has("device"); });
  } catch (const files::ConfigError&) {
    return false;
  }
}

CaptureConfig load_capture_config(const fs::path& file) {
  const yaml::YamlReader root = yaml::YamlReader::file(file);
  if (root.has("rig") || root.has("targets"))
    root.fail("",
              "this is the configuration of a tracker: a camera host has version, host, cameras, dds and log_level");
  CaptureConfig config;
  config.file = fs::absolute(file).lexically_normal();
  Reader reader(root, root.path().parent_path());
  // Also reads a tracker's keys, for better messages.
  describe_capture(reader, config, [](auto& in, auto& camera) { describe_camera(in, camera); });
  reader.finish();
  if (config.cameras.empty()) root.fail("cameras", "is missing: name the cameras of this host");
  for (const LiveCameraConfig& camera : config.cameras) {
    const yaml::YamlReader yaml = root.map("cameras").map(camera.name);
    if (!camera.host.empty()) yaml.fail("host", "is not for a camera host: its cameras are local");
    if (camera.send != Sent::frames) yaml.fail("send", "belongs to the tracker's configuration");
    if (camera.crop)
      yaml.fail("crop",
                "is not for a camera host, which forwards whole pictures: connect the camera to the tracker's host");
    if (camera.fields) yaml.fail("fields", "belongs to the tracker's configuration");
    if (!camera.size) yaml.fail("size", "is missing: a camera host has no rig; give [width, height] as calibrated");
    if (camera.latency_offset_s) yaml.fail("latency_offset_s", "belongs to the tracker's configuration or the rig");
    for (const LiveCameraConfig& other : config.cameras) {
      if (&other == &camera) break;
      if (other.device == camera.device) yaml.fail("device", "is the device of " + other.name + " already");
    }
    check_network_camera(camera, *camera.size, yaml);
  }
  return config;
}

ServiceConfig load_service_config(const fs::path& file) {
  if (recordings::is_video_or_picture(file) || bags::is_bag(file))
    throw files::ConfigError(file, 0,
                             "is a video, a picture or a bag, not a configuration with rig and targets "
                             "(configs/huetrackd.yaml has every key): huetrackd replay my.yaml left=a.mp4 right=b.mp4");
  if (const auto advice = recordings::advice_to_convert(file); !advice.empty())
    throw files::ConfigError(file, 0, advice);
  const yaml::YamlReader written = yaml::YamlReader::file(file);
  refuse_other_files(written);
  const fs::path beside = taught_file(file);
  if (!fs::exists(beside)) return read_config(file, written, std::nullopt);
  return read_config(file, written, yaml::YamlReader::file(beside));
}

ServiceConfig load_service_config(const fs::path& file, const std::string& taught) {
  return read_config(file, yaml::YamlReader::file(file), yaml::YamlReader::text(taught, taught_file(file).string()));
}

std::string to_yaml(const ServiceConfig& config) {
  return printed(config, Printer::Show::all);
}

std::string to_yaml(const CaptureConfig& config) {
  std::string out;
  const TaughtKeys nothing;
  const Printer::Style style{.taught = nothing};
  Printer printer(out, style);
  describe_capture(printer, config, [](auto& in, auto& camera) { describe_device(in, camera); });
  return out;
}
std::string to_yaml_with_origins(const ServiceConfig& config) {
  return printed(config, Printer::Show::all_origins);
}

std::string to_taught_yaml(const ServiceConfig& config) {
  return printed(config, Printer::Show::taught);
}

std::string to_portable_yaml(const ServiceConfig& config) {
  ServiceConfig portable = config;
  if (config.is_calibrated()) portable.rig_file = "rig.yaml";
  portable.dds.publisher.profiles.clear();
  for (LiveCameraConfig& camera : portable.cameras)  // recordings are shared, and an address may contain a password
    if (capture::is_network_address(camera.device.native())) camera.device = "rtsp://" + camera.name;
  CameraTrackingConfig& tracking = portable.camera_tracking;
  if (!tracking.board.empty()) tracking.board = board_beside;
  if (!tracking.load_map.empty()) tracking.load_map = map_beside;
  tracking.save_map.clear();
  // The initial knowledge, from which a replay starts, too.
  portable.calibration.room_file = portable.calibration.room.empty() ? "" : room_beside;
  return to_yaml(portable);
}

std::vector<std::pair<std::string, std::string>> files_beside(const ServiceConfig& config) {
  std::vector<std::pair<std::string, std::string>> files;
  const auto add = [&files](const char* name, const std::filesystem::path& file) {
    if (file.empty()) return;
    files.emplace_back(name, files::read_text_file(file, largest_beside));
  };
  add(board_beside, config.camera_tracking.board);
  add(map_beside, config.camera_tracking.load_map);
  if (!config.calibration.room.empty())
    files.emplace_back(room_beside, room_to_yaml(config.calibration.room, calib::rig_identity(config.rig)));
  return files;
}

std::string config_identity(const ServiceConfig& config) {
  ServiceConfig anywhere = config;
  anywhere.rig_file.clear();                 // the rig's path does not matter; its content has its own identity
  std::uint64_t hash = 0xcbf29ce484222325u;  // FNV-1a 64
  for (const char c : to_yaml(anywhere)) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
  return fmt::format("{:016x}", hash);
}

std::vector<std::string> differing_keys(const ServiceConfig& a, const ServiceConfig& b) {
  using Sections = std::vector<std::pair<std::string, std::string>>;  // top-level key and its text
  const auto sections_of = [](const ServiceConfig& config) {
    Sections sections;
    const std::string yaml = to_yaml(config);
    for (std::size_t at = 0; at < yaml.size();) {
      const std::size_t end = yaml.find('\n', at) + 1;
      const std::string line = yaml.substr(at, end - at);
      if (line.front() != ' ') sections.emplace_back(line.substr(0, line.find(':')), "");
      sections.back().second += line;
      at = end;
    }
    return sections;
  };
  const Sections of_a = sections_of(a), of_b = sections_of(b);  // same keys in the same order
  std::vector<std::string> keys;
  for (std::size_t i = 0; i < of_a.size(); ++i) {
    const bool is_rig = of_a[i].first == "rig";
    if (of_a[i] != of_b[i] || (is_rig && calib::rig_identity(a.rig) != calib::rig_identity(b.rig)))
      keys.push_back(of_a[i].first);
  }
  return keys;
}

std::vector<std::size_t> targets_that_differ(const ServiceConfig& before, const ServiceConfig& after) {
  const auto keys = differing_keys(before, after);
  const bool all = std::ranges::find(keys, "object_tracking") != keys.end();
  std::vector<std::size_t> targets;
  for (std::size_t t = 0; t < after.targets.size(); ++t) {
    const object_tracking::TargetOptions &a = before.targets.at(t), &b = after.targets[t];
    const bool is_same = a.name == b.name && a.radius_m == b.radius_m && a.is_radius_assumed == b.is_radius_assumed &&
                         a.shape == b.shape && a.color == b.color && a.camera_colors == b.camera_colors &&
                         a.adapts_color == b.adapts_color && a.count == b.count && a.is_up_to == b.is_up_to &&
                         a.ignored == b.ignored;
    if (all || !is_same) targets.push_back(t);
  }
  return targets;
}

}  // namespace huetrack::config
