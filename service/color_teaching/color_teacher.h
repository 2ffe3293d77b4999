// Learns a target's colour from points on the object in some views: its region, its colour ranges per view, how well it
// stands out from the rest of each picture, and where it probably is in the other views. Model: design.md.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "calib/model/camera_rig.h"
#include "capture/frames/frame.h"
#include "color_teaching/ball_size.h"
#include "color_teaching/found_again.h"
#include "color_teaching/hsi_image.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::color_teaching {

struct TeachPoint {
  int camera = 0;            // in the rig
  Eigen::Vector2d px{0, 0};  // raw pixels
};

struct TeachRequestOptions {
  std::vector<TeachPoint> points{};           // of several in one camera the last counts
  object_tracking::IgnoredRegions ignored{};  // nothing matches in there
  int wider = 0;                              // steps; negative: narrower
  bool accepts_suggestions = false;           // suggestions in the other cameras count as pointed at
  std::optional<double> radius_m{};           // of the object, if it is known
  bool is_tried = false;                      // on a recording, which decides the width
};

struct TaughtView {
  bool pointed = false;              // it was learnt from: by a point, an accepted suggestion, or at other moments
  std::string problem;               // why nothing could be learnt from the point, and what to do
  std::optional<MaskRegion> region;  // the object's; without a point the suggested one
  color::HsiRange color;             // without a point that of the first view with one
  double object_share = 0;           // of the region's pixels that match, 0..1; only with a point
  double background_share = 0;       // of the pixels away from the object that match, 0..1
  std::optional<MaskRegion> patch;   // the largest connected part of those, if it could be taken for the object
  std::string verdict;               // one sentence for the user
  std::vector<std::vector<color::Hsi>> elsewhere;  // pixels per place where it, or another object like it, was seen
  std::vector<MaskRegion> alike;                   // of several objects: the others in this picture; no background
  // With a patch: ranges narrower by steps, and the shares that would then match.
  struct Narrower {
    int wider = 0;  // TeachRequestOptions::wider
    color::HsiRange color;
    double object_share = 0, background_share = 0;
  };
  std::optional<Narrower> narrower;
  PixelMask object;  // the region's pixels; empty without a point
  PixelMask mask;    // pixels that match; empty without a picture
};

// A smaller share of the object that matches is a warning.
inline constexpr double least_object_share = 0.5;

struct Taught {
  std::vector<TaughtView> views;  // per camera of the rig
  // Other moments at which it alone was found (ColorTeacher::held_elsewhere).
  struct Moment {
    std::size_t index = 0;
    std::vector<ColoredRegion> views;
  };
  std::vector<Moment> moments;
  bool any() const { return std::ranges::any_of(views, &TaughtView::pointed); }  // something was learnt
};

// thread-compatible. Keeps converted copies of the pictures.
class ColorTeacher {
 public:
  // Moments that it keeps, the first included, and the memory that they may take.
  static constexpr std::size_t most_moments = 32, most_moment_bytes = 128u << 20;

  // set: one slot per camera of the rig; a camera without a frame cannot be pointed into.
  // others: per camera, its pictures of other moments, which show what moves. May be empty.
  // has_poses: false: of the rig only names and picture sizes are known. Then each picture teaches by itself: nothing
  // is suggested in another one, and no size is measured.
  ColorTeacher(const calib::CameraRig& rig, const capture::FrameSet& set,
               const std::vector<std::vector<capture::Image>>& others = {}, bool has_poses = true);

  const calib::CameraRig& rig() const { return rig_; }

  // Another moment of the same cameras, by which the object's size is measured; ignored beyond the limits above.
  // Returns whether more are of use.
  bool add_moment(const capture::FrameSet& set);

  // Finds out what moves from the added moments, if `others` was empty. Takes some tenths of a second; does nothing
  // until clearly more moments have come.
  void learn_motion();

  // volume: where a suggested object may be
  Taught teach(const TeachRequestOptions& request, const object_tracking::Volume& volume) const;

  // `taught` with ranges that hold the object in other light, too: at other moments at which two views or more show it,
  // in its size. With accepted suggestions also of views that show it only then. several: the target has several
  // objects; the others are learnt from as well.
  Taught held_elsewhere(Taught taught, const TeachRequestOptions& request, const object_tracking::Volume& volume,
                        bool several) const;

  // `taught` with the ranges of another width (request.wider), from the same pixels.
  Taught fitted(Taught taught, const TeachRequestOptions& request) const;

  // The object's size, from the points, the suggestions, and the other moments at which it was found.
  RadiusProposal radius(const Taught& taught) const;

  // Names of other targets whose ranges hold half of the object or more in some view: the trackers would confuse them.
  std::vector<std::string> namesakes(const Taught& taught, const std::vector<object_tracking::TargetOptions>& targets,
                                     const std::string& own_name) const;

 private:
  std::vector<ColoredRegion> ball_of(const Taught& taught) const;  // at the first moment
  PixelMask background_of(const TaughtView& view, const std::vector<color::PixelBox>& ignored) const;
  std::optional<FoundAgain> search_of(const Taught& taught, const TeachRequestOptions& request,
                                      const object_tracking::Volume& volume) const;
  void judge_all(Taught& taught, const TeachRequestOptions& request) const;
  const std::vector<color::PixelBox>& ignored_in(const TeachRequestOptions& request, std::size_t camera) const;
  void judge(TaughtView& view, std::size_t camera, const std::string& color_of, int wider,
             const std::vector<color::PixelBox>& ignored) const;
  // For a view with a patch: the widest ranges without it.
  std::optional<TaughtView::Narrower> narrower(const TaughtView& view, std::size_t camera, int wider,
                                               const std::vector<color::PixelBox>& ignored) const;
  void suggest(std::vector<TaughtView>& views, const TeachRequestOptions& request,
               const object_tracking::Volume& volume) const;

  calib::CameraRig rig_;
  bool has_poses_;
  std::vector<std::optional<HsiImage>> images_;
  std::vector<std::optional<PixelMask>> moving_;  // per camera
  bool has_others_;
  std::size_t moments_of_motion_ = 0;       // moments that learn_motion() has used
  double moved_m_ = 0;                      // that the object may have moved between the pictures
  std::vector<capture::FrameSet> moments_;  // copies; the first is that of images_
};

// Names of cameras without a point, in which the object probably is.
std::vector<std::string> unconfirmed(const Taught& taught, const calib::CameraRig& rig);

// Why it must not be saved: nothing was learnt, or nothing of the object matches. Empty: it may be saved.
std::string why_useless(const Taught& taught, const calib::CameraRig& rig);

// The target with the learnt colours: `color` of the first view with a point, `camera_colors` of all of them if they
// differ. Cameras without a point keep their own.
object_tracking::TargetOptions with_taught_color(object_tracking::TargetOptions target, const calib::CameraRig& rig,
                                                 const Taught& taught);

}  // namespace huetrack::color_teaching
