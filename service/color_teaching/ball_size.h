// Measures a ball's radius with calibrated cameras: its outline and its distance give the radius in every view, and the
// views of many moments vote. Pure functions. Model: design.md, "Size".
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
};

// One ball at one moment, in two views or more. The pictures are whole, one slot per camera of the rig.
struct BallMoment {
  std::vector<const capture::Image*> pictures;
  std::vector<ColoredRegion> views;
};

struct RadiusProposal {
  std::optional<double> radius_m = {};   // nullopt: it cannot be measured
  double sigma_m = 0;                    // 1 sigma, without the error of the rig's scale
  bool is_rough = false;                 // from regions of one moment: parts may be hidden or in shade in all views
  std::size_t moments = 0, cameras = 0;  // that voted
  std::string why_not = {};              // for the user: why it cannot be measured; empty: it can
};

// The proposal and a configured radius differ by more than their usual errors.
bool differs_clearly(const RadiusProposal& proposal, double radius_m);

// Where the rays of the regions' centres meet to some pixels; nullopt: nowhere.
std::optional<Eigen::Vector3d> meeting_point(const calib::CameraRig& rig, std::span<const ColoredRegion> views);

// From regions alone, whose thresholds leave or remove some of the edge. nullopt: fewer than two views, or no ball.
std::optional<double> radius_of_regions(const calib::CameraRig& rig, std::span<const ColoredRegion> views);

// About as wide as high, and filled like a disc.
bool has_disc_shape(const MaskRegion& region);

// moments: the first one is that of the points.
RadiusProposal voted_radius(const calib::CameraRig& rig, std::span<const BallMoment> moments);

}  // namespace huetrack::color_teaching
