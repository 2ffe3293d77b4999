// Predicts a map point's patch by warping a key frame's patch as a small plane, and locates it in the image.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/model/camera_model.h"
#include "calib/model/rigid3.h"
#include "camera_tracking/grey_image.h"
#include "camera_tracking/ncc.h"

namespace huetrack::camera_tracking {

// The homography between the rays of two cameras of a plane n . X = d (first camera's frame, metres): ray_1 ~ H ray_0,
// H = R + t n^T / d. Lee, eq. (12), without K and with the opposite sign of n.
Eigen::Matrix3d plane_homography(const calib::Rigid3d& cam1_from_cam0, const Eigen::Vector3d& normal, double d);

// Centre and affine distortion (d px_1 / d px_0, lens included) of a patch on such a plane in the second image.
struct PatchTransfer {
  Eigen::Vector2d px;      // raw, level 0
  Eigen::Matrix2d affine;  // px_1 - centre_1 = affine (px_0 - centre_0)
};
// nullopt: behind a camera, or outside the lens model.
std::optional<PatchTransfer> transfer_patch(const calib::CameraModel& lens, const Eigen::Vector2d& px0,
                                            const Eigen::Matrix3d& homography);

// A patch as predicted at a level of the current pyramid.
struct WarpedPatch {
  int level = 0;
  NccTemplate inner;            // side x side
  std::vector<float> bordered;  // (side + 2)^2: one more pixel on each side, for gradients
};
// The level of the current pyramid at which the patch has about the resolution of source_level in its key frame.
int search_level(const Eigen::Matrix2d& affine, int source_level, int levels);
// false: outside the source image, or too distorted to match.
bool warp_patch(const Pyramid& source, const Eigen::Vector2d& source_px, const Eigen::Matrix2d& affine, int level,
                int side, WarpedPatch& out);

// Sub-pixel position of the patch's centre by inverse compositional Lucas-Kanade with free gain and offset. start,
// result: pixels of the patch's level. nullopt: left the image, moved by more than max_shift, or lacks texture.
struct Refined {
  Eigen::Vector2d px;  // of the level
  float rms = 0;       // residual, grey levels of the patch
  float ncc = 0;
};
std::optional<Refined> refine(const GreyImage& image, const WarpedPatch& patch, const Eigen::Vector2d& start,
                              double max_shift = 2.0);

}  // namespace huetrack::camera_tracking
