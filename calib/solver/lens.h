// Lens models as parameter vectors with derivatives.
#pragma once

#include <Eigen/Core>
#include <string_view>

#include "calib/model/camera_model.h"
#include "calib/model/lens_derivatives.h"

namespace huetrack::solver {

// Pinhole with 4 (k1 k2 p1 p2), 5 (k3) or 8 (k4 k5 k6) distortion coefficients, fisheye (Kannala-Brandt), stereographic
// with radial, tangential and prism terms. all_lens_models: simplest first.
enum class LensModel { radtan4, radtan5, radtan8, fisheye, stereographic };
inline constexpr std::array<LensModel, 5> all_lens_models{LensModel::radtan4, LensModel::radtan5, LensModel::fisheye,
                                                          LensModel::radtan8, LensModel::stereographic};
inline bool is_pinhole(LensModel lens) {
  return lens <= LensModel::radtan8;
}

using calib::LensParameters;

std::string_view name(LensModel lens);                       // "radtan4", ..., "stereographic"
int parameter_count(LensModel lens);                         // leading ones of LensParameters
std::string_view parameter_name(LensModel lens, int index);  // "fx", ..., "k6"

// Decentring (p1, p2) or prism (s1, s2).
inline bool is_sideways(LensModel lens, int index) {
  return lens != LensModel::fisheye && (index == 6 || index == 7 || (lens == LensModel::stereographic && index >= 10));
}

calib::CameraModel camera_model(LensModel lens, const LensParameters& parameters);
using calib::parameters_of;
LensModel lens_model_of(const calib::CameraModel& model);  // the simplest with all its coefficients

using calib::PixelByLens;
using calib::PixelByPoint;

// As CameraModel::project() without its limit(): intermediate lenses of an optimisation may fold. false: p_cam is
// behind the camera (pinhole), or not finite. Derivatives may be null.
bool project(LensModel lens, const LensParameters& parameters, const Eigen::Vector3d& p_cam, Eigen::Vector2d& px,
             PixelByPoint* by_point, PixelByLens* by_lens);

}  // namespace huetrack::solver
