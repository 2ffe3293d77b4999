#include "color_teaching/found_again.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "object_tracking/sighting.h"

namespace huetrack::color_teaching {
namespace {

constexpr std::size_t most_candidates = 8;  // of one picture: the likeliest
constexpr int room_samples = 32;            // moments that the room's colours are the mean of
constexpr double size_reach = 0.4;          // a found disc's size is open by so much, as a logarithm
constexpr double picture_reach = 3;         // radii around a disc that are looked at
constexpr double same_place = 2;            // of radii

// A part of a picture.
struct Part {
  Eigen::Vector2d corner;
  HsiImage image;
  TintImage tints;
};

Part part_around(const capture::Image& image, const TintDisc& disc) {
  const int u = int(std::lround(disc.centre.x())), v = int(std::lround(disc.centre.y()));
  const int reach = int(std::ceil(picture_reach * disc.radius)) + 4;
  const color::PixelBox box{std::clamp(u - reach, 0, image.width - 1), std::clamp(v - reach, 0, image.height - 1),
                            std::clamp(u + reach, 0, image.width - 1), std::clamp(v + reach, 0, image.height - 1)};
  HsiImage pixels = hsi_image(image, box);
  TintImage tints(pixels);
  return {Eigen::Vector2d(box.u_min, box.v_min), std::move(pixels), std::move(tints)};
}

// Of the object itself: of its surroundings a share has its colour, too, and of itself not all.
int area_of(int alike, const Candidate& of) {
  const double searched = std::numbers::pi * std::pow(region_reach * of.disc.radius, 2);
  const double clear = of.contrast.inside - of.contrast.around;
  return std::max(1, int(std::lround((alike - of.contrast.around * searched) / clear)));
}

}  // namespace

struct FoundAgain::Picture {
  std::size_t camera = 0;
  std::vector<Candidate> candidates = {};  // in the picture
  std::vector<FoundView> views = {};       // of each

  // The likeliest disc there of a size up to so much other. false: none, or not round, or not whole.
  bool add(const capture::Image& image, const TintDisc& disc, double log_reach, const Look& look) {
    const Part part = part_around(image, disc);
    std::optional<Candidate> best;
    for (double log = -log_reach; log <= log_reach; log += size_step) {
      auto next = settled(part.tints, nullptr, {disc.centre - part.corner, disc.radius * std::exp(log)}, look);
      if (next && (!best || next->cost < best->cost)) best = std::move(next);
    }
    if (!best) return false;
    PixelMask mask(part.image.width, part.image.height);
    FoundView found{.view = {camera, region_of(part.tints, best->disc, best->contrast, &mask)}, .pixels = {}};
    for (std::size_t i = 0; i < mask.pixels.size(); ++i)
      if (mask.pixels[i] != 0) found.pixels.push_back(part.image.pixels[i]);
    MaskRegion& region = found.view.region;
    if (region.area == 0 || !has_disc_shape(region)) return false;
    region.area = area_of(region.area, *best);
    region.centre += part.corner, best->disc.centre += part.corner;
    const int du = int(part.corner.x()), dv = int(part.corner.y());
    region.box = {region.box.u_min + du, region.box.v_min + dv, region.box.u_max + du, region.box.v_max + dv};
    const Eigen::Vector2d least = best->disc.centre.array() - best->disc.radius;
    const Eigen::Vector2d most = best->disc.centre.array() + best->disc.radius;
    if (least.minCoeff() < 0 || most.x() > image.width - 1 || most.y() > image.height - 1) return false;
    candidates.push_back(std::move(*best));
    views.push_back(std::move(found));
    return true;
  }
};

struct FoundAgain::Place {
  Eigen::Vector3d position;
  double cost = 0;                                             // of all views
  std::vector<std::pair<std::size_t, std::size_t>> seen = {};  // picture, its candidate
};

FoundAgain::FoundAgain(const calib::CameraRig& rig, const object_tracking::TargetOptions& target,
                       std::vector<Look> looks, const object_tracking::Volume& volume)
    : rig_(rig), looks_(std::move(looks)), volume_(volume), radius_m_(target.radius_m), views_(rig, target) {
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) rooms_.push_back(std::make_shared<color::RoomColors>());
}

FoundAgain::Picture FoundAgain::picture_of(const object_tracking::TargetView& view) {
  Picture out{.camera = std::size_t(view.index)};
  if (view.table == nullptr || !view.matches->has_pixels()) return out;
  color::RoomColors& room = *rooms_[out.camera];
  room.learn(*view.matches, *view.table, view.image->format, {}, room_samples);
  view.matches->set_room(rooms_[out.camera]);
  const Eigen::Vector3d centre = view.camera->centre();
  const double nearest_m = (centre.cwiseMax(volume_.min).cwiseMin(volume_.max) - centre).norm();
  const double farthest_m = (centre - (volume_.min + volume_.max) / 2).norm() + (volume_.max - volume_.min).norm() / 2;
  const double unit = radius_m_ * view.camera->model.fx();
  const auto& found = finder_.find(*view.matches, {0, 0, view.image->width - 1, view.image->height - 1},
                                   unit / farthest_m, unit / std::max(2 * radius_m_, nearest_m));
  for (std::size_t i = 0; i < std::min(found.size(), most_candidates); ++i)
    out.add(*view.image, {found[i].centre, (found[i].box.u_max - found[i].box.u_min) / 2.0}, size_reach,
            looks_[out.camera]);
  return out;
}

std::vector<FoundAgain::Place> FoundAgain::places_of(const std::vector<Picture>& pictures) const {
  std::vector<Place> out;
  const auto add = [&](const Eigen::Vector3d& position) {
    Place place{.position = position};
    for (std::size_t p = 0; p < pictures.size(); ++p) {
      std::pair<std::size_t, double> best{0, hidden_cost};
      for (const auto& at : costs_at(rig_.cameras[pictures[p].camera], pictures[p].candidates, position, radius_m_, 0))
        if (at.second < best.second) best = at;
      place.cost += best.second;
      if (best.second <= largest_cost) place.seen.emplace_back(p, best.first);
    }
    if (place.seen.size() >= 2) out.push_back(std::move(place));
  };
  for (std::size_t a = 0; a < pictures.size(); ++a)
    for (std::size_t b = a + 1; b < pictures.size(); ++b)
      for (const FoundView& one : pictures[a].views)
        for (const FoundView& other : pictures[b].views)
          if (const auto at = meeting_point(rig_, std::vector{one.view, other.view});
              at && object_tracking::inside(volume_, *at, around_volume_m))
            add(*at);
  std::ranges::stable_sort(out, {}, &Place::cost);
  return out;
}

std::vector<std::vector<FoundView>> FoundAgain::in(const capture::FrameSet& set, bool several) {
  std::vector<Picture> pictures;
  std::vector<const capture::Image*> images;
  for (const object_tracking::TargetView& view : views_.look_at(set)) {
    pictures.push_back(picture_of(view));
    images.push_back(view.image);
  }
  const std::vector<Place> places = places_of(pictures);
  std::vector<const Place*> chosen;
  std::vector<std::vector<FoundView>> out;
  for (const Place& place : places) {
    const auto is_here = [&](const Place* other) {
      return (other->position - place.position).norm() < same_place * radius_m_;
    };
    if (std::ranges::any_of(chosen, is_here)) continue;
    if (!several && !chosen.empty()) {
      if (place.cost < chosen.front()->cost + clear_lead) return {};
      break;
    }
    chosen.push_back(&place);
    std::vector<FoundView>& ball = out.emplace_back();
    for (std::size_t p = 0; p < pictures.size(); ++p) {
      Picture& picture = pictures[p];
      const auto seen = std::ranges::find(place.seen, p, [](const auto& of) { return of.first; });
      if (seen != place.seen.end()) {
        ball.push_back(picture.views[seen->second]);
        continue;
      }
      // Where the others show it, less distinguished from the room.
      const calib::Camera& camera = rig_.cameras[picture.camera];
      const auto at = camera.project_world(place.position);
      if (!at || !camera.contains({at->px})) continue;
      Picture there{.camera = picture.camera};
      if (there.add(*images[p], {at->px, radius_px_of(camera, place.position, radius_m_)}, 0, looks_[picture.camera]))
        for (const auto& [i, cost] : costs_at(camera, there.candidates, place.position, radius_m_, 0))
          if (cost <= largest_cost) ball.push_back(there.views[i]);
    }
  }
  return out;
}

}  // namespace huetrack::color_teaching
