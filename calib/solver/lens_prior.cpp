#include <algorithm>
#include <cmath>

#include "calib/model/usual_lens.h"
#include "calib/solver/adjustment_steps.h"

namespace huetrack::solver {

double reach_of(const AdjustedCamera& camera) {
  const calib::CameraModel model = camera.model();
  double reach = 0;
  const double right = camera.image_size.width - 1, bottom = camera.image_size.height - 1;
  for (const calib::RawPixel& corner : {calib::RawPixel{{0, 0}}, calib::RawPixel{{right, 0}},
                                        calib::RawPixel{{0, bottom}}, calib::RawPixel{{right, bottom}}}) {
    const auto ray = model.ray(corner);
    const bool pinhole = is_pinhole(camera.lens), stereographic = camera.lens == LensModel::stereographic;
    if (ray && (!pinhole || ray->z() > 0.05)) {
      const double rho = ray->head<2>().norm();
      reach = std::max(reach, pinhole         ? rho / ray->z()
                              : stereographic ? 2 * rho / (1 + ray->z())
                                              : std::atan2(rho, ray->z()));
    } else {
      // Both are squares.
      const bool squared = pinhole || stereographic;
      reach = std::max(reach, 1.15 * (squared ? std::sqrt(std::min(model.limit(), 400.0)) : model.limit()));
    }
  }
  return reach;
}

LensPrior lens_prior(const AdjustedCamera& camera) {
  if (camera.lens_prior) return *camera.lens_prior;
  using calib::usual_lens;
  // In an angle or in the stereographic projection terms are larger, and nearly cancel one another in wide lenses. True
  // rational lenses have numerators and denominators of ten and more.
  constexpr double wide_share = 1, rational_share = 10;
  // In the stereographic projection, a rotation of the camera equals a shift of the image plus p1, p2 and -2 (s1, s2).
  // With small radial terms the axis is nearly unobservable; holding the prism puts it where models with p1, p2 have
  // it.
  constexpr double prism_share = usual_lens.decentring_share / 10;
  const LensModel lens = camera.lens;
  const double focal = camera.parameters.head<2>().mean();
  const double reach = std::hypot(camera.image_size.width, camera.image_size.height) / 2 / focal, s = reach * reach;
  const double centre_px = usual_lens.centre_share * camera.image_size.width;
  const int count = parameter_count(lens);
  LensPrior prior;
  prior.mean.head<4>() << focal, focal, (camera.image_size.width - 1) / 2.0, (camera.image_size.height - 1) / 2.0;
  Eigen::VectorXd sigma(count);
  sigma.segment<2>(2).setConstant(centre_px);
  const double share = lens == LensModel::radtan8 ? rational_share
                       : is_pinhole(lens)         ? usual_lens.radial_share
                                                  : wide_share;
  for (int i = 4, numerator = 0, denominator = 0; i < count; ++i) {
    if (is_sideways(lens, i)) {
      sigma(i) = (i < 10 ? usual_lens.decentring_share : prism_share) / reach;
    } else {
      sigma(i) = share / std::pow(s, ++(lens == LensModel::radtan8 && i >= 9 ? denominator : numerator));
    }
  }
  prior.information = Eigen::MatrixXd::Zero(count, count);
  prior.information.diagonal().tail(count - 2) = sigma.tail(count - 2).cwiseAbs2().cwiseInverse();
  // Of the logarithms: the mean of fx and fy, and their difference.
  const double mean = 1 / std::pow(usual_lens.log_focal * focal, 2),
               ratio = 1 / std::pow(usual_lens.log_aspect * focal, 2);
  prior.information.topLeftCorner<2, 2>() << mean / 4 + ratio, mean / 4 - ratio, mean / 4 - ratio, mean / 4 + ratio;
  return prior;
}

}  // namespace huetrack::solver
