// Finds an object that was pointed at in some views in another view. Pure functions. Model: design.md, "Suggestions".
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/model/camera_rig.h"
#include "color_teaching/hsi_image.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::color_teaching {

struct TaughtPicture {
  const calib::Camera* camera = nullptr;
  const HsiImage* image = nullptr;
  const PixelMask* moving = nullptr;  // pixels that differ from the usual picture; null: unknown
};

// The object in a picture with a point.
struct PointedObject {
  TaughtPicture picture;
  MaskRegion region;
  PixelMask pixels;  // the region's
};

// Pixels that may have the object's chroma in other light, shade, or another camera's white balance.
PixelMask alike_pixels(const HsiImage& image, const PixelMask& object);

// The object in a picture without a point.
struct Suggestion {
  MaskRegion region;
  PixelMask pixels;  // the region's
};

// What is known of the object without pictures.
struct Expected {
  object_tracking::Volume volume;
  double moved_m = 0;                   // how far it may have moved between the pictures
  std::optional<double> radius_m = {};  // configured
};

// pointed: one or more. others: pictures of the same moment without a point. Returns one entry per picture of `others`;
// nullopt: not there, or ambiguous.
std::vector<std::optional<Suggestion>> suggested_regions(const std::vector<PointedObject>& pointed,
                                                         const std::vector<TaughtPicture>& others,
                                                         const Expected& expected);

// Pixels that differ from the same camera's pictures of other moments; nullopt: too few of those.
std::optional<PixelMask> moving_pixels(const capture::Image& picture, const std::vector<capture::Image>& others);

}  // namespace huetrack::color_teaching
