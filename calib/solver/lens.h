// The lens models that calibration chooses from, as parameters that an adjustment can move, with their derivatives.
#pragma once

#include <Eigen/Core>
#include <string_view>

#include "calib/model/camera_model.h"
#include "calib/model/lens_derivatives.h"

namespace huetrack::solver {

// Pinhole with 4 (k1 k2 p1 p2), 5 (k3) or 8 (k4 k5 k6) distortion coefficients, the fisheye, and the stereographic one,
// which follows any lens. all_lens_models: from the simplest.
enum class LensModel { radtan4, radtan5, radtan8, fisheye, stereographic };
inline constexpr std::array<LensModel, 5> all_lens_models{LensModel::radtan4, LensModel::radtan5, LensModel::fisheye,
                                                          LensModel::radtan8, LensModel::stereographic};
inline bool is_pinhole(LensModel lens) {
  return lens <= LensModel::radtan8;
}

using calib::LensParameters;

std::string_view name(LensModel lens);                       // "radtan4", ..., "stereographic"
int parameter_count(LensModel lens);                         // the leading ones of LensParameters that are free
std::string_view parameter_name(LensModel lens, int index);  // "fx", ..., "k6"

calib::CameraModel camera_model(LensModel lens, const LensParameters& parameters);
using calib::parameters_of;
LensModel lens_model_of(const calib::CameraModel& model);  // the simplest one that holds all its coefficients

using calib::PixelByLens;
using calib::PixelByPoint;

// Pixel of p_cam, as CameraModel::project() but without its limit(): an adjustment may pass through lenses that fold on
// its way. false: p_cam lies behind the camera (pinhole), or is not finite. The derivatives may be null.
bool project(LensModel lens, const LensParameters& parameters, const Eigen::Vector3d& p_cam, Eigen::Vector2d& px,
             PixelByPoint* by_point, PixelByLens* by_lens);

}  // namespace huetrack::solver
