#include "doctor/doctor.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <set>

#include "calib/files/config_error.h"
#include "calib/files/joined.h"
#include "calib/files/text_file.h"
#include "capture/network_source.h"
#include "config/service_config.h"
#include "doctor/light_exam.h"
#include "doctor/network_exam.h"
#include "hosts/camera_host.h"
#include "hosts/machine_clock.h"
#include "metrics/metrics.h"
#include "pipeline/live_cameras.h"
#include "publish/estimate_publisher.h"

namespace huetrack::doctor {
namespace {

namespace fs = std::filesystem;

using files::joined;

constexpr double slow = 0.95;  // of the agreed rate; below it is a finding

std::string name_of(const CameraExam& exam) {
  const std::string node = exam.node.identity.node.filename().string();
  return exam.name.empty() ? node : exam.name + " (" + node + ")";
}

std::string offered(const capture::OfferedFormat& format) {
  std::vector<std::string> sizes;
  for (const auto& size : format.sizes) {
    std::vector<std::string> rates;
    for (const double fps : format.sizes.empty() ? std::vector<double>{} : size.fps)
      rates.push_back(fmt::format("{:.4g}", fps));
    const std::string range =
        size.min_width < size.width ? fmt::format("{}x{} to ", size.min_width, size.min_height) : std::string();
    sizes.push_back(range + fmt::format("{}x{}", size.width, size.height) +
                    (rates.empty() ? "" : "@" + joined(rates, "/")));
    if (sizes.size() == 12 && format.sizes.size() > 13) {
      sizes.push_back(fmt::format("and {} sizes more", format.sizes.size() - sizes.size()));
      break;
    }
  }
  return joined(sizes);
}

// ---- One camera

void judge_names(const CameraExam& exam, bool is_expected, std::vector<Finding>& findings) {
  const capture::V4l2Identity& identity = exam.node.identity;
  if (identity.by_path.empty()) {
    findings.push_back({is_expected ? Grade::warning : Grade::note, "no name in /dev/v4l/by-path",
                        "udev makes these names; without them only " + identity.node.string() +
                            " is left, which may be another camera after the next boot"});
  } else {
    findings.push_back({Grade::ok, "by path (the port): " + joined(identity.by_path), ""});
  }
  if (identity.by_id.empty()) {
    findings.push_back({Grade::note, "no name in /dev/v4l/by-id: the camera has no serial number",
                        identity.by_path.empty() ? "" : "use its port, in /dev/v4l/by-path"});
  } else {
    findings.push_back({Grade::ok, "by id (the camera): " + joined(identity.by_id), ""});
  }
}

void judge_formats(const CameraExam& exam, std::vector<Finding>& findings) {
  std::vector<std::string> others;
  bool has_any = false;
  for (const auto& format : exam.formats) {
    if (format.format) {
      findings.push_back({Grade::ok, std::string(capture::name(*format.format)) + ": " + offered(format), ""});
      has_any = true;
    } else {
      others.push_back(capture::fourcc_text(format.fourcc));
    }
  }
  if (!has_any)
    findings.push_back({Grade::problem,
                        "no usable format" + (others.empty() ? std::string() : ", only " + joined(others)),
                        "huetrackd reads yuyv, nv12, mjpeg and grey: use another camera"});
  else if (!others.empty())
    findings.push_back({Grade::note, "not used by huetrackd: " + joined(others), ""});
}

void judge_stream(const CameraExam& exam, std::vector<Finding>& findings) {
  const StreamTrial& trial = *exam.trial;
  const capture::StreamFormat& agreed = trial.agreed;
  const std::string what = fmt::format("{} {}x{}", capture::name(agreed.format), agreed.width, agreed.height);
  if (!trial.failure.empty()) {
    findings.push_back(
        {Grade::problem, what + ": " + trial.failure,
         "try another cable, port or a powered hub; for several cameras on one bus, format: mjpeg or a lower rate"});
    if (trial.frames < 2) return;
  }
  const double said = agreed.fps > 0 ? agreed.fps : exam.asked_fps;
  const bool is_slow = said > 0 && trial.fps() < slow * said;
  findings.push_back(
      {is_slow ? Grade::warning : Grade::ok,
       what + fmt::format(": {:.1f} frames/s reached", trial.fps()) +
           (said > 0 ? fmt::format(" of {:.4g}", said) : std::string()) +
           fmt::format(" over {:.1f} s, longest gap {:.0f} ms", trial.seconds, 1000 * trial.longest_gap_s),
       is_slow ? "long exposures lower the rate: set exposure_time_absolute below the frame period and "
                 "exposure_dynamic_framerate: 0, or give more light; if that is not it, the USB: format: mjpeg"
               : ""});
  if (exam.asked_fps > 0 && agreed.fps > 0 && std::abs(agreed.fps - exam.asked_fps) > 0.02 * exam.asked_fps)
    findings.push_back({Grade::warning,
                        fmt::format("requested {:.4g} frames/s, the camera chose {:.4g}", exam.asked_fps, agreed.fps),
                        "set fps to one of the rates above"});
  if (trial.dropped > 0 || trial.corrupted > 0)
    findings.push_back({Grade::warning,
                        fmt::format("{} frames dropped, {} damaged of {}", trial.dropped, trial.corrupted,
                                    trial.frames + trial.dropped),
                        "a busy host, the cable, or the USB bus: try another port, format: mjpeg, or a lower rate"});
  else
    findings.push_back({Grade::ok, fmt::format("no frame of {} dropped or damaged", trial.frames), ""});
  const std::string stamp = "time stamps: " + std::string(capture::name(trial.stamp)) +
                            fmt::format(", {:.1f} ms before the dequeue", 1000 * trial.mean_age_s);
  if (trial.stamp == capture::StampKind::dequeued)
    findings.push_back({Grade::warning, "time stamps: none by the driver; the time of the dequeue is used",
                        "several ms of jitter: track slowly moving objects only, or use another camera"});
  else if (trial.mean_age_s < 0)
    findings.push_back(
        {Grade::warning, stamp + ": they are in the future", "give latency_offset_s, or update the driver"});
  else if (trial.stamp == capture::StampKind::end_of_frame)
    findings.push_back({Grade::note, stamp, "they are late by exposure and transfer: set latency_offset_s"});
  else
    findings.push_back({Grade::ok, stamp, ""});
  if (agreed.is_interlaced && !exam.has_fields)
    findings.push_back({Grade::warning, "interlaced frames: moving objects look like combs",
                        "use a progressive mode, or set fields: top or bottom"});
}

// Automatic controls change colours and rates while tracking.
void judge_automatics(const CameraExam& exam, std::vector<Finding>& findings) {
  struct Automatic {
    const char *control, *manual;
    std::int64_t off;
    const char* what;
  };
  for (const Automatic& a :
       {Automatic{"auto_exposure", "exposure_time_absolute", 1, "exposure is automatic: colours and frame rate change"},
        Automatic{"white_balance_automatic", "white_balance_temperature", 0, "white balance is automatic: hues change"},
        Automatic{"focus_automatic_continuous", "focus_absolute", 0, "focus is automatic: the calibration changes"}}) {
    const auto control = std::ranges::find(exam.controls, a.control, &capture::Control::name);
    if (control == exam.controls.end()) continue;
    std::optional<std::int64_t> value = control->value;
    for (const auto& set : exam.configured)
      if (set.name == a.control) value = set.got;
    if (value && *value != a.off)
      findings.push_back({exam.name.empty() ? Grade::note : Grade::warning, a.what,
                          std::string("controls: {") + a.manual + ": ...} in the configuration switches it off"});
  }
}

void judge_controls(const CameraExam& exam, std::vector<Finding>& findings) {
  std::vector<std::string> good;
  for (const auto& set : exam.configured)
    if (!set.problem.empty())
      findings.push_back(
          {Grade::warning, capture::to_string(set), "give a value that the camera accepts, or remove it"});
  for (const auto& set : exam.stayed) {
    if (set.problem.empty())
      good.push_back(set.name + " " + std::to_string(set.got.value_or(0)));
    else
      findings.push_back(
          {Grade::warning, capture::to_string(set), "another control changes it: switch its automatic control off"});
  }
  if (!good.empty()) findings.push_back({Grade::ok, "accepted controls of the configuration: " + joined(good), ""});
  good.clear();
  for (const auto& set : exam.tried) {
    if (set.problem.empty() && !set.is_implied) good.push_back(set.name);
    if (!set.problem.empty())
      findings.push_back(
          {Grade::note, "cannot be set: " + capture::to_string(set), "do not use it in the configuration"});
  }
  if (!good.empty())
    findings.push_back(
        {Grade::ok, "controls that accept a change (tested by one step, then restored): " + joined(good), ""});
  std::vector<std::string> others;
  for (const auto& control : exam.controls) {
    const auto is_it = [&](const capture::ControlResult& set) { return set.name == control.name; };
    if (control.is_read_only || control.is_button || std::ranges::any_of(exam.tried, is_it) ||
        std::ranges::any_of(exam.configured, is_it))
      continue;
    others.push_back(control.name + (control.is_inactive ? " (under automatic control)" : ""));
  }
  if (!others.empty())
    findings.push_back(
        {Grade::note, "controls not tried: " + joined(others), "only controls of the configuration are tested"});
  if (exam.controls.empty())
    findings.push_back({Grade::note, "no controls", "exposure and white balance are up to the camera"});
}

// ---- The host

std::map<int, double> bus_speeds(std::span<const CameraExam> exams) {
  std::map<int, double> speeds;
  for (const auto& exam : exams) {
    if (!exam.node.identity.usb) continue;
    const int bus = exam.node.identity.usb->bus;
    std::ifstream file("/sys/bus/usb/devices/usb" + std::to_string(bus) + "/speed");
    if (double mbps = 0; file >> mbps) speeds[bus] = mbps;
  }
  return speeds;
}

std::optional<double> largest_receive_buffer() {
  std::ifstream file("/proc/sys/net/core/rmem_max");
  if (double bytes = 0; file >> bytes) return bytes;
  return std::nullopt;
}

bool is_busy(const CameraExam& exam) {
  return exam.problem.find("another program uses it") != std::string::npos ||
         exam.node.problem.find("another program uses it") != std::string::npos;
}

class Doctor {
 public:
  Doctor(const DoctorOptions& options, const std::stop_token& stop) : options_(options), stop_(stop) {}

  int run() {
    if (options_.config) look_at_config();
    look_at_cameras();
    look_at_hosted();
    look_at_network();
    look_at_hosts();
    if (config_) {
      look_at_recording();
      look_at_metrics();
    }
    std::printf("%d problem%s, %d warning%s%s\n", problems_, problems_ == 1 ? "" : "s", warnings_,
                warnings_ == 1 ? "" : "s", not_examined(busy_, examined_).c_str());
    if (has_none_) std::printf("to try huetrackd without a camera: huetrackd demo\n");
    return problems_;
  }

 private:
  static void title(const std::string& title) {
    std::printf("%s\n", files::printable(title, files::longest_message).c_str());
  }
  void say(const Finding& finding) {
    problems_ += finding.verdict == Grade::problem ? 1 : 0;
    warnings_ += finding.verdict == Grade::warning ? 1 : 0;
    std::fputs(to_text(finding).c_str(), stdout);
    std::fflush(stdout);
  }
  void say(const std::vector<Finding>& findings) {
    for (const auto& finding : findings) say(finding);
  }

  void look_at_config() {
    title("configuration " + options_.config->string());
    try {
      if (config::is_capture_config(*options_.config)) return look_at_host(*options_.config);
      config_ = config::load_service_config(*options_.config);
    } catch (const files::ConfigError& error) {
      std::error_code ignored;
      say({Grade::problem, error.what(),
           fs::is_regular_file(*options_.config, ignored)
               ? "correct it; huetrackd check prints the whole configuration if it is valid"
               : "give the service's configuration; that of the package is /etc/huetrack/huetrackd.yaml"});
      return;
    }
    say({Grade::ok,
         fmt::format("it is valid; {} of {} cameras, {} targets",
                     config_->is_calibrated() ? "rig " + config_->rig_file.string() : "no rig yet",
                     config_->rig.cameras.size(), config_->targets.size()),
         ""});
    // Nothing can be tracked with it.
    const std::string unit = config::unit_mistake(*config_), unseen = config::coverage_mistake(*config_);
    for (const auto& warning : config::warnings_of(*config_))
      say({warning == unit || warning == unseen ? Grade::problem : Grade::warning, warning, ""});
    if (const auto both = pipeline::one_under_two_names(config_->cameras))
      say({Grade::problem, "cameras: " + *both, "give each its own device: run refuses to start otherwise"});
    if (config_->cameras.empty())
      say({Grade::warning, "cameras: none, so it is for replay only",
           lists_devices() ? "to track live, add the cameras that are listed below to its cameras:"
                           : "to track live, plug cameras in, and add them to its cameras:"});
  }

  // Whether there are cameras on this machine, which look_at_cameras() lists.
  static bool lists_devices() {
    return std::ranges::any_of(capture::list_v4l2_nodes(), &capture::V4l2Node::is_capture);
  }

  // For a camera host.
  void look_at_host(const fs::path& file) {
    host_ = config::load_capture_config(file);
    const std::string name = host_->host.empty() ? hosts::name_of_this_machine() : host_->host;
    if (!hosts::is_host_name(name))
      say({Grade::problem, "host: \"" + name + "\" is not a valid name: use letters, digits, '_', '-', '.'",
           "correct host: in the configuration"});
    else
      say({Grade::ok,
           fmt::format("it is valid; camera host {} with {} camera{}: trackers use host: {}", name,
                       host_->cameras.size(), host_->cameras.size() == 1 ? "" : "s", name),
           ""});
    for (const auto& camera : host_->cameras)
      if (!hosts::is_host_name(camera.name))
        say({Grade::problem, "cameras: \"" + camera.name + "\": letters, digits, '_', '-' and '.' only", "rename it"});
    if (const auto both = pipeline::one_under_two_names(host_->cameras))
      say({Grade::problem, "cameras: " + *both, "give each its own device: capture refuses to start otherwise"});
  }

  std::span<const config::LiveCameraConfig> cameras() const {
    if (host_) return host_->cameras;
    return config_ ? std::span<const config::LiveCameraConfig>(config_->cameras)
                   : std::span<const config::LiveCameraConfig>();
  }
  calib::ImageSize size_of(const config::LiveCameraConfig& camera) const {
    if (host_) return *camera.size;
    return camera.picture_size(
        config_->rig.cameras[std::size_t(config_->rig.index_of(camera.name).value())].image_size);
  }

  // Network load between camera hosts and trackers, and clock synchronisation.
  void look_at_hosts() {
    std::vector<std::string> elsewhere;
    std::vector<SentCamera> sent;
    for (const auto& camera : cameras()) {
      if (!host_ && camera.host.empty()) continue;
      if (!host_) elsewhere.push_back(camera.name);
      const calib::ImageSize size = size_of(camera);
      sent.push_back(
          {camera.name, size.width, size.height, camera.fps.value_or(30), host_ ? camera.format : std::nullopt});
    }
    if (sent.empty()) return;
    title(host_ ? "this camera host" : "camera hosts of " + joined(elsewhere));
    say(judge_sending(sent, largest_receive_buffer(), !host_));
    std::set<std::string> said;
    for (const HostedExam& exam : hosted_)
      if (exam.health.clock && said.insert(exam.host).second) say(judge_clock(*exam.health.clock));
    say(judge_clock(hosts::machine_clock().kept_s));
  }

  void look_at_network_camera(const config::LiveCameraConfig& camera) {
    if (!options_.streams) return say({Grade::note, "network camera, not tested", ""});
    const calib::ImageSize size = size_of(camera);
    const capture::NetworkSourceOptions source{
        .name = camera.name, .address = camera.device, .width = size.width, .height = size.height};
    say(judge_network_camera(try_network_camera(source, std::chrono::duration<double>(options_.seconds), stop_)));
  }

  // Cameras of the configuration with their device nodes; reports missing devices.
  std::vector<ExamRequest> requests(const std::vector<capture::V4l2Node>& nodes) {
    std::vector<ExamRequest> requests;
    std::set<fs::path> taken;
    for (const auto& camera : cameras()) {
      if (!camera.host.empty()) continue;  // remote
      if (capture::is_network_address(camera.device.native())) {
        title("camera " + camera.name);
        look_at_network_camera(camera);
        continue;
      }
      std::error_code error;
      const fs::path node = fs::canonical(camera.device, error);
      const auto found = std::ranges::find(nodes, node, [](const capture::V4l2Node& n) { return n.identity.node; });
      capture::V4l2SourceOptions source;
      source.device = camera.device;
      for (const auto& warning : source.warnings()) unstable_[camera.name] = warning;
      if (error || found == nodes.end()) {
        title("camera " + camera.name);
        if (const auto warning = unstable_.find(camera.name); warning != unstable_.end())
          say({Grade::warning, warning->second, ""});
        if (error)
          say({Grade::problem, camera.device.string() + " is not there",
               fmt::format("plug it in{}; the service starts without it and uses it when it appears",
                           lists_devices() ? ", or use one of those below" : "")});
        else
          say({Grade::problem, camera.device.string() + " is not a video device",
               fmt::format("use {}: run refuses to start otherwise",
                           lists_devices() ? "one of those below" : "the node of a camera")});
        continue;
      }
      if (camera.crop && taken.contains(node)) {
        title("camera " + camera.name);
        say({Grade::note, "shares its device with a camera that is examined", ""});
        continue;
      }
      const calib::ImageSize size = size_of(camera);
      requests.push_back(
          {.node = *found,
           .name = camera.name,
           .has_fields = camera.fields.has_value(),
           .stream =
               capture::StreamRequest{
                   .format = camera.format, .width = size.width, .height = size.height, .fps = camera.fps.value_or(0)},
           .controls = camera.controls,
           .streams = options_.streams});
      taken.insert(node);
    }
    const bool has_cameras = !cameras().empty();
    for (const auto& node : nodes)  // others; stream only without a configuration
      if ((node.is_capture || !node.problem.empty()) && !taken.contains(node.identity.node))
        requests.push_back({.node = node,
                            .name = {},
                            .stream = std::nullopt,
                            .controls = {},
                            .streams = options_.streams && !has_cameras});
    return requests;
  }

  void look_at_cameras() {
    const auto nodes = capture::list_v4l2_nodes();
    const auto asked = requests(nodes);
    const auto exams = examine_cameras(asked, std::chrono::duration<double>(options_.seconds), stop_);
    const bool has_cameras = !cameras().empty();
    for (const auto& exam : exams) {
      title("camera " + name_of(exam) + ": " + exam.node.identity.to_string());
      if (const auto warning = unstable_.find(exam.name); warning != unstable_.end())
        say({Grade::warning, warning->second, ""});
      say(judge_camera(exam, !has_cameras || !exam.name.empty()));
      ++examined_;
      busy_ += is_busy(exam) ? 1 : 0;
    }
    // With network or remote cameras, no local camera is needed.
    const bool wants_none = has_cameras && std::ranges::none_of(cameras(), [](const auto& camera) {
                              return camera.host.empty() && !capture::is_network_address(camera.device.native());
                            });
    if (exams.empty() && !wants_none) {
      title("cameras");
      // Missing devices of a configuration are problems of their own; one without cameras is for replay.
      const Grade grade = !options_.config ? Grade::problem : has_cameras ? Grade::warning : Grade::note;
      say({grade, "no camera is plugged in", "lsusb lists USB devices; dmesg explains why a camera has no /dev/video"});
      has_none_ = true;
    }
    title("USB");
    say(judge_usb(exams, bus_speeds(exams)));
  }

  // Remote cameras.
  void look_at_hosted() {
    if (!config_ || std::ranges::all_of(config_->cameras, [](const auto& camera) { return camera.host.empty(); }))
      return;
    if (!options_.streams) {
      for (const auto& camera : config_->cameras) {
        if (camera.host.empty()) continue;
        title("camera " + camera.name);
        say({Grade::note, "remote camera of host " + camera.host + ", not tested", ""});
      }
      return;
    }
    try {
      hosted_ = examine_hosted(*config_, std::chrono::duration<double>(options_.seconds), stop_);
    } catch (const std::exception& error) {
      title("remote cameras");
      say({Grade::problem, error.what(), "correct dds: in the configuration, or the environment"});
    }
    for (const HostedExam& exam : hosted_) {
      title("camera " + exam.name + " of the host " + exam.host);
      say(judge_hosted(exam));
    }
  }

  void look_at_network() {
    title("DDS");
    publish::EstimatePublisherOptions options;
    options.targets = {"target"};
    if (config_) options = config_->dds.publisher;
    if (host_) {
      options = host_->dds.publisher;
      options.targets = {"target"};
    }
    if (config_ && !config_->dds.enabled) {
      say({Grade::note, "dds.enabled is false: nothing is published", ""});
      return;
    }
    try {
      for (const auto& warning : publish::EstimatePublisher::check(options)) say({Grade::warning, warning, ""});
      const auto network = publish::EstimatePublisher::network(options);
      const char* variable = std::getenv("ROS_DOMAIN_ID");
      say(judge_network(network.domain,
                        options.domain        ? "the configuration"
                        : variable != nullptr ? "ROS_DOMAIN_ID"
                                              : "the default; ROS_DOMAIN_ID is not set",
                        network.interfaces, !options.interfaces.empty()));
    } catch (const std::invalid_argument& error) {
      say({Grade::problem, error.what(), "correct dds: in the configuration, or the environment"});
    }
  }

  void look_at_recording() {
    const config::RecordConfig& record = config_->record;
    if (record.folder.empty()) return;
    title("recording");
    std::error_code error;
    fs::path there = record.folder;
    while (!there.empty() && !fs::exists(there, error) && there != there.root_path()) there = there.parent_path();
    if (::access(there.c_str(), W_OK | X_OK) != 0) {
      say({Grade::problem, "this user may not write to " + there.string(), "change its owner, or use another folder"});
      return;
    }
    const auto space = fs::space(there, error);
    double bytes_per_s = 0;  // of raw images
    for (const auto& camera : config_->cameras) {
      const calib::ImageSize size = size_of(camera);
      bytes_per_s += 2.0 * size.width * size.height * camera.fps.value_or(30);
    }
    const double minutes = bytes_per_s > 0 ? double(space.available) / bytes_per_s / 60 : 0;
    const bool is_short = minutes < 30;
    say({is_short ? Grade::warning : Grade::ok,
         record.folder.string() + fmt::format(": {:.1f} GB free, room for {:.0f} minutes of raw images of all cameras",
                                              double(space.available) / 1e9, minutes),
         is_short ? "free some space, or use format: mjpeg or raw_storage: huffyuv" : ""});
  }

  void look_at_metrics() {
    if (!config_->metrics.port) return;
    title("metrics");
    try {
      const metrics::MetricsServer server(config_->metrics.address, *config_->metrics.port);
      say({Grade::ok, fmt::format("{}:{} is free", config_->metrics.address, *config_->metrics.port), ""});
    } catch (const std::runtime_error& error) {
      say({Grade::warning, error.what(), "no problem if a running huetrackd uses it"});
    }
  }

  const DoctorOptions& options_;
  const std::stop_token& stop_;
  std::optional<config::ServiceConfig> config_;  // of a tracker,
  std::optional<config::CaptureConfig> host_;    // or of a camera host; neither: only the host and its cameras
  std::vector<HostedExam> hosted_;               // empty: none, or not tested
  std::map<std::string, std::string> unstable_;  // by camera
  int problems_ = 0, warnings_ = 0;
  int examined_ = 0, busy_ = 0;  // cameras
  bool has_none_ = false;        // no camera is plugged in, and one is needed
};

}  // namespace

std::string not_examined(int busy, int cameras) {
  if (busy == 0) return {};
  return fmt::format("; {} of {} camera{} could not be examined: busy", busy, cameras, cameras == 1 ? "" : "s");
}

std::vector<Finding> judge_camera(const CameraExam& exam, bool is_expected) {
  std::vector<Finding> findings;
  judge_names(exam, is_expected, findings);
  if (!exam.node.problem.empty()) {
    findings.push_back({is_busy(exam) ? Grade::warning
                        : is_expected ? Grade::problem
                                      : Grade::note,
                        exam.node.problem, ""});
    return findings;
  }
  findings.push_back({Grade::ok, "this user may read and write " + exam.node.identity.node.string(), ""});
  if (!exam.formats.empty() || exam.problem.empty()) judge_formats(exam, findings);
  if (!exam.problem.empty()) {
    findings.push_back(
        {is_busy(exam) || !is_expected ? Grade::warning : Grade::problem, exam.problem,
         is_busy(exam) ? "if the service is running, stop it (systemctl stop huetrackd) to examine the camera" : ""});
    return findings;
  }
  if (exam.trial) judge_stream(exam, findings);
  judge_controls(exam, findings);
  judge_automatics(exam, findings);
  std::ranges::move(judge_light(exam), std::back_inserter(findings));
  return findings;
}

std::vector<Finding> judge_usb(std::span<const CameraExam> exams, const std::map<int, double>& bus_mbps) {
  std::map<int, std::vector<std::string>> cameras;
  std::map<int, double> wanted_mbps;
  std::vector<Finding> findings;
  for (const auto& exam : exams) {
    if (!exam.node.identity.usb) continue;
    const capture::UsbPlace& usb = *exam.node.identity.usb;
    std::string text_of_camera = name_of(exam) + " in port " + usb.port;
    if (exam.trial && exam.trial->seconds > 0) {
      const StreamTrial& trial = *exam.trial;
      // Nominal rate of raw formats, measured rate of compressed ones.
      const double per_frame = double(trial.bytes) / double(trial.frames);
      const double fps =
          trial.agreed.format == capture::CaptureFormat::mjpeg ? trial.fps() : std::max(trial.fps(), trial.agreed.fps);
      const double mbps = 8e-6 * per_frame * fps;
      wanted_mbps[usb.bus] += std::max(mbps, trial.usb ? trial.usb->mbps() : 0);
      text_of_camera += fmt::format(" {:.0f} Mbit/s", mbps);
      if (trial.usb) text_of_camera += ", " + capture::to_string(*trial.usb);
    }
    cameras[usb.bus].push_back(text_of_camera);
    if (usb.speed_mbps > 0 && usb.speed_mbps < 100)
      findings.push_back({Grade::problem, name_of(exam) + fmt::format(" runs at {:.4g} Mbit/s", usb.speed_mbps),
                          "it is behind a USB 1 hub or a bad cable: plug it in directly"});
  }
  for (const auto& [bus, names] : cameras) {
    const auto speed = bus_mbps.find(bus);
    const double mbps = speed == bus_mbps.end() ? 480 : speed->second;
    const double budget = (mbps < 100 ? 0.9 : 0.8) * mbps;  // USB 2.0, 5.6.4 and 5.5.4: periodic transfers
    const double wanted = wanted_mbps[bus];
    const Grade verdict = wanted > budget ? Grade::problem : wanted > 0.7 * budget ? Grade::warning : Grade::ok;
    findings.push_back({verdict,
                        fmt::format("bus {}, {:.4g} Mbit/s: ", bus, mbps) + joined(names) +
                            fmt::format("; together {:.0f} of the available {:.0f} Mbit/s", wanted, budget),
                        verdict == Grade::ok
                            ? ""
                            : "drivers reserve more than is sent, and then report \"No space left on device\": format: "
                              "mjpeg, a lower rate, or a port of another bus (lsusb -t)"});
  }
  if (cameras.empty()) findings.push_back({Grade::note, "no camera on it", ""});
  return findings;
}

std::vector<Finding> judge_network(int domain, const std::string& domain_from,
                                   const std::vector<std::string>& interfaces, bool are_chosen) {
  std::vector<Finding> findings{{Grade::ok, "domain " + std::to_string(domain) + ", from " + domain_from, ""}};
  std::vector<std::string> outside;
  for (const auto& interface : interfaces)
    if (interface.find(" 127.") == std::string::npos) outside.push_back(interface);
  if (interfaces.empty())
    findings.push_back({Grade::problem, "no network interface is up", "DDS needs at least one: ip link set lo up"});
  else if (outside.empty())
    findings.push_back({Grade::note, "only " + joined(interfaces) + ": subscribers on this host only",
                        are_chosen
                            ? "for other hosts, add their network to dds: {interfaces: [...]}, or remove that key"
                            : "for other hosts, bring a network up; it is used automatically"});
  else if (outside.size() > 1)
    findings.push_back({Grade::note, "several networks: " + joined(interfaces),
                        "if subscribers do not find the service, set their network in dds: {interfaces: [...]}, and "
                        "allow multicast to 239.255.0.1"});
  else
    findings.push_back({Grade::ok, "networks: " + joined(interfaces), ""});
  return findings;
}

std::vector<Finding> judge_sending(std::span<const SentCamera> cameras, std::optional<double> receive_buffer,
                                   bool is_tracker) {
  constexpr double gigabit = 125e6, shared = 0.6;
  constexpr double in_memory = 1.6;  // a packet of 1472 bytes takes 2304 in the kernel,
  constexpr double granted = 2;      // which grants twice its limit
  std::vector<std::string> raw;
  double bytes_per_s = 0, at_one_moment = 0;
  for (const SentCamera& camera : cameras) {
    const double pixels = double(camera.width) * camera.height;
    const bool is_compressed = !camera.format || *camera.format == capture::CaptureFormat::mjpeg;
    // Webcams' JPEGs have about 1.5 bit per pixel.
    const double bytes = is_compressed                                    ? 1.5 / 8 * pixels
                         : *camera.format == capture::CaptureFormat::grey ? pixels
                         : *camera.format == capture::CaptureFormat::nv12 ? 1.5 * pixels
                                                                          : 2 * pixels;
    if (!is_compressed) raw.push_back(camera.name);
    at_one_moment += bytes;
    bytes_per_s += bytes * camera.fps;
  }
  std::vector<Finding> findings;
  const bool is_much = bytes_per_s > shared * gigabit;
  findings.push_back({is_much       ? Grade::warning
                      : raw.empty() ? Grade::ok
                                    : Grade::note,
                      fmt::format("{} about {:.1f} MB/s of frames{}", is_tracker ? "receives" : "sends",
                                  1e-6 * bytes_per_s, raw.empty() ? "" : ", uncompressed from " + joined(raw)),
                      is_much       ? "more than 60 % of a gigabit: format: mjpeg, fewer frames, or another network"
                      : raw.empty() ? ""
                                    : "format: mjpeg needs a tenth of it"});
  if (is_tracker && receive_buffer && in_memory * at_one_moment > granted * *receive_buffer)
    findings.push_back({Grade::warning,
                        fmt::format("{:.0f} kB of frames may arrive at once, more than the {:.0f} kB of a socket "
                                    "buffer: they are retransmitted, and late",
                                    1e-3 * at_one_moment, 1e-3 * granted * *receive_buffer / in_memory),
                        "sysctl -w net.core.rmem_max=4194304, and add it to /etc/sysctl.d"});
  return findings;
}

std::vector<Finding> judge_hosted(const HostedExam& exam) {
  const capture::CameraHealth& health = exam.health;
  if (health.state != capture::CaptureState::delivering)
    return {{Grade::problem, health.message.empty() ? "no frame came from " + exam.host : health.message,
             "run huetrackd doctor there; the service starts without it and uses it when it appears"}};
  std::vector<Finding> findings;
  const double said = health.stream ? health.stream->fps : 0;
  std::string what = fmt::format("{:.1f} frames/s received", exam.fps);
  if (health.stream)
    what =
        fmt::format("{} {}x{}: ", capture::name(health.stream->format), health.stream->width, health.stream->height) +
        what + (said > 0 ? fmt::format(" of {:.4g}", said) : std::string());
  const bool is_slow = said > 0 && exam.fps < slow * said;
  findings.push_back(
      {is_slow ? Grade::warning : Grade::ok, what,
       is_slow ? "run huetrackd doctor there to see the camera's own rate, and check the network load below" : ""});
  if (health.dropped > 0 || health.corrupted > 0)
    findings.push_back(
        {Grade::warning,
         fmt::format("{} frames were lost on the way, {} were damaged", health.dropped, health.corrupted),
         "format: mjpeg there, a wired network, or larger socket buffers"});
  if (!health.warning.empty()) findings.push_back({Grade::warning, health.warning, ""});
  return findings;
}

Finding judge_clock(const capture::HostClock& clock) {
  if (!clock.is_known) return {Grade::note, "the clock of " + clock.host + " could not be compared with ours", ""};
  if (clock.is_ours) return {Grade::ok, "the clock of " + clock.host + " is ours: same machine", ""};
  return {clock.advice.empty() ? Grade::ok : Grade::warning,
          fmt::format("the clock of {} is {:.3f} ms {} ours, known to {:.3f} ms; corrected", clock.host,
                      1e3 * std::abs(clock.offset_s), clock.offset_s < 0 ? "behind" : "ahead of", 1e3 * clock.sigma_s),
          clock.advice};
}

std::vector<Finding> judge_clock(const std::optional<double>& kept_s) {
  if (kept_s)
    return {{Grade::ok, fmt::format("NTP or PTP synchronises this host's clock to {:.2f} ms", 1e3 * *kept_s), ""}};
  return {{Grade::note, "this host's clock is not synchronised: trackers measure the offsets of the hosts' clocks",
           "with a cable that is sufficient (see huetrack status); otherwise apt install chrony on all hosts"}};
}

std::string to_text(const Finding& finding) {
  static constexpr std::array<const char*, 4> words{"ok  ", "note", "WARN", "FAIL"};
  // Names may come from devices and files.
  const auto line = [](const std::string& text) { return files::printable(text, files::longest_message) + "\n"; };
  return std::string("  ") + words[std::size_t(finding.verdict)] + "  " + line(finding.what) +
         (finding.advice.empty() ? "" : "        -> " + line(finding.advice));
}

int doctor(const DoctorOptions& options, const std::stop_token& stop) {
  return Doctor(options, stop).run();
}

}  // namespace huetrack::doctor
