#include "calib/solver/ray_uncertainty.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>

#include "calib/model/cross_matrix.h"
#include "calib/model/index.h"

namespace huetrack::solver {
namespace {

using calib::index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Stations = std::array<bool, ImageStations::count>;

Vector2d station_px(std::size_t station, calib::ImageSize size) {
  const std::size_t column = station % ImageStations::columns, row = station / ImageStations::columns;
  return {(static_cast<double>(column) + 0.5) / ImageStations::columns * size.width - 0.5,
          (static_cast<double>(row) + 0.5) / ImageStations::rows * size.height - 0.5};
}

// Uncovered parts of the lens are extrapolated: they must not decide the rotation.
double weight_of(bool covered) {
  constexpr double uncovered = 1e-3;
  return covered ? 1 : uncovered;
}

// Derivatives of a station's pixel. nullopt: outside of the lens model.
struct Station {
  MatrixXd by_lens;  // 2 x parameter_count()
  Eigen::Matrix<double, 2, 3> by_turn;
};
std::optional<Station> station_of(const AdjustedCamera& camera, const calib::CameraModel& model, std::size_t station) {
  const auto ray = model.ray({station_px(station, camera.image_size)});
  Vector2d px;
  PixelByPoint by_point;
  PixelByLens by_lens;
  if (!ray || !project(camera.lens, camera.parameters, *ray, px, &by_point, &by_lens)) return std::nullopt;
  return Station{by_lens.leftCols(parameter_count(camera.lens)), -by_point * calib::cross_matrix(*ray)};
}

// See turn_by_lens().
Eigen::Matrix3Xd nearest_turn(const std::vector<std::optional<Station>>& stations, const Stations& covered, int count) {
  Matrix3d normal = 1e-12 * Matrix3d::Identity();
  Eigen::Matrix3Xd moment = Eigen::Matrix3Xd::Zero(3, count);
  for (std::size_t i = 0; i < stations.size(); ++i) {
    if (!stations[i]) continue;
    normal += weight_of(covered[i]) * stations[i]->by_turn.transpose() * stations[i]->by_turn;
    moment += weight_of(covered[i]) * stations[i]->by_turn.transpose() * stations[i]->by_lens;
  }
  return normal.ldlt().solve(moment);
}

std::vector<std::optional<Station>> all_stations(const AdjustedCamera& camera) {
  const calib::CameraModel model = camera.model();
  std::vector<std::optional<Station>> stations;
  for (std::size_t i = 0; i < ImageStations::count; ++i) stations.push_back(station_of(camera, model, i));
  return stations;
}

}  // namespace

int ImageStations::cell_of(const Vector2d& px, calib::ImageSize size) {
  const int column = std::clamp(static_cast<int>((px.x() + 0.5) / size.width * columns), 0, columns - 1);
  const int row = std::clamp(static_cast<int>((px.y() + 0.5) / size.height * rows), 0, rows - 1);
  return row * columns + column;
}

Stations covered_stations(const Adjustment& a, int camera) {
  Stations covered{};
  for (std::size_t v = 0; v < a.views.size(); ++v) {
    if (a.views[v].camera != camera || a.fits[v].dropped) continue;
    for (std::size_t k = 0; k < a.views[v].px.size(); ++k) {
      if (a.fits[v].used[k])
        covered[index(ImageStations::cell_of(a.views[v].px[k], a.cameras[index(camera)].image_size))] = true;
    }
  }
  return covered;
}

RayUncertainty ray_uncertainty(const Adjustment& a, int camera) {
  RayUncertainty result;
  result.covered = covered_stations(a, camera);
  const int at = a.lens_offset.empty() ? -1 : a.lens_offset[index(camera)];
  if (at < 0) return result;
  const AdjustedCamera& of = a.cameras[index(camera)];
  const int count = parameter_count(of.lens);
  const MatrixXd covariance = a.covariance.block(at, at, count, count);
  const auto stations = all_stations(of);
  const Eigen::Matrix3Xd turn = nearest_turn(stations, result.covered, count);
  std::vector<double> where_covered;
  double squares = 0;
  int seen = 0;
  for (std::size_t i = 0; i < stations.size(); ++i) {
    if (!stations[i]) continue;
    const MatrixXd left = stations[i]->by_lens - stations[i]->by_turn * turn;
    const double variance = std::max(0.0, (left * covariance * left.transpose()).trace());
    result.sigma_px[i] = std::sqrt(variance);
    squares += variance;
    ++seen;
    if (result.covered[i]) where_covered.push_back(result.sigma_px[i]);
  }
  result.image_px = std::sqrt(squares / std::max(1, seen));
  if (!where_covered.empty()) {
    std::ranges::sort(where_covered);
    result.covered_px = where_covered[static_cast<std::size_t>(0.95 * static_cast<double>(where_covered.size() - 1))];
  }
  return result;
}

LensDifference difference(const AdjustedCamera& a, const AdjustedCamera& b, const Stations& covered) {
  const calib::CameraModel from = a.model();
  std::vector<Vector2d> off(ImageStations::count, Vector2d::Zero());
  const auto stations = all_stations(a);
  std::vector<bool> seen(ImageStations::count, false);
  Matrix3d normal = 1e-12 * Matrix3d::Identity();
  Vector3d moment = Vector3d::Zero();
  for (std::size_t i = 0; i < stations.size(); ++i) {
    const Vector2d px = station_px(i, a.image_size);
    const auto ray = from.ray({px});
    Vector2d other;
    if (!stations[i] || !ray || !project(b.lens, b.parameters, *ray, other, nullptr, nullptr)) continue;
    seen[i] = true;
    off[i] = other - px;
    normal += weight_of(covered[i]) * stations[i]->by_turn.transpose() * stations[i]->by_turn;
    moment += weight_of(covered[i]) * stations[i]->by_turn.transpose() * off[i];
  }
  const Vector3d turn = normal.ldlt().solve(moment);
  LensDifference result;
  int all = 0, inside = 0;
  for (std::size_t i = 0; i < stations.size(); ++i) {
    if (!seen[i]) continue;
    const double square = (off[i] - stations[i]->by_turn * turn).squaredNorm();
    result.image_px += square;
    ++all;
    if (!covered[i]) continue;
    result.covered_px += square;
    ++inside;
  }
  result.image_px = std::sqrt(result.image_px / std::max(1, all));
  result.covered_px = std::sqrt(result.covered_px / std::max(1, inside));
  return result;
}

Eigen::Matrix3Xd turn_by_lens(const AdjustedCamera& camera, const Stations& covered) {
  return nearest_turn(all_stations(camera), covered, parameter_count(camera.lens));
}

}  // namespace huetrack::solver
