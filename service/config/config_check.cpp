#include "config/config_check.h"
#include "calib/files/nearest_word.h"
#include "calib/model/placement.h"
#include "capture/network_source.h"
#include "color/color_name.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <limits>

namespace huetrack::config {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t most_targets = 100;
constexpr double most_particles = 4e6;  // of all objects during a search: about a gigabyte
constexpr std::size_t most_pairs = 3;   // of targets with overlapping colours that get separate warnings

std::string not_in_the_rig(const std::string& camera, const calib::CameraRig& rig) {
  const std::vector<std::string> names = rig.camera_names();
  const auto nearest = files::nearest_word(camera, names);
  return fmt::format("is not a camera of the rig, which has {}{}", fmt::join(names, ", "),
                     nearest ? " (did you mean " + *nearest + "?)" : "");
}

void check_camera_tracking(const ServiceConfig& config, const yaml::YamlReader& yaml) {
  const CameraTrackingConfig& tracking = config.camera_tracking;
  if (tracking.camera.empty()) {
    if (tracking.starts() > 0) yaml.fail("camera", "is not given: name the camera of the rig that moves");
    return;
  }
  if (!config.rig.index_of(tracking.camera))
    yaml.fail("camera", tracking.camera + " " + not_in_the_rig(tracking.camera, config.rig));
  if (tracking.starts() != 1 && (tracking.starts() > 1 || tracking.load_map.empty()))
    yaml.fail("start", fmt::format("exactly one of rectangle, points, board and leds must be given (with load_map none "
                                   "is needed), and there are {}",
                                   tracking.starts()));
  const calib::Camera& camera = config.rig.cameras[std::size_t(*config.rig.index_of(tracking.camera))];
  for (const auto& [key, rows] : {std::pair{"rectangle", &tracking.rectangle}, {"points", &tracking.points}}) {
    const auto problem = start_row_problem(*rows, camera);
    if (!problem) continue;
    const yaml::YamlReader start = yaml.map("start");
    const std::string message = fmt::format("row {}: {}", problem->row + 1, problem->message);
    if (start.is_list(key)) start.fail(key, message);
    const fs::path file = fs::absolute(config.file.parent_path() / start.string(key)).lexically_normal();
    throw files::ConfigError(file, line_of_row(file, problem->row), message);
  }
  for (const auto& row : tracking.led_schedule)
    if (row[0] != std::floor(row[0])) yaml.map("start").fail("led_schedule", "must hold whole numbers of LEDs, from 0");
  if (!tracking.leds.empty() && !tracking.save_map.empty())
    yaml.fail("save_map", "with LEDs there is no map to save; their positions are given: leave it out");
  if (const auto problems = tracker_options(tracking).problems(); !problems.empty()) yaml.fail("", problems.front());
  if (const auto problems = config.dds.publisher.problems(); !problems.empty()) yaml.fail("camera", problems.front());
}

void check_object_tracking(const ServiceConfig& config, const yaml::YamlReader& root) {
  const object_tracking::Volume& volume = config.object_tracking.volume;
  const yaml::YamlReader tracking = root.map_or_empty("object_tracking");
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!(volume.min[Eigen::Index(axis)] < volume.max[Eigen::Index(axis)]))
      tracking.fail("volume", fmt::format("min must be less than max on every axis, and on {} it is not", "xyz"[axis]));
  }
  if (const auto problems = config.object_tracking.problems(); !problems.empty())
    root.fail("object_tracking", problems.front());
  double particles = 0;
  for (const auto& target : config.targets)
    particles += double(target.count) * config.object_tracking.max_particle_count;
  if (particles > most_particles)
    tracking.fail("max_particle_count", fmt::format("makes {:.0f} particles of all objects together, and {:.0f} are "
                                                    "the most: give fewer particles, or fewer targets",
                                                    particles, most_particles));
  if (!config.targets.empty() && config.is_calibrated() && volume_coverage(config.rig, volume).by_one == 0) {
    const std::string units = unit_mistake(config);
    tracking.fail("volume", "no camera of the rig sees any of it: " +
                                (units.empty() ? "is the volume in the rig's world frame, in metres?" : units));
  }
}

void check_ignored(const ServiceConfig& config, const yaml::YamlReader& root) {
  for (const auto& [camera, boxes] : config.ignored)
    if (!config.rig.index_of(camera)) root.map("ignore").fail(camera, not_in_the_rig(camera, config.rig));
}

void check_crop(const LiveCameraConfig& camera, calib::ImageSize calibrated, const yaml::YamlReader& at) {
  if (!camera.crop) return;
  if (!camera.host.empty() || capture::is_network_address(camera.device.native()))
    at.fail("crop",
            "is for a camera that is connected to this host: connect it here, or have its pictures cropped where they "
            "come from");
  if (!camera.size) at.fail("crop", "needs size: that of the device's whole picture, as [1280, 480]");
  if (camera.crop->width != calibrated.width || camera.crop->height != calibrated.height)
    at.fail("crop", fmt::format("is {}x{}, and the rig was calibrated at {}x{}: calibrate with this crop",
                                camera.crop->width, camera.crop->height, calibrated.width, calibrated.height));
}

// What cameras that share a device must have in common.
void check_devices(const ServiceConfig& config, const yaml::YamlReader& live) {
  std::vector<capture::CameraRequest> requests;
  for (const auto& camera : config.cameras) {
    if (!camera.crop) continue;
    capture::CameraRequest& request = requests.emplace_back();
    request.name = camera.name;
    request.device = camera.device;
    request.format = camera.format;
    request.width = camera.size->width;
    request.height = camera.size->height;
    request.fps = camera.fps.value_or(0);
    request.controls = camera.controls;
    request.restore_controls = camera.restore_controls;
    request.crop = camera.crop;
    if (const auto problem = capture::problem_of(requests); !problem.empty())
      live.map(camera.name).fail("crop", problem);
  }
}

void check_live_cameras(const ServiceConfig& config, const yaml::YamlReader& root) {
  const yaml::YamlReader live = config.cameras.empty() ? root : root.map("cameras");
  for (const auto& camera : config.cameras) {
    const auto index = config.rig.index_of(camera.name);
    if (!index) live.fail(camera.name, not_in_the_rig(camera.name, config.rig));
    const calib::ImageSize calibrated = config.rig.cameras[std::size_t(*index)].image_size;
    check_crop(camera, calibrated, live.map(camera.name));
    if (camera.fields && camera.send == Sent::matches)
      live.map(camera.name).fail("fields", "needs the camera's pictures: give send: frames");
    if (camera.size && !camera.crop && *camera.size != calibrated)
      live.map(camera.name)
          .fail("size",
                fmt::format("the rig was calibrated at {}x{}: use that size (or the word rig), or calibrate anew",
                            calibrated.width, calibrated.height));
    for (const auto& other : config.cameras) {
      if (&other == &camera) break;
      if (other.host != camera.host) continue;
      if (camera.host.empty() && other.device == camera.device && !(camera.crop && other.crop))
        live.map(camera.name)
            .fail("device", "is the device of " + other.name +
                                " already: cameras that share one need a crop each, their part of its picture");
      if (!camera.host.empty() && other.name_on_host() == camera.name_on_host())
        live.map(camera.name).fail("camera", "is the camera of " + other.name + " already");
    }
    check_network_camera(camera, calibrated, live.map(camera.name));
    if (camera.host.empty()) {
      if (!camera.camera_there.empty())
        live.map(camera.name).fail("camera", "is for a camera of another host: give host, too");
      if (camera.send != Sent::frames)
        live.map(camera.name).fail("send", "is what the host of a camera sends: give host, too");
    } else if (camera.format || camera.fps || !camera.controls.empty() || camera.restore_controls) {
      live.map(camera.name)
          .fail("host",
                "has the camera, and its settings (format, fps, controls): give them in the configuration of "
                "`huetrackd capture` there");
    }
    if (camera.send == Sent::matches && camera.name == config.camera_tracking.camera)
      live.map(camera.name).fail("send", "must be frames: camera_tracker needs its pictures");
    // Each of two colours while a new configuration is taken over.
    constexpr std::size_t most_colors = capture::Matches::most / 2;
    if (camera.send == Sent::matches && config.targets.size() > most_colors)
      live.map(camera.name)
          .fail("send", fmt::format("must be frames: matches allow at most {} targets, and there are {}", most_colors,
                                    config.targets.size()));
    if (camera.send == Sent::matches && !config.is_calibrated())
      live.map(camera.name).fail("send", "must be frames until the cameras are calibrated (rig: none)");
  }
  if (config.quorum && *config.quorum > int(config.cameras.size()))
    root.fail("quorum", fmt::format("is more than there are in cameras ({})", config.cameras.size()));
  check_devices(config, live);
}

void check_targets(const ServiceConfig& config, const yaml::YamlReader& root) {
  const object_tracking::Volume& volume = config.object_tracking.volume;
  const double smallest_side_m = (volume.max - volume.min).minCoeff();
  const yaml::YamlReader targets = root.map_or_empty("targets");
  for (const auto& target : config.targets) {
    publish::EstimatePublisherOptions topics;  // topic names contain it
    topics.targets = {target.name};
    if (const auto problems = topics.problems(); !problems.empty()) targets.fail(target.name, problems.front());
    const yaml::YamlReader yaml = targets.map(target.name);
    if (2 * target.radius_m > smallest_side_m)
      yaml.fail("radius_m", fmt::format("a ball of this radius does not fit into object_tracking.volume; the unit is "
                                        "metres: did you mean {:g}?",
                                        target.radius_m / 1000));
    for (const auto& [camera, range] : target.camera_colors) {
      const yaml::YamlReader colors = yaml.map("camera_colors");
      if (!config.rig.index_of(camera)) colors.fail(camera, not_in_the_rig(camera, config.rig));
      if (const auto problems = range.problems(); !problems.empty()) colors.fail(camera, problems.front());
    }
    if (const auto problems = target.color.problems(); !problems.empty()) yaml.fail("color", problems.front());
    if (target.count > 1 && config.object_tracking.observation == object_tracking::Observation::paper)
      yaml.fail("count", "is not for object_tracking.observation: paper, whose filter is of one object");
    if (target.adapts_color && config.object_tracking.observation == object_tracking::Observation::paper)
      yaml.map("color").fail("adapt",
                             "is not for object_tracking.observation: paper, which is the paper's filter alone");
    if (const auto problems = target.problems(); !problems.empty()) targets.fail(target.name, problems.front());
  }
}

// Whether two colour ranges overlap.
bool hues_overlap(const color::HsiRange& a, const color::HsiRange& b) {
  const auto inside = [](double hue, const color::HsiRange& r) {
    return r.hue_min_deg <= r.hue_max_deg ? hue >= r.hue_min_deg && hue <= r.hue_max_deg
                                          : hue >= r.hue_min_deg || hue <= r.hue_max_deg;
  };
  return (inside(a.hue_min_deg, b) || inside(b.hue_min_deg, a)) && a.saturation_min <= b.saturation_max &&
         b.saturation_min <= a.saturation_max && a.intensity_min <= b.intensity_max &&
         b.intensity_min <= a.intensity_max;
}

}  // namespace

void check_network_camera(const LiveCameraConfig& camera, calib::ImageSize size, const yaml::YamlReader& at) {
  if (!capture::is_network_address(camera.device.native())) return;
  const capture::NetworkSourceOptions network{.address = camera.device, .width = size.width, .height = size.height};
  if (const auto problems = network.problems(); !problems.empty()) at.fail("device", problems.front());
  if (camera.format || !camera.controls.empty() || camera.restore_controls)
    at.fail("device", "is a camera of the network, which has its own settings: format and controls are not for it");
}

void check(const ServiceConfig& config, const yaml::YamlReader& root) {
  if (config.cameras.size() > calib::max_cameras)
    root.fail("cameras", fmt::format("are {}, and there may be {} at most", config.cameras.size(), calib::max_cameras));
  if (config.targets.size() > most_targets)
    root.fail(
        "targets",
        fmt::format("are {}, and {} at most can be tracked: each has particles, colour tables and topics of its own",
                    config.targets.size(), most_targets));
  if (!config.is_calibrated() && !config.camera_tracking.camera.empty())
    root.map("camera_tracking").fail("camera", "cannot be tracked yet: rig is none");
  check_camera_tracking(config, root.map_or_empty("camera_tracking"));
  // With allow_teach, the first target may be added later.
  if (config.targets.empty() && config.camera_tracking.camera.empty() && !config.control.allow_teach)
    root.fail("targets",
              "at least one target is needed: targets: {ball: {color: {hue_deg: [65, 115]}}}, or {ball: {}} to be "
              "taught; or a camera to track, under camera_tracking");
  check_object_tracking(config, root);
  check_ignored(config, root);
  check_live_cameras(config, root);
  if (config.record.folder.empty() && (config.record.always || config.record.pre_roll_s > 0))
    root.map("record").fail("", "a folder is needed to record to, or to save the pre-roll to");
  check_targets(config, root);
  if (const auto problems = config.dds.publisher.problems(); !problems.empty())
    root.map_or_empty("dds").fail("", problems.front());
}

namespace {

constexpr double hall_m = 200;  // longer than any room for this purpose

// Distance of the nearest camera from the middle of the volume.
double nearest_camera_m(const ServiceConfig& config) {
  const Eigen::Vector3d middle = (config.object_tracking.volume.min + config.object_tracking.volume.max) / 2;
  double nearest_m = std::numeric_limits<double>::infinity();
  for (const auto& camera : config.rig.cameras) nearest_m = std::min(nearest_m, (camera.centre() - middle).norm());
  return nearest_m;
}

// Largest distance between two cameras.
double rig_width_m(const calib::CameraRig& rig) {
  double widest_m = 0;
  for (const auto& a : rig.cameras)
    for (const auto& b : rig.cameras) widest_m = std::max(widest_m, (a.centre() - b.centre()).norm());
  return widest_m;
}

// One of the entries of its calibration; empty: there is none.
std::string made_by(const calib::CameraRig& rig, std::string_view key) {
  const auto entry = std::ranges::find(rig.made_by, key, &std::pair<std::string, std::string>::first);
  return entry == rig.made_by.end() ? "" : entry->second;
}

// Evidence against the rig in its own file; empty: none.
std::string rig_warning(const calib::CameraRig& rig) {
  using namespace std::chrono;
  // Mounts sag and lenses are touched within months.
  constexpr auto old = days(180);
  const sys_seconds now = floor<seconds>(system_clock::now());
  const calib::RigHistory& made = rig.made;
  if (!made.checks.empty() && made.checks.back().verdict != "usable" &&
      made.checks.back().verdict != calib::mended_verdict)
    return "the rig was found " + made.checks.back().verdict + " when it was last checked: " + made.text(now);
  if (const std::string verdict = made_by(rig, "verdict");
      !verdict.empty() && verdict != "usable" && (made.checks.empty() || !made_by(rig, "doubt").empty())) {
    const std::string error_mm = made_by(rig, "expected_error_mm"), doubt = made_by(rig, "doubt");
    return fmt::format("the rig was {} when it was calibrated{}: {}", verdict,
                       error_mm.empty() ? "" : ", with an expected error of positions of " + error_mm + " mm",
                       doubt.empty() ? "calibrate again, and follow the report's advice" : doubt);
  }
  const auto seen = made.checks.empty() ? made.at : std::optional(made.checks.back().at);
  if (seen && now - *seen > old)
    return "the rig has not been checked for long: " + made.text(now) + "; check it with huetrack-calibrate check";
  return {};
}

// A target that is too small to be seen; empty: none.
std::string size_warning(const ServiceConfig& config) {
  constexpr double least_seen_px = 0.25;  // radius of a ball that colours no pixel
  const double nearest_m = nearest_camera_m(config);
  double px_per_rad = 0;
  for (const auto& camera : config.rig.cameras)
    px_per_rad = std::max(px_per_rad, double(camera.image_size.width));  // the view is about one radian wide
  for (const auto& target : config.targets) {
    const double px = px_per_rad * target.radius_m / nearest_m;
    if (px < least_seen_px)
      return fmt::format(
          "target {}: a ball of radius {:g} m would be {:.2g} pixels large in the middle of the volume, {:.0f} m from "
          "the nearest camera: is the rig, or the volume, not in metres?",
          target.name, target.radius_m, 2 * px, nearest_m);
  }
  return {};
}

// The probable meaning of a range that is wider than any paint: reversed, or in OpenCV's units of two degrees, in which
// red is 170 to 10; the narrower of the two.
std::string meant_hue(const color::HsiRange& range) {
  const double low = range.hue_max_deg, high = range.hue_min_deg;
  const double turned_deg = high - low, doubled_deg = 360 - 2 * turned_deg;
  if (high <= 180 && doubled_deg > 0 && doubled_deg < turned_deg)
    return fmt::format("were [{:g}, {:g}] meant, which are [{:g}, {:g}] in OpenCV's units (0 to 180)?", 2 * high,
                       2 * low, high, low);
  return fmt::format("were [{:g}, {:g}] meant?", low, high);
}

std::string unset_radius_warning(const ServiceConfig& config, const object_tracking::TargetOptions& target) {
  const bool is_measured = config.rig.cameras.size() > 1 &&
                           config.object_tracking.observation == object_tracking::Observation::huetrack &&
                           target.count == 1 && target.shape != object_tracking::TargetShape::blob;
  return fmt::format("no radius of target {} is set: {:g} m is assumed{}: measure it, and set radius_m", target.name,
                     target.radius_m,
                     is_measured ? " until its outlines have shown another" : ", and positions are as wrong as that");
}

}  // namespace

std::string teach_advice(const ServiceConfig& config, const object_tracking::TargetOptions& target,
                         const std::string& recording) {
  std::string click = "click on it on the page of huetrack view";
  if (!recording.empty())
    click = fmt::format("replay with --hold{} and {}",
                        config.control.allow_teach ? "" : ", with control: {allow_teach: true},", click);
  return fmt::format("{}, or run huetrackd teach {} {} {}--at CAMERA,FRAME,U,V", click, config.file.string(),
                     recording.empty() ? "RECORDING" : recording,
                     config.targets.size() > 1 ? "--target " + target.name + " " : "");
}

std::string unit_mistake(const ServiceConfig& config) {
  if (!config.is_calibrated()) return {};
  if (const double widest_m = rig_width_m(config.rig); widest_m > hall_m)
    return fmt::format("the cameras stand up to {:.0f} m apart: is the rig in millimetres? Write it in metres",
                       widest_m);
  if (config.targets.empty()) return {};
  const object_tracking::Volume& volume = config.object_tracking.volume;
  if (const double longest_m = (volume.max - volume.min).maxCoeff(); longest_m > hall_m)
    return fmt::format("object_tracking.volume is {:.0f} m long: is it in millimetres? Write it in metres", longest_m);
  if (const double nearest_m = nearest_camera_m(config); nearest_m > hall_m)
    return fmt::format(
        "the nearest camera stands {:.0f} m from the middle of object_tracking.volume: is the rig, or the volume, in "
        "millimetres? Write them in metres",
        nearest_m);
  return {};
}

std::string pose_mistake(const ServiceConfig& config) {
  const calib::CameraRig& rig = config.rig;
  if (!config.is_calibrated() || rig.cameras.size() < 2) return {};
  const auto inverted = calib::better_inverted(rig.cameras);
  if (!inverted || !calib::are_probably_inverted(rig.cameras, *inverted)) return {};
  const calib::Middle as_it_is = calib::middle_of(rig.cameras);
  return fmt::format(
      "the rig's cameras {}; with inverted poses they are up to {:.2f} m apart and look at a place {:.2f} m away: its "
      "poses are probably world_from_cam where cam_from_world is expected: invert them, or import the rig with "
      "--inverted-poses",
      as_it_is.is_in_all_pictures ? fmt::format("are up to {:.2f} m apart", as_it_is.widest)
                                  : "do not look at one place",
      inverted->widest, inverted->distance);
}

std::string coverage_mistake(const ServiceConfig& config) {
  if (!config.is_calibrated() || config.targets.empty() || config.rig.cameras.size() < 2) return {};
  const auto coverage = volume_coverage(config.rig, config.object_tracking.volume);
  if (std::lround(100 * coverage.by_two) > 0) return {};
  const std::string poses = pose_mistake(config);
  return "0 % of object_tracking.volume is seen by two or more cameras, so nothing can be located there: " +
         (poses.empty() ? "is the volume where the cameras look, in the rig's world frame and in metres? Are the "
                          "rig's poses inverted (huetrack-calibrate import --inverted-poses), or in another unit "
                          "(--unit)?"
                        : poses);
}

std::vector<std::string> warnings_of(const ServiceConfig& config) {
  std::vector<std::string> warnings;
  if (!config.is_calibrated())
    return {
        "the cameras are not calibrated (rig: none), so nothing is tracked: calibrate them on the page of huetrack "
        "view, or with huetrack-calibrate"};
  for (const auto& target : config.targets)
    if (!is_taught(target))
      warnings.push_back(fmt::format("target {} has no colour yet: {}", target.name, teach_advice(config, target)));
    else if (target.is_radius_assumed)
      warnings.push_back(unset_radius_warning(config, target));
  for (const auto& camera : config.rig.cameras) {
    if (!config.cameras.empty() &&
        std::ranges::find(config.cameras, camera.name, &LiveCameraConfig::name) == config.cameras.end())
      warnings.push_back("camera " + camera.name + " of the rig is not among the live cameras, so run does not use it");
  }
  if (std::string warning = rig_warning(config.rig); !warning.empty()) warnings.push_back(std::move(warning));
  std::string seen = coverage_mistake(config);
  if (seen.empty()) seen = pose_mistake(config);
  if (!seen.empty()) warnings.push_back(std::move(seen));
  const RecordConfig& record = config.record;
  if (!record.folder.empty() && !record.always && !(record.pre_roll_s > 0) && !config.control.allow_record)
    warnings.push_back(
        "record.folder is set, but nothing will be recorded: set record.always, record.pre_roll_s, or "
        "control.allow_record");
  if (config.targets.empty()) return warnings;
  const auto coverage = volume_coverage(config.rig, config.object_tracking.volume);
  for (std::size_t c = 0; c < config.rig.cameras.size(); ++c) {
    if (coverage.per_camera[c] == 0)
      warnings.push_back("camera " + config.rig.cameras[c].name + " sees nothing of the volume");
  }
  if (config.rig.cameras.size() == 1)
    warnings.push_back(
        config.object_tracking.observation == object_tracking::Observation::paper
            ? "one camera: observation: paper leaves the distance open"
            : "one camera: a ball's distance follows from its size, to 20 % by its region, to 2 to 5 % once its "
              "outline is fitted, and is as wrong as its radius_m and the lens; targets of shape: blob are not found");
  else if (std::lround(100 * coverage.by_two) > 0 && coverage.by_two < 0.5)
    warnings.push_back(
        fmt::format("only {} % of the volume is seen by two or more cameras: a target's depth is not fixed in the rest",
                    std::lround(100 * coverage.by_two)));
  std::string unit = unit_mistake(config);
  if (unit.empty()) unit = size_warning(config);
  if (!unit.empty()) warnings.push_back(std::move(unit));
  for (const auto& target : config.targets) {
    const color::HsiRange& c = target.color;
    if (is_taught(target) && color::is_share_of_circle(c))
      warnings.push_back(fmt::format("target {}: its hue_deg [{:g}, {:g}] is one degree wide at most; {}", target.name,
                                     c.hue_min_deg, c.hue_max_deg, color::other_unit_text(c)));
    constexpr double widest_paint_deg = 180;
    if (c.hue_min_deg > c.hue_max_deg && hue_width_deg(c) > widest_paint_deg)
      warnings.push_back(fmt::format("target {}: its hue runs from {:g} through red to {:g}, {:g} degrees in all; {}",
                                     target.name, c.hue_min_deg, c.hue_max_deg, hue_width_deg(c), meant_hue(c)));
  }
  std::vector<std::string> pairs;
  for (std::size_t a = 0; a < config.targets.size(); ++a) {
    for (std::size_t b = a + 1; b < config.targets.size(); ++b) {
      if (!is_taught(config.targets[a]) || !is_taught(config.targets[b])) continue;
      for (const auto& camera : config.rig.cameras) {
        if (!hues_overlap(config.targets[a].color_in(camera.name), config.targets[b].color_in(camera.name))) continue;
        pairs.push_back("targets " + config.targets[a].name + " and " + config.targets[b].name +
                        " have overlapping colours in camera " + camera.name + " and may be taken for each other");
        break;
      }
    }
  }
  if (pairs.size() > most_pairs) {
    warnings.push_back(
        fmt::format("{} pairs of targets have overlapping colours and may be taken for each other; the first: {}",
                    pairs.size(), pairs.front()));
  } else {
    std::ranges::move(pairs, std::back_inserter(warnings));
  }
  return warnings;
}

VolumeCoverage volume_coverage(const calib::CameraRig& rig, const object_tracking::Volume& volume) {
  constexpr int steps = 12;  // per axis: 1728 points, fine enough for a share in per cent
  VolumeCoverage coverage{.per_camera = std::vector<double>(rig.cameras.size(), 0.0)};
  constexpr double weight = 1.0 / (steps * steps * steps);
  for (int i = 0; i < steps * steps * steps; ++i) {
    const Eigen::Array3d cell = Eigen::Array3i(i % steps, i / steps % steps, i / (steps * steps)).cast<double>();
    const Eigen::Vector3d p = volume.min.array() + (cell + 0.5) / steps * (volume.max - volume.min).array();
    int views = 0;
    for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
      const auto pixel = rig.cameras[c].project_world(p);
      if (!pixel || !rig.cameras[c].contains(*pixel)) continue;
      coverage.per_camera[c] += weight;
      ++views;
    }
    if (views >= 1) coverage.by_one += weight;
    if (views >= 2) coverage.by_two += weight;
  }
  return coverage;
}

}  // namespace huetrack::config
