#include "calib/report/rig_check.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <numbers>
#include <optional>
#include <set>
#include <utility>

#include "calib/solver/extrinsics.h"
#include "calib/solver/intrinsics.h"

namespace huetrack::report {
namespace {

std::size_t index(int i) {
  return static_cast<std::size_t>(i);
}

template <typename... Values>
std::string text_of(const char* format, Values... values) {
  std::array<char, 512> text;
  std::snprintf(text.data(), text.size(), format, values...);
  return text.data();
}

// A solution counts as good as the best one when its rms is at most this much larger.
constexpr double as_good = 1.15, as_good_px = 0.03;
constexpr int enough_views = 4;  // shared ones, to judge a camera

bool is_as_good(double rms, double best) {
  return rms <= as_good * best + as_good_px;
}

// The views of sets that two or more cameras have.
std::vector<solver::BoardView> shared(const std::vector<solver::BoardView>& views) {
  std::map<int, std::set<int>> cameras;
  for (const solver::BoardView& view : views) cameras[view.set].insert(view.camera);
  std::vector<solver::BoardView> some;
  for (const solver::BoardView& view : views) {
    if (cameras[view.set].size() > 1) some.push_back(view);
  }
  return some;
}

solver::Adjustment with_free(solver::Adjustment a, const std::set<int>& free) {
  for (std::size_t c = 0; c < a.cameras.size(); ++c) a.cameras[c].pose_is_free = free.contains(static_cast<int>(c));
  return a;
}

int corner_count(const std::vector<solver::BoardView>& views) {
  int count = 0;
  for (const solver::BoardView& view : views) count += static_cast<int>(view.ids.size());
  return count;
}

MovedCamera movement(const solver::Adjustment& a, const calib::CameraRig& rig, int c) {
  const calib::Rigid3d& before = rig.cameras[index(c)].cam_from_world;
  MovedCamera moved;
  moved.camera = c;
  moved.cam_from_world = a.cameras[index(c)].cam_from_world;
  moved.moved_m = (calib::inverse(moved.cam_from_world).translation - calib::inverse(before).translation).norm();
  moved.turned_rad = moved.cam_from_world.rotation.angularDistance(before.rotation);
  moved.moved_sigma_m = a.centre_sigma(c).norm();
  moved.turned_sigma_rad = a.rotation_sigma(c).norm();
  return moved;
}

// By how much all distances between cameras would have to be longer for the rig to fit, if that is all that is wrong:
// the board's squares are not as large as those that the rig was made with, or the rig was scaled. nullopt: it is not
// that.
std::optional<double> other_scale(const board::Board& board, const calib::CameraRig& rig,
                                  const std::vector<solver::BoardView>& views, const solver::Adjustment& best,
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
  const solver::Adjustment fit = solver::adjust(with_free(solver::place_boards(board, scaled, views), {}),
                                                {.find_outliers = false, .with_covariance = false});
  return is_as_good(fit.rms_px, best_px) ? std::optional(scale) : std::nullopt;
}

// Two cameras of the rig whose names are swapped in the pictures: then everything fits. as_is_px: with the names as
// they are.
std::optional<std::pair<int, int>> swapped_names(const board::Board& board, const calib::CameraRig& rig,
                                                 const std::vector<solver::BoardView>& views, const std::set<int>& seen,
                                                 double as_is_px) {
  for (const int a : seen) {
    for (const int b : seen) {
      if (a >= b || rig.cameras[index(a)].image_size != rig.cameras[index(b)].image_size) continue;
      std::vector<solver::BoardView> renamed = views;
      for (solver::BoardView& view : renamed) view.camera = view.camera == a ? b : view.camera == b ? a : view.camera;
      try {
        const solver::Adjustment fit =
            solver::adjust(with_free(solver::place_boards(board, rig, renamed), {}), {.with_covariance = false});
        if (fit.rms_px < as_is_px / 4 && fit.corners_used > 0.7 * corner_count(views)) return std::pair(a, b);
      } catch (const solver::CalibrationError&) {  // then they are not swapped
      }
    }
  }
  return std::nullopt;
}

}  // namespace

RigCheck check_rig(const board::Board& board, const calib::CameraRig& rig, const std::vector<solver::BoardView>& given,
                   const solver::Progress& progress) {
  // Three adjustments, as many as there are cameras if one has moved, and the lenses.
  int done = 0;
  const auto tell = [&](const std::string& step) {
    if (progress) progress(step, done, 4 + 2 * static_cast<int>(rig.cameras.size()));
    ++done;
  };
  RigCheck check;
  check.rms_px.resize(rig.cameras.size());
  check.shared_views.resize(rig.cameras.size());
  const auto add = [&](Verdict verdict, std::string name, std::string finding, std::string advice) {
    check.checks.push_back({verdict, std::move(name), std::move(finding), std::move(advice)});
  };
  std::vector<solver::BoardView> views = shared(given);
  std::set<int> seen;
  for (const solver::BoardView& view : views) seen.insert(view.camera);
  if (seen.size() < 2) {
    throw solver::CalibrationError(
        "no two cameras of the rig saw the board at the same time: nothing tells how they stand to each other");
  }
  const int fixed = *seen.begin();
  std::set<int> all_free = seen;
  all_free.erase(fixed);
  // What the cameras could do at best; and which corners are no good whatever the cameras' poses.
  tell("what the cameras could do at best");
  const solver::Adjustment best = solver::adjust(with_free(solver::place_boards(board, rig, views), all_free));
  views = shared(solver::inliers(best));
  for (const solver::BoardView& view : views) ++check.shared_views[index(view.camera)];
  if (views.empty()) {
    throw solver::CalibrationError(
        "the views of the board contradict the rig altogether: is it the rig of these cameras?");
  }
  const solver::Adjustment start = solver::place_boards(board, rig, views);
  const solver::AdjustmentOptions plain{.find_outliers = false, .with_covariance = false};
  const auto cost = [&](const std::set<int>& free) {
    tell(free.empty() ? "the rig as it is" : "who moved");
    return solver::adjust(with_free(start, free), plain);
  };
  check.best_px = cost(all_free).rms_px;
  const solver::Adjustment as_is = cost({});
  check.as_is_px = as_is.rms_px;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) check.rms_px[c] = as_is.rms_of_camera(static_cast<int>(c));

  if (!is_as_good(check.as_is_px, check.best_px)) {
    if (const auto scale = other_scale(board, rig, views, best, seen, check.best_px)) {
      add(Verdict::failed, "scale",
          text_of("everything fits (%.2f px rms instead of %.2f) if all distances between the cameras are %.4f times "
                  "what the rig says",
                  check.best_px, check.as_is_px, *scale),
          "is the board file of this board (its square's size), and the one that the rig was made with?");
      check.verdict = Verdict::failed;
      return check;
    }
  }
  constexpr double far_off_px = 3;  // nearly always more than a bump
  if (check.as_is_px > far_off_px) {
    tell("whose names are swapped");
    if (const auto swapped = swapped_names(board, rig, shared(given), seen, check.as_is_px)) {
      const std::string &a = rig.cameras[index(swapped->first)].name, &b = rig.cameras[index(swapped->second)].name;
      add(Verdict::failed, "names",
          "cameras " + a + " and " + b + " look swapped: with their names exchanged the rig fits",
          "give the pictures of each under its own name (which device is which, after a reboot?)");
      check.verdict = Verdict::failed;
      return check;
    }
  }

  std::set<int> moved;
  double reached = check.as_is_px;
  while (!is_as_good(reached, check.best_px) && moved.size() + 1 < seen.size()) {
    std::vector<std::pair<double, int>> trials;
    for (const int c : seen) {
      if (moved.contains(c)) continue;
      std::set<int> free = moved;
      free.insert(c);
      trials.emplace_back(cost(free).rms_px, c);
    }
    std::ranges::sort(trials);
    for (std::size_t t = 1; moved.empty() && t < trials.size(); ++t) {
      if (is_as_good(trials[t].first, trials.front().first)) check.or_else.push_back(trials[t].second);
    }
    reached = trials.front().first;
    moved.insert(trials.front().second);
  }
  if (!moved.empty()) {
    solver::AdjustmentOptions with_bounds = plain;
    with_bounds.with_covariance = true;
    const solver::Adjustment found = solver::adjust(with_free(start, moved), with_bounds);
    for (const int c : moved) check.moved.push_back(movement(found, rig, c));
  }

  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const calib::Camera& camera = rig.cameras[c];
    if (check.shared_views[c] < enough_views) {
      add(Verdict::doubtful, "views of " + camera.name,
          text_of("%s: only %d views that it shares with another camera: it cannot be judged", camera.name.c_str(),
                  check.shared_views[c]),
          "show the board to it and a neighbour together, at some ten places");
      continue;
    }
    std::vector<solver::BoardView> own;
    for (const solver::BoardView& view : given) {
      if (view.camera == static_cast<int>(c)) own.push_back(view);
    }
    solver::AdjustedCamera lens;
    lens.name = camera.name;
    lens.image_size = camera.image_size;
    lens.lens = solver::lens_model_of(camera.model);
    lens.parameters = solver::parameters_of(camera.model);
    constexpr std::size_t enough_for_lens = 6;
    if (own.size() >= enough_for_lens) {
      tell("the lens of " + camera.name);
      if (const solver::LensCheck of_lens = solver::check_lens(board, lens, own); !of_lens.contradiction.empty()) {
        check.lenses.push_back(of_lens.contradiction);
        add(Verdict::doubtful, "lens of " + camera.name, of_lens.contradiction,
            "its focus or zoom was changed, or another camera is in its place: calibrate it anew");
      }
    }
    const auto own_move = std::ranges::find(check.moved, static_cast<int>(c), &MovedCamera::camera);
    if (own_move == check.moved.end()) {
      add(Verdict::usable, "pose of " + camera.name,
          text_of("%s: stands where the rig says (%.2f px rms, %d shared views)", camera.name.c_str(), check.rms_px[c],
                  check.shared_views[c]),
          {});
      continue;
    }
    std::string who = camera.name + ": ";
    if (!check.or_else.empty() && own_move == check.moved.begin()) {
      who = camera.name + " or ";
      for (const int other : check.or_else) {
        who += rig.cameras[index(other)].name + (other == check.or_else.back() ? "" : " or ");
      }
      who += " (these views do not tell which; as if it were " + camera.name + "): ";
    }
    // Hardly visible: half a pixel more than at best.
    const bool slight = check.as_is_px < check.best_px + 0.5;
    add(slight ? Verdict::doubtful : Verdict::failed, "pose of " + camera.name,
        who + text_of("was moved by %.1f mm (+- %.1f) and turned by %.2f degrees (+- %.2f); %.2f px rms with the rig "
                      "as it is, %.2f px with it moved",
                      1000 * own_move->moved_m, 1000 * own_move->moved_sigma_m,
                      180 / std::numbers::pi * own_move->turned_rad,
                      180 / std::numbers::pi * own_move->turned_sigma_rad, check.as_is_px, reached),
        "put it back, or take its new pose with --mend OUT.yaml, or calibrate the extrinsics anew");
  }
  std::ranges::stable_sort(check.checks, std::greater<>{}, &Check::verdict);
  check.verdict = check.checks.front().verdict;
  return check;
}

std::string to_text(const RigCheck& check, const calib::CameraRig& rig) {
  std::string out = check.verdict == Verdict::usable     ? "The rig FITS.\n"
                    : check.verdict == Verdict::doubtful ? "DOUBTFUL.\n"
                                                         : "The rig DOES NOT FIT.\n";
  for (const Check& one : check.checks) {
    out += one.verdict == Verdict::usable ? "    " : one.verdict == Verdict::doubtful ? "  ? " : "  ! ";
    out += one.finding + ".\n";
    if (one.verdict != Verdict::usable) out += "    -> " + one.advice + ".\n";
  }
  out += text_of("%zu cameras; corners fit to %.3f px rms with the rig as it is, to %.3f px at best.\n",
                 rig.cameras.size(), check.as_is_px, check.best_px);
  return out;
}

}  // namespace huetrack::report
