// A lens as a parameter vector, with the derivatives of its pixels, for adjustments. CameraModel is the finished lens;
// tests/solver/lens_test compares the two. Pure; thread-safe; nothing throws.
#pragma once

#include <Eigen/Core>

#include "calib/model/camera_model.h"

namespace huetrack::calib {

// fx fy cx cy, then k1 k2 p1 p2 k3 k4 k5 k6 (pinhole_radtan), k1 k2 k3 k4 (fisheye_kb; the rest is 0) or
// k1 k2 p1 p2 k3 k4 s1 s2 (stereographic).
using LensParameters = Eigen::Matrix<double, 12, 1>;
LensParameters parameters_of(const CameraModel& model);
CameraModel model_like(const CameraModel& model, const LensParameters& parameters);  // of the same kind

using PixelByPoint = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;
using PixelByLens = Eigen::Matrix<double, 2, 12, Eigen::RowMajor>;

// Pixel of p_cam as CameraModel::project(), but without limit(): an adjustment may pass through lenses that fold back.
// false: p_cam is behind the camera (pinhole), or not finite. The derivatives may be null.
bool project_radtan(const LensParameters& lens, const Eigen::Vector3d& p_cam, Eigen::Vector2d& px,
                    PixelByPoint* by_point, PixelByLens* by_lens);
bool project_fisheye(const LensParameters& lens, const Eigen::Vector3d& p_cam, Eigen::Vector2d& px,
                     PixelByPoint* by_point, PixelByLens* by_lens);
bool project_stereographic(const LensParameters& lens, const Eigen::Vector3d& p_cam, Eigen::Vector2d& px,
                           PixelByPoint* by_point, PixelByLens* by_lens);
// With the model's kind of lens and these parameters.
bool project_like(const CameraModel& model, const LensParameters& lens, const Eigen::Vector3d& p_cam,
                  Eigen::Vector2d& px, PixelByPoint* by_point, PixelByLens* by_lens);

}  // namespace huetrack::calib
