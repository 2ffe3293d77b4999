// Projection uncertainty of a lens over the image (mrcal: "projection uncertainty", Kogan). Lens parameters are
// strongly correlated with one another and with the camera's rotation; what counts is the error of a pixel's ray after
// the best rotation of the camera, in pixels.
#pragma once

#include <Eigen/Core>
#include <array>

#include "calib/solver/bundle_adjustment.h"

namespace huetrack::solver {

// Sample points at the middles of columns x rows cells, row by row.
struct ImageStations {
  static constexpr int columns = 8, rows = 6, count = columns * rows;
  static int cell_of(const Eigen::Vector2d& px, calib::ImageSize size);
};

struct RayUncertainty {
  std::array<double, ImageStations::count> sigma_px{};  // length of both axes' standard deviations
  std::array<bool, ImageStations::count> covered{};     // cell with used corners
  double covered_px = 0;                                // 95 % quantile over covered cells
  double image_px = 0;                                  // rms over all stations
};

// By the covariance of the adjustment. All zero: the lens is exact.
RayUncertainty ray_uncertainty(const Adjustment& calibrated, int camera);

// rms difference of two lenses of one camera, px, over all stations and over `covered` ones, after the rotation that
// aligns them best where `covered`.
struct LensDifference {
  double image_px = 0, covered_px = 0;
};
LensDifference difference(const AdjustedCamera& a, const AdjustedCamera& b,
                          const std::array<bool, ImageStations::count>& covered);

// Best rotation (camera axes) for an error of the lens, per unit of its parameters: 3 x parameter_count().
Eigen::Matrix3Xd turn_by_lens(const AdjustedCamera& camera, const std::array<bool, ImageStations::count>& covered);

std::array<bool, ImageStations::count> covered_stations(const Adjustment& adjustment, int camera);

}  // namespace huetrack::solver
