#include "truth/alignment.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace huetrack::truth {
namespace {

constexpr double furthest_s = 0.5;  // latencies of cameras are tenths of a second at most
constexpr double coarse_s = 5e-3, fine_s = 2.5e-4;
constexpr Eigen::Index fewest = 30;
constexpr std::size_t most_in_search = 500, most_kept = 4000;
constexpr double least_share = 0.8;  // of the estimates with a truth, with the offset
constexpr double explains = 0.5;     // maximum ratio of the rms errors with and without it

std::chrono::nanoseconds duration_of(double s) {
  return std::chrono::round<std::chrono::nanoseconds>(std::chrono::duration<double>(s));
}

// Positions of the track and of the truth at the same times, a column each.
struct Pairs {
  Eigen::Matrix3Xd track, truth;
};

// Every n-th.
Pairs pairs_at(const Truth& truth, std::span<const TargetTrack> tracks, std::size_t every, double offset_s) {
  std::vector<Eigen::Vector3d> of_track, of_truth;
  const auto offset = duration_of(offset_s);
  for (const TargetTrack& track : tracks)
    for (std::size_t i = 0; i < track.estimates.size(); i += every)
      if (const auto there = truth.position(track.target, track.estimates[i].at - offset)) {
        of_track.push_back(track.estimates[i].position);
        of_truth.push_back(*there);
      }
  const auto columns_of = [](const std::vector<Eigen::Vector3d>& points) -> Eigen::Matrix3Xd {
    return Eigen::Map<const Eigen::Matrix3Xd>(points.empty() ? nullptr : points.front().data(), 3,
                                              static_cast<Eigen::Index>(points.size()));
  };
  return {columns_of(of_track), columns_of(of_truth)};
}

// Umeyama, Least-squares estimation of transformation parameters between two point patterns, PAMI 1991. Not empty.
Alignment fitted(const Pairs& pairs, Freedom freedom) {
  Alignment fit{.freedom = freedom};
  if (freedom != Freedom::none) {
    const Eigen::Vector3d from = pairs.track.rowwise().mean(), to = pairs.truth.rowwise().mean();
    const bool has_size = !(pairs.track.colwise() - from).isZero(0);
    const Eigen::Matrix4d onto = Eigen::umeyama(pairs.track, pairs.truth, freedom == Freedom::similarity && has_size);
    fit.scale = std::cbrt(onto.topLeftCorner<3, 3>().determinant());
    fit.rotation = onto.topLeftCorner<3, 3>() / fit.scale;
    fit.translation = onto.topRightCorner<3, 1>();
    fit.shift_m = (to - from).norm();
  }
  const Eigen::Matrix3Xd left = ((fit.scale * fit.rotation * pairs.track).colwise() + fit.translation) - pairs.truth;
  fit.rms_m = std::sqrt(left.squaredNorm() / double(left.cols()));
  return fit;
}

Truth negated(const Truth& truth, std::initializer_list<int> axes) {
  Truth out = truth;
  out.transform([&](Eigen::Vector3d& position) {
    for (const int axis : axes) position[axis] *= -1;
  });
  return out;
}

// left_m: what transforms that keep the handedness leave.
std::optional<Mirrored> mirrored_of(const Truth& truth, std::span<const TargetTrack> tracks, double left_m) {
  constexpr int y = 1;
  const auto rigid = align(negated(truth, {y}), tracks, Freedom::rigid, true);
  if (!rigid || rigid->rms_m >= explains * left_m) return std::nullopt;
  Mirrored mirrored{.axis = {}, .rms_m = rigid->rms_m};
  for (int axis = 0; axis < 3; ++axis)
    if (const auto alone = align(negated(truth, {axis}), tracks, Freedom::none, true);
        alone && alone->rms_m < explains * left_m)
      mirrored.axis = axis;
  return mirrored;
}

std::string text_of(const Mirrored& mirrored, double as_it_is_m) {
  const std::string how = mirrored.axis ? fmt::format("negate {} in the truth", "xyz"[*mirrored.axis])
                                        : "negate one axis of the truth, or exchange two";
  return fmt::format(
      "the axes of track and truth are mirrored (one world is left-handed), which explains most of the error: {}; the "
      "rms error while tracking is {:.1f} mm, and {:.1f} mm with a reflection, a rigid transform and a clock offset",
      how, 1e3 * as_it_is_m, 1e3 * mirrored.rms_m);
}

std::string options_text(const Alignment& left, const Applied& applied) {
  const Freedom freedom = std::max(left.freedom, applied.freedom);
  if (freedom == Freedom::none && !applied.aligns_time)
    return fmt::format("--clock-offset {:.4f}", applied.clock_offset_s + left.offset_s);
  std::string text;
  if (freedom == Freedom::rigid) text = "--align rigid";
  if (freedom == Freedom::similarity) text = "--align similarity";
  if (left.aligns_time || applied.aligns_time) text += text.empty() ? "--align-time" : " --align-time";
  return text;
}

// truth = scale * track.
std::string unit_text(double scale) {
  constexpr double within = 0.2;  // of 1000: a wrong radius or camera distance scales, too
  if (std::abs(scale / 1000 - 1) < within) return "; the truth looks like millimetres: divide x, y and z by 1000";
  if (std::abs(scale * 1000 - 1) < within)
    return "; the track looks like millimetres: give the rig's lengths in metres";
  return "";
}

}  // namespace

Estimated Alignment::aligned(const Estimated& estimate) const {
  return {.at = estimate.at - duration_of(offset_s),
          .position = scale * rotation * estimate.position + translation,
          .covariance = scale * scale * rotation * estimate.covariance * rotation.transpose()};
}

std::string Alignment::text(double given_s) const {
  std::string text;
  if (aligns_time) text = fmt::format("a clock offset of {:.4f} s", given_s + offset_s);
  if (freedom == Freedom::none) return text;
  constexpr double deg = 180 / std::numbers::pi;
  if (!text.empty()) text += " and ";
  if (freedom == Freedom::similarity) text += fmt::format("a scale of {:.4f} with ", scale);
  return text + fmt::format("a rigid transform (turns by {:.2f} degrees, moves by {:.1f} mm)",
                            deg * Eigen::AngleAxisd(rotation).angle(), 1e3 * shift_m);
}

std::optional<Alignment> align(const Truth& truth, std::span<const TargetTrack> tracks, Freedom freedom,
                               bool aligns_time) {
  std::size_t count = 0;
  for (const TargetTrack& track : tracks) count += track.estimates.size();
  const Pairs all = pairs_at(truth, tracks, 1, 0);
  if (all.track.cols() < fewest) return std::nullopt;
  double best_s = 0;
  if (aligns_time) {
    const std::size_t every = 1 + count / most_in_search;
    double least_m = std::numeric_limits<double>::infinity();
    const auto search = [&](double around_s, double reach_s, double step_s) {
      const int steps = int(std::lround(reach_s / step_s));
      for (int k = -steps; k <= steps; ++k) {
        const double offset_s = around_s + k * step_s;
        const Pairs pairs = pairs_at(truth, tracks, every, offset_s);
        if (pairs.track.cols() == 0 ||
            double(pairs.track.cols()) * double(every) < least_share * double(all.track.cols()))
          continue;
        if (const double rms_m = fitted(pairs, freedom).rms_m; rms_m < least_m) least_m = rms_m, best_s = offset_s;
      }
    };
    // A least error at the end of the search is none: it goes on from there, as long as track and truth overlap.
    for (double middle_s = 0;; middle_s = best_s) {
      search(middle_s, furthest_s, coarse_s);
      if (std::abs(best_s - middle_s) < furthest_s - coarse_s / 2) break;
    }
    search(best_s, coarse_s, fine_s);
  }
  Alignment best = fitted(best_s == 0 ? all : pairs_at(truth, tracks, 1, best_s), freedom);
  best.aligns_time = aligns_time;
  best.offset_s = best_s;
  return best;
}

std::optional<Explanation> explanation(const Truth& truth, std::span<const TargetTrack> tracks) {
  const auto as_it_is = align(truth, tracks, Freedom::none, false);
  if (!as_it_is) return std::nullopt;
  const auto fit = [&](Freedom freedom, bool aligns_time) { return *align(truth, tracks, freedom, aligns_time); };
  const Alignment rigid_and_clock = fit(Freedom::rigid, true), with_scale = fit(Freedom::similarity, true);
  const Alignment simplest_first[] = {fit(Freedom::none, true), fit(Freedom::rigid, false), rigid_and_clock,
                                      fit(Freedom::similarity, false), with_scale};
  const auto* by = std::ranges::find_if(
      simplest_first, [&](const Alignment& candidate) { return candidate.rms_m < explains * as_it_is->rms_m; });
  const bool is_scaled = with_scale.rms_m < explains * rigid_and_clock.rms_m;
  const Alignment& full = is_scaled ? with_scale : rigid_and_clock;
  auto mirrored = mirrored_of(truth, tracks, full.rms_m);
  if (by == std::end(simplest_first) && !mirrored) return std::nullopt;
  return Explanation{.rms_m = as_it_is->rms_m,
                     .by = by == std::end(simplest_first) ? *as_it_is : *by,
                     .full = full,
                     .mirrored = std::move(mirrored)};
}

std::string to_text(const Explanation& e, const Applied& applied) {
  const double given_s = applied.clock_offset_s;
  if (e.mirrored) return text_of(*e.mirrored, e.rms_m);
  const Alignment& by = e.by;
  const bool is_clock = by.freedom == Freedom::none;
  std::string text =
      fmt::format("{} explain{} most of the error: the rms error while tracking is {:.1f} mm, and {:.1f} mm with {}",
                  by.text(given_s), by.aligns_time && !is_clock ? "" : "s", 1e3 * e.rms_m, 1e3 * by.rms_m,
                  options_text(by, applied));
  const auto mm = [](const Alignment& alignment) { return fmt::format("{:.1f} mm", 1e3 * alignment.rms_m); };
  if (e.full.rms_m < by.rms_m && mm(e.full) != mm(by))  // no difference in figures that are not shown
    text += fmt::format("; {} leave {} ({})", e.full.text(given_s), mm(e.full), options_text(e.full, applied));
  return text + "; options of huetrackd compare and huetrack plot" + unit_text(e.full.scale);
}

void EstimatedSample::add(const Estimated& estimate) {
  if (seen_++ % every_ != 0) return;
  kept_.push_back(estimate);
  if (kept_.size() < most_kept) return;
  for (std::size_t i = 0; 2 * i < kept_.size(); ++i) kept_[i] = kept_[2 * i];
  kept_.resize((kept_.size() + 1) / 2);
  every_ *= 2;
}

}  // namespace huetrack::truth
