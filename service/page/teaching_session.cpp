#include "page/teaching_session.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>

#include "capture/frames/jpeg_encoder.h"
#include "config/taught_file.h"

namespace huetrack::page {
namespace {

constexpr int picture_width = 960;  // larger than a preview, for precise clicks
constexpr int picture_quality = 85;
constexpr std::size_t most_marks = 64;  // points or rectangles of a request; each costs time for all pictures
// For the object's size, while it is moved.
constexpr std::chrono::milliseconds moments_apart(300), moments_until(15'000);
constexpr double none = std::numeric_limits<double>::quiet_NaN();

msg::TeachReply reply_to(const msg::TeachRequest& request) {
  msg::TeachReply reply;
  reply.client(request.client());
  reply.number(request.number());
  reply.granted(true);
  reply.radius_m(none);
  return reply;
}

// At the picture's size, sampled at the middle of each pixel.
std::vector<std::uint8_t> packed(const color_teaching::PixelMask& mask, int width, int height) {
  const int stride = (width + 7) / 8;
  std::vector<std::uint8_t> bits(std::size_t(stride) * std::size_t(height), 0);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const int u = (2 * x + 1) * mask.width / (2 * width), v = (2 * y + 1) * mask.height / (2 * height);
      if (mask.at(u, v) != 0) bits[std::size_t(y * stride + x / 8)] |= std::uint8_t(0x80 >> (x % 8));
    }
  }
  return bits;
}

std::optional<object_tracking::IgnoredRegions> ignored_of(const msg::TeachRequest& request,
                                                          const calib::CameraRig& rig) {
  object_tracking::IgnoredRegions regions;
  if (request.ignored().size() > most_marks * rig.cameras.size()) return std::nullopt;
  for (const auto& ignore : request.ignored()) {
    const auto index = rig.index_of(ignore.camera());
    if (!index) return std::nullopt;
    const calib::ImageSize size = rig.cameras[std::size_t(*index)].image_size;
    const auto in = [](double value, int most) {
      return std::isfinite(value) ? int(std::clamp(value, 0.0, double(most))) : 0;
    };
    const color::PixelBox box{in(ignore.box()[0], size.width - 1), in(ignore.box()[1], size.height - 1),
                              in(ignore.box()[2], size.width - 1), in(ignore.box()[3], size.height - 1)};
    if (box.empty()) return std::nullopt;
    color_teaching::add_ignored(regions, ignore.camera(), box);
  }
  return regions;
}

// The page's points, or the reason why they are invalid.
struct PointedAt {
  color_teaching::TeachRequestOptions request;
  std::string problem;
};

PointedAt pointing_of(const msg::TeachRequest& request, const calib::CameraRig& rig) {
  PointedAt pointing;
  if (request.points().size() > most_marks) return {{}, fmt::format("More than {} points.", most_marks)};
  const auto ignored = ignored_of(request, rig);
  if (!ignored) return {{}, "A rectangle is outside every camera's picture."};
  pointing.request.ignored = *ignored;
  pointing.request.wider = std::clamp(request.wider(), -50, 50);
  for (const auto& point : request.points()) {
    const auto index = rig.index_of(point.camera());
    if (!index || !std::isfinite(point.pixel()[0]) || !std::isfinite(point.pixel()[1]) ||
        !rig.cameras[std::size_t(*index)].contains({{point.pixel()[0], point.pixel()[1]}}))
      return {{}, "A point is outside every camera's picture."};
    pointing.request.points.push_back({*index, {point.pixel()[0], point.pixel()[1]}});
  }
  if (pointing.request.points.empty()) return {{}, "Click on the object first."};
  return pointing;
}

// With a mask of this size; 0: none.
msg::TeachCamera camera_of(const color_teaching::TaughtView& view, const std::string& name,
                           std::pair<std::uint32_t, std::uint32_t> mask_size) {
  msg::TeachCamera camera;
  camera.camera(name);
  camera.pointed(view.pointed);
  camera.region_pixel({none, none});
  if (view.region) {
    camera.region_pixel({view.region->centre.x(), view.region->centre.y()});
    camera.region_radius_px(view.region->radius_px());
  }
  camera.color().camera(name);
  camera.color().hue_deg({view.color.hue_min_deg, view.color.hue_max_deg});
  camera.color().saturation({view.color.saturation_min, view.color.saturation_max});
  camera.color().intensity({view.color.intensity_min, view.color.intensity_max});
  camera.background_share(view.background_share);
  if (view.patch) {
    const color::PixelBox& b = view.patch->box;
    camera.background_box({double(b.u_min), double(b.v_min), double(b.u_max), double(b.v_max)});
  }
  camera.verdict(view.verdict);
  camera.width(mask_size.first);
  camera.height(mask_size.second);
  if (view.mask.width > 0) camera.mask(packed(view.mask, int(camera.width()), int(camera.height())));
  return camera;
}

// The reason why nothing was learnt.
std::string why_nothing(const color_teaching::Taught& taught) {
  const auto failed = std::ranges::find_if(taught.views, [](const auto& view) { return !view.problem.empty(); });
  return failed == taught.views.end() ? "Click on the object first." : failed->verdict;
}

// For display: with `send: matches`, the latest picture.
capture::FrameSet pictures_of(capture::FrameSet set) {
  for (auto& frame : set.frames) {
    if (frame && !take_picture(*frame, picture_of(*frame))) frame.reset();
  }
  return set;
}

std::string learnt(const color_teaching::Lesson& lesson) {
  const auto& views = lesson.taught.views;
  std::string text = fmt::format("Learnt from {} of {} cameras.",
                                 std::ranges::count_if(views, &color_teaching::TaughtView::pointed), views.size());
  if (!lesson.unconfirmed.empty())
    text += fmt::format(" Confirm it where the dashed ring is: {}.", fmt::join(lesson.unconfirmed, ", "));
  return text;
}

// is_recording: `huetrackd teach` would have tracked it by the colour before.
std::string saved(const color_teaching::Lesson& lesson, const std::filesystem::path& file, bool with_radius,
                  bool is_recording) {
  std::string text = fmt::format("Saved: {} is now tracked by this colour{}, written into {}.", lesson.target.name,
                                 with_radius ? " and with this radius" : "", file.string());
  if (is_recording)
    text += " The recording was not tried with it: see whether it is tracked as it goes on, or else narrow the ranges.";
  if (!lesson.unconfirmed.empty())
    text += fmt::format(" Its place in {} is not confirmed: it may not be seen there.",
                        fmt::join(lesson.unconfirmed, ", "));
  if (lesson.is_faint) text += " Less than half of the object matches: widen the ranges.";
  return text;
}

std::string warnings(const color_teaching::Lesson& lesson) {
  if (lesson.namesakes.empty()) return {};
  return fmt::format(" The object also has the colour of {}: they cannot be distinguished.",
                     fmt::join(lesson.namesakes, ", "));
}

std::string radius(const color_teaching::Lesson& lesson, std::optional<double> said_radius_m) {
  return " " + color_teaching::radius_words(lesson.radius, said_radius_m);
}

}  // namespace

std::string TeachingSession::why_not(const config::ServiceConfig& config) {
  if (config.control.allow_teach) return "";
  return fmt::format(
      "The configuration does not allow it. Set control: {{allow_teach: true}} in {}, then reload it: kill -HUP {} (or "
      "systemctl reload huetrackd).",
      config.file.string(), ::getpid());
}

msg::TeachReply TeachingSession::refusal(const msg::TeachRequest& request, const std::string& reason) {
  msg::TeachReply reply = reply_to(request);
  reply.granted(false);
  reply.reason(reason);
  return reply;
}

msg::TeachReply TeachingSession::freeze(const msg::TeachRequest& request, const config::ServiceConfig& config,
                                        const capture::FrameSet& shown) {
  if (const std::string why = why_not(config); !why.empty()) return refusal(request, why);
  msg::TeachReply reply = reply_to(request);
  const capture::FrameSet set = pictures_of(shown);
  teacher_.emplace(config.rig, set, std::vector<std::vector<capture::Image>>(), config.is_calibrated());
  read_moments();
  client_ = request.client();
  set_number_ = moment_number_ = set.number;
  takes_moments_ = true;
  next_moment_ = std::chrono::steady_clock::now() + moments_apart;
  last_moment_ = std::chrono::steady_clock::now() + moments_until;
  picture_sizes_.assign(config.rig.cameras.size(), {0, 0});
  reply.set_number(set.number);
  for (std::size_t c = 0; c < config.rig.cameras.size(); ++c) {
    msg::TeachCamera& camera = reply.cameras().emplace_back();
    camera.camera(config.rig.cameras[c].name);
    camera.region_pixel({none, none});
    camera.color().camera(config.rig.cameras[c].name);
    const auto& frame = set.frames[c];
    if (!frame || frame->status != capture::FrameStatus::ok) continue;
    const capture::PictureSize size = capture::picture_size(frame->pixels, picture_width);
    camera.width(std::uint32_t(size.width));
    camera.height(std::uint32_t(size.height));
    picture_sizes_[c] = {camera.width(), camera.height()};
    camera.jpeg(capture::encode_picture(frame->pixels, size, picture_quality));
  }
  reply.reason("Click on the object in one picture.");
  return reply;
}

void TeachingSession::add_moment(const capture::FrameSet& set) {
  next_moment_ = std::chrono::steady_clock::now() + moments_apart;
  if (set.number == moment_number_) return;  // a held replay
  moment_number_ = set.number;
  takes_moments_ = teacher_->add_moment(pictures_of(set));
}

// In a separate thread, because a long recording takes long.
void TeachingSession::read_moments() {
  reading_ = {};  // for earlier pictures
  read_.clear();
  why_not_read_.clear();
  if (!actions_.moments) return;
  reading_ = std::jthread([this](const std::stop_token& stop) {
    try {
      std::vector<capture::FrameSet> moments = actions_.moments(stop);
      const std::scoped_lock lock(read_mutex_);
      read_ = std::move(moments);
    } catch (const std::exception& error) {
      const std::scoped_lock lock(read_mutex_);
      why_not_read_ = fmt::format(" Motion is unknown: {}.", error.what());
    }
  });
}

// Returns the reason if there are none; empty: no error.
std::string TeachingSession::take_read_moments() {
  std::vector<capture::FrameSet> moments;
  std::string why_not;
  {
    const std::scoped_lock lock(read_mutex_);
    moments.swap(read_);
    why_not = why_not_read_;
  }
  for (const capture::FrameSet& moment : moments) takes_moments_ = teacher_->add_moment(moment);
  return why_not;
}

msg::TeachReply TeachingSession::look(const msg::TeachRequest& request, const config::ServiceConfig& config,
                                      bool applies) {
  if (!teacher_ || client_ != request.client())
    return refusal(request, "Another client has taken new pictures. Take new ones and click again.");
  const auto target = std::ranges::find(config.targets, request.target(), &object_tracking::TargetOptions::name);
  if (target == config.targets.end()) return refusal(request, "There is no target \"" + request.target() + "\".");
  const PointedAt pointing = pointing_of(request, config.rig);
  if (!pointing.problem.empty()) return refusal(request, pointing.problem);

  const std::string unread = take_read_moments();
  teacher_->learn_motion();
  const color_teaching::Lesson lesson =
      color_teaching::learn(*teacher_, pointing.request, config.targets, *target, config.object_tracking.volume);
  msg::TeachReply reply = reply_to(request);
  reply.set_number(set_number_);
  // A measured radius replaces the default. A configured radius is only changed by the user.
  const bool is_sized = !target->is_radius_assumed;
  const auto said_radius_m = is_sized ? std::optional(target->radius_m) : std::nullopt;
  const bool agrees =
      lesson.radius.radius_m && said_radius_m && !color_teaching::differs_clearly(lesson.radius, *said_radius_m);
  reply.radius_m(agrees ? none : lesson.radius.radius_m.value_or(none));
  for (std::size_t c = 0; c < lesson.taught.views.size(); ++c)
    reply.cameras().push_back(camera_of(lesson.taught.views[c], config.rig.cameras[c].name, picture_sizes_[c]));
  if (!lesson.taught.any()) {
    reply.granted(false);
    reply.reason(why_nothing(lesson.taught));
    return reply;
  }
  if (!applies) {
    // Why no radius is measured is of interest once all is confirmed: the next point may measure it.
    const bool may_be_measured = !lesson.unconfirmed.empty() && !lesson.radius.radius_m;
    reply.reason(learnt(lesson) + warnings(lesson) + (may_be_measured ? "" : radius(lesson, said_radius_m)) + unread);
    return reply;
  }
  if (!lesson.why_useless.empty()) return refusal(request, "Not saved: " + lesson.why_useless + ".");
  const bool changes_ignored = pointing.request.ignored != config.ignored;
  std::filesystem::path file;
  const auto radius_m = is_sized || !lesson.unconfirmed.empty() ? std::nullopt : lesson.radius.radius_m;
  const std::string why_not = why_not_saved([&] {
    file = config::save_taught(config.file, lesson.target,
                               changes_ignored ? std::optional(pointing.request.ignored) : std::nullopt, radius_m);
  });
  if (!why_not.empty()) return refusal(request, why_not);
  const bool is_unsaved = !is_sized && !radius_m && lesson.radius.radius_m;
  reply.reason(saved(lesson, file, radius_m.has_value(), bool(actions_.moments)) + warnings(lesson) +
               radius(lesson, said_radius_m) + (is_unsaved ? " " + color_teaching::unsaved_radius_words() : ""));
  return reply;
}

msg::TeachReply TeachingSession::ignore(const msg::TeachRequest& request, const config::ServiceConfig& config) {
  const auto ignored = ignored_of(request, config.rig);
  if (!ignored) return refusal(request, "A rectangle is outside every camera's picture.");
  const std::string why_not = why_not_saved([&] { config::save_ignored(config.file, *ignored); });
  if (!why_not.empty()) return refusal(request, why_not);
  msg::TeachReply reply = reply_to(request);
  reply.reason("Saved: these rectangles are now ignored.");
  return reply;
}

msg::TeachReply TeachingSession::undo(const msg::TeachRequest& request, const config::ServiceConfig& config) {
  std::filesystem::path file;
  const std::string why_not = why_not_saved([&] { file = config::undo_taught(config.file); });
  if (!why_not.empty()) return refusal(request, why_not);
  msg::TeachReply reply = reply_to(request);
  reply.reason(fmt::format("Undone: {} is as it was before the last save.", file.filename().string()));
  return reply;
}

std::string TeachingSession::why_not_saved(const std::function<void()>& save) const {
  try {
    save();
    const std::string problem = actions_.reload();
    return problem.empty() ? "" : "It is saved, but not in use: " + problem;
  } catch (const std::exception& error) {  // write error, or an invalid configuration
    return std::string("Not saved: ") + error.what();
  }
}

msg::TeachReply TeachingSession::answer(const msg::TeachRequest& request, const config::ServiceConfig& config) {
  if (const std::string why = why_not(config); !why.empty()) return refusal(request, why);
  if (request.action() == msg::TEACH_ACTION_RESUME) {
    if (!actions_.resume) return refusal(request, "Nothing is held.");
    actions_.resume();
    msg::TeachReply reply = reply_to(request);
    reply.reason("Going on.");
    return reply;
  }
  switch (request.action()) {
    case msg::TEACH_ACTION_LOOK:
      return look(request, config, false);
    case msg::TEACH_ACTION_APPLY:
      return look(request, config, true);
    case msg::TEACH_ACTION_IGNORE:
      return ignore(request, config);
    case msg::TEACH_ACTION_UNDO:
      return undo(request, config);
    default:
      return refusal(request, "This service does not know that request.");
  }
}

}  // namespace huetrack::page
