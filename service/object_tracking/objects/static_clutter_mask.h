// Masks static clutter: pixels of the target's colour that never move. In a room that shares the colour, views are
// sampled every 0.5 s; pixels that matched in three of the last four samples, or that match again after they did not
// (noise at the colour's limits), match nothing while they show their usual values: an object in front of furniture of
// its colour is seen. Pixels under a tracked object keep their state, so that a resting object stays tracked, unless
// its surroundings have the colour, too.
//
// A room shares the colour if one view shows more of it than all objects could cover, or more regions of it than a
// search looks at; then all views learn. If so at the first set, everything but discs of an object's size is clutter
// until it moves. Targets with several objects learn in any room: what rests for 2 s and is not tracked is clutter.
// Otherwise the mask is empty and costs nothing.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "color/color_region.h"
#include "color/color_window.h"
#include "color/room_colors.h"
#include "object_tracking/object_estimate.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"

namespace huetrack::objects {

struct ClutterHistoryTuning {
  int kept_samples = 12;      // samples in which a pixel that matches again counts as static: 6 s
  double period_s = 0.5;      // between samples of a view
  double shared_above = 2.5;  // times the share that the objects could cover: more is the room's; radii may be wrong
};
inline constexpr ClutterHistoryTuning clutter_history{};

// thread-compatible; one per target.
class StaticClutterMask {
 public:
  // count: of objects, TargetOptions::count
  StaticClutterMask(std::size_t cameras, int count) : count_(count), cameras_(cameras) {}

  // Range of an object's radius over the volume, in this camera.
  void set_sizes(std::size_t camera, double smallest_px, double largest_px, calib::ImageSize size);
  // Before the views of a set are used otherwise: follows the light. Samples all views of the first set.
  void look(const std::vector<object_tracking::TargetView>& views, capture::Timestamp set_at);
  // After that: samples one view after the other, for the next sets. tracked: the objects in this set, and in a room
  // that shares the colour their predicted places (add_expected()).
  void learn(const std::vector<object_tracking::TargetView>& views, std::span<const object_tracking::Sighting> tracked,
             capture::Timestamp set_at);
  void forget(std::size_t camera);  // it was moved
  // This view shows more regions than a search looks at (ClutterMap::is_crowded()): the room shares the colour.
  void note_crowded(std::size_t camera) { cameras_[camera].is_crowded = true; }

  // The room may show the colour in this camera: moving regions may be noise at the mask's edges.
  bool is_shared(std::size_t camera) const { return cameras_[camera].is_learning; }
  bool is_room_shared() const { return is_room_shared_; }  // some view shows more of the colour than the objects could
  // Masked pixels are near enough to cut a region of this radius there.
  bool may_clip(std::size_t camera, const Eigen::Vector2d& px, double radius_px) const;
  // Density of clutter, per px^2 and frame set, at a place that an object may have uncovered: share of the disc of
  // radius_px behind which the room has never been seen, times the masked share of its surroundings, per disc area.
  double uncovered_density(std::size_t camera, const Eigen::Vector2d& px, double radius_px) const;
  // Sets is_cut, and adds the possible error of the centroid to the covariance.
  void mark_clipped(std::vector<object_tracking::Sighting>& sightings) const;
  const std::vector<object_tracking::ColorShare>& shares() const { return shares_; }  // per camera of the rig

 private:
  static constexpr int samples = 4;  // layout: of mostly(), three of which must match: 2 s
  static constexpr int kept_samples = clutter_history.kept_samples;
  struct Tile {
    std::array<std::uint64_t, kept_samples> matched{};  // per sample, a ring
    std::uint64_t still = 0;
    std::uint64_t seen = 0;  // in some sample with no object in front
    bool is_listed = false;
    // Of masked pixels, in the light of the last sample. known: which; changed: differed in the last two samples.
    color::UsualPixels usual{};
    std::uint64_t known = 0;
    std::array<std::uint64_t, 2> changed{};
  };
  struct Probe {  // a masked pixel, by which the light is followed
    int u, v;
    const std::array<std::uint8_t, 3>* usual;
  };
  struct PerCamera {
    std::vector<Tile> tiles;            // empty until the room shares the colour
    std::vector<std::uint32_t> listed;  // tiles with any match
    int sampled = 0;
    int stride = 0;                                              // tiles in a row
    double smallest_px = 0, largest_px = 0;                      // radius of an object
    std::vector<object_tracking::Sighting> may_be_objects = {};  // at the first set
    color::RegionFinder finder = {};
    color::DiscFinder disc_finder = {};
    std::shared_ptr<color::RoomColors> colors = {};  // while the room shares the colour
    std::vector<Probe> probes = {};
    color::LightChange light = {};  // since the last sample
    bool is_above = false;          // more of the colour than the objects could cover
    bool is_crowded = false;        // note_crowded()
    bool is_learning = false;
  };
  void measure(const object_tracking::TargetView& view);
  void sample(const object_tracking::TargetView& view, std::span<const object_tracking::Sighting> tracked);
  void learn_pixels(const object_tracking::TargetView& view, PerCamera& camera,
                    std::span<const object_tracking::Sighting> tracked);
  std::uint64_t covered_in(color::TileAt tile) const;  // by covering_
  void cover(const object_tracking::TargetView& view, PerCamera& camera,
             std::span<const object_tracking::Sighting> tracked);  // fills covering_
  void leave_out(const object_tracking::TargetView& view, PerCamera& camera);
  void learn_usual(const object_tracking::TargetView& view, const PerCamera& camera, color::TileAt where,
                   std::uint64_t masked, Tile& tile);
  void choose_probes(PerCamera& camera, std::size_t known);
  void follow_light(const object_tracking::TargetView& view, PerCamera& camera);
  void learn_colors(const object_tracking::TargetView& view, PerCamera& camera);
  void find_what_may_be_objects(const object_tracking::TargetView& view, PerCamera& camera);
  void describe(const object_tracking::TargetView& view, const PerCamera& camera);

  int count_;
  std::vector<PerCamera> cameras_;
  std::vector<object_tracking::ColorShare> shares_{cameras_.size()};
  std::vector<color::PixelAt> hits_;  // of the last measure(); hits_px_ apart
  int hits_px_ = 0;
  std::vector<object_tracking::Sighting> covering_;  // work space: objects in front of the room
  std::vector<color::Disc> discs_;                   // work space: covering_
  std::vector<std::uint32_t> open_;                  // work space: tiles of a patch
  std::vector<char> is_visited_;                     // work space: per tile
  std::vector<std::uint64_t> masked_;                // work space: per tile
  std::vector<float> differences_;                   // work space: of probes
  bool is_room_shared_ = false;
  std::size_t next_ = 0;
  std::optional<capture::Timestamp> last_at_ = {};
};

// Radius about a place within which regions count as its clutter, in radii of the object. A room that shares the colour
// has clutter everywhere, so only regions at the place itself count. In other rooms this would count an object at rest
// as clutter.
inline double near_radii(const StaticClutterMask& still) {
  return still.is_room_shared() ? 1 : object_tracking::sighting_tuning.extent_radii;
}

}  // namespace huetrack::objects
