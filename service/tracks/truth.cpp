#include "tracks/truth.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "calib/yaml/csv_table.h"
#include "config/formatted.h"

namespace huetrack::tracks {
namespace {

constexpr double lock_within_m = 0.05;
constexpr double wrong_beyond_m = 0.10;
constexpr double chi2_3_95 = 7.815;  // 95 % quantile of chi-squared with 3 degrees of freedom
constexpr capture::Duration longest_gap = std::chrono::milliseconds(100);

}  // namespace

Truth Truth::read(const std::filesystem::path& file) {
  static constexpr std::string_view columns[] = {"ball", "t", "x", "y", "z"};
  yaml::CsvTable table(file, columns);
  Truth truth;
  while (table.next()) {
    auto& samples = truth.targets_[std::string(table.text(0))];
    const Sample sample{table.time(1), {table.number(2), table.number(3), table.number(4)}};
    if (!samples.empty() && sample.at <= samples.back().at) table.fail("t must grow from row to row of one target");
    if (!sample.position.allFinite()) table.fail("x, y and z must be finite");
    samples.push_back(sample);
  }
  return truth;
}

std::vector<std::string> Truth::match(std::span<const std::string> targets) {
  if (targets.size() == 1 && targets_.size() == 1 && !targets_.contains(targets.front())) {
    auto only = targets_.extract(targets_.begin());
    const std::string ball = std::exchange(only.key(), targets.front());
    targets_.insert(std::move(only));
    return {"the truth is of a ball named " + ball + ", the only one, and is compared with the only target, " +
            targets.front()};
  }
  std::string balls;
  for (const auto& [ball, _] : targets_) balls += (balls.empty() ? "" : ", ") + ball;
  std::vector<std::string> sentences;
  for (const auto& target : targets) {
    if (targets_.contains(target)) continue;
    sentences.push_back("the truth has no ball named " + target + ", which is not compared: it has " +
                        (balls.empty() ? "none" : balls));
  }
  return sentences;
}

std::optional<Eigen::Vector3d> Truth::position(std::string_view target, capture::Timestamp at) const {
  const auto it = targets_.find(target);
  if (it == targets_.end()) return std::nullopt;
  const auto& samples = it->second;
  // Times may be rounded in the file: half a millisecond past either end is still that end.
  constexpr capture::Duration rounding = std::chrono::microseconds(500);
  const auto after = std::ranges::lower_bound(samples, at, {}, &Sample::at);
  if (after == samples.end())
    return at - samples.back().at <= rounding ? std::optional(samples.back().position) : std::nullopt;
  if (after == samples.begin()) return after->at - at <= rounding ? std::optional(after->position) : std::nullopt;
  const auto before = std::prev(after);
  if (after->at - before->at > longest_gap) {
    if (after->at - at <= rounding) return after->position;
    if (at - before->at <= rounding) return before->position;
    return std::nullopt;
  }
  const double share = capture::seconds(at - before->at) / capture::seconds(after->at - before->at);
  return before->position + share * (after->position - before->position);
}

double nees(const Eigen::Vector3d& error_m, const Eigen::Matrix3d& covariance) {
  const Eigen::LLT<Eigen::Matrix3d> cholesky(covariance);
  if (!covariance.allFinite() || cholesky.info() != Eigen::Success) return std::numeric_limits<double>::infinity();
  return error_m.dot(cholesky.solve(error_m));
}

std::optional<double> TruthComparison::add(const object_tracking::ObjectEstimate& estimate) {
  const auto truth = truth_->position(target_, estimate.at);
  if (!truth) return std::nullopt;
  if (!first_at_) first_at_ = estimate.at;
  ++sums_.sets;
  if (!estimate.has_position()) return std::nullopt;
  const Eigen::Vector3d error = estimate.position - *truth;
  const double error_m = error.norm();
  const bool tracking = estimate.state == object_tracking::TrackState::tracking;
  if (tracking && !(error_m <= wrong_beyond_m)) ++sums_.wrong_tracking;  // NaN is wrong too
  if (!sums_.lock_set && tracking && error_m <= lock_within_m) {
    sums_.lock_set = sums_.sets;
    sums_.lock_s = capture::seconds(estimate.at - *first_at_);
  }
  if (sums_.lock_set) {
    ++sums_.samples;
    sums_.rms_m += error_m * error_m;
    sums_.max_m = std::max(sums_.max_m, error_m);
    const double squared = nees(error, estimate.covariance);
    sums_.mean_nees += squared;
    if (squared <= chi2_3_95) sums_.share_inside_95 += 1;
  }
  return error_m;
}

TruthFigures TruthComparison::figures() const {
  TruthFigures figures = sums_;
  if (const auto n = static_cast<double>(figures.samples); n > 0) {
    figures.rms_m = std::sqrt(figures.rms_m / n);
    figures.mean_nees /= n;
    figures.share_inside_95 /= n;
  }
  return figures;
}

std::string to_text(const TruthFigures& f) {
  if (!f.lock_set)
    return config::formatted(
        "never within %.0f mm of the truth while tracking, in %zu sets; over %.0f cm off while tracking: %zu",
        1e3 * lock_within_m, f.sets, 1e2 * wrong_beyond_m, f.wrong_tracking);
  return config::formatted(
      "locked in set %zu (%.3f s); then %zu samples, rms error %.1f mm, max %.1f mm, mean NEES %.2f, truth inside "
      "the 95 %% ellipsoid %.1f %%; over %.0f cm off while tracking: %zu of %zu",
      *f.lock_set, f.lock_s, f.samples, 1e3 * f.rms_m, 1e3 * f.max_m, f.mean_nees, 100 * f.share_inside_95,
      1e2 * wrong_beyond_m, f.wrong_tracking, f.sets);
}

}  // namespace huetrack::tracks
