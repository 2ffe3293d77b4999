#include "daemon/teach.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <thread>

#include "calib/yaml/yaml_reader.h"
#include "capture/recording.h"
#include "capture/replay_source.h"
#include "color_teaching/color_teacher.h"
#include "config/config_editor.h"
#include "config/formatted.h"
#include "pictures/pictures.h"
#include "pipeline/live_cameras.h"
#include "publish/service_finder.h"

namespace huetrack::daemon {
namespace {

using namespace std::chrono_literals;

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == ',') {
      parts.emplace_back();
    } else {
      parts.back() += c;
    }
  }
  return parts;
}

double number_of(const std::string& text, const std::string& whole, const char* form) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value))
    throw std::runtime_error("\"" + whole + "\" is not of the form " + form);
  return value;
}

int camera_of(const calib::CameraRig& rig, const std::string& name) {
  if (const auto index = rig.index_of(name)) return *index;
  std::string list;
  std::vector<std::string> names;
  for (const auto& camera : rig.cameras) {
    list += (list.empty() ? "" : ", ") + camera.name;
    names.push_back(camera.name);
  }
  const auto nearest = yaml::nearest_word(name, names);
  throw std::runtime_error("there is no camera " + name + " in the rig, which has " + list +
                           (nearest ? " (did you mean " + *nearest + "?)" : ""));
}

struct At {
  color_teaching::TeachPoint point;
  std::int64_t frame = 0;
};

At at_of(const calib::CameraRig& rig, const std::string& text) {
  constexpr const char* form = "CAMERA,FRAME,U,V, as in left,0,310,222";
  const auto parts = split(text);
  if (parts.size() != 4) throw std::runtime_error("--at \"" + text + "\" is not of the form " + form);
  At at;
  at.point.camera = camera_of(rig, parts[0]);
  const double frame = number_of(parts[1], text, form);
  if (frame < 0 || frame != std::floor(frame)) throw std::runtime_error("--at \"" + text + "\": frames count from 0");
  at.frame = std::int64_t(frame);
  at.point.px = {number_of(parts[2], text, form), number_of(parts[3], text, form)};
  const calib::Camera& camera = rig.cameras[std::size_t(at.point.camera)];
  if (!camera.contains({at.point.px}))
    throw std::runtime_error("--at \"" + text + "\": the pictures of " + camera.name + " are " +
                             std::to_string(camera.image_size.width) + "x" + std::to_string(camera.image_size.height));
  return at;
}

// One picture of every camera: where somebody pointed, the frame of that number; of the others, the one captured
// nearest to the first of those.
capture::FrameSet recorded_pictures(const config::ServiceConfig& config, const std::filesystem::path& recording,
                                    const std::map<int, std::int64_t>& wanted, const std::stop_token& stop) {
  const calib::CameraRig& rig = config.rig;
  std::vector<std::string> names;
  for (const auto& camera : rig.cameras) names.push_back(camera.name);
  capture::ReplaySource source(capture::read_recording(recording), names);
  capture::FrameSet set;
  set.frames.resize(rig.cameras.size());
  std::vector<std::int64_t> count(rig.cameras.size(), 0);
  std::vector<bool> is_settled(rig.cameras.size(), false);
  const int leader = wanted.begin()->first;
  std::optional<capture::Timestamp> leader_at;
  while (!std::ranges::all_of(is_settled, std::identity{})) {
    auto frame = source.next(stop);
    if (!frame) break;
    const auto c = std::size_t(frame->camera);
    const std::int64_t number = count[c]++;
    if (frame->status != capture::FrameStatus::ok || is_settled[c]) continue;
    if (const auto it = wanted.find(frame->camera); it != wanted.end()) {
      if (number != it->second) continue;
      if (frame->camera == leader) leader_at = frame->captured_at;
      is_settled[c] = true;
      set.frames[c] = std::move(*frame);
      continue;
    }
    auto& slot = set.frames[c];
    // Before the leader's frame is known, the newest one is the nearest; after it, the first that is later ends the
    // search.
    const bool is_nearer =
        !leader_at || !slot ||
        std::chrono::abs(frame->captured_at - *leader_at) < std::chrono::abs(slot->captured_at - *leader_at);
    is_settled[c] = leader_at && frame->captured_at >= *leader_at;
    if (is_nearer) slot = std::move(*frame);
  }
  for (const auto& [camera, number] : wanted) {
    if (!is_settled[std::size_t(camera)])
      throw std::runtime_error(recording.string() + ": camera " + rig.cameras[std::size_t(camera)].name +
                               " has no sound frame " + std::to_string(number) + " (it has " +
                               std::to_string(count[std::size_t(camera)]) + ")");
  }
  return set;
}

// The live cameras one after the other: the object has to hold still.
capture::FrameSet live_pictures(const config::ServiceConfig& config, const std::map<int, std::int64_t>& wanted,
                                const std::stop_token& stop) {
  constexpr std::int64_t settled = 30;  // frames until exposure and white balance have settled
  constexpr auto patience = 10s;        // for a camera's frames
  if (config.cameras.empty()) throw std::runtime_error(config.file.string() + ": cameras: none is given to teach from");
  capture::FrameSet set;
  set.frames.resize(config.rig.cameras.size());
  for (auto& camera : pipeline::open_cameras(config, stop)) {
    std::stop_source enough;
    const std::stop_callback forward(stop, [&] { enough.request_stop(); });
    const auto until = std::chrono::steady_clock::now() + patience;
    const std::jthread watch([&](const std::stop_token& done) {
      while (!done.stop_requested() && std::chrono::steady_clock::now() < until) std::this_thread::sleep_for(20ms);
      enough.request_stop();
    });
    const auto it = wanted.find(camera.camera);
    const std::int64_t number = it == wanted.end() ? settled : it->second;
    std::int64_t count = 0;
    while (auto frame = camera.source->next(enough.get_token())) {
      if (frame->status != capture::FrameStatus::ok || count++ < number) continue;
      set.frames[std::size_t(camera.camera)] = std::move(*frame);
      break;
    }
    if (!set.frames[std::size_t(camera.camera)] && it != wanted.end())
      throw std::runtime_error(
          "camera " + config.rig.cameras[std::size_t(camera.camera)].name +
          " gave no such frame within 10 s; is it in use by a running huetrackd? Then teach on the page");
  }
  return set;
}

void draw(const std::filesystem::path& folder, const calib::CameraRig& rig, const capture::FrameSet& set,
          const color_teaching::Taught& taught) {
  std::filesystem::create_directories(folder);
  for (std::size_t c = 0; c < set.frames.size(); ++c) {
    const color_teaching::PixelMask& mask = taught.views[c].mask;
    if (!set.frames[c] || mask.width == 0) continue;
    cv::Mat picture = pictures::bgr_of(set.frames[c]->pixels);
    for (int v = 0; v < picture.rows; ++v) {
      for (int u = 0; u < picture.cols; ++u) {
        auto& pixel = picture.at<cv::Vec3b>(v, u);
        pixel = mask.at(u, v) != 0 ? cv::Vec3b(220, 0, 255) : pixel / 2;
      }
    }
    const auto file = folder / (rig.cameras[c].name + ".png");
    if (!cv::imwrite(file.string(), picture)) throw std::runtime_error("cannot write " + file.string());
  }
}

// A service on this host that runs with this file, or replays with it, reloads it.
void tell_services(const config::ServiceConfig& config) {
  if (!config.dds.enabled) return;
  bool told = false;
  const auto is_same_file = [](const std::string& a, const std::filesystem::path& b) {
    std::error_code none;
    return a == b || std::filesystem::equivalent(a, b, none);
  };
  for (const publish::RunningService& service : publish::running_services(config.dds.publisher, 1500ms)) {
    if (!service.is_on_this_host || !is_same_file(service.config_file, config.file)) continue;
    const bool runs = service.mode == "run";
    if (::kill(pid_t(service.pid), SIGHUP) == 0) {
      std::printf("huetrackd (process %u%s) has been told to take it over\n", service.pid,
                  runs                     ? ""
                  : service.mode == "held" ? ", a replay that is held: Go on on the page lets it run"
                                           : ", a replay");
    } else {
      std::printf("huetrackd runs as another user: tell it with  kill -HUP %u%s\n", service.pid,
                  runs ? "  or  systemctl reload huetrackd" : "");
    }
    told = true;
  }
  if (!told) std::printf("no huetrackd runs with this file on this host: it takes effect at the next start\n");
}

}  // namespace

int teach(const TeachCommand& command, std::stop_token stop) {
  const config::ServiceConfig config = config::load_service_config(command.config);
  const calib::CameraRig& rig = config.rig;
  std::string names;
  for (const auto& t : config.targets) names += (names.empty() ? "" : ", ") + t.name;
  if (command.target.empty() && config.targets.size() > 1)
    throw std::runtime_error("which target? Give --target with one of: " + names);
  const auto target = command.target.empty()
                          ? config.targets.begin()
                          : std::ranges::find(config.targets, command.target, &object_tracking::TargetOptions::name);
  if (target == config.targets.end())
    throw std::runtime_error("there is no target " + command.target + " in " + config.file.string() + ", which has " +
                             names);

  if (command.at.empty()) throw std::runtime_error("point at the object: --at CAMERA,FRAME,U,V");
  std::map<int, std::int64_t> wanted;
  color_teaching::TeachRequestOptions request;
  for (const std::string& text : command.at) {
    const At at = at_of(rig, text);
    if (!wanted.emplace(at.point.camera, at.frame).second)
      throw std::runtime_error("--at \"" + text + "\": there is another --at for this camera; one per camera counts");
    request.points.push_back(at.point);
  }
  object_tracking::IgnoredRegions ignored = config.ignored;
  for (const std::string& text : command.ignore) {
    constexpr const char* form = "CAMERA,U_MIN,V_MIN,U_MAX,V_MAX";
    const auto parts = split(text);
    if (parts.size() != 5) throw std::runtime_error("--ignore \"" + text + "\" is not of the form " + form);
    camera_of(rig, parts[0]);
    object_tracking::PixelBox box{};
    int* const to[] = {&box.u_min, &box.v_min, &box.u_max, &box.v_max};
    for (std::size_t i = 0; i < 4; ++i)
      *to[i] = int(std::lround(std::clamp(number_of(parts[i + 1], text, form), -1e6, 1e6)));
    if (box.empty()) throw std::runtime_error("--ignore \"" + text + "\" ends before it begins");
    auto it = std::ranges::find(ignored, parts[0], &object_tracking::IgnoredRegions::value_type::first);
    if (it == ignored.end()) it = ignored.insert(ignored.end(), {parts[0], {}});
    it->second.push_back(box);
  }
  request.ignored.resize(rig.cameras.size());
  for (const auto& [camera, boxes] : ignored) request.ignored[std::size_t(*rig.index_of(camera))] = boxes;
  request.wider = command.wider;

  const capture::FrameSet set = command.recording == "live"
                                    ? live_pictures(config, wanted, stop)
                                    : recorded_pictures(config, command.recording, wanted, stop);
  const color_teaching::ColorTeacher teacher(rig, set);
  color_teaching::Taught taught = teacher.teach(request, config.object_tracking.volume);
  if (command.accept && taught.any()) {
    for (std::size_t c = 0; c < taught.views.size(); ++c)
      if (!taught.views[c].pointed && taught.views[c].region && taught.views[c].problem.empty())
        request.points.push_back({int(c), taught.views[c].region->centre});
    taught = teacher.teach(request, config.object_tracking.volume);
  }
  for (std::size_t c = 0; c < taught.views.size(); ++c) {
    const color_teaching::TaughtView& view = taught.views[c];
    if (!view.verdict.empty()) std::printf("%s\n", view.verdict.c_str());
    if (view.pointed) {
      std::printf("  hue_deg: [%g, %g], saturation: [%g, %g], intensity: [%g, %g]\n", view.color.hue_min_deg,
                  view.color.hue_max_deg, view.color.saturation_min, view.color.saturation_max,
                  view.color.intensity_min, view.color.intensity_max);
    } else if (view.region) {
      std::printf("  confirm it with  --at %s,%lld,%ld,%ld  or take all that is suggested with --accept\n",
                  rig.cameras[c].name.c_str(), static_cast<long long>(wanted.begin()->second),
                  std::lround(view.region->centre.x()), std::lround(view.region->centre.y()));
    }
  }
  if (const std::string hint = color_teaching::radius_hint(taught, *target); !hint.empty())
    std::printf("%s\n", hint.c_str());
  for (const std::string& name : teacher.namesakes(taught, config.targets, target->name))
    std::printf("Warning: the object has the colour of the target %s, too: nothing tells the two apart\n",
                name.c_str());
  if (!command.pictures.empty()) {
    draw(command.pictures, rig, set, taught);
    std::printf("pictures with what matches in pink: %s\n", command.pictures.c_str());
  }
  if (const std::string why = color_teaching::why_useless(taught, rig); !why.empty()) {
    std::fprintf(stderr, "huetrackd: nothing is written: %s\n", why.c_str());
    return 1;
  }
  if (const auto open = color_teaching::unconfirmed(taught, rig); !open.empty()) {
    const std::string where = "nobody has confirmed where the object is in " + config::list_of(open);
    if (!command.only && !command.dry_run) {
      std::fprintf(stderr,
                   "huetrackd: nothing is written: %s. Confirm it with the --at above, take what is suggested with "
                   "--accept, or leave it so with --only\n",
                   where.c_str());
      return 1;
    }
    std::printf("Warning: %s: the colour may not be seen there\n", where.c_str());
  }
  if (command.dry_run) return 0;
  config::save_taught(config, color_teaching::with_taught_color(*target, rig, taught),
                      command.ignore.empty() ? std::nullopt : std::optional(ignored));
  std::printf("written into %s: the colour of %s\n", config.file.c_str(), target->name.c_str());
  tell_services(config);
  return 0;
}

}  // namespace huetrack::daemon
