#include "page/teach.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <iterator>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <span>
#include <thread>

#include "calib/files/config_error.h"
#include "calib/files/joined.h"
#include "calib/files/nearest_word.h"
#include "color_teaching/lesson.h"
#include "color_teaching/spread_moments.h"
#include "config/service_config.h"
#include "config/taught_file.h"
#include "page/request_words.h"
#include "page/tried_teaching.h"
#include "pictures/pictures.h"
#include "pipeline/file_outputs.h"
#include "pipeline/live_cameras.h"
#include "publish/service_finder.h"
#include "recordings/recording.h"
#include "recordings/replay_source.h"

namespace huetrack::page {
namespace {

// From the cameras, without a recording for a trial.
bool is_live(const TeachCommand& command) {
  return command.recording == std::vector<std::string>{"live"};
}

using namespace std::chrono_literals;

double number_of(const std::string& text, const std::string& whole, const char* form) {
  if (const auto value = finite_number(text)) return *value;
  throw std::runtime_error("\"" + whole + "\" is not of the form " + form);
}

int camera_of(const calib::CameraRig& rig, const std::string& name) {
  if (const auto index = rig.index_of(name)) return *index;
  const std::vector<std::string> names = rig.camera_names();
  const auto nearest = files::nearest_word(name, names);
  throw std::runtime_error(fmt::format("there is no camera {} in the rig, which has {}{}", name, fmt::join(names, ", "),
                                       nearest ? " (did you mean " + *nearest + "?)" : ""));
}

const object_tracking::TargetOptions& target_of(const config::ServiceConfig& config, const std::string& name) {
  const std::string names = files::joined(config.target_names());
  if (name.empty() && config.targets.size() > 1)
    throw std::runtime_error("which target? Give --target with one of: " + names);
  const auto target = name.empty() ? config.targets.begin()
                                   : std::ranges::find(config.targets, name, &object_tracking::TargetOptions::name);
  if (target == config.targets.end())
    throw std::runtime_error(
        fmt::format("there is no target {} in {}, which has {}", name, config.file.string(), names));
  return *target;
}

struct At {
  color_teaching::TeachPoint point;
  std::int64_t frame = 0;
};

At at_of(const calib::CameraRig& rig, const std::string& text) {
  constexpr const char* form = "CAMERA,FRAME,U,V, as in left,0,310,222";
  const auto parts = split(text, ',');
  if (parts.size() != 4) throw std::runtime_error(fmt::format("--at \"{}\" is not of the form {}", text, form));
  At at;
  at.point.camera = camera_of(rig, parts[0]);
  const double frame = number_of(parts[1], text, form);
  constexpr double most_frames = 1e9;  // a year of them
  if (frame < 0 || frame != std::floor(frame) || frame > most_frames)
    throw std::runtime_error(fmt::format("--at \"{}\": frames count from 0, and there are 1e9 at most", text));
  at.frame = std::int64_t(frame);
  at.point.px = {number_of(parts[2], text, form), number_of(parts[3], text, form)};
  const calib::Camera& camera = rig.cameras[std::size_t(at.point.camera)];
  if (!camera.contains({at.point.px}))
    throw std::runtime_error(fmt::format("--at \"{}\": the pictures of {} are {}x{}", text, camera.name,
                                         camera.image_size.width, camera.image_size.height));
  return at;
}

std::pair<std::string, color::PixelBox> ignored_of(const calib::CameraRig& rig, const std::string& text) {
  constexpr const char* form = "CAMERA,U_MIN,V_MIN,U_MAX,V_MAX";
  const auto parts = split(text, ',');
  if (parts.size() != 5) throw std::runtime_error(fmt::format("--ignore \"{}\" is not of the form {}", text, form));
  camera_of(rig, parts[0]);
  const auto pixel = [&](std::size_t part) {
    return int(std::lround(std::clamp(number_of(parts[part], text, form), -1e6, 1e6)));
  };
  const color::PixelBox box{pixel(1), pixel(2), pixel(3), pixel(4)};
  if (box.empty()) throw std::runtime_error(fmt::format("--ignore \"{}\" ends before it begins", text));
  return {parts[0], box};
}

// The points of the command line, with their frames.
struct Pointing {
  color_teaching::TeachRequestOptions request;
  std::map<int, std::int64_t> frames;
};

// The rectangles of the configuration and of the command.
object_tracking::IgnoredRegions with_ignored(const TeachCommand& command, const config::ServiceConfig& config) {
  object_tracking::IgnoredRegions ignored = config.ignored;
  for (const std::string& text : command.ignore) {
    const auto [camera, box] = ignored_of(config.rig, text);
    color_teaching::add_ignored(ignored, camera, box);
  }
  return ignored;
}

Pointing pointing_of(const TeachCommand& command, const config::ServiceConfig& config) {
  if (command.at.empty())
    throw std::runtime_error(
        "give the object's place: --at CAMERA,FRAME,U,V; only rectangles are saved without one: --ignore, without a "
        "recording");
  Pointing pointing;
  pointing.request.wider = command.wider;
  pointing.request.accepts_suggestions = command.accept;
  pointing.request.is_tried = !is_live(command);
  for (const std::string& text : command.at) {
    const At at = at_of(config.rig, text);
    if (!pointing.frames.emplace(at.point.camera, at.frame).second)
      throw std::runtime_error(
          fmt::format("--at \"{}\": there is another --at for this camera; one per camera counts", text));
    pointing.request.points.push_back(at.point);
  }
  pointing.request.ignored = with_ignored(command, config);
  return pointing;
}

// Pictures of one moment with their frame numbers, one slot per camera; pictures of other moments, per camera and of
// all.
struct Pictures {
  capture::FrameSet set;
  std::vector<std::int64_t> numbers;
  std::vector<std::vector<capture::Image>> elsewhen = {};
  std::vector<capture::FrameSet> moments = {};
};

// One picture of every camera: the clicked frame, or the frame captured nearest to the first clicked one.
Pictures recorded_pictures(const config::ServiceConfig& config, std::span<const std::string> words,
                           const std::map<int, std::int64_t>& wanted, const std::stop_token& stop) {
  const calib::CameraRig& rig = config.rig;
  const std::vector<std::string> names = rig.camera_names();
  const recordings::Recording recording = recordings::read_recording(words);
  recordings::ReplaySource source(recording, names, {.timing = config::frame_timing(rig), .takes_matches = true});
  capture::FrameSet set;
  set.frames.resize(rig.cameras.size());
  constexpr std::size_t most_elsewhen = 15;
  std::vector<color_teaching::Spread<capture::Image>> spread(rig.cameras.size(),
                                                             color_teaching::Spread<capture::Image>(most_elsewhen));
  color_teaching::SpreadMoments moments(rig.cameras.size());
  std::vector<std::int64_t> count(rig.cameras.size(), 0), numbers(rig.cameras.size(), 0);
  std::vector<bool> is_settled(rig.cameras.size(), false);
  const int leader = wanted.begin()->first;
  std::optional<capture::Timestamp> leader_at;
  while (auto frame = source.next(stop)) {
    const auto c = std::size_t(frame->camera);
    const std::int64_t number = count[c]++;
    if (frame->status == capture::FrameStatus::ok &&
        !take_picture(*frame, own_picture_of(*frame))) {  // with send: matches
      if (const auto it = wanted.find(frame->camera); it != wanted.end() && it->second == number)
        throw std::runtime_error(
            fmt::format("{}: frame {} of camera {} has no picture, only matches: with send: matches, take a frame with "
                        "a picture (every picture_every_s)",
                        recording.file.string(), number, names[c]));
      continue;
    }
    if (frame->status == capture::FrameStatus::ok) {
      spread[c].add(frame->pixels);
      moments.add(*frame);
    }
    if (frame->status != capture::FrameStatus::ok || is_settled[c]) continue;
    if (const auto it = wanted.find(frame->camera); it != wanted.end()) {
      if (number != it->second) continue;
      if (frame->camera == leader) leader_at = frame->captured_at;
      is_settled[c] = true;
      set.frames[c] = std::move(*frame), numbers[c] = number;
      continue;
    }
    auto& slot = set.frames[c];
    // Before the reference frame, the newest frame is the nearest; after it, the first later one ends the search.
    const bool is_nearer =
        !leader_at || !slot ||
        std::chrono::abs(frame->captured_at - *leader_at) < std::chrono::abs(slot->captured_at - *leader_at);
    is_settled[c] = leader_at && frame->captured_at >= *leader_at;
    if (is_nearer) slot = std::move(*frame), numbers[c] = number;
  }
  for (const auto& [camera, number] : wanted) {
    if (!is_settled[std::size_t(camera)])
      throw std::runtime_error(fmt::format("{}: camera {} has no sound frame {} (it has {})", recording.file.string(),
                                           rig.cameras[std::size_t(camera)].name, number, count[std::size_t(camera)]));
  }
  Pictures pictures{.set = std::move(set), .numbers = std::move(numbers), .moments = moments.take()};
  for (auto& of_camera : spread) pictures.elsewhen.push_back(of_camera.take());
  return pictures;
}

// One live camera after the other: the object must not move.
capture::FrameSet live_pictures(const config::ServiceConfig& config, const std::map<int, std::int64_t>& wanted,
                                const std::stop_token& stop) {
  constexpr std::int64_t settled = 30;  // frames until exposure and white balance have settled
  constexpr auto patience = 10s;        // for a camera's frames
  if (config.cameras.empty()) throw std::runtime_error(config.file.string() + ": there are no cameras to teach from");
  capture::FrameSet set;
  set.frames.resize(config.rig.cameras.size());
  for (auto& camera : pipeline::open_cameras(config::with_frames(config), stop)) {
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
      throw std::runtime_error(fmt::format(
          "camera {} gave no such frame within 10 s; is it in use by a running huetrackd? Then teach on the page",
          config.rig.cameras[std::size_t(camera.camera)].name));
  }
  return set;
}

std::filesystem::path picture_of(const std::filesystem::path& folder, const calib::Camera& camera) {
  return folder / (camera.name + ".png");
}

// throws std::runtime_error if a picture would replace an input, or be among a recording's own pictures
void refuse_pictures_over_what_is_read(const TeachCommand& command, const config::ServiceConfig& config) {
  if (command.pictures.empty()) return;
  std::vector<std::filesystem::path> read = pipeline::files_of(config), written;
  if (!is_live(command))
    std::ranges::copy(pipeline::files_of(recordings::read_recording(command.recording)), std::back_inserter(read));
  for (const calib::Camera& camera : config.rig.cameras) written.push_back(picture_of(command.pictures, camera));
  pipeline::refuse_outputs({.files = std::move(written)}, read);
  pipeline::refuse_outputs({.files = {}, .pictures = command.pictures}, read);
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
    const auto file = picture_of(folder, rig.cameras[c]);
    if (!cv::imwrite(file.string(), picture)) throw std::runtime_error("cannot write " + file.string());
  }
}

// Makes services on this host with this configuration reload it.
void tell_services(const config::ServiceConfig& config) {
  if (!config.dds.enabled) return;
  bool is_running = false;
  const auto is_same_file = [](const std::string& a, const std::filesystem::path& b) {
    std::error_code ignored;
    return a == b || std::filesystem::equivalent(a, b, ignored);
  };
  for (const publish::RunningService& service : publish::running_services(config.dds.publisher, 1500ms)) {
    if (!service.is_on_this_host || !is_same_file(service.config_file, config.file)) continue;
    const bool runs = service.mode == "run";
    if (::kill(pid_t(service.pid), SIGHUP) == 0) {
      fmt::print("huetrackd (process {}{}) reloads it\n", service.pid,
                 runs                     ? ""
                 : service.mode == "held" ? ", a held replay: \"Go on\" on the page continues it"
                                          : ", a replay");
    } else {
      fmt::print("huetrackd runs as another user: reload it with  kill -HUP {}{}\n", service.pid,
                 runs ? "  or  systemctl reload huetrackd" : "");
    }
    is_running = true;
  }
  if (!is_running) fmt::print("no huetrackd runs with this file on this host: it takes effect at the next start\n");
}

void save_rectangles(const TeachCommand& command, const config::ServiceConfig& config) {
  const object_tracking::IgnoredRegions ignored = with_ignored(command, config);
  if (command.dry_run) return;
  const std::filesystem::path written = config::save_ignored(config.file, ignored);
  fmt::print("written into {}: these rectangles are now ignored\n", written.string());
  tell_services(config);
}

// numbers: of the frames, per camera.
void print_lesson(const color_teaching::Lesson& lesson, const calib::CameraRig& rig,
                  const std::vector<std::int64_t>& numbers, std::optional<double> said_radius_m) {
  for (std::size_t c = 0; c < lesson.taught.views.size(); ++c) {
    const color_teaching::TaughtView& view = lesson.taught.views[c];
    if (!view.verdict.empty()) fmt::print("{}\n", view.verdict);
    if (view.pointed) {
      fmt::print("  hue_deg: [{:g}, {:g}], saturation: [{:g}, {:g}], intensity: [{:g}, {:g}]\n", view.color.hue_min_deg,
                 view.color.hue_max_deg, view.color.saturation_min, view.color.saturation_max, view.color.intensity_min,
                 view.color.intensity_max);
      if (view.narrower) fmt::print("  narrow it with --wider {}\n", view.narrower->wider);
    } else if (view.region) {
      fmt::print("  confirm it with  --at {},{},{},{}  or accept all suggestions with --accept\n", rig.cameras[c].name,
                 numbers[c], std::lround(view.region->centre.x()), std::lround(view.region->centre.y()));
    }
  }
  if (lesson.narrowed_to)
    fmt::print("Narrower ranges are used (--wider {}), because wider ones include something else\n",
               *lesson.narrowed_to);
  if (lesson.taught.any()) fmt::print("{}\n", color_teaching::radius_words(lesson.radius, said_radius_m));
  for (const std::string& name : lesson.namesakes)
    fmt::print("Warning: the object also has the colour of target {}: they cannot be distinguished\n", name);
}

// Whether it may be saved; prints the reason if not.
bool is_worth_writing(const color_teaching::Lesson& lesson, const TeachCommand& command) {
  const std::string& why_not =
      lesson.why_useless.empty() && is_live(command) ? lesson.why_doubtful : lesson.why_useless;
  if (!why_not.empty()) {
    fmt::print(stderr, "huetrackd: nothing is saved: {}\n", why_not);
    return false;
  }
  if (lesson.unconfirmed.empty()) return true;
  const std::string where =
      fmt::format("the object's place is not confirmed in {}", fmt::join(lesson.unconfirmed, ", "));
  if (!command.only && !command.dry_run) {
    fmt::print(stderr,
               "huetrackd: nothing is saved: {}. Confirm it with the --at above, accept the suggestions with --accept, "
               "or save without with --only\n",
               where);
    return false;
  }
  fmt::print("Warning: {}: the colour may not be seen there\n", where);
  return true;
}

void save_lesson(const TriedLesson& tried, const TeachCommand& command, const config::ServiceConfig& config,
                 const object_tracking::TargetOptions& target, const object_tracking::IgnoredRegions& ignored) {
  const color_teaching::RadiusProposal& radius = tried.lesson.radius;
  const std::filesystem::path written = config::save_taught(
      config.file, tried.lesson.target, command.ignore.empty() ? std::nullopt : std::optional(ignored), tried.radius_m);
  fmt::print("written into {}: the colour of {}{}\n", written.string(), target.name,
             tried.radius_m ? ", and its radius" : "");
  if (!tried.radius_m && radius.radius_m && target.is_radius_assumed)
    fmt::print("Warning: {} --radius saves it\n", color_teaching::unsaved_radius_words());
  else if (!tried.radius_m && radius.radius_m && color_teaching::differs_clearly(radius, target.radius_m))
    fmt::print("radius_m is not changed; --radius uses the one above\n");
}

}  // namespace

int teach(const TeachCommand& command, std::stop_token stop) {
  const config::ServiceConfig config = config::load_service_config(command.config);
  if (command.redo) {
    fmt::print("{} is as it was before --undo\n", config::redo_taught(config.file).string());
    tell_services(config);
    return 0;
  }
  if (command.undo) {
    fmt::print("{} is as it was before the last save; --redo redoes it\n", config::undo_taught(config.file).string());
    tell_services(config);
    return 0;
  }
  config::require_rig(config);
  if (command.at.empty() && command.recording.empty() && !command.ignore.empty()) {
    save_rectangles(command, config);
    return 0;
  }
  if (command.recording.empty()) throw std::runtime_error("give a recording to teach from, or the word live");
  const object_tracking::TargetOptions& target = target_of(config, command.target);
  refuse_pictures_over_what_is_read(command, config);
  const Pointing pointing = pointing_of(command, config);
  const Pictures pictures =
      is_live(command) ? Pictures{.set = live_pictures(config, pointing.frames, stop),
                                  .numbers = std::vector(config.rig.cameras.size(), pointing.frames.begin()->second)}
                       : recorded_pictures(config, command.recording, pointing.frames, stop);
  color_teaching::ColorTeacher teacher(config.rig, pictures.set, pictures.elsewhen);
  for (const capture::FrameSet& moment : pictures.moments)
    if (!teacher.add_moment(moment)) break;
  const auto first_camera = std::size_t(pointing.request.points.front().camera);
  const TriedTeaching teaching(command, config, target, teacher, pointing.request,
                               pictures.set.frames[first_camera]->captured_at);
  color_teaching::Lesson lesson = teaching.learn();
  const bool is_sized = !target.is_radius_assumed;
  const auto show = [&](const color_teaching::Lesson& learnt) {
    print_lesson(learnt, config.rig, pictures.numbers, is_sized ? std::optional(target.radius_m) : std::nullopt);
    if (command.pictures.empty()) return;
    draw(command.pictures, config.rig, pictures.set, learnt.taught);
    fmt::print("pictures with matching pixels in pink: {}\n", command.pictures.string());
  };
  show(lesson);
  if (!is_worth_writing(lesson, command)) return 1;
  if (command.dry_run && !command.accept) return 0;
  TriedLesson tried = teaching.untried(std::move(lesson));
  if (!is_live(command) && !teaching.passes(tried, stop)) return 1;
  if (tried.is_of_other_width) show(tried.lesson);
  if (command.dry_run) return 0;
  save_lesson(tried, command, config, target, pointing.request.ignored);
  tell_services(config);
  return 0;
}

}  // namespace huetrack::page
