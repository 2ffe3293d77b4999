// What a point of the map should look like now: its patch of a key frame, warped as a small plane, found again in the
// image.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/model/camera_model.h"
#include "calib/model/rigid3.h"
#include "camera_tracking/grey_image.h"
#include "camera_tracking/ncc.h"

namespace huetrack::camera_tracking {

// The homography of a plane n . X = d in the first camera's frame (metres) between the rays of two cameras: Lee, eq.
// (12), without K, which the lens takes the place of: ray_1 ~ H ray_0, H = R + t n^T / d. (The paper writes R - t N^T /
// d: its N points the other way.)
Eigen::Matrix3d plane_homography(const calib::Rigid3d& cam1_from_cam0, const Eigen::Vector3d& normal, double d);

// Where a patch on such a plane lies in the second camera's image, and how it is distorted there (d px_1 / d px_0),
// lens included.
struct PatchTransfer {
  Eigen::Vector2d px;      // raw, level 0
  Eigen::Matrix2d affine;  // px_1 - centre_1 = affine (px_0 - centre_0)
};
// ray0: unit, through the patch's centre px0. nullopt: behind a camera, or outside of the lens model.
std::optional<PatchTransfer> transfer_patch(const calib::CameraModel& lens, const Eigen::Vector2d& px0,
                                            const Eigen::Matrix3d& homography);

// A patch as it should look at a level of the current pyramid.
struct WarpedPatch {
  int level = 0;
  NccTemplate inner;            // side x side
  std::vector<float> bordered;  // (side + 2)^2, with one pixel more on each side, for gradients
};
// The level at which the patch, found at source_level of its key frame, has about its own resolution again.
int search_level(const Eigen::Matrix2d& affine, int source_level, int levels);
// false: it reaches beyond the source image, or it is so distorted that nothing would match.
bool warp_patch(const Pyramid& source, const Eigen::Vector2d& source_px, const Eigen::Matrix2d& affine, int level,
                int side, WarpedPatch& out);

// Sub-pixel position of the patch's centre in its level of the current pyramid: inverse compositional Lucas-Kanade,
// with gain and offset free. start and result: pixels of that level. nullopt: it left the image or moved by more than
// max_shift.
struct Refined {
  Eigen::Vector2d px;  // of the level
  float rms = 0;       // left over, in grey levels of the patch
  float ncc = 0;       // there
};
std::optional<Refined> refine(const GreyImage& image, const WarpedPatch& patch, const Eigen::Vector2d& start,
                              double max_shift = 2.0);

}  // namespace huetrack::camera_tracking
