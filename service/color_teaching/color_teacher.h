// Teaching a colour: somebody points at the object in some of the views; out come its region, the ranges of its colour
// in each view, how well it stands out from the rest of each picture, and where it probably is in the other views.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "calib/model/camera_rig.h"
#include "capture/frames/frame.h"
#include "color_teaching/ball_size.h"
#include "color_teaching/hsi_image.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::color_teaching {

struct TeachPoint {
  int camera = 0;            // in the rig
  Eigen::Vector2d px{0, 0};  // raw pixels
};

struct TeachRequestOptions {
  std::vector<TeachPoint> points{};           // at most one per camera counts: the last
  object_tracking::IgnoredRegions ignored{};  // nothing matches in there
  int wider = 0;                              // steps; negative: narrower
  bool accepts_suggestions = false;           // learn(): in the other cameras, what is suggested counts as pointed at
};

// What was learnt of one camera.
struct TaughtView {
  bool pointed = false;              // somebody pointed into it, and there is a region
  std::string problem;               // why nothing could be learnt where somebody pointed; what to do
  std::optional<MaskRegion> region;  // the object's; where nobody pointed: the suggested one
  color::HsiRange color;             // where nobody pointed: as in the first view that was
  double object_share = 0;          // 0..1, of the region's pixels: how many have the colour; only where it was pointed
  double background_share = 0;      // 0..1, of the pixels away from the object: how many have the colour
  std::optional<MaskRegion> patch;  // the largest connected part of them, when it could be taken for the object
  std::string verdict;              // one sentence for people
  // Where else it was seen, at other moments, and others like it: the pixels of each. The ranges hold them, too.
  std::vector<std::vector<color::Hsi>> elsewhere;
  std::vector<MaskRegion> alike;  // of several objects: others in this picture, which are no background
  // Where a patch could be taken for the object: ranges that are narrower by these steps would leave so much of both.
  struct Narrower {
    int wider = 0;  // TeachRequestOptions::wider
    color::HsiRange color;
    double object_share = 0, background_share = 0;
  };
  std::optional<Narrower> narrower;
  PixelMask object;  // the region's pixels; empty where nobody pointed
  PixelMask mask;    // which pixels have the colour; empty where there is no picture
};

// Below this share of the object that has the colour, people are warned.
inline constexpr double least_object_share = 0.5;

struct Taught {
  std::vector<TaughtView> views;  // per camera of the rig
  bool any() const;               // something was learnt
};

// thread-compatible. Holds converted copies of the pictures; the frames may go.
class ColorTeacher {
 public:
  // Moments by which the object's size is told, the first included, and what they may take of memory.
  static constexpr std::size_t most_moments = 32, most_moment_bytes = 128u << 20;

  // set: one slot per camera of the rig; cameras without a frame cannot be pointed into.
  // elsewhen: per camera, what it shows at other moments; with some of them it is known what moves. May be empty.
  ColorTeacher(const calib::CameraRig& rig, const capture::FrameSet& set,
               const std::vector<std::vector<capture::Image>>& elsewhen = {});

  const calib::CameraRig& rig() const { return rig_; }

  // What the same cameras show at another moment: the object's size is told by many of them. Those beyond the limits
  // above are not taken. Returns whether more are of use.
  bool add_moment(const capture::FrameSet& set);

  // Which pixels move, by the moments that were added: as by `elsewhen`, where that was empty. It takes some tenths of
  // a second, and nothing is done where few moments have come since it was last done.
  void learn_motion();

  // volume: where a suggested object may be
  Taught teach(const TeachRequestOptions& request, const object_tracking::Volume& volume) const;

  // What was taught, with ranges that hold the object elsewhere, too: in other light at other moments, as far as it is
  // found there by what was learnt, its own size and two views or more. several: it is one of several of its colour,
  // which are no background, and are learnt from as well.
  Taught held_elsewhere(Taught taught, const TeachRequestOptions& request, const object_tracking::Volume& volume,
                        bool several) const;

  // How large the object is, by where somebody pointed, what is suggested, and every moment at which one ball of about
  // that size and of the learnt colour is seen.
  RadiusProposal radius(const Taught& taught, const object_tracking::IgnoredRegions& ignored,
                        const object_tracking::Volume& volume) const;

  // Of the other targets, those whose colour at least half of the object has in some view: by colour they are the same.
  std::vector<std::string> namesakes(const Taught& taught, const std::vector<object_tracking::TargetOptions>& targets,
                                     const std::string& own_name) const;

 private:
  // One more place where the object was seen, or another one like it.
  struct SeenElsewhere {
    std::size_t moment;
    ColoredRegion view;
    std::vector<color::Hsi> pixels;
  };
  std::vector<ColoredRegion> ball_of(const Taught& taught) const;  // at the first moment
  PixelMask background_of(const TaughtView& view, const std::vector<color::PixelBox>& ignored) const;
  std::vector<SeenElsewhere> seen_elsewhere(const Taught& taught, const TeachRequestOptions& request,
                                            const object_tracking::Volume& volume, bool several) const;
  void judge_all(Taught& taught, const TeachRequestOptions& request) const;
  const std::vector<color::PixelBox>& ignored_in(const TeachRequestOptions& request, std::size_t camera) const;
  void judge(TaughtView& view, std::size_t camera, const std::string& color_of, int wider,
             const std::vector<color::PixelBox>& ignored) const;
  // Of the ranges of a view whose background has a patch of the colour; the least narrow that leaves none of it.
  std::optional<TaughtView::Narrower> narrower(const TaughtView& view, std::size_t camera, int wider,
                                               const std::vector<color::PixelBox>& ignored) const;
  void suggest(std::vector<TaughtView>& views, const object_tracking::Volume& volume) const;

  calib::CameraRig rig_;
  std::vector<std::optional<HsiImage>> images_;
  std::vector<std::optional<PixelMask>> moving_;  // per camera
  bool knows_elsewhen_;
  std::size_t moments_of_motion_ = 0;       // so many of moments_ have told what moves
  double moved_m_ = 0;                      // how far an object may move between the pictures
  std::vector<capture::FrameSet> moments_;  // copies; the first is that of images_
};

// Cameras into which nobody pointed, though the object probably is there.
std::vector<std::string> unconfirmed(const Taught& taught, const calib::CameraRig& rig);

// Why it must not be saved: nothing was learnt, or what was learnt matches nothing of the object. Empty: it may be.
std::string why_useless(const Taught& taught, const calib::CameraRig& rig);

// The target with what was learnt: `color` is that of the first view that was pointed into, `camera_colors` those of
// all of them where they differ. Cameras into which nobody pointed keep their overrides.
object_tracking::TargetOptions with_taught_color(object_tracking::TargetOptions target, const calib::CameraRig& rig,
                                                 const Taught& taught);

}  // namespace huetrack::color_teaching
