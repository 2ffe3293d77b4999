#include "calib/solver/rig_check.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <map>
#include <set>

#include "calib/model/index.h"
#include "calib/solver/extrinsics.h"

namespace huetrack::solver {
namespace {

using calib::index;

// A solution is as good as the best one if its rms is at most so much larger.
constexpr double as_good = 1.15, as_good_px = 0.03;

bool is_as_good(double rms, double best) {
  return rms <= as_good * best + as_good_px;
}

// Views of sets that two or more cameras saw.
std::vector<BoardView> shared(const std::vector<BoardView>& views) {
  std::map<int, std::set<int>> cameras;
  for (const BoardView& view : views) cameras[view.set].insert(view.camera);
  std::vector<BoardView> some;
  for (const BoardView& view : views) {
    if (cameras[view.set].size() > 1) some.push_back(view);
  }
  return some;
}

Adjustment with_free(Adjustment a, const std::set<int>& free) {
  for (std::size_t c = 0; c < a.cameras.size(); ++c) a.cameras[c].pose_is_free = free.contains(static_cast<int>(c));
  return a;
}

int corner_count(const std::vector<BoardView>& views) {
  int count = 0;
  for (const BoardView& view : views) count += static_cast<int>(view.ids.size());
  return count;
}

MovedCamera movement(const Adjustment& a, const calib::CameraRig& rig, int c) {
  const calib::Rigid3d& before = rig.cameras[index(c)].cam_from_world;
  MovedCamera moved;
  moved.camera = c;
  moved.cam_from_world = a.cameras[index(c)].cam_from_world;
  moved.moved_m = (calib::inverse(moved.cam_from_world).translation - calib::inverse(before).translation).norm();
  moved.turned_rad = moved.cam_from_world.rotation.angularDistance(before.rotation);
  moved.moved_sigma_m = a.centre_sigma(c).norm();
  moved.turned_sigma_rad = a.rotation_sigma(c).norm();
  if (const int at = a.pose_offset[index(c)]; at >= 0) moved.covariance = a.covariance.block<6, 6>(at, at);
  return moved;
}

// Scale of the rig that alone makes it fit (another board's squares, or a scaled rig). nullopt: none does.
std::optional<double> other_scale(const board::Board& board, const calib::CameraRig& rig,
                                  const std::vector<BoardView>& views, const Adjustment& best,
                                  const std::set<int>& seen, double best_px) {
  double found = 0, known = 0;
  for (const int a : seen) {
    for (const int b : seen) {
      if (a >= b) continue;
      const auto distance = [&](const calib::Rigid3d& p, const calib::Rigid3d& q) {
        return (calib::inverse(p).translation - calib::inverse(q).translation).norm();
      };
      found += distance(best.cameras[index(a)].cam_from_world, best.cameras[index(b)].cam_from_world);
      known += distance(rig.cameras[index(a)].cam_from_world, rig.cameras[index(b)].cam_from_world);
    }
  }
  const double scale = found / known;
  if (!(known > 0) || !(scale > 0.01) || std::abs(scale - 1) < 0.003) return std::nullopt;
  calib::CameraRig scaled = rig;
  for (calib::Camera& camera : scaled.cameras) camera.cam_from_world.translation *= scale;
  const Adjustment fit =
      adjust(with_free(place_boards(board, scaled, views), {}), {.find_outliers = false, .with_covariance = false});
  return is_as_good(fit.rms_px, best_px) ? std::optional(scale) : std::nullopt;
}

// Two cameras whose exchanged names make the rig fit. as_is_px: rms with the names as they are.
std::optional<std::pair<int, int>> swapped_names(const board::Board& board, const calib::CameraRig& rig,
                                                 const std::vector<BoardView>& views, const std::set<int>& seen,
                                                 double as_is_px) {
  // Under a wrong name a camera is metres off. Most corners must be inliers.
  constexpr double of_as_is = 0.25, most_corners = 0.7;
  for (const int a : seen) {
    for (const int b : seen) {
      if (a >= b || rig.cameras[index(a)].image_size != rig.cameras[index(b)].image_size) continue;
      std::vector<BoardView> renamed = views;
      for (BoardView& view : renamed) view.camera = view.camera == a ? b : view.camera == b ? a : view.camera;
      try {
        const Adjustment fit = adjust(with_free(place_boards(board, rig, renamed), {}), {.with_covariance = false});
        const bool fits_most = fit.corners_used > most_corners * corner_count(views);
        if (fit.rms_px < of_as_is * as_is_px && fits_most) return std::pair(a, b);
      } catch (const CalibrationError&) {  // not swapped
      }
    }
  }
  return std::nullopt;
}

std::vector<std::pair<int, bool>> trials_of_mirrors(const std::set<int>& cameras) {
  std::vector<std::pair<int, bool>> trials;
  for (const int c : cameras) {
    for (const bool by_rows : {false, true}) trials.emplace_back(c, by_rows);
  }
  return trials;
}

// A camera whose mirrored images make the rig fit. Only chessboards are detected in mirrored images, numbered from the
// other side.
std::optional<int> mirrored_pictures(const board::Board& board, const calib::CameraRig& rig,
                                     const std::vector<BoardView>& views, const std::set<int>& seen,
                                     const Adjustment& best) {
  // The back of a chessboard looks like its mirrored front.
  if (board.type != board::BoardType::chessboard || board.back) return std::nullopt;
  // Numbered from the other side along columns or rows, depending on the colours of the squares.
  for (const auto& [c, by_rows] : trials_of_mirrors(seen)) {
    std::vector<BoardView> turned = views;
    for (BoardView& view : turned) {
      if (view.camera != c) continue;
      for (int& id : view.ids) {
        const int column = id % board.columns, row = id / board.columns;
        id = by_rows ? (board.rows - 1 - row) * board.columns + column
                     : row * board.columns + board.columns - 1 - column;
      }
      for (Eigen::Vector2d& px : view.px) px.x() = rig.cameras[index(c)].image_size.width - 1 - px.x();
      board::sort_corners(view.ids, view.px);
    }
    try {
      const Adjustment fit = adjust(with_free(place_boards(board, rig, turned), {}), {.with_covariance = false});
      // Where nothing fits, no corner is an outlier: the rms must be small, too.
      constexpr double most_corners = 0.7, well_px = 2;
      const bool fits_most = fit.corners_used > most_corners * corner_count(views) && fit.rms_px < well_px;
      if (fits_most && fit.corners_used > best.corners_used) return c;
    } catch (const CalibrationError&) {  // not mirrored
    }
  }
  return std::nullopt;
}

// Moved cameras by greedy selection, until the rest fits. cost: rms with these free.
// start: with the boards placed for the rig as it is. Sets moved, alternatives and with_moved_px.
void find_moved(RigCheck& check, const calib::CameraRig& rig, const Adjustment& start, const std::set<int>& seen,
                const std::function<double(const std::set<int>&)>& cost) {
  std::set<int> moved;
  check.with_moved_px = check.as_is_px;
  while (!is_as_good(check.with_moved_px, check.best_px) && moved.size() + 1 < seen.size()) {
    std::vector<std::pair<double, int>> trials;
    for (const int c : seen) {
      if (moved.contains(c)) continue;
      std::set<int> free = moved;
      free.insert(c);
      trials.emplace_back(cost(free), c);
    }
    std::ranges::sort(trials);
    for (std::size_t t = 1; moved.empty() && t < trials.size(); ++t) {
      if (is_as_good(trials[t].first, trials.front().first)) check.alternatives.push_back(trials[t].second);
    }
    check.with_moved_px = trials.front().first;
    moved.insert(trials.front().second);
  }
  if (moved.empty()) return;
  const Adjustment found = adjust(with_free(start, moved), {.find_outliers = false, .with_covariance = true});
  for (const int c : moved) check.moved.push_back(movement(found, rig, c));
}

// nullopt: consistent with its own views.
std::optional<LensContradiction> against_lens(const board::Board& board, const calib::Camera& camera,
                                              const std::vector<BoardView>& own) {
  AdjustedCamera lens;
  lens.name = camera.name;
  lens.image_size = camera.image_size;
  lens.lens = lens_model_of(camera.model);
  lens.parameters = parameters_of(camera.model);
  return check_lens(board, lens, own).contradiction;
}

}  // namespace

RigCheck check_rig(const board::Board& board, const calib::CameraRig& rig, const std::vector<BoardView>& given,
                   const Progress& progress) {
  int done = 0;
  const auto report_progress = [&](const std::string& step) {
    if (progress) progress(step, done, 4 + 2 * static_cast<int>(rig.cameras.size()));
    ++done;
  };
  RigCheck check;
  check.rms_px.resize(rig.cameras.size());
  check.shared_views.resize(rig.cameras.size());
  check.lenses.resize(rig.cameras.size());
  std::vector<BoardView> views = shared(given);
  std::set<int> seen;
  for (const BoardView& view : views) seen.insert(view.camera);
  if (seen.size() < 2) {
    throw CalibrationError(
        "no two cameras of the rig saw the board at the same time, so that no relative pose can be checked");
  }
  std::set<int> all_free = seen;
  all_free.erase(*seen.begin());
  // Best possible residuals, and outliers whatever the poses.
  report_progress("all poses free");
  const Adjustment best = adjust(with_free(place_boards(board, rig, views), all_free));
  constexpr double usual_share = 0.8;
  if (best.corners_used < usual_share * corner_count(views)) {
    report_progress("mirrored images");
    check.mirrored = mirrored_pictures(board, rig, views, seen, best);
    if (check.mirrored) return check;
  }
  views = shared(inliers(best));
  for (const BoardView& view : views) ++check.shared_views[index(view.camera)];
  if (views.empty()) throw CalibrationError("the views of the board contradict the rig altogether", Fault::other_rig);
  const Adjustment start = place_boards(board, rig, views);
  const auto fit = [&](const std::set<int>& free) {
    report_progress(free.empty() ? "the rig as it is" : "moved cameras");
    return adjust(with_free(start, free), {.find_outliers = false, .with_covariance = false});
  };
  check.best_px = fit(all_free).rms_px;
  const Adjustment as_is = fit({});
  check.as_is_px = as_is.rms_px;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) check.rms_px[c] = as_is.rms_of_camera(static_cast<int>(c));

  if (!is_as_good(check.as_is_px, check.best_px)) {
    check.scale = other_scale(board, rig, views, best, seen, check.best_px);
    if (check.scale) return check;
  }
  constexpr double far_off_px = 3;  // nearly always more than a bump
  if (check.as_is_px > far_off_px) {
    report_progress("swapped names");
    check.swapped = swapped_names(board, rig, shared(given), seen, check.as_is_px);
    if (check.swapped) return check;
  }
  find_moved(check, rig, start, seen, [&](const std::set<int>& free) { return fit(free).rms_px; });

  constexpr std::size_t enough_for_lens = 6;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    if (check.shared_views[c] < RigCheck::enough_views) continue;
    std::vector<BoardView> own;
    std::ranges::copy_if(given, std::back_inserter(own),
                         [&](const BoardView& view) { return view.camera == static_cast<int>(c); });
    if (own.size() < enough_for_lens) continue;
    report_progress("the lens of " + rig.cameras[c].name);
    check.lenses[c] = against_lens(board, rig.cameras[c], own);
  }
  return check;
}

}  // namespace huetrack::solver
