// Approximates a lens by one of another kind: for file formats without the original kind, and as the start of a fit.
#pragma once

#include "calib/model/camera_model.h"
#include "calib/model/camera_rig.h"

namespace huetrack::calib {

struct NearestLens {
  CameraModel model;
  double p95_px = 0, worst_px = 0;  // pixel error over the image
  bool covers_image = true;         // every ray of the image has a pixel in `model`
};

// Least squares over rays all over the image, without rotation. kind: selects the kind of lens, and fixes its
// parameters from number `free` on (8 of 12: k1 k2 p1 p2 are fitted, the rest stays).
NearestLens nearest_lens(const CameraModel& lens, ImageSize size, const CameraModel& kind, int free);

}  // namespace huetrack::calib
