// What has the target's colour and never moves: furniture. In a room that shares the colour, views are sampled now and
// then, and pixels that have matched in nearly all of the last samples match nothing until they change: the scene's,
// not an object's. What lies under an object that is tracked is left as it was, so that an object that rests where it
// was tracked stays tracked; but not where the colour is all around it, for there nobody can tell it from the room. A
// room that does not share the colour costs nothing and changes nothing.
//
// A room shares the colour where one view shows more of it than all objects could cover; then all views learn. When
// that is so at the first set there is no past to ask: all that is there then counts as furniture until it moves, but
// for what is a disc of an object's size. What hardly has the colour matches now and then, as noise has it: pixels that
// have matched, have not, and match again are furniture, too. Where a target is several objects, what stands still for
// two seconds and is none of those that are tracked is furniture in any room.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "color/color_region.h"
#include "color/color_window.h"
#include "object_tracking/object_estimate.h"
#include "object_tracking/sighting.h"
#include "object_tracking/target_views.h"

namespace huetrack::objects {

struct ClutterHistoryTuning {
  int kept_samples = 12;  // samples in which a pixel that matches again counts as static: 6 s
};
inline constexpr ClutterHistoryTuning clutter_history{};

// thread-compatible; one per target.
class StillColor {
 public:
  // count: of objects, TargetOptions::count
  StillColor(std::size_t cameras, int count) : count_(count), cameras_(cameras) {}

  // Radius of an object anywhere in the volume, in this camera.
  void set_sizes(std::size_t camera, double smallest_px, double largest_px, calib::ImageSize size);
  // Before the views of a set are looked at otherwise. tracked: where objects were seen in the last set, and in a room
  // that shares the colour where they are expected now (add_expected()): a fast one is not where it was. Takes one view
  // after the other, each about once in half a second; all of them at first.
  void look(const std::vector<object_tracking::TargetView>& views, std::span<const object_tracking::Sighting> tracked,
            capture::Timestamp set_at);
  void forget(std::size_t camera);  // it stands elsewhere
  // What was found was of the room, though it shows little of the colour: from now on as in a room that shares it, as
  // at its first set.
  void doubt(capture::Timestamp set_at);

  // The room may show the colour in this camera: what moves in it may be noise at the edges of what is left out.
  bool is_shared(std::size_t camera) const { return cameras_[camera].is_learning; }
  // It was found to do so at the first set, a moment ago: what stands still and what moves is only being learnt, and
  // what looks like an object counts as one that may be.
  bool is_starting(capture::Timestamp set_at) const;
  bool is_doubted() const { return is_doubted_; }
  bool is_room_shared() const { return is_room_shared_; }  // some view shows more of it than objects could cover
  // Something that is left out lies so near to this pixel that a region of this radius there may be cut by it.
  bool may_cut(std::size_t camera, const Eigen::Vector2d& px, double radius_px) const;
  // Which of them may be cut so, and by how much their middles may be off because of it.
  void mark_cut(std::vector<object_tracking::Sighting>& sightings) const;
  const std::vector<object_tracking::ColorShare>& shares() const { return shares_; }  // per camera of the rig

 private:
  static constexpr int samples = 4;  // layout: of mostly(), three of which must match: 2 s
  static constexpr int kept_samples = clutter_history.kept_samples;
  struct Tile {
    std::array<std::uint64_t, kept_samples> matched{};  // the last ones, a ring
    std::uint64_t still = 0;
    bool is_listed = false;
  };
  struct PerCamera {
    std::vector<Tile> tiles;            // once the room was found to share the colour
    std::vector<std::uint32_t> listed;  // tiles of which anything is known
    int sampled = 0;
    int stride = 0;                                              // tiles in a row
    double smallest_px = 0, largest_px = 0;                      // radius of an object
    std::vector<object_tracking::Sighting> may_be_objects = {};  // at the first set
    color::RegionFinder finder = {};
    bool is_above = false;  // more of the colour than all objects could cover
    bool is_learning = false;
  };
  void measure(const object_tracking::TargetView& view);
  void sample(const object_tracking::TargetView& view, std::span<const object_tracking::Sighting> tracked);
  void learn(const object_tracking::TargetView& view, PerCamera& camera,
             std::span<const object_tracking::Sighting> tracked);
  void leave_out(const object_tracking::TargetView& view, PerCamera& camera);
  void find_what_may_be_objects(const object_tracking::TargetView& view, PerCamera& camera);
  void describe(const object_tracking::TargetView& view, const PerCamera& camera);

  int count_;
  std::vector<PerCamera> cameras_;
  std::vector<object_tracking::ColorShare> shares_{cameras_.size()};
  std::vector<color::PixelAt> hits_;  // of the view that was measured last, so far apart
  int hits_px_ = 0;
  std::vector<object_tracking::Sighting> covering_;  // work space: what covers the room in a view
  std::vector<std::uint32_t> open_;                  // work space: tiles of a patch
  std::vector<char> is_told_;                        // work space: per tile
  bool is_room_shared_ = false, is_doubted_ = false;
  std::size_t next_ = 0;
  std::optional<capture::Timestamp> last_at_ = {}, first_at_ = {};
};

}  // namespace huetrack::objects
