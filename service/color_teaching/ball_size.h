// How large a ball is, by calibrated cameras that see it: its outline in pixels and its distance give the radius in
// every view, and views of many moments vote. Pure functions.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calib/model/camera_rig.h"
#include "color_teaching/hsi_image.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::color_teaching {

struct ColoredRegion {
  std::size_t camera = 0;  // in the rig
  MaskRegion region;
  // Of one picture, whose regions do not overlap.
  bool is_same_as(const ColoredRegion& other) const {
    return camera == other.camera && region.centre == other.region.centre;
  }
};

// One ball at one moment, in two views or more. The pictures are whole, one slot per camera of the rig.
struct BallMoment {
  std::vector<const capture::Image*> pictures;
  std::vector<ColoredRegion> views;
};

struct RadiusProposal {
  std::optional<double> radius_m = {};  // nullopt: it cannot be told
  // Standard deviation, as far as the rig's own scale is right: a rig that is 3 % too large has every ball so.
  double sigma_m = 0;
  // By coloured regions of one moment alone: a hand or a shade may have hidden a part in all views.
  bool is_rough = false;
  std::size_t moments = 0, cameras = 0;  // that voted
  std::string why_not = {};              // it cannot be told, for people; empty: it can
};

// Do this proposal and a radius that somebody has said contradict each other, by more than both are usually off?
bool differs_clearly(const RadiusProposal& proposal, double radius_m);

// The ball that regions of one moment are of, where exactly one of about this radius explains them; otherwise none.
// candidates: of all cameras, in any order.
std::vector<ColoredRegion> one_ball_of(const calib::CameraRig& rig, std::span<const ColoredRegion> candidates,
                                       const object_tracking::Volume& volume, double about_m);

// All of them, none of which shares a region with another one: those that most views show count first. Rays of
// different balls may meet, too: what is found is of that colour and that size, and need not be one ball.
std::vector<std::vector<ColoredRegion>> balls_of(const calib::CameraRig& rig, std::span<const ColoredRegion> candidates,
                                                 const object_tracking::Volume& volume, double about_m);

// By regions alone, which are off by what their thresholds leave of the edge. nullopt: less than two views, or views
// that are no ball's.
std::optional<double> radius_of_regions(const calib::CameraRig& rig, std::span<const ColoredRegion> views);

// Is it as wide as it is high, and as full as a disc?
bool has_disc_shape(const MaskRegion& region);

// moments: the first one is the one somebody has pointed into. names: of the cameras.
RadiusProposal voted_radius(const calib::CameraRig& rig, std::span<const BallMoment> moments);

}  // namespace huetrack::color_teaching
