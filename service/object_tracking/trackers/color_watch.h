// Whether the cameras still show the object in the colour that it was taught with. Exposure and white balance move all
// colours, and an object that leaves its range is lost; this warns per camera before that.
//
// Measured are the object's pixels, not the matching ones: the inner part of its disc, whatever its colour; the median
// and the spread around it, which outliers on less than half of the disc (a highlight, a hand) do not move. Only in
// views that see the whole object while another view confirms its position.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "calib/model/camera_rig.h"
#include "capture/frames/frame.h"
#include "color/color_model.h"
#include "object_tracking/object_estimate.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::object_trackers {

enum class ColorAxis : std::uint8_t { hue, saturation, intensity };
using PerColorAxis = std::array<double, 3>;  // by ColorAxis; hue in degrees, the others 0..1

// Of an object's pixels in one image. Hue is relative to the middle of the taught range, -180..180; NaN where too few
// pixels have one.
struct SeenColor {
  PerColorAxis median{};
  PerColorAxis below{}, above{};  // >= 0; distance from the median to the lower and the upper sixth of the pixels
};

// An end of the range in force that the object's colour is near to.
struct NearEnd {
  ColorAxis axis = ColorAxis::hue;
  bool is_upper = false;
  double left = 0;  // from the object's median to that end; < 0: beyond it
};

struct ColorHealth {
  std::optional<SeenColor> seen;    // smoothed over about a second of good views; nullopt: never yet
  capture::Timestamp seen_at;       // the last time
  std::optional<NearEnd> near_end;  // a warning: the camera loses the object if its colour moves on; nullopt: none
  PerColorAxis followed{};          // shift of the range in force from the taught one (color_follower.h)
};

// A range on one axis. Where the axis itself ends, a range has no end.
struct AxisRange {
  double min = 0, max = 0;
  bool has_min = true, has_max = true;
};
AxisRange axis_range(const color::HsiRange& range, ColorAxis axis, double hue_origin_deg);
double middle_hue_deg(const color::HsiRange& range);     // [0, 360)
double degrees_between(double from_deg, double to_deg);  // counterclockwise, -180..180

// What noise, JPEG, and light within a second or two change.
struct ColorNoiseTuning {
  double hue_deg = 3.5;
  double share = 0.03;  // of saturation and of intensity
};
inline constexpr ColorNoiseTuning color_noise_tuning{};
inline constexpr PerColorAxis color_noise{color_noise_tuning.hue_deg, color_noise_tuning.share,
                                          color_noise_tuning.share};

// Of the pixels within inner_px of px; nullopt: not all inside of the image.
std::optional<SeenColor> color_inside(const capture::Image& image, const Eigen::Vector2f& px, float inner_px,
                                      double hue_origin_deg);

// thread-compatible; one per target. update() does not allocate.
class ColorWatch {
 public:
  ColorWatch(const calib::CameraRig& rig, const object_tracking::TargetOptions& target);

  // After the tracker's update with this set. in_force: the ranges that it used, per camera of the rig.
  void update(const capture::FrameSet& set, const object_tracking::ObjectEstimate& estimate,
              std::span<const color::HsiRange> in_force);

  const ColorHealth& in(std::size_t camera) const { return cameras_[camera].health; }
  std::size_t camera_count() const { return cameras_.size(); }
  std::uint64_t change_count() const { return changes_; }  // how often a near_end came, went or became another one

 private:
  struct PerCamera {
    double hue_origin_deg = 0;
    ColorHealth health = {};
    int looks = 0;  // one after the other
  };
  void judge(PerCamera& camera, const color::HsiRange& in_force);

  std::vector<PerCamera> cameras_;
  double fastest_m_s_;
  std::uint64_t sets_ = 0, changes_ = 0;
};

}  // namespace huetrack::object_trackers
