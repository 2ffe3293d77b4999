#include <algorithm>
#include <cmath>

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

std::vector<LensRegularizer> lens_regularizers(const AdjustedCamera& camera) {
  // Displacement of the image's corner by one coefficient, relative to the radius. True rational lenses have numerators
  // and denominators of ten and more; stereographic terms are a few tenths.
  constexpr double rational_share = 10, radial_share = 1, sideways_share = 0.005;
  // In the stereographic projection, a rotation of the camera equals a shift of the image plus p1, p2 and -2 (s1, s2).
  // With small radial terms the axis is nearly unobservable; holding the prism puts it where models with p1, p2 have
  // it.
  constexpr double prism_share = sideways_share / 10;
  std::vector<LensRegularizer> beliefs;
  if (camera.lens != LensModel::radtan8 && camera.lens != LensModel::stereographic) return beliefs;
  const double reach = std::clamp(reach_of(camera), 0.05, 20.0), s = reach * reach;
  if (camera.lens == LensModel::radtan8) {
    for (const int first : {4, 9}) {
      for (int power = 1; power <= 3; ++power) {
        const int at = first == 4 && power == 3 ? 8 : first + power - 1;  // k3 follows p1 and p2
        beliefs.push_back({at, rational_share / std::pow(s, power)});
      }
    }
    return beliefs;
  }
  int power = 0;
  for (const int at : {4, 5, 8, 9}) beliefs.push_back({at, radial_share / std::pow(s, ++power)});
  for (const int at : {6, 7}) beliefs.push_back({at, sideways_share / reach});
  for (const int at : {10, 11}) beliefs.push_back({at, prism_share / reach});
  return beliefs;
}

}  // namespace huetrack::solver
