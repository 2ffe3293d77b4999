#include "daemon/setup_command.h"

#include <fmt/format.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "calib/files/document_path.h"
#include "calib/files/output_file.h"
#include "calib/files/text_file.h"
#include "calib/model/rig_yaml.h"
#include "calib/model/usual_lens.h"
#include "config/service_config.h"
#include "daemon/page_process.h"
#include "doctor/camera_exam.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"

namespace huetrack::daemon {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

constexpr std::size_t max_cameras = 8;
// Data sheets round to five degrees or ten, and lenses differ by some per cent from one another.
constexpr double stated_focal_sigma = 0.05;
constexpr double wanted_fps = 30;
constexpr double pre_roll_s = 60;
constexpr double bytes_per_mb = 1e6;  // unit of record.pre_roll_mb

double memory_of_this_host() {
  return double(::sysconf(_SC_PHYS_PAGES)) * double(::sysconf(_SC_PAGESIZE));
}

double log_focal_sigma(std::optional<double> fov_deg) {
  return fov_deg ? stated_focal_sigma : calib::usual_lens.log_focal;
}

// Joint covariance of fx fy cx cy k1 k2 p1 p2 of an ordinary lens.
Eigen::MatrixXd usual_covariance(const calib::ImageSize& size, double focal_px, double log_focal) {
  using calib::usual_lens;
  const double reach2 = (size.width * size.width + size.height * size.height) / (4 * focal_px * focal_px);
  const double centre_px = usual_lens.centre_share * size.width,
               decentring = usual_lens.decentring_share / std::sqrt(reach2);
  Eigen::Vector<double, 8> sigma;
  sigma << 0, 0, centre_px, centre_px, usual_lens.radial_share / reach2, usual_lens.radial_share / (reach2 * reach2),
      decentring, decentring;
  Eigen::MatrixXd out = sigma.cwiseAbs2().asDiagonal();
  const double mean2 = std::pow(log_focal * focal_px, 2), half2 = std::pow(usual_lens.log_aspect * focal_px / 2, 2);
  out.topLeftCorner<2, 2>() << mean2 + half2, mean2 - half2, mean2 - half2, mean2 + half2;
  return out;
}

// Next to the configuration, and named after it: films of one folder have rigs of their own. Returns its name.
std::string write_rig_of_one(const fs::path& config, const SetUpCamera& camera, std::optional<double> fov_deg) {
  const std::string name = config.stem().string() + ".rig.yaml";
  const fs::path file = config.parent_path() / name;
  std::error_code none;
  if (fs::exists(file, none))
    throw std::runtime_error(
        fmt::format("{} is there already: move it away, or name it in {} as rig:", file.string(), config.string()));
  files::write_whole_file(file, rig_of_one_camera(camera, fov_deg));
  fmt::print(
      "written: {}: its picture is taken to be {:g} degrees wide; positions are uncertain by {:.0f} % of their "
      "distance for that alone. Delete both files and run setup --fov DEGREES if you know better, or calibrate the "
      "camera: huetrack-calibrate intrinsics. A second camera would measure the distance itself.\n",
      file.string(), fov_deg.value_or(calib::usual_lens.fov_deg), 100 * log_focal_sigma(fov_deg));
  return name;
}

void write_first_configuration(const SetUpCommand& command, const std::stop_token& stop) {
  const fs::path& file = command.config;
  std::vector<std::string> left_out;
  const std::vector<SetUpCamera> cameras = cameras_of_this_host(left_out, stop);
  for (const std::string& camera : left_out)
    fmt::print("left out: {}\n", files::printable(camera, files::longest_message));
  if (cameras.empty())
    throw std::runtime_error(fmt::format(
        "{} was not written: no camera can be used here. Run huetrackd doctor to examine them; add network cameras "
        "manually ({}). Without a camera, huetrackd demo shows the page on a recording",
        file.string(), files::document_path("service/daemon/live.md")));
  const std::string rig = cameras.size() == 1 ? write_rig_of_one(file, cameras.front(), command.fov_deg) : "";
  files::write_whole_file(file, first_configuration(cameras, memory_of_this_host(), rig));
  fmt::print("written: {}, with {} camera{}\n", file.string(), cameras.size(), cameras.size() == 1 ? "" : "s");
  if (cameras.size() == 1)
    fmt::print(
        "One camera: a ball's distance follows from its size in the picture, to some 2 to 5 per cent; set its radius "
        "in targets:. A second camera measures positions to millimetres: plug it in, and run setup with a new file.\n");
  for (const SetUpCamera& camera : cameras)
    fmt::print("  {} ({}x{}{}, {})\n", camera.device.string(), camera.width, camera.height,
               camera.fps > 0 ? fmt::format(" at {:.4g} frames/s", camera.fps) : "",
               files::printable(camera.model));  // text from the device
  if (cameras.size() > 1)
    fmt::print(
        "The page leads on: click on your ball in each picture, wave it for a minute, throw it five times, done. No "
        "board, no lens data and no tape are needed; with a printed board it is more accurate.\n");
  fmt::print(
      "The page may teach colours, calibrate and record, and so may every participant of this DDS domain. When all is "
      "set up, remove the line `control:` from the file, or keep DDS on this host: dds: {{interfaces: [lo]}}, and "
      "huetrack view --interface lo\n");
}

}  // namespace

std::vector<SetUpCamera> cameras_of_this_host(std::vector<std::string>& left_out, const std::stop_token& stop) {
  std::vector<doctor::ExamRequest> requests;
  for (const capture::V4l2Node& node : capture::list_v4l2_nodes()) {
    if (!node.problem.empty()) left_out.push_back(node.identity.node.string() + ": " + node.problem);
    if (node.is_capture) requests.push_back({.node = node, .name = "", .stream = {}, .controls = {}, .streams = false});
  }
  std::vector<SetUpCamera> cameras;
  for (const doctor::CameraExam& exam : doctor::examine_cameras(requests, 0s, stop)) {
    const capture::V4l2Identity& of = exam.node.identity;
    const auto stream = doctor::suitable_stream(exam.formats);
    if (!stream) {
      left_out.push_back(of.node.string() + ": " + (exam.problem.empty() ? "no usable format" : exam.problem));
    } else if (cameras.size() == max_cameras) {
      left_out.push_back(fmt::format("{}: {} are enough", of.node.string(), max_cameras));
    } else {
      const auto& stable = !of.by_path.empty() ? of.by_path : of.by_id;
      cameras.push_back({.device = stable.empty() ? of.node : stable.front(),
                         .width = stream->width,
                         .height = stream->height,
                         .model = of.card});
      choose_rate(exam.formats, cameras.back());
    }
  }
  return cameras;
}

void choose_rate(std::span<const capture::OfferedFormat> formats, SetUpCamera& camera) {
  constexpr double jpeg_bytes_per_pixel = 0.25;  // of a detailed picture; webcams: 0.1 to 0.2
  double raw_fps = 0, any_fps = 0;
  const auto take = [](double fps, double& best) {
    if (best == 0 || std::abs(fps - wanted_fps) < std::abs(best - wanted_fps)) best = fps;
  };
  for (const capture::OfferedFormat& offered : formats) {
    if (!offered.format) continue;
    for (const capture::OfferedSize& size : offered.sizes) {
      if (camera.width < size.min_width || camera.width > size.width || camera.height < size.min_height ||
          camera.height > size.height)
        continue;
      for (const double fps : size.fps) {
        take(fps, any_fps);
        if (*offered.format != capture::CaptureFormat::mjpeg) take(fps, raw_fps);
      }
    }
  }
  camera.fps = any_fps;
  const bool is_raw = raw_fps > 0 && raw_fps >= any_fps;  // as the driver chooses (StreamRequest::format)
  camera.bytes_per_s =
      (any_fps > 0 ? any_fps : wanted_fps) * camera.width * camera.height * (is_raw ? 2 : jpeg_bytes_per_pixel);
}

std::string rig_of_one_camera(const SetUpCamera& camera, std::optional<double> fov_deg) {
  calib::CameraRig rig;
  calib::Camera& out = rig.cameras.emplace_back(
      calib::guessed_camera("cam0", {camera.width, camera.height}, fov_deg.value_or(calib::usual_lens.fov_deg)));
  Eigen::Matrix3d forwards;
  forwards << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  out.cam_from_world.rotation = Eigen::Quaterniond(forwards);
  rig.uncertainty = calib::RigUncertainty::of(
      {{.lens_count = 8}}, usual_covariance(out.image_size, out.model.fx(), log_focal_sigma(fov_deg)));
  return fmt::format(
             "# Written by huetrackd setup: one camera, not calibrated. Its picture is taken to be {:g} degrees wide; "
             "all\n"
             "# distances scale with that. World: at the camera, x forwards, y to the left, z up, metres.\n",
             fov_deg.value_or(calib::usual_lens.fov_deg)) +
         calib::to_yaml(rig);
}

std::string first_configuration(std::span<const SetUpCamera> cameras, double memory_bytes, const std::string& rig) {
  std::string text =
      "# Written by huetrackd setup: the cameras of this host. The page of `huetrack view` guides you: exposure,\n"
      "# the ball's colour, calibration. It saves changes in a separate file; edit this one as you like: every key\n"
      "# is in configs/huetrackd.yaml (/etc/huetrack/huetrackd.yaml of the package).\n"
      "version: 1\n";
  if (rig.empty())
    text += "rig: none                  # the cameras are not calibrated yet\n";
  else
    text += fmt::format(
        "rig: {}\n"
        "# Balls are found wherever the camera sees them. object_tracking: {{volume: ...}} limits that; metres from "
        "the\n"
        "# camera, x forwards, y to the left, z up.\n",
        rig);
  text += "cameras:\n";
  int number = 0;
  double bytes_per_s = 0;
  for (const SetUpCamera& camera : cameras) {
    const std::string model = files::printable(camera.model);
    text += fmt::format("  cam{}: {{device: '{}', size: [{}, {}]{}}}{}\n", number++, camera.device.string(),
                        camera.width, camera.height, camera.fps > 0 ? fmt::format(", fps: {:.4g}", camera.fps) : "",
                        model.empty() ? "" : "   # " + model);
    bytes_per_s += camera.bytes_per_s;
  }
  // The default suffices for some cameras with JPEG, or for a few seconds of raw cameras.
  const int usual_mb = config::RecordConfig().pre_roll_mb;
  const double wanted_mb = std::min(pre_roll_s * bytes_per_s, memory_bytes / 4) / bytes_per_mb;
  return text +
         fmt::format(
             "record: {{folder: recordings, pre_roll_s: {:g}, pre_roll_mb: {:.0f}}}   # keeps the last minute in "
             "memory\n",
             pre_roll_s, std::max(double(usual_mb), std::ceil(wanted_mb))) +
         "control: {allow_teach: true, allow_record: true}\n";
}

void set_up_film(const SetUpCommand& command, const std::stop_token& stop) {
  const fs::path& file = command.config;
  if (std::error_code none; fs::exists(file, none))
    throw std::runtime_error(file.string() + " is there already: name another file to write");
  const std::string word = "cam0=" + command.film.string();
  const std::vector<std::string> words{word}, names{"cam0"};
  recordings::ReplaySource source(recordings::read_recording(words), names);
  const auto frame = source.next(stop);
  if (!frame || frame->pixels.width == 0)
    throw std::runtime_error(command.film.string() + ": its first picture cannot be read");
  const SetUpCamera camera{.device = {}, .width = frame->pixels.width, .height = frame->pixels.height, .model = ""};
  const std::string rig = write_rig_of_one(file, camera, command.fov_deg);
  files::write_whole_file(
      file,
      fmt::format(
          "# Written by huetrackd setup --film: a film of one camera, cam0. Every key is in configs/huetrackd.yaml.\n"
          "version: 1\n"
          "rig: {}\n"
          "targets: {{ball: {{}}}}           # add radius_m, in metres: the distance scales with it\n"
          "control: {{allow_teach: true}}\n",
          rig));
  fmt::print(
      "written: {0}, for a film of {1}x{2}\n"
      "next: teach its colour, by a pixel of it in a frame, and track it. Distances scale with radius_m in {0}, "
      "{4:g} mm until you set it; teaching works without it:\n"
      "  huetrackd teach {0} {3} --at cam0,FRAME,U,V     (or huetrackd replay {0} {3} --hold, and click on the page of "
      "huetrack view; huetrack control replay step N: a later frame)\n"
      "  huetrackd replay {0} {3} --tracks track.csv\n",
      file.string(), camera.width, camera.height, word, 1e3 * object_tracking::TargetOptions().radius_m);
}

void set_up(const SetUpCommand& command, LiveRequests& requests, const std::stop_token& stop) {
  std::error_code none;
  if (fs::exists(command.config, none)) {
    files::open_text_file(command.config);
    fmt::print("using the existing {}\n", command.config.string());
  } else {
    write_first_configuration(command, stop);
  }
  if (!command.with_page) {
    fmt::print("next: huetrackd run {}, and in a second terminal: huetrack view\n", command.config.string());
    return;
  }
  const auto page =
      start_page({}, [] { std::fputs("huetrackd: the page has ended: huetrack view starts it again\n", stderr); });
  if (!page) fmt::print("huetrack was not found next to huetrackd or on the PATH: continuing without the page\n");
  std::fflush(stdout);
  run(command.config, {}, requests, stop);
}

}  // namespace huetrack::daemon
