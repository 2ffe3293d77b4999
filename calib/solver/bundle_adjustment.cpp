#include "calib/solver/bundle_adjustment.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <opencv2/calib3d.hpp>
#include <tuple>

#include "calib/model/index.h"
#include "calib/model/median.h"
#include "calib/solver/adjustment_steps.h"

namespace huetrack::solver {
namespace {

using calib::index;
using Eigen::Vector2d;
using Eigen::Vector3d;

// Residuals of all corners, used or not.
void measure(Adjustment& a, const BoardShape& shape) {
  for (std::size_t v = 0; v < a.views.size(); ++v) {
    const BoardView& view = a.views[v];
    ViewFit& fit = a.fits[v];
    double sum = 0;
    for (std::size_t k = 0; k < view.ids.size(); ++k) {
      Vector2d residual;
      if (!corner_residual(a, shape, v, k, residual, nullptr))
        residual = Vector2d::Constant(-1e6);  // behind the camera
      fit.residuals[k] = -residual;
      sum += residual.squaredNorm();
    }
    fit.rms_px = std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, view.ids.size())));
  }
}

// Image speed of every view's corners.
void measure_speeds(Adjustment& a, const BoardShape& shape) {
  for (std::size_t v = 0; v < a.views.size(); ++v) {
    a.fits[v].speed_px_s = 0;
    if (!a.moves(a.views[v].set)) continue;
    std::vector<double> speeds;
    for (std::size_t k = 0; k < a.views[v].ids.size(); ++k) {
      Vector2d residual;
      CornerDerivatives d;
      if (corner_residual(a, shape, v, k, residual, &d)) speeds.push_back(d.by_time.norm());
    }
    a.fits[v].speed_px_s = calib::median(std::move(speeds));
  }
}

// Medians for normal residuals: |component| 0.6745 sigma, length of two components 1.1774 sigma.
constexpr double sigma_of_median_component = 1.4826, median_length_of_sigma = 1.18;

// Views with fewer inliers are dropped: another object, or another moment.
constexpr std::size_t least_good_tenths = 6, least_good_corners = 4;

// Robust standard deviation of a corner per axis, of one camera (-1: all, each relative to its own noise).
double robust_sigma(const Adjustment& a, int camera = -1) {
  std::vector<double> components;
  for (std::size_t v = 0; v < a.fits.size(); ++v) {
    if (a.fits[v].dropped || (camera >= 0 && a.views[v].camera != camera)) continue;
    const double share = camera >= 0 ? 1 : a.cameras[index(a.views[v].camera)].relative_noise;
    for (const Vector2d& r : a.fits[v].residuals) {
      components.push_back(std::abs(r.x()) / share);
      components.push_back(std::abs(r.y()) / share);
    }
  }
  return sigma_of_median_component * calib::median(std::move(components));
}

// Renews relative_noise of clearly noisier cameras (out of focus). Returns whether it changed.
bool weigh_cameras(Adjustment& a) {
  constexpr double clearly = 1.5, most = 30, changed_share = 0.1;
  std::vector<double> sigmas;
  for (int c = 0; c < static_cast<int>(a.cameras.size()); ++c) sigmas.push_back(robust_sigma(a, c));
  std::vector<double> seen;
  std::ranges::copy_if(sigmas, std::back_inserter(seen), [](double sigma) { return sigma > 0; });
  if (seen.size() < 2) return false;
  // Lower median: of two cameras one can be noisier.
  std::ranges::sort(seen);
  const double usual = seen[(seen.size() - 1) / 2];
  bool changed = false;
  for (std::size_t c = 0; c < sigmas.size(); ++c) {
    const double noise = sigmas[c] > clearly * usual ? std::min(most, sigmas[c] / usual) : 1;
    double& known = a.cameras[c].relative_noise;
    if (std::abs(noise - known) <= changed_share * known) continue;
    known = noise;
    changed = true;
  }
  return changed;
}

// Robust scale of all residuals, limited to 0.3..10 px.
double median_length(const Adjustment& a) {
  std::vector<double> lengths;
  for (const ViewFit& fit : a.fits) {
    for (const Vector2d& r : fit.residuals) lengths.push_back(r.norm());
  }
  return std::clamp(calib::median(lengths), 0.3, 10.0);
}

// Priors keep some weight where corners are exact.
constexpr double least_noise_px = 0.01;

// Renews the motions from the present poses. Returns whether they have converged.
bool renew(Adjustment& a, const BoardShape& shape, bool with_stamps) {
  a.noise_px = std::max(robust_sigma(a), least_noise_px);
  const std::vector<BoardMotion> before = a.motions;
  const double stamps_before_s = a.stamp_sigma_s;
  renew_motions(a, shape, with_stamps);
  constexpr double settled_s = 2e-5, settled_share = 0.2;
  for (std::size_t s = 0; s < before.size(); ++s) {
    if (before[s].is_known != a.motions[s].is_known || std::abs(before[s].at_s - a.motions[s].at_s) > settled_s)
      return false;
  }
  return std::abs(a.stamp_sigma_s - stamps_before_s) < settled_share * a.stamp_sigma_s;
}

// Renews the inliers; views with few of them are dropped for good. Returns whether they changed.
bool classify(Adjustment& a, const AdjustmentOptions& options) {
  const double usual_sigma = robust_sigma(a);
  bool changed = false;
  for (std::size_t v = 0; v < a.views.size(); ++v) {
    ViewFit& fit = a.fits[v];
    if (fit.dropped) continue;
    const double sigma = usual_sigma * a.cameras[index(a.views[v].camera)].relative_noise;
    const double limit = std::max(options.outlier_sigmas * sigma, options.least_outlier_px);
    std::vector<bool> used;
    for (const Vector2d& r : fit.residuals) used.push_back(r.norm() < limit);
    const auto good = static_cast<std::size_t>(std::ranges::count(used, true));
    if (10 * good < least_good_tenths * used.size() || good < least_good_corners) {
      std::vector<double> lengths;
      for (const Vector2d& r : fit.residuals) lengths.push_back(r.norm());
      fit.dropped = ViewMisfit{calib::median(lengths), sigma * median_length_of_sigma};
      used.assign(used.size(), false);
    }
    changed = changed || used != fit.used;
    fit.used = used;
  }
  return changed;
}

}  // namespace

Vector3d Adjustment::board_point(int id) const {
  const BoardShape shape(board);
  return shape.points[index(id)] + shape.by_warp[index(id)] * warp;
}

Vector3d Adjustment::centre_sigma(int camera) const {
  const int at = pose_offset.empty() ? -1 : pose_offset[index(camera)];
  // Only the translation of the left tangent moves the centre.
  return at < 0 ? Vector3d(Vector3d::Zero()) : Vector3d(covariance.diagonal().segment<3>(at + 3).cwiseSqrt());
}

Vector3d Adjustment::rotation_sigma(int camera) const {
  const int at = pose_offset.empty() ? -1 : pose_offset[index(camera)];
  return at < 0 ? Vector3d(Vector3d::Zero()) : Vector3d(covariance.diagonal().segment<3>(at).cwiseSqrt());
}

LensParameters Adjustment::lens_sigma(int camera) const {
  LensParameters sigma = LensParameters::Zero();
  const int at = lens_offset.empty() ? -1 : lens_offset[index(camera)];
  if (at < 0) return sigma;
  const int count = parameter_count(cameras[index(camera)].lens);
  sigma.head(count) = covariance.diagonal().segment(at, count).cwiseSqrt();
  return sigma;
}

double Adjustment::rms_of_camera(int camera) const {
  double sum = 0;
  int count = 0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (views[v].camera != camera) continue;
    for (std::size_t k = 0; k < fits[v].used.size(); ++k) {
      if (!fits[v].used[k]) continue;
      sum += fits[v].residuals[k].squaredNorm();
      ++count;
    }
  }
  return count > 0 ? std::sqrt(sum / count) : 0;
}

int Adjustment::views_used(int camera) const {
  int count = 0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (views[v].camera == camera && !fits[v].dropped) ++count;
  }
  return count;
}

Adjustment adjust(Adjustment a, const AdjustmentOptions& options) {
  std::ranges::sort(a.views, {}, [](const BoardView& v) { return std::tie(v.set, v.camera, v.image); });
  const BoardShape shape(a.board);
  a.fits.clear();
  for (const BoardView& view : a.views) {
    a.fits.push_back({std::vector<Vector2d>(view.ids.size()), std::vector<bool>(view.ids.size(), true), 0, 0, {}});
  }
  const bool with_motion = !a.motions.empty();
  // Known motions are those of a former adjustment.
  const bool is_near = std::ranges::any_of(a.motions, &BoardMotion::is_known);
  const bool with_lens_prior = std::ranges::any_of(a.cameras, &AdjustedCamera::lens_is_free);
  // Relative tolerances of the cost, of which one corner is some 1e-5. `roughly`: where another solution follows.
  constexpr double exactly = 1e-10, well = 1e-8, roughly = 1e-6;
  // Priors are scaled by the corners' noise.
  const auto weigh_priors = [&] {
    if (with_lens_prior && !with_motion) a.noise_px = std::max(robust_sigma(a), least_noise_px);
  };
  if (options.find_outliers) {
    // First with a robust loss (not to convergence), then least squares on the inliers.
    constexpr int enough_robust = 30;
    const int robust_iterations = std::min(enough_robust, options.max_iterations);
    measure(a, shape);
    weigh_priors();
    if (!is_near) solve(a, shape, {.robust_px = median_length(a), .max_iterations = robust_iterations});
    // Motion between exposures looks like an outlier until the times are estimated.
    const int rounds_with_motion = is_near ? 1 : 3;
    for (int round = 0; with_motion && round < rounds_with_motion; ++round) {
      measure(a, shape);
      renew(a, shape, round > 0);
      solve(a, shape,
            {.robust_px = median_length(a),
             .max_iterations = std::min(20, options.max_iterations),
             .is_near = is_near || round > 0,
             .tolerance = roughly});
    }
    measure(a, shape);
    weigh_priors();
    solve(a, shape,
          {.robust_px = 0.5,
           .max_iterations = robust_iterations,
           .is_near = with_motion,
           .tolerance = with_motion ? roughly : exactly});
    measure(a, shape);
    weigh_cameras(a);
    classify(a, options);
  } else if (with_motion || with_lens_prior) {
    measure(a, shape);
  }
  const int max_rounds = with_motion ? 12 : 8;
  // Not to convergence while the motion prior still changes.
  const int first_iterations = std::min(10, options.max_iterations);
  for (int round = 0; round < max_rounds; ++round) {
    weigh_priors();
    const bool is_settled = !with_motion || renew(a, shape, true) || round + 1 == max_rounds;
    solve(a, shape,
          {.max_iterations = is_settled ? options.max_iterations : first_iterations,
           .is_near = with_motion,
           .tolerance = !with_motion ? exactly
                        : is_settled ? well
                                     : roughly});
    measure(a, shape);
    // The solution before may have been far off, and the priors too strong.
    constexpr double settled_share = 0.2;
    const double noise_px = std::max(robust_sigma(a), least_noise_px);
    const bool priors_changed =
        with_lens_prior && !with_motion && std::abs(noise_px - a.noise_px) > settled_share * noise_px;
    const bool weights_changed = (options.find_outliers && weigh_cameras(a)) || priors_changed;
    if ((!options.find_outliers || !classify(a, options)) && !weights_changed && is_settled) break;
  }
  double sum = 0;
  a.corners_used = 0;
  for (const ViewFit& fit : a.fits) {
    for (std::size_t k = 0; k < fit.used.size(); ++k) {
      if (!fit.used[k]) continue;
      sum += fit.residuals[k].squaredNorm();
      ++a.corners_used;
    }
  }
  a.rms_px = std::sqrt(sum / std::max(1, a.corners_used));
  measure_speeds(a, shape);
  if (options.with_covariance) find_covariance(a, shape);
  return a;
}

std::vector<BoardView> inliers(const Adjustment& adjustment) {
  std::vector<BoardView> views;
  for (std::size_t v = 0; v < adjustment.views.size(); ++v) {
    if (adjustment.fits[v].dropped) continue;
    BoardView view = adjustment.views[v];
    view.ids.clear();
    view.px.clear();
    for (std::size_t k = 0; k < adjustment.views[v].ids.size(); ++k) {
      if (!adjustment.fits[v].used[k]) continue;
      view.ids.push_back(adjustment.views[v].ids[k]);
      view.px.push_back(adjustment.views[v].px[k]);
    }
    views.push_back(std::move(view));
  }
  return views;
}

std::vector<double> stamp_errors_of_inliers(const Adjustment& adjustment) {
  std::vector<double> errors_s;
  for (std::size_t v = 0; v < adjustment.stamp_error_s.size(); ++v) {
    if (!adjustment.fits[v].dropped) errors_s.push_back(adjustment.stamp_error_s[v]);
  }
  return errors_s;
}

std::vector<ViewFit> evaluate(const Adjustment& state) {
  Adjustment a = state;
  a.fits.clear();
  for (const BoardView& view : a.views) {
    a.fits.push_back({std::vector<Vector2d>(view.ids.size()), std::vector<bool>(view.ids.size(), true), 0, 0, {}});
  }
  measure(a, BoardShape(a.board));
  return std::move(a.fits);
}

std::vector<BoardPose> board_poses(const board::Board& board, const BoardView& view, LensModel lens,
                                   const LensParameters& parameters) {
  const calib::CameraModel model = camera_model(lens, parameters);
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> normalised;
  std::vector<std::size_t> used;
  for (std::size_t k = 0; k < view.ids.size(); ++k) {
    const auto ray = model.ray({view.px[k]});
    if (!ray || ray->z() < 0.1) continue;  // beyond 84 degrees off the axis
    const Vector3d p = board.point(view.ids[k]);
    points.emplace_back(p.x(), p.y(), 0);
    normalised.emplace_back(ray->x() / ray->z(), ray->y() / ray->z());
    used.push_back(k);
  }
  std::vector<BoardPose> poses;
  if (points.size() < 4) return poses;
  std::vector<cv::Mat> rotations, translations;
  try {
    cv::solvePnPGeneric(points, normalised, cv::Matx33d::eye(), cv::noArray(), rotations, translations, false,
                        cv::SOLVEPNP_IPPE);
  } catch (const cv::Exception&) {  // collinear corners
    return poses;
  }
  for (std::size_t s = 0; s < rotations.size(); ++s) {
    const Vector3d w(rotations[s].at<double>(0), rotations[s].at<double>(1), rotations[s].at<double>(2));
    BoardPose pose;
    pose.cam_from_board.rotation = calib::exp((calib::Tangent6d() << w, Vector3d::Zero()).finished()).rotation;
    pose.cam_from_board.translation = {translations[s].at<double>(0), translations[s].at<double>(1),
                                       translations[s].at<double>(2)};
    // The pose is that of the corners' plane, which on the back is not the board's.
    pose.cam_from_board.translation -= pose.cam_from_board.rotation * Vector3d(0, 0, board.point(view.ids.front()).z());
    // Gauss-Newton on the reprojection error.
    calib::Tangent6d step;
    for (int iteration = 0; iteration < 10; ++iteration) {
      Eigen::Matrix<double, 6, 6> h = Eigen::Matrix<double, 6, 6>::Identity() * 1e-9;
      calib::Tangent6d g = calib::Tangent6d::Zero();
      double sum = 0;
      for (const std::size_t k : used) {
        Vector2d r;
        CornerDerivatives d;
        const BoardCorner corner{board.point(view.ids[k]), PointByWarp::Zero(), view.px[k], 0, board.diameter / 2};
        if (!corner_residual(lens, parameters, {}, {pose.cam_from_board, BoardWarp::Zero()}, corner, r, &d)) {
          sum += 1e12;
          continue;
        }
        h += d.by_board.transpose() * d.by_board;
        g += d.by_board.transpose() * r;
        sum += r.squaredNorm();
      }
      pose.rms_px = std::sqrt(sum / static_cast<double>(used.size()));
      if (iteration == 9) break;
      step = -h.ldlt().solve(g);
      if (!step.allFinite() || step.norm() > 1) break;
      pose.cam_from_board = pose.cam_from_board * calib::exp(step);
    }
    if (pose.cam_from_board.translation.z() > 0 && std::isfinite(pose.rms_px)) poses.push_back(pose);
  }
  std::ranges::sort(poses, {}, &BoardPose::rms_px);
  return poses;
}

}  // namespace huetrack::solver
