#include "daemon/teach_desk.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "capture/jpeg_encoder.h"
#include "config/config_editor.h"
#include "config/formatted.h"

namespace huetrack::daemon {
namespace {

constexpr int picture_width = 960;  // larger than a preview's: people point into it
constexpr int picture_quality = 85;
constexpr double none = std::numeric_limits<double>::quiet_NaN();

msg::TeachReply reply_to(const msg::TeachRequest& request) {
  msg::TeachReply reply;
  reply.client(request.client());
  reply.number(request.number());
  reply.granted(true);
  reply.radius_m(none);
  return reply;
}

// At the picture's size: a pixel of it matches when the pixel in its middle does.
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
  for (const auto& ignore : request.ignored()) {
    const auto index = rig.index_of(ignore.camera());
    if (!index) return std::nullopt;
    const calib::ImageSize size = rig.cameras[std::size_t(*index)].image_size;
    const auto in = [](double value, int most) {
      return std::isfinite(value) ? int(std::clamp(value, 0.0, double(most))) : 0;
    };
    const object_tracking::PixelBox box{in(ignore.box()[0], size.width - 1), in(ignore.box()[1], size.height - 1),
                                        in(ignore.box()[2], size.width - 1), in(ignore.box()[3], size.height - 1)};
    if (box.empty()) return std::nullopt;
    auto it = std::ranges::find(regions, ignore.camera(), &object_tracking::IgnoredRegions::value_type::first);
    if (it == regions.end()) it = regions.insert(regions.end(), {ignore.camera(), {}});
    it->second.push_back(box);
  }
  return regions;
}

}  // namespace

std::string TeachDesk::why_not(const config::ServiceConfig& config) {
  if (config.control.allow_teach) return "";
  return "The configuration does not allow it. Set control: {allow_teach: true} in " + config.file.string() +
         ", then reload it: kill -HUP " + std::to_string(::getpid()) + " (or systemctl reload huetrackd).";
}

msg::TeachReply TeachDesk::refusal(const msg::TeachRequest& request, const std::string& reason) {
  msg::TeachReply reply = reply_to(request);
  reply.granted(false);
  reply.reason(reason);
  return reply;
}

msg::TeachReply TeachDesk::freeze(const msg::TeachRequest& request, const config::ServiceConfig& config,
                                  const capture::FrameSet& set) {
  if (const std::string why = why_not(config); !why.empty()) return refusal(request, why);
  msg::TeachReply reply = reply_to(request);
  teacher_.emplace(config.rig, set);
  client_ = request.client();
  set_number_ = set.number;
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

msg::TeachReply TeachDesk::look(const msg::TeachRequest& request, const config::ServiceConfig& config, bool applies) {
  if (!teacher_ || client_ != request.client())
    return refusal(request, "Somebody else took new pictures meanwhile. Take new ones, and point again.");
  const auto target = std::ranges::find(config.targets, request.target(), &object_tracking::TargetOptions::name);
  if (target == config.targets.end()) return refusal(request, "There is no target \"" + request.target() + "\".");
  const auto ignored = ignored_of(request, config.rig);
  if (!ignored) return refusal(request, "A rectangle is not in any camera's picture.");
  color_teaching::TeachRequestOptions options;
  options.wider = std::clamp(request.wider(), -50, 50);
  options.ignored.resize(config.rig.cameras.size());
  for (const auto& [camera, boxes] : *ignored) options.ignored[std::size_t(*config.rig.index_of(camera))] = boxes;
  for (const auto& point : request.points()) {
    const auto index = config.rig.index_of(point.camera());
    if (!index || !std::isfinite(point.pixel()[0]) || !std::isfinite(point.pixel()[1]) ||
        !config.rig.cameras[std::size_t(*index)].contains({{point.pixel()[0], point.pixel()[1]}}))
      return refusal(request, "A point is not in any camera's picture.");
    options.points.push_back({*index, {point.pixel()[0], point.pixel()[1]}});
  }
  if (options.points.empty()) return refusal(request, "Point at the object first.");

  const color_teaching::Taught taught = teacher_->teach(options, config.object_tracking.volume);
  msg::TeachReply reply = reply_to(request);
  reply.set_number(set_number_);
  reply.radius_m(taught.radius_m.value_or(none));
  for (std::size_t c = 0; c < taught.views.size(); ++c) {
    const color_teaching::TaughtView& view = taught.views[c];
    msg::TeachCamera& camera = reply.cameras().emplace_back();
    camera.camera(config.rig.cameras[c].name);
    camera.pointed(view.pointed);
    camera.region_pixel({none, none});
    if (view.region) {
      camera.region_pixel({view.region->centre.x(), view.region->centre.y()});
      camera.region_radius_px(view.region->radius_px());
    }
    camera.color().camera(config.rig.cameras[c].name);
    camera.color().hue_deg({view.color.hue_min_deg, view.color.hue_max_deg});
    camera.color().saturation({view.color.saturation_min, view.color.saturation_max});
    camera.color().intensity({view.color.intensity_min, view.color.intensity_max});
    camera.background_share(view.background_share);
    if (view.patch) {
      const object_tracking::PixelBox& b = view.patch->box;
      camera.background_box({double(b.u_min), double(b.v_min), double(b.u_max), double(b.v_max)});
    }
    camera.verdict(view.verdict);
    camera.width(picture_sizes_[c].first);
    camera.height(picture_sizes_[c].second);
    if (taught.any() && view.mask.width > 0) camera.mask(packed(view.mask, int(camera.width()), int(camera.height())));
  }
  const auto pointed = std::ranges::count_if(taught.views, &color_teaching::TaughtView::pointed);
  const auto open = color_teaching::unconfirmed(taught, config.rig);
  if (!taught.any()) {
    reply.granted(false);
    const auto failed = std::ranges::find_if(taught.views, [](const auto& v) { return !v.problem.empty(); });
    reply.reason(failed == taught.views.end() ? "Point at the object first." : failed->verdict);
    return reply;
  }
  std::string reason =
      "Learnt from " + std::to_string(pointed) + " of " + std::to_string(taught.views.size()) + " cameras.";
  if (!open.empty()) reason += " Confirm it where the dashed ring is: " + config::list_of(open) + ".";
  std::string warnings;
  if (const auto names = teacher_->namesakes(taught, config.targets, target->name); !names.empty())
    warnings += " The object has the colour of " + config::list_of(names) + ", too: nothing tells them apart.";
  if (const std::string hint = color_teaching::radius_hint(taught, *target); !hint.empty()) warnings += " " + hint;
  const auto faint = std::ranges::find_if(
      taught.views, [](const auto& v) { return v.pointed && v.object_share < color_teaching::least_object_share; });
  if (applies) {
    if (const std::string why = color_teaching::why_useless(taught, config.rig); !why.empty())
      return refusal(request, "Not saved: " + why + ".");
    try {
      const bool changes_ignored = *ignored != config.ignored;
      config::save_taught(config, color_teaching::with_taught_color(*target, config.rig, taught),
                          changes_ignored ? std::optional(*ignored) : std::nullopt);
      const std::string problem = actions_.reload();
      if (!problem.empty()) return refusal(request, "It is written, but not taken over: " + problem);
      reason = "Saved: " + target->name + " is tracked by this colour now, and it is written into " +
               config.file.string() + ".";
      if (!open.empty())
        reason += " Nobody has confirmed where it is in " + config::list_of(open) + ": it may not be seen there.";
      if (faint != taught.views.end()) reason += " Less than half of the object matches: widen the ranges.";
    } catch (const std::exception& error) {  // the file cannot be written, or not be changed by a program
      return refusal(request, std::string("Not saved: ") + error.what());
    }
  }
  reply.reason(reason + warnings);
  return reply;
}

msg::TeachReply TeachDesk::answer(const msg::TeachRequest& request, const config::ServiceConfig& config) {
  if (request.action() == msg::TEACH_ACTION_RESUME) {
    if (!actions_.resume) return refusal(request, "Nothing is held.");
    actions_.resume();
    msg::TeachReply reply = reply_to(request);
    reply.reason("Going on.");
    return reply;
  }
  if (const std::string why = why_not(config); !why.empty()) return refusal(request, why);
  switch (request.action()) {
    case msg::TEACH_ACTION_LOOK:
      return look(request, config, false);
    case msg::TEACH_ACTION_APPLY:
      return look(request, config, true);
    case msg::TEACH_ACTION_IGNORE: {
      const auto ignored = ignored_of(request, config.rig);
      if (!ignored) return refusal(request, "A rectangle is not in any camera's picture.");
      try {
        config::save_ignored(config, *ignored);
        const std::string problem = actions_.reload();
        if (!problem.empty()) return refusal(request, "It is written, but not taken over: " + problem);
      } catch (const std::exception& error) {  // as above
        return refusal(request, std::string("Not saved: ") + error.what());
      }
      msg::TeachReply reply = reply_to(request);
      reply.reason("Saved: nothing matches in these rectangles any more.");
      return reply;
    }
    default:
      return refusal(request, "This service does not know that request.");
  }
}

}  // namespace huetrack::daemon
