// `color: adapt: true`: a camera's colour range follows the object's colour (ColorWatch) when exposure or white balance
// move it. The range is only shifted, no further than needed, and within limits around the taught one:
//   shift = the one nearest to 0 with which both ends are twice as far from the object's median as ColorWatch warns at
// So it stays while the object is well inside, and comes back with the light. The background is never learnt:
// ColorWatch measures only a view that sees the whole object while another one confirms its position. When the object
// is lost for long, the taught range is used again.
//
// A colour table takes some 5 ms. It is built in pieces, one per set, one table at a time, so that no set is delayed.
// The same sets give the same ranges.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "calib/model/camera_rig.h"
#include "capture/frames/frame.h"
#include "color/color_model.h"
#include "object_tracking/object_estimate.h"
#include "object_tracking/target_views.h"
#include "object_tracking/trackers/color_watch.h"

namespace huetrack::object_trackers {

struct ColorFollowerTuning {
  double furthest_noises = 6;      // 21 degrees of hue: a webcam from daylight to lamp light; beyond is another colour
  double least_saturation = 0.15;  // a range below it would hold greys
  double longest_unseen_s = 1;     // older measurements of the colour are not used
  double forgotten_after_s = 10;   // of a lost object, the taught range is used again
  double well_inside = 2;    // where a range moves to: ends this much further from the median than ColorWatch warns at
  double just_inside = 1.5;  // from where on it moves, likewise; a warning ends there
};
inline constexpr ColorFollowerTuning color_follower{};
inline constexpr PerColorAxis furthest_followed{color_follower.furthest_noises * color_noise[0],
                                                color_follower.furthest_noises* color_noise[1],
                                                color_follower.furthest_noises* color_noise[2]};

// The range shifted by so much, of the same width; clipped where the axis ends.
color::HsiRange shifted(const color::HsiRange& range, const PerColorAxis& shift);

// The shift of the taught range that an object of this colour needs.
PerColorAxis wanted_shift(const color::HsiRange& taught, const SeenColor& seen);

// thread-compatible; one per target.
class ColorFollower {
 public:
  ColorFollower(const calib::CameraRig& rig, const object_tracking::TargetOptions& target);

  // After watch.update() with the same set; changes what `views` match from the next set on.
  void follow(const capture::FrameSet& set, const object_tracking::ObjectEstimate& estimate, const ColorWatch& watch,
              object_tracking::TargetViews& views);

  std::span<const color::HsiRange> in_force() const { return in_force_; }  // per camera of the rig
  const PerColorAxis& shift(std::size_t camera) const { return cameras_[camera].shift; }

 private:
  struct PerCamera {
    color::HsiRange taught;
    PerColorAxis shift{};                                        // of the range in force
    std::shared_ptr<const color::ColorTable> taught_table = {};  // while another one is in force
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
