#include "color_teaching/color_teacher.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <utility>

#include "capture/frames/image_copy.h"
#include "color_teaching/color_fit.h"
#include "color_teaching/suggestion.h"

namespace huetrack::color_teaching {
namespace {

constexpr int soft_edge_px = 3;          // blur, and chroma that neighbours share
constexpr double notable_share = 0.005;  // of the background
// Frames of cameras that are not synchronised are of one moment to half a period, and stamps are late by up to 45 ms:
// at 2 m/s (a stroll, a hand) that is a decimetre.
constexpr auto in_step = std::chrono::milliseconds(2);
constexpr double moved_between_frames_m = 0.1;
constexpr int most_narrowing = 5;            // steps; further ones leave nothing of a shaded ball
constexpr double worth_narrowing = 0.5;      // of the background that matched
constexpr double negligible_share = 0.0005;  // of the background
constexpr double notable_patch = 0.25;       // of the object's own area: a patch that could be taken for it

std::string part_of_picture(const Eigen::Vector2d& at, int width, int height) {
  const int column = std::clamp(static_cast<int>(3 * at.x() / width), 0, 2);
  const int row = std::clamp(static_cast<int>(3 * at.y() / height), 0, 2);
  const char* const words[3][3] = {{"at the upper left", "at the top", "at the upper right"},
                                   {"at the left", "in the middle", "at the right"},
                                   {"at the lower left", "at the bottom", "at the lower right"}};
  return words[row][column];
}

std::size_t bytes_of(const capture::FrameSet& set) {
  std::size_t bytes = 0;
  for (const auto& frame : set.frames)
    if (frame) bytes += capture::packed_bytes(frame->pixels);
  return bytes;
}

// Share of the region's pixels that match.
double share_of(const HsiImage& image, const PixelMask& region, const color::HsiRange& range) {
  const PixelMask mask = matching(image, range, {});
  std::size_t both = 0;
  for (std::size_t i = 0; i < mask.pixels.size(); ++i) both += region.pixels[i] != 0 && mask.pixels[i] != 0 ? 1 : 0;
  return static_cast<double>(both) / static_cast<double>(std::max<std::size_t>(1, region.count()));
}

// The same of what was seen at other moments.
double share_of(const std::vector<std::vector<color::Hsi>>& seen, const color::HsiRange& range) {
  std::size_t all = 0, match = 0;
  for (const auto& pixels : seen) {
    all += pixels.size();
    match += std::size_t(std::ranges::count_if(pixels, [&](const color::Hsi& p) { return color::contains(range, p); }));
  }
  return double(match) / double(std::max<std::size_t>(1, all));
}

// With its soft edge.
color::PixelBox around(const MaskRegion& region) {
  const int reach = soft_edge_px + static_cast<int>(region.radius_px() / 2);
  return {region.box.u_min - reach, region.box.v_min - reach, region.box.u_max + reach, region.box.v_max + reach};
}

// The region around the pixel. Where the pixel moved and its region did not, the region is furniture of nearly the
// object's colour behind it, and the object is what moved of it.
std::optional<PixelMask> pointed_region(const HsiImage& image, color::PixelAt at,
                                        const std::optional<PixelMask>& moving) {
  constexpr double moving_share = 0.6;
  std::optional<PixelMask> region = grow_region(image, at);
  const bool is_inside = at.u > 0 && at.v > 0 && at.u < image.width - 1 && at.v < image.height - 1;
  if (!moving || !is_inside) return region;
  int moved_here = 0;
  for (int v = at.v - 1; v <= at.v + 1; ++v)
    for (int u = at.u - 1; u <= at.u + 1; ++u) moved_here += moving->at(u, v);
  if (moving->at(at.u, at.v) == 0 || moved_here < 5) return region;  // 5 of 9
  if (region) {
    std::size_t moved = 0;
    for (std::size_t i = 0; i < region->pixels.size(); ++i) moved += region->pixels[i] & moving->pixels[i];
    if (double(moved) >= moving_share * double(region->count())) return region;
  }
  auto of_it = grow_region(image, at, &*moving);
  return of_it ? of_it : region;
}

// Light, noise and a JPEG's coarse chroma may leave the object's colour on only a part of it. If something round that
// moved, and is larger than the part but by no more than light explains, has the part in it, that is the object. (An
// arm that carries it is not round.) What has its hue all over is the object however small the part: the saturated core
// of a shaded ball may be a third of it across.
MaskRegion whole_of(const MaskRegion& part, const PixelMask& object, const HsiImage& image,
                    const std::optional<PixelMask>& moving) {
  constexpr double least_larger = 1.35, most_larger = 2.2, least_held = 0.8;  // of radii; of the part's area
  constexpr double soft_px = 1;  // a blurred edge has moved, too, on both sides
  if (!moving) return part;
  const auto round_around = [&](const PixelMask& mask, double most) -> std::optional<MaskRegion> {
    for (const MaskRegion& whole : regions_of(mask, part.area)) {
      const double larger = (whole.radius_px() - soft_px) / part.radius_px();
      if (larger < least_larger || larger > most || !has_disc_shape(whole)) continue;
      int held = 0;
      for (int v = whole.box.v_min; v <= whole.box.v_max; ++v)
        for (int u = whole.box.u_min; u <= whole.box.u_max; ++u) held += mask.at(u, v) & object.at(u, v);
      if (held >= least_held * part.area) return whole;
    }
    return std::nullopt;
  };
  if (const auto whole = round_around(*moving, most_larger)) return *whole;
  PixelMask of_its_hue = alike_pixels(image, object);
  for (std::size_t i = 0; i < of_its_hue.pixels.size(); ++i) of_its_hue.pixels[i] &= moving->pixels[i];
  return round_around(of_its_hue, std::numeric_limits<double>::infinity()).value_or(part);
}

std::vector<std::vector<color::Hsi>> all_seen_of(const TaughtView& view, const HsiImage& image) {
  std::vector<std::vector<color::Hsi>> all = view.elsewhere;
  all.push_back(pixels_of(image, view.object));
  return all;
}

std::vector<const capture::Image*> pictures_of(const capture::FrameSet& set) {
  std::vector<const capture::Image*> pictures;
  for (const auto& frame : set.frames) pictures.push_back(frame ? &frame->pixels : nullptr);
  return pictures;
}

std::string percent(double share) {
  return fmt::format("{:.{}f} %", 100 * share, share < 0.001 ? 2 : 1);
}

}  // namespace

ColorTeacher::ColorTeacher(const calib::CameraRig& rig, const capture::FrameSet& set,
                           const std::vector<std::vector<capture::Image>>& others, bool has_poses)
    : rig_(rig),
      has_poses_(has_poses),
      images_(rig.cameras.size()),
      moving_(rig.cameras.size()),
      has_others_(!others.empty()) {
  std::optional<capture::Timestamp> first_at;
  for (std::size_t c = 0; c < images_.size() && c < set.frames.size(); ++c) {
    const auto& frame = set.frames[c];
    if (frame && frame->status == capture::FrameStatus::ok && frame->pixels.width == rig.cameras[c].image_size.width &&
        frame->pixels.height == rig.cameras[c].image_size.height) {
      images_[c] = hsi_image(frame->pixels);
      if (!first_at) first_at = frame->captured_at;
      if (std::chrono::abs(frame->captured_at - *first_at) > in_step) moved_m_ = moved_between_frames_m;
      if (c < others.size()) moving_[c] = moving_pixels(frame->pixels, others[c]);
    }
  }
  add_moment(set);
}

bool ColorTeacher::add_moment(const capture::FrameSet& set) {
  const auto is_of_use = [&] {
    std::size_t bytes = 0;
    for (const capture::FrameSet& moment : moments_) bytes += bytes_of(moment);
    return moments_.empty() ||
           (moments_.size() < most_moments && bytes + bytes_of(moments_.front()) <= most_moment_bytes);
  };
  if (!is_of_use()) return false;
  capture::FrameSet copy{.number = set.number, .at = set.at, .frames = {}};
  for (std::size_t c = 0; c < images_.size(); ++c) {
    auto& frame = copy.frames.emplace_back();
    if (c >= set.frames.size() || !set.frames[c] || set.frames[c]->status != capture::FrameStatus::ok) continue;
    const capture::Image& pixels = set.frames[c]->pixels;
    const calib::ImageSize& size = rig_.cameras[c].image_size;
    if (pixels.width != size.width || pixels.height != size.height) continue;
    frame.emplace();
    frame->camera = int(c);
    frame->captured_at = set.frames[c]->captured_at;
    frame->pixels = capture::copy_of(pixels);
  }
  moments_.push_back(std::move(copy));
  return is_of_use();
}

void ColorTeacher::learn_motion() {
  constexpr std::size_t most_others = 15;
  const std::size_t known = std::min(moments_.size(), 1 + most_others);
  if (has_others_ || known < 2 * moments_of_motion_ || known == moments_of_motion_) return;
  bool is_any = false;
  for (std::size_t c = 0; c < images_.size(); ++c) {
    if (!images_[c] || !moments_.front().frames[c]) continue;
    std::vector<capture::Image> others;
    for (std::size_t m = 1; m < known; ++m)
      if (moments_[m].frames[c]) others.push_back(moments_[m].frames[c]->pixels);
    if (auto moving = moving_pixels(moments_.front().frames[c]->pixels, others)) {
      moving_[c] = std::move(moving);
      is_any = true;
    }
  }
  if (is_any) moments_of_motion_ = known;
}

std::vector<ColoredRegion> ColorTeacher::ball_of(const Taught& taught) const {
  std::vector<ColoredRegion> ball;
  for (std::size_t c = 0; c < taught.views.size(); ++c)
    if (taught.views[c].region && images_[c]) ball.push_back({c, *taught.views[c].region});
  return ball;
}

// Everything but the object and others like it, with what is around them: soft edge, shadow, glint.
PixelMask ColorTeacher::background_of(const TaughtView& view, const std::vector<color::PixelBox>& ignored) const {
  PixelMask background =
      view.region ? grown(view.object, soft_edge_px + static_cast<int>(view.region->radius_px() / 3)) : view.object;
  for (auto& pixel : background.pixels) pixel = pixel == 0 ? 1 : 0;
  for (const color::PixelBox& box : ignored) fill(background, box, 0);
  for (const MaskRegion& other : view.alike) fill(background, around(other), 0);
  return background;
}

RadiusProposal ColorTeacher::radius(const Taught& taught) const {
  if (!has_poses_) return {.why_not = "the cameras are not calibrated yet"};
  std::vector<BallMoment> moments;
  std::vector<ColoredRegion> first = ball_of(taught);
  if (taught.moments.empty() || radius_of_regions(rig_, first))
    moments.push_back({pictures_of(moments_.front()), std::move(first)});
  for (const Taught::Moment& moment : taught.moments)
    moments.push_back({pictures_of(moments_[moment.index]), moment.views});
  return voted_radius(rig_, moments);
}

const std::vector<color::PixelBox>& ColorTeacher::ignored_in(const TeachRequestOptions& request,
                                                             std::size_t camera) const {
  static const std::vector<color::PixelBox> none;
  const auto own = std::ranges::find(request.ignored, rig_.cameras[camera].name,
                                     &object_tracking::IgnoredRegions::value_type::first);
  return own == request.ignored.end() ? none : own->second;
}

Taught ColorTeacher::teach(const TeachRequestOptions& request, const object_tracking::Volume& volume) const {
  Taught taught;
  taught.views.resize(images_.size());
  for (const TeachPoint& point : request.points) {
    const auto c = static_cast<std::size_t>(point.camera);
    TaughtView& view = taught.views.at(c);
    view = {};
    if (!images_[c]) {
      view.problem = "there is no picture of this camera";
      continue;
    }
    const HsiImage& image = *images_[c];
    const auto region = pointed_region(
        image, {static_cast<int>(std::lround(point.px.x())), static_cast<int>(std::lround(point.px.y()))}, moving_[c]);
    if (!region) {
      view.problem =
          "there is no coloured region at this point: it is grey, dark, or runs into everything around it; point at "
          "a more colourful part of the object, or take a moment at which it is better lit";
      continue;
    }
    view.region = regions_of(*region, 1).front();
    view.object = *region;
    view.pointed = true;
  }
  if (!taught.any()) {
    for (std::size_t c = 0; c < images_.size(); ++c)
      if (!taught.views[c].problem.empty())
        taught.views[c].verdict = "camera " + rig_.cameras[c].name + ": " + taught.views[c].problem;
    return taught;
  }
  suggest(taught.views, request, volume);
  return fitted(std::move(taught), request);
}

void ColorTeacher::judge_all(Taught& taught, const TeachRequestOptions& request) const {
  const auto first = std::ranges::find_if(taught.views, &TaughtView::pointed);
  for (std::size_t c = 0; c < images_.size(); ++c)
    if (images_[c])
      judge(taught.views[c], c, rig_.cameras[std::size_t(first - taught.views.begin())].name, request.wider,
            ignored_in(request, c));
}

// nullopt: its size is unknown.
std::optional<FoundAgain> ColorTeacher::search_of(const Taught& taught, const TeachRequestOptions& request,
                                                  const object_tracking::Volume& volume) const {
  if (!has_poses_) return std::nullopt;
  const auto about = radius_of_regions(rig_, ball_of(taught));
  if (!about && !request.radius_m) return std::nullopt;
  // As far as light may change its colour, whatever else has it: contrast, size and position distinguish the object.
  Taught in_any_light = taught;
  std::vector<Look> looks(images_.size());
  const auto first = std::size_t(std::ranges::find_if(taught.views, &TaughtView::pointed) - taught.views.begin());
  for (std::size_t k = 0; k < images_.size(); ++k) {
    const std::size_t c = taught.views[k].pointed ? k : first;
    const PixelMask& object = taught.views[c].object;
    in_any_light.views[k].color = fit_range(*images_[c], object, PixelMask(object.width, object.height), 0);
    in_any_light.views[k].pointed = true;
    looks[k] = look_of(pixels_of(*images_[c], object));
  }
  object_tracking::TargetOptions target;
  target.name = "object";
  target.ignored = request.ignored;
  target.radius_m = about.value_or(request.radius_m.value_or(0));
  target = with_taught_color(std::move(target), rig_, in_any_light);
  return std::make_optional<FoundAgain>(rig_, target, std::move(looks), volume);
}

Taught ColorTeacher::held_elsewhere(Taught taught, const TeachRequestOptions& request,
                                    const object_tracking::Volume& volume, bool several) const {
  if (!taught.any()) return taught;
  auto search = search_of(taught, request, volume);
  if (!search) return taught;
  const std::vector<ColoredRegion> pointed = ball_of(taught);
  const auto is_pointed = [&](const FoundView& found) {
    return std::ranges::any_of(pointed, [&](const ColoredRegion& own) {
      return own.camera == found.view.camera &&
             (own.region.centre - found.view.region.centre).norm() < own.region.radius_px();
    });
  };
  for (std::size_t m = several ? 0 : 1; m < moments_.size(); ++m) {
    auto balls = search->in(moments_[m], several);
    if (m == 0) std::erase_if(balls, [&](const auto& ball) { return std::ranges::any_of(ball, is_pointed); });
    if (m > 0 && balls.size() == 1) taught.moments.push_back({.index = m, .views = {}});
    for (auto& ball : balls) {
      for (FoundView& found : ball) {
        TaughtView& view = taught.views[found.view.camera];
        if (m == 0) view.alike.push_back(found.view.region);
        if (m > 0 && balls.size() == 1) taught.moments.back().views.push_back(found.view);
        view.elsewhere.push_back(std::move(found.pixels));
      }
    }
  }
  for (std::size_t c = 0; c < taught.views.size(); ++c) {
    TaughtView& view = taught.views[c];
    if (!request.accepts_suggestions || view.pointed || !view.problem.empty() || !images_[c] || view.elsewhere.empty())
      continue;
    view.object = PixelMask(images_[c]->width, images_[c]->height);
    view.pointed = true;
  }
  return fitted(std::move(taught), request);
}

Taught ColorTeacher::fitted(Taught taught, const TeachRequestOptions& request) const {
  if (!taught.any()) return taught;
  for (std::size_t c = 0; c < taught.views.size(); ++c) {
    TaughtView& view = taught.views[c];
    if (!view.pointed) continue;
    view.color = fit_range(all_seen_of(view, *images_[c]), *images_[c], background_of(view, ignored_in(request, c)),
                           request.wider);
    view.object_share =
        view.region ? share_of(*images_[c], view.object, view.color) : share_of(view.elsewhere, view.color);
  }
  const auto first = std::ranges::find_if(taught.views, &TaughtView::pointed);
  for (TaughtView& view : taught.views)
    if (!view.pointed) view.color = first->color;
  judge_all(taught, request);
  return taught;
}

void ColorTeacher::suggest(std::vector<TaughtView>& views, const TeachRequestOptions& request,
                           const object_tracking::Volume& volume) const {
  if (!has_poses_) return;
  const auto picture = [this](std::size_t c) {
    return TaughtPicture{&rig_.cameras[c], &*images_[c], moving_[c] ? &*moving_[c] : nullptr};
  };
  std::vector<PointedObject> pointed;
  std::vector<TaughtPicture> others;
  std::vector<std::size_t> cameras;
  for (std::size_t c = 0; c < views.size(); ++c) {
    if (views[c].pointed) {
      pointed.push_back(
          {picture(c), whole_of(*views[c].region, views[c].object, *images_[c], moving_[c]), views[c].object});
    } else if (images_[c]) {
      others.push_back(picture(c));
      cameras.push_back(c);
    }
  }
  auto suggestions = suggested_regions(pointed, others, {volume, moved_m_, request.radius_m});
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    if (!suggestions[i]) continue;
    TaughtView& view = views[cameras[i]];
    view.region = suggestions[i]->region;
    if (!request.accepts_suggestions || !view.problem.empty()) continue;
    view.object = std::move(suggestions[i]->pixels);
    view.pointed = true;
  }
}

std::optional<TaughtView::Narrower> ColorTeacher::narrower(const TaughtView& view, std::size_t camera, int wider,
                                                           const std::vector<color::PixelBox>& ignored) const {
  const HsiImage& image = *images_[camera];
  const PixelMask background = background_of(view, ignored);
  const auto seen = all_seen_of(view, image);
  std::optional<TaughtView::Narrower> best;
  const int first = std::min(0, wider - 1);
  for (int steps = first; steps > first - most_narrowing; --steps) {
    TaughtView::Narrower next{.wider = steps, .color = fit_range(seen, image, background, steps)};
    next.object_share = share_of(image, view.object, next.color);
    if (next.object_share < least_object_share) break;  // the tracker would lose it in the next shadow
    next.background_share = share_of(image, background, next.color);
    const bool is_better = next.background_share < worth_narrowing * view.background_share;
    if (is_better && (!best || next.background_share < worth_narrowing * best->background_share)) best = next;
    if (next.background_share < negligible_share) break;
  }
  return best;
}

void ColorTeacher::judge(TaughtView& view, std::size_t camera, const std::string& color_of, int wider,
                         const std::vector<color::PixelBox>& ignored) const {
  const HsiImage& image = *images_[camera];
  view.mask = matching(image, view.color, ignored);
  view.patch.reset(), view.narrower.reset();
  PixelMask object(image.width, image.height);
  if (view.region) {
    fill(object, around(*view.region), 1);
    for (const MaskRegion& other : view.alike) fill(object, around(other), 1);
  }
  PixelMask beside = view.mask;
  for (std::size_t i = 0; i < beside.pixels.size(); ++i)
    beside.pixels[i] = object.pixels[i] != 0 ? 0 : beside.pixels[i];
  view.background_share = static_cast<double>(beside.count()) /
                          static_cast<double>(std::max<std::size_t>(1, beside.pixels.size() - object.count()));
  if (const auto patches = regions_of(beside, 1); !patches.empty()) view.patch = patches.front();

  const std::string& name = rig_.cameras[camera].name;
  const double own_area = view.region ? view.region->area : 30;
  const bool is_rival = view.patch && view.patch->area >= std::max(6.0, notable_patch * own_area);
  if (!is_rival) view.patch.reset();
  std::string text = "camera " + name + ": ";
  const auto patch_text = [&] {
    return fmt::format(", mostly a patch of {} pixels {} (around {}, {})", view.patch->area,
                       part_of_picture(view.patch->centre, image.width, image.height),
                       std::lround(view.patch->centre.x()), std::lround(view.patch->centre.y()));
  };
  if (!view.pointed) {
    text += !view.problem.empty() ? view.problem
            : view.region         ? fmt::format("the object is probably at {}, {}: point at it to confirm",
                                                std::lround(view.region->centre.x()), std::lround(view.region->centre.y()))
            : has_poses_
                ? "no region fits what was pointed at in the other views; point at the object if it is in this picture"
                : "point at the object, if it is in this picture";
    // Where the object's place is unknown, what matches may be it.
    const bool is_placed = view.region.has_value();
    text += ". By what was learnt in " + color_of + ", " + percent(view.background_share) + " of the " +
            (is_placed ? "background" : "picture") + " matches here" + (is_rival ? patch_text() : "") +
            (is_rival && !is_placed ? ": is that the object?" : "");
    view.verdict = text;
    return;
  }
  if (view.object_share == 0) {
    view.verdict = text + "nothing of the object matches: widen the ranges";
    return;
  }
  if (view.object_share < least_object_share)
    text += "only " + percent(view.object_share) + " of the object matches: widen the ranges; ";
  else
    text += percent(view.object_share) + " of the object matches" +
            (view.elsewhere.empty() ? "; " : fmt::format(" (learnt from {} views); ", view.elsewhere.size() + 1));
  text += percent(view.background_share) + " of the background matches";
  if (is_rival) {
    text += patch_text();
    if (view.region) view.narrower = narrower(view, camera, wider, ignored);
    if (const auto& n = view.narrower) {
      text += fmt::format(
          ": narrow it by {} step{}: then {} of the background matches, and {} of the object; or choose another "
          "colour, or ignore this region",
          wider - n->wider, wider - n->wider == 1 ? "" : "s", percent(n->background_share), percent(n->object_share));
    } else if (!view.region) {
      text += ", which may be the object: it was found at other moments only";
    } else {
      text +=
          ": no narrower range tells the two apart: choose another colour, ignore this region, or, if it is another "
          "object to track, raise the target's count";
    }
  } else if (view.background_share > notable_share) {
    text += ", scattered in small patches: narrow it, or choose another colour";
  } else {
    text += view.object_share < least_object_share ? ""
            : view.background_share == 0           ? ": the colour is unique here"
                                                   : ", in patches too small to matter: the colour stands out well";
  }
  view.verdict = text;
}

std::vector<std::string> ColorTeacher::namesakes(const Taught& taught,
                                                 const std::vector<object_tracking::TargetOptions>& targets,
                                                 const std::string& own_name) const {
  std::vector<std::string> names;
  for (const object_tracking::TargetOptions& target : targets) {
    if (target.name == own_name) continue;
    for (std::size_t c = 0; c < taught.views.size(); ++c) {
      if (!taught.views[c].pointed) continue;
      const color::HsiRange& range = target.color_in(rig_.cameras[c].name);
      if (share_of(*images_[c], taught.views[c].object, range) < 0.5) continue;
      names.push_back(target.name);
      break;
    }
  }
  return names;
}

std::vector<std::string> unconfirmed(const Taught& taught, const calib::CameraRig& rig) {
  std::vector<std::string> names;
  for (std::size_t c = 0; c < taught.views.size(); ++c)
    if (!taught.views[c].pointed && taught.views[c].region) names.push_back(rig.cameras[c].name);
  return names;
}

std::string why_useless(const Taught& taught, const calib::CameraRig& rig) {
  if (!taught.any()) return "nothing was learnt";
  for (std::size_t c = 0; c < taught.views.size(); ++c)
    if (taught.views[c].pointed && taught.views[c].object_share == 0)
      return "in camera " + rig.cameras[c].name + " nothing of the object matches: widen the ranges";
  return "";
}

object_tracking::TargetOptions with_taught_color(object_tracking::TargetOptions target, const calib::CameraRig& rig,
                                                 const Taught& taught) {
  const auto old = std::exchange(target.camera_colors, {});
  bool is_first = true, differ = false;
  for (const TaughtView& view : taught.views) {
    if (!view.pointed) continue;
    if (is_first) target.color = view.color;
    differ |= !is_first && view.color != target.color;
    is_first = false;
  }
  for (std::size_t c = 0; c < taught.views.size(); ++c) {
    if (taught.views[c].pointed) {
      if (differ) target.camera_colors.emplace_back(rig.cameras[c].name, taught.views[c].color);
      continue;
    }
    const auto own = std::ranges::find(old, rig.cameras[c].name, [](const auto& entry) { return entry.first; });
    if (own != old.end()) target.camera_colors.push_back(*own);
  }
  return target;
}

}  // namespace huetrack::color_teaching
