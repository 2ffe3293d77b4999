#include "calib/report/calibration_report.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include "calib/model/index.h"
#include "calib/model/median.h"
#include "calib/report/calibration_checks.h"
#include "calib/report/sentences.h"

namespace huetrack::report {
namespace {

using calib::index;
using Eigen::Vector2d;
using Eigen::Vector3d;

Vector3d middle_of(const board::Board& board) {
  Vector3d middle = Vector3d::Zero();
  for (int id = 0; id < board.point_count(); ++id) middle += board.point(id) / board.point_count();
  return middle;
}

bool is_at_edge(std::size_t cell) {
  const auto column = cell % ImageGrid::columns, row = cell / ImageGrid::columns;
  return column == 0 || row == 0 || column + 1 == ImageGrid::columns || row + 1 == ImageGrid::rows;
}

// Median blur of a camera's views, and the number of views with far more blur (motion, or refocusing).
void add_blur(CameraReport& report, const std::vector<const solver::BoardView*>& views) {
  constexpr double far_more = 1.8;
  std::vector<double> blurs;
  for (const solver::BoardView* view : views) {
    if (view->blur_px > 0) blurs.push_back(view->blur_px);
  }
  if (blurs.empty()) return;
  report.blur_px = calib::median(blurs);
  report.blurred_views =
      static_cast<int>(std::ranges::count_if(blurs, [&](double blur) { return blur > far_more * report.blur_px; }));
}

// Views that differ from all earlier ones: median distance of the corners over 1 % of the image's width.
int distinct(const std::vector<const solver::BoardView*>& views, calib::ImageSize size) {
  std::vector<const solver::BoardView*> kept;
  for (const solver::BoardView* view : views) {
    const bool known = std::ranges::any_of(kept, [&](const solver::BoardView* other) {
      std::vector<double> apart;
      for (std::size_t i = 0, j = 0; i < view->ids.size() && j < other->ids.size();) {
        if (view->ids[i] == other->ids[j]) {
          apart.push_back((view->px[i++] - other->px[j++]).norm());
        } else {
          view->ids[i] < other->ids[j] ? ++i : ++j;
        }
      }
      return !apart.empty() && calib::median(std::move(apart)) < 0.01 * size.width;
    });
    if (!known) kept.push_back(view);
  }
  return static_cast<int>(kept.size());
}

CameraReport camera_report(const solver::Adjustment& a, int c, Evidence& evidence) {
  const solver::AdjustedCamera& camera = a.cameras[index(c)];
  CameraReport report;
  report.name = camera.name;
  report.image_size = camera.image_size;
  report.lens = camera.lens;
  report.parameters = camera.parameters;
  report.sigma = a.lens_sigma(c);
  report.rms_px = a.rms_of_camera(c);
  std::array<Vector2d, 48> sums{};
  sums.fill(Vector2d::Zero());
  std::vector<const solver::BoardView*> used_views;
  const Vector3d middle = middle_of(a.board);
  int behind = 0;
  for (std::size_t v = 0; v < a.views.size(); ++v) {
    if (a.views[v].camera != c || a.fits[v].dropped) continue;
    const solver::BoardView& view = a.views[v];
    used_views.push_back(&view);
    double view_sum = 0;
    int view_corners = 0;
    for (std::size_t k = 0; k < view.ids.size(); ++k) {
      const auto cell = index(solver::ImageStations::cell_of(view.px[k], camera.image_size));
      if (!a.fits[v].used[k]) {
        ++report.grid.left_out[cell];
        ++report.corners_left_out;
        report.left_out_at_edge += is_at_edge(cell) ? 1 : 0;
        continue;
      }
      ++report.grid.corners[cell];
      sums[cell] += a.fits[v].residuals[k];
      view_sum += a.fits[v].residuals[k].squaredNorm();
      ++view_corners;
    }
    report.corners_used += view_corners;
    const double rms = std::sqrt(view_sum / std::max(1, view_corners));
    if (rms > report.worst_view_rms_px) {
      report.worst_view_rms_px = rms;
      report.worst_view = view.image;
    }
    const calib::Rigid3d cam_from_board = camera.cam_from_world * a.world_from_board[index(view.set)];
    const Vector3d centre = cam_from_board * middle, normal = cam_from_board.rotation * Vector3d::UnitZ();
    const double cosine = normal.dot(centre.normalized());
    const bool is_of_back = view.ids.front() >= a.board.side_point_count();
    behind += (cosine < 0) != is_of_back ? 1 : 0;
    report.tilt_deg.push_back(std::acos(std::clamp(std::abs(cosine), 0.0, 1.0)) * 180 / std::numbers::pi);
    report.distance_m.push_back(centre.norm());
  }
  report.views_used = static_cast<int>(used_views.size());
  report.distinct_views = distinct(used_views, camera.image_size);
  int filled = 0, cells = 0;
  double pattern = 0;
  for (std::size_t cell = 0; cell < sums.size(); ++cell) {
    const int n = report.grid.corners[cell];
    report.grid.mean_residual[cell] = n > 0 ? Vector2d(sums[cell] / n) : Vector2d(0, 0);
    filled += n > 0 ? 1 : 0;
    constexpr int enough = 20;
    if (n < enough) continue;
    ++cells;
    // Noise alone contributes to the mean, too.
    pattern += std::max(0.0, report.grid.mean_residual[cell].squaredNorm() - 2 * a.noise_px * a.noise_px / n);
  }
  report.coverage = static_cast<double>(filled) / static_cast<double>(sums.size());
  report.pattern_px = cells > 0 ? std::sqrt(pattern / cells) : 0;
  add_blur(report, used_views);
  report.rays = solver::ray_uncertainty(a, c);
  report.relative_noise = camera.relative_noise;
  evidence.behind.push_back(used_views.empty() ? 0 : static_cast<double>(behind) / report.views_used);
  evidence.covers_image.push_back(solver::covers_image(camera.model(), camera.image_size));
  return report;
}

// Standard deviation of the distance of two cameras' centres.
double distance_sigma(const solver::Adjustment& a, int i, int k) {
  const auto centre = [&](int c) { return calib::inverse(a.cameras[index(c)].cam_from_world).translation; };
  const Vector3d direction = (centre(i) - centre(k)).normalized();
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(a.covariance.rows());
  for (const auto& [c, sign] : {std::pair(i, 1.0), std::pair(k, -1.0)}) {
    const int at = a.pose_offset.empty() ? -1 : a.pose_offset[index(c)];
    // The centre moves opposite to the translation of the tangent.
    if (at >= 0) gradient.segment<3>(at + 3) = -sign * (a.cameras[index(c)].cam_from_world.rotation * direction);
  }
  return std::sqrt(std::max(0.0, gradient.dot(a.covariance * gradient)));
}

void add_views(CalibrationReport& report, const solver::Adjustment& a) {
  for (std::size_t v = 0; v < a.views.size(); ++v) {
    if (!a.fits[v].dropped) continue;
    report.dropped.push_back({a.views[v].camera, a.views[v].image, dropped_text(*a.fits[v].dropped)});
  }
  // Per camera: the worst used views, one of median quality, and some dropped ones.
  for (int c = 0; c < static_cast<int>(a.cameras.size()); ++c) {
    std::vector<std::size_t> used, dropped;
    for (std::size_t v = 0; v < a.views.size(); ++v) {
      if (a.views[v].camera == c) (a.fits[v].dropped ? dropped : used).push_back(v);
    }
    std::ranges::stable_sort(used, std::greater<>{}, [&](std::size_t v) { return a.fits[v].rms_px; });
    std::vector<std::size_t> chosen(used.begin(),
                                    used.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(2, used.size())));
    if (used.size() > 3) chosen.push_back(used[used.size() / 2]);
    for (std::size_t k = 0; k < std::min<std::size_t>(3, dropped.size()); ++k) chosen.push_back(dropped[k]);
    for (const std::size_t v : chosen) {
      report.shown.push_back(a.views[v]);
      report.shown_fits.push_back(a.fits[v]);
    }
  }
}

// Fit of moving and resting boards: a difference indicates wrong times.
void compare_speeds(const solver::Adjustment& a, Evidence& evidence) {
  std::vector<std::size_t> moving;
  for (std::size_t v = 0; v < a.views.size(); ++v) {
    if (!a.fits[v].dropped && a.moves(a.views[v].set)) moving.push_back(v);
  }
  constexpr std::size_t enough = 12;
  if (moving.size() < enough) return;
  std::ranges::stable_sort(moving, {}, [&](std::size_t v) { return a.fits[v].speed_px_s; });
  const auto rms = [&](std::size_t first, std::size_t last) {
    double sum = 0;
    int corners = 0;
    for (std::size_t i = first; i < last; ++i) {
      const solver::ViewFit& fit = a.fits[moving[i]];
      for (std::size_t k = 0; k < fit.used.size(); ++k) {
        if (!fit.used[k]) continue;
        sum += fit.residuals[k].squaredNorm();
        ++corners;
      }
    }
    return std::sqrt(sum / std::max(1, corners));
  };
  evidence.slow_px = rms(0, moving.size() / 3);
  evidence.fast_px = rms(moving.size() - moving.size() / 3, moving.size());
}

CalibrationReport base_report(const solver::Adjustment& a, const ReportInput& input, Evidence& evidence) {
  CalibrationReport report;
  report.made_of = input.made_of;
  report.board = a.board.description();
  report.rms_px = a.rms_px;
  report.noise_px = a.noise_px;
  for (int c = 0; c < static_cast<int>(a.cameras.size()); ++c) {
    report.cameras.push_back(camera_report(a, c, evidence));
    if (index(c) < input.cameras.size()) {
      report.cameras.back().pictures = input.cameras[index(c)].pictures;
      report.cameras.back().boards = input.cameras[index(c)].boards;
      report.cameras.back().motion_blurred = input.cameras[index(c)].motion_blurred;
    }
  }
  std::set<int> sets;
  for (const solver::BoardView& view : a.views) sets.insert(view.set);
  report.sets = static_cast<int>(sets.size());
  evidence.warnings = input.warnings;
  evidence.board_doubt = input.board_doubt;
  evidence.reader = input.reader;
  report.left_out = input.left_out;
  add_views(report, a);
  return report;
}

void take_lens(CameraReport& camera, const solver::Intrinsics& lens) {
  camera.lens_was_found = true;
  camera.lens = lens.trials[lens.chosen].lens;  // the adjustment may have a k3 of 0 that is uncertain
  camera.lens_reason = choice_text(lens);
  camera.trials = lens.trials;
}

}  // namespace

std::string_view name(Verdict verdict) {
  return verdict == Verdict::usable ? "usable" : verdict == Verdict::doubtful ? "doubtful" : "failed";
}

CalibrationReport report_on(const solver::Intrinsics& result, const ReportInput& input) {
  Evidence evidence;
  CalibrationReport report = base_report(result.adjustment, input, evidence);
  report.title = "Lens of " + report.cameras.front().name;
  take_lens(report.cameras.front(), result);
  judge(report, evidence);
  return report;
}

CalibrationReport report_on(const solver::Extrinsics& result, const ReportInput& input) {
  const solver::Adjustment& a = result.adjustment;
  Evidence evidence;
  evidence.alone_px = result.alone_px;
  evidence.extrinsics = &result;
  compare_speeds(a, evidence);
  CalibrationReport report = base_report(a, input, evidence);
  report.title = "Cameras";
  for (const CameraReport& camera : report.cameras) {
    report.title += (&camera == &report.cameras.front() ? " " : ", ") + camera.name;
  }
  report.lens_reason = refinement_text(result);
  if (!a.motions.empty()) evidence.stamps_s = a.stamp_sigma_s;
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    CameraReport& camera = report.cameras[c];
    if (c < result.lenses.size() && result.lenses[c]) take_lens(camera, *result.lenses[c]);
    camera.cam_from_world = a.cameras[c].cam_from_world;
    camera.centre = calib::inverse(a.cameras[c].cam_from_world).translation;
    camera.timing = timing_text(a, a.cameras[c]);
    evidence.late_s.push_back(a.motions.empty() ? 0 : a.cameras[c].latency.value_s);
  }
  for (int i = 0; i < static_cast<int>(a.cameras.size()); ++i) {
    for (int k = i + 1; k < static_cast<int>(a.cameras.size()); ++k) {
      PairReport pair{i, k, 0, 0, 0, 0};
      const auto known =
          std::ranges::find_if(result.pairs, [&](const solver::CameraPair& p) { return p.a == i && p.b == k; });
      if (known != result.pairs.end()) {
        pair.shared_sets = known->shared_sets;
        pair.rms_px = known->rms_px;
      }
      pair.distance_m = (report.cameras[index(i)].centre - report.cameras[index(k)].centre).norm();
      pair.distance_sigma_m = distance_sigma(a, i, k);
      report.pairs.push_back(pair);
    }
  }
  std::map<int, Vector3d> centres;
  for (std::size_t v = 0; v < a.views.size(); ++v) {
    if (!a.fits[v].dropped) centres[a.views[v].set] = a.world_from_board[index(a.views[v].set)] * middle_of(a.board);
  }
  report.board_centres.assign(centres.begin(), centres.end());
  constexpr std::array<int, 3> steps{13, 13, 7};
  report.volume = solver::predict_accuracy(a, input.volume ? *input.volume : solver::board_volume(a), steps);
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    const solver::PoseSigma sigma = solver::pose_sigma(a, *report.volume, static_cast<int>(c));
    report.cameras[c].centre_sigma_m = sigma.position.norm();
    report.cameras[c].rotation_sigma_rad = sigma.rotation.norm();
  }
  judge(report, evidence);
  return report;
}

}  // namespace huetrack::report
