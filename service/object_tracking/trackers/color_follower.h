// `color: adapt: true`: the range that a camera looks for follows the object's colour (ColorWatch) when exposure or
// white balance move it. A range only moves, as far as the object needs to lie well inside, and stays near the taught
// one:
//   shift = the one nearest to 0 with which the ends are twice as far from the object's median as where ColorWatch
//   warns
// So nothing moves while the object is well inside, and the range comes back with the light. Background is never
// learnt: what counts is what ColorWatch measures, in a view that sees the object whole, while another one confirms
// where it is. When the object is lost for long, what was taught is in force again.
//
// A new table of colours takes some 5 ms, which the road of the frames has not got: it is made in pieces, one per set,
// one table at a time, and is in force when it is done. The same sets give the same ranges.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "calib/model/camera_rig.h"
#include "capture/frame.h"
#include "color/color_model.h"
#include "object_tracking/object_estimate.h"
#include "object_tracking/target_views.h"
#include "object_tracking/trackers/color_watch.h"

namespace huetrack::object_trackers {

struct ColorFollowerTuning {
  double furthest_hue_deg = 20;       // white balance of a webcam from daylight to lamp light; beyond is another colour
  double furthest_saturation = 0.15;  // likewise
  double furthest_intensity = 0.2;    // likewise
  double least_saturation = 0.15;     // a range below it would hold greys
  double least_step_hue_deg = 1.5;    // smaller changes are not worth a table
  double least_step_share = 0.015;    // likewise, of saturation and of intensity
  double largest_step_hue_deg = 6;    // of one table: some degrees in a second
  double largest_step_saturation = 0.06;
  double largest_step_intensity = 0.07;
  double longest_unseen_s = 1;    // what was seen before does not say what the colour is now
  double forgotten_after_s = 10;  // of a lost object, the taught range is used again
  double well_inside = 2;    // where a range moves to: ends this much further from the median than ColorWatch warns at
  double just_inside = 1.3;  // from where on it moves, likewise
  double steps_back = 4;     // least steps by which a range that is off too far goes back
};
inline constexpr ColorFollowerTuning color_follower{};
inline constexpr PerColorAxis furthest_followed{color_follower.furthest_hue_deg, color_follower.furthest_saturation,
                                                color_follower.furthest_intensity};

// The range moved by so much: the same width, but where the axis itself ends.
color::HsiRange moved(const color::HsiRange& range, const PerColorAxis& shift);

// By how much the taught range is to move for an object that looks like that.
PerColorAxis wanted_shift(const color::HsiRange& taught, const SeenColor& seen);

// thread-compatible; one per target.
class ColorFollower {
 public:
  ColorFollower(const calib::CameraRig& rig, const object_tracking::TargetOptions& target);

  // After watch.look() at the same set; changes what `views` will match from the next set on.
  void follow(const capture::FrameSet& set, const object_tracking::ObjectEstimate& estimate, const ColorWatch& watch,
              object_tracking::TargetViews& views);

  std::span<const color::HsiRange> in_force() const { return in_force_; }  // per camera of the rig
  const PerColorAxis& shift(std::size_t camera) const { return cameras_[camera].shift; }

 private:
  struct PerCamera {
    color::HsiRange taught;
    PerColorAxis shift{};                                        // of the range in force
    std::shared_ptr<const color::ColorTable> taught_table = {};  // once another one is in force
  };
  struct Building {
    std::size_t camera;
    PerColorAxis shift;
    color::HsiRange color;
    color::ColorTableBuilder builder;
  };
  void begin_next(const capture::FrameSet& set, const ColorWatch& watch);
  void put_in_force(std::size_t camera, const PerColorAxis& shift, const color::HsiRange& color,
                    std::shared_ptr<const color::ColorTable> table, object_tracking::TargetViews& views);
  void forget(object_tracking::TargetViews& views);

  std::vector<PerCamera> cameras_;
  std::vector<color::HsiRange> in_force_;
  std::optional<Building> building_;
  std::optional<capture::Timestamp> last_tracking_;
};

}  // namespace huetrack::object_trackers
