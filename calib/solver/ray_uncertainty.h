// How well a lens tells where a pixel looks, place by place (Tal, Kogan: mrcal, "projection uncertainty").
//
// A focal length, a principal point and a decentring that are each uncertain say little: they make up for one another,
// and for a turn of the whole camera, so that pixels look where they do all the same. What counts is by how much a
// pixel's ray is off after the best turn of the camera, which is no error of the lens: in pixels.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "calib/solver/bundle_adjustment.h"

namespace huetrack::solver {

// Stations all over an image, at the middles of columns x rows cells, row by row.
struct ImageStations {
  static constexpr int columns = 8, rows = 6, count = columns * rows;
  static int cell_of(const Eigen::Vector2d& px, calib::ImageSize size);
};

struct RayUncertainty {
  std::array<double, ImageStations::count> sigma_px{};  // length of both axes' standard deviations
  std::array<bool, ImageStations::count> covered{};     // used corners were in the cell
  double covered_px = 0;                                // of those, that 95 % are below
  double image_px = 0;                                  // of all stations: their root mean square
};

// Of the camera's lens, by the covariance of the adjustment. All zero: its lens is exactly known.
RayUncertainty ray_uncertainty(const Adjustment& calibrated, int camera);

// By how much two lenses of one camera differ, px: root mean square over all stations, and over those of `covered`
// alone; the turn that makes them alike where `covered` is taken away.
struct LensDifference {
  double image_px = 0, covered_px = 0;
};
LensDifference difference(const AdjustedCamera& a, const AdjustedCamera& b,
                          const std::array<bool, ImageStations::count>& covered);

// The turn of the camera (about its own axes) that an error of its lens looks like, per unit of its parameters: 3 x
// parameter_count().
Eigen::Matrix3Xd turn_by_lens(const AdjustedCamera& camera, const std::array<bool, ImageStations::count>& covered);

std::array<bool, ImageStations::count> covered_stations(const Adjustment& adjustment, int camera);

}  // namespace huetrack::solver
