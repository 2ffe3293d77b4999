// Where an object that somebody pointed at in one view, or in some, is in another one. Pure functions.
//
// At every depth along the ray of the click the object would have a certain size, and would appear in the other view at
// a certain place, in a certain size. Where the picture there has its colour, and has it not around that, is a
// candidate. Of several that are about as good, none is suggested: a wrong one costs more than none.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/model/camera_rig.h"
#include "color_teaching/hsi_image.h"
#include "object_tracking/tracker_options.h"

namespace huetrack::color_teaching {

// A camera's picture.
struct TaughtPicture {
  const calib::Camera* camera = nullptr;
  const HsiImage* image = nullptr;
  const PixelMask* moving = nullptr;  // which pixels differ from what is usually there; null: nobody knows
};

// The object in a picture into which somebody pointed.
struct PointedObject {
  TaughtPicture picture;
  MaskRegion region;
  PixelMask pixels;  // the region's
};

// Of the pixels in the box that are set; zero: there are none.
Eigen::Vector2d median_chroma(const HsiImage& image, const PixelMask& pixels, const color::PixelBox& box);

// Which pixels may have that chroma in other light, shade, or another camera's white balance.
PixelMask alike_pixels(const HsiImage& image, const Eigen::Vector2d& color);

// pointed: one or more. others: pictures of the same moment, none of those that were pointed into. moved_m: how far the
// object may have moved between them, metres, where they are of one moment only roughly. Returns one entry per picture
// of `others`; nullopt: it is not there, or it cannot be told which of several regions it is.
std::vector<std::optional<MaskRegion>> suggested_regions(const std::vector<PointedObject>& pointed,
                                                         const std::vector<TaughtPicture>& others,
                                                         const object_tracking::Volume& volume, double moved_m);

// Which pixels of the picture differ from what the same camera shows at other moments; nullopt: of too few of them.
std::optional<PixelMask> moving_pixels(const capture::Image& picture, const std::vector<capture::Image>& others);

}  // namespace huetrack::color_teaching
