// The lens of another kind that is nearest to a lens: for files that have no place for it, and to start a fit from.
#pragma once

#include "calib/model/camera_model.h"
#include "calib/model/camera_rig.h"

namespace huetrack::calib {

struct NearestLens {
  CameraModel model;
  double p95_px = 0, worst_px = 0;  // by how much pixels are off, over the image
  bool covers_image = true;         // every ray that the image shows has a pixel by it
};

// By least squares over rays all over the image; the camera stays as it is turned. kind: only which alternative it is
// counts; free: how many of its parameters may move (8 of 12: k1 k2 p1 p2, say), the others stay as `kind` has them.
NearestLens nearest_lens(const CameraModel& lens, ImageSize size, const CameraModel& kind, int free);

}  // namespace huetrack::calib
