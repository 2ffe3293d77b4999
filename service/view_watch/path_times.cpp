#include "view_watch/path_times.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <utility>

#include "calib/model/covariance_ellipse.h"
#include "calib/model/median.h"
#include "view_watch/pair_residuals.h"

namespace huetrack::view_watch {
namespace {

struct PathTimesTuning {
  double least_error_s = 0.003;  // 1 sigma of the times: rounding them to 10 ms, which has its own warning, costs less
};
constexpr PathTimesTuning path_tuning{};
constexpr std::size_t most_seen = 160;                    // capacity: 5 s at 30 Hz
constexpr double least_ratio = 0.125, largest_ratio = 3;  // capacity: of source pictures to those shown
constexpr int phases = 12;                                // capacity: of a source picture
constexpr double sigma_of_median = 1 / 0.6745;            // maths: of |x| of a standard normal x
constexpr std::size_t points = 7;                         // maths: one more than a quintic has coefficients

using Sample = PathTimes::Sample;
using Errors = std::vector<double>;  // seconds by which the stamps are late, per sample

struct Window {
  std::size_t first = 0;                   // sample
  std::array<double, points> weights{};    // zero for every quintic; of norm 1
  double speed_px_s = 0, speed_sigma = 0;  // the latter relative
  double along_px = 0, across_px = 0;      // the weighted sum of the samples
  double sigma_px = 0;
};

struct Velocity {
  Eigen::Vector2d px_per_s;
  double sigma;  // of its size, relative
};

// Of the samples about this time, as far as a path may be taken as straight.
Velocity velocity(const std::vector<Sample>& samples, std::size_t first, double mid_s) {
  double t = 0, tt = 0, count = 0, xx = 0;
  Eigen::Vector2d x = Eigen::Vector2d::Zero(), tx = Eigen::Vector2d::Zero();
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const double since_s = samples[k].t_s - mid_s;
    const bool is_of_window = k >= first && k < first + points;
    if (!is_of_window && std::abs(since_s) > pair_sampling.longest_gap_s) continue;
    const Eigen::Vector2d px = samples[k].px - samples[first].px;
    ++count, t += since_s, tt += since_s * since_s;
    x += px, tx += since_s * px, xx += px.squaredNorm();
  }
  const double spread = tt - t * t / count;
  const Eigen::Vector2d v = (tx - t / count * x) / spread;
  const double left = std::max(0.0, xx - x.squaredNorm() / count - spread * v.squaredNorm());
  return {v, std::sqrt(left / (count * spread)) / v.norm()};
}

std::optional<Window> window_at(const std::vector<Sample>& samples, std::size_t first) {
  const auto frames = samples[first + points - 1].number - samples[first].number;
  if (frames > 2 * static_cast<std::int64_t>(points - 1)) return std::nullopt;  // it was not seen for too long
  Window window{.first = first};
  double mid_s = 0, norm = 0;
  for (std::size_t i = 0; i < points; ++i) {
    double product = 1;
    for (std::size_t j = 0; j < points; ++j)
      if (j != i) product *= samples[first + i].t_s - samples[first + j].t_s;
    window.weights[i] = 1 / product;
    norm += window.weights[i] * window.weights[i];
    mid_s += samples[first + i].t_s / points;
  }
  const auto [v, speed_sigma] = velocity(samples, first, mid_s);
  window.speed_px_s = v.norm();
  window.speed_sigma = speed_sigma;
  if (!std::isfinite(norm) || !(window.speed_px_s > 0)) return std::nullopt;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double variance = 0;
  for (std::size_t i = 0; i < points; ++i) {
    window.weights[i] /= std::sqrt(norm);
    sum += window.weights[i] * samples[first + i].px;
    variance += std::pow(window.weights[i] * samples[first + i].sigma_px, 2);
  }
  const Eigen::Vector2d along = v / window.speed_px_s;
  window.along_px = sum.dot(along);
  window.across_px = along.x() * sum.y() - along.y() * sum.x();
  window.sigma_px = std::sqrt(variance);
  return window;
}

// The samples of a path and what contradicts their stamps.
class Path {
 public:
  explicit Path(std::vector<Sample> samples) : samples_(std::move(samples)) {
    for (std::size_t k = 0; k + points <= samples_.size(); ++k)
      if (const auto window = window_at(samples_, k)) windows_.push_back(*window);
    if (!is_enough()) return;
    std::vector<double> steps_s, across;
    for (std::size_t k = 1; k < samples_.size(); ++k)
      steps_s.push_back((samples_[k].stamp_s - samples_[k - 1].stamp_s) /
                        static_cast<double>(samples_[k].number - samples_[k - 1].number));
    usual_step_s_ = calib::median(std::move(steps_s));
    period_s_ = regression_s();
    span_ = static_cast<double>(samples_.back().number - samples_.front().number);
    for (const Window& window : windows_) across.push_back(std::abs(window.across_px) / window.sigma_px);
    // The tracker's sigmas contain what lasts, too, which no difference shows.
    const double scale = sigma_of_median * calib::median(std::move(across));
    for (Window& window : windows_) {
      window.sigma_px = scale * window.sigma_px + 1e-9;
      across_cost_ += cost(window.across_px, window.sigma_px);
      window.sigma_px = std::hypot(window.sigma_px, window.speed_sigma * window.along_px);
    }
    as_is_ = cost_with(Errors(samples_.size(), 0.0));
    // Twice the logarithm of a likelihood ratio that the best of so many hypotheses has by chance once in a thousand;
    // each sample is in that many windows.
    const double hypotheses = (largest_ratio - least_ratio) / step() * phases;
    least_gain_ = points * (2 * std::log(hypotheses) + calib::chi2_999_in_1d);
  }

  bool is_enough() const { return !windows_.empty(); }
  // Otherwise no hypothesis can gain enough.
  bool is_suspicious() const { return as_is_ - across_cost_ >= least_gain_; }

  // The best hypothesis, if it is significant.
  std::optional<Mistake> fault(int camera) {
    try_even();
    // A converted film's stamps are even.
    if (std::abs(usual_step_s_ / period_s_ - 1) < 0.5 / span_) try_exchanged(), try_conversions();
    const double gain = as_is_ - best_cost_;
    if (!best_ || gain < least_gain_ || 2 * gain < as_is_) return std::nullopt;
    best_->cameras = {camera};
    return best_;
  }

  // Stamps by number: seconds a frame.
  double regression_s() const {
    double n = 0, nn = 0, s = 0, ns = 0;
    for (const Sample& sample : samples_) {
      const auto number = static_cast<double>(sample.number - samples_.front().number);
      n += number, nn += number * number, s += sample.stamp_s, ns += number * sample.stamp_s;
    }
    const auto count = static_cast<double>(samples_.size());
    return (count * ns - n * s) / (count * nn - n * n);
  }

 private:
  static double cost(double off_px, double sigma_px) {
    return std::min(std::pow(off_px / sigma_px, 2), calib::chi2_999_in_1d);
  }

  double cost_with(const Errors& late_s) const {
    double sum = 0;
    for (const Window& window : windows_) {
      double difference_s = 0;
      for (std::size_t i = 0; i < points; ++i) difference_s += window.weights[i] * late_s[window.first + i];
      sum += cost(window.along_px + window.speed_px_s * difference_s, window.sigma_px);
    }
    return sum;
  }

  void try_errors(const Errors& late_s, const Mistake& mistake) {
    const double with = cost_with(late_s);
    if (best_ && with >= best_cost_) return;
    double mean = 0, square = 0;
    for (const double s : late_s)
      mean += s / static_cast<double>(late_s.size()), square += s * s / static_cast<double>(late_s.size());
    const double error_s = std::sqrt(std::max(0.0, square - mean * mean));
    if (error_s < path_tuning.least_error_s) return;
    best_cost_ = with;
    best_ = mistake;
    best_->size = error_s;
  }

  // Pictures were taken evenly, and the stamps are not even: those of their arrival.
  void try_even() {
    Errors late_s;
    for (const Sample& sample : samples_)
      late_s.push_back(sample.stamp_s - samples_.front().stamp_s -
                       period_s_ * static_cast<double>(sample.number - samples_.front().number));
    try_errors(late_s, {.kind = MistakeKind::delayed, .shown_hz = 1 / period_s_});
  }

  // Two and two are shown in the wrong order, as fields are by a wrong parity.
  void try_exchanged() {
    for (const double sign : {1.0, -1.0}) {
      Errors late_s;
      for (const Sample& sample : samples_) late_s.push_back((sample.number % 2 == 0 ? sign : -sign) * period_s_);
      try_errors(late_s, {.kind = MistakeKind::exchanged, .shown_hz = 1 / period_s_});
    }
  }

  // Picture k shows the source's picture floor(k ratio + phase).
  void try_conversions() {
    Errors late_s(samples_.size());
    for (double ratio = least_ratio; ratio <= largest_ratio; ratio += step()) {
      if (std::abs(ratio - std::round(ratio)) * span_ < 3) continue;  // hardly a picture is dropped or repeated
      for (int phase = 0; phase < phases; ++phase) {
        for (std::size_t k = 0; k < samples_.size(); ++k) {
          const double pictures = static_cast<double>(samples_[k].number - samples_.front().number) * ratio +
                                  static_cast<double>(phase) / phases;
          late_s[k] = (pictures - std::floor(pictures)) * period_s_ / ratio;
        }
        try_errors(late_s, {.kind = MistakeKind::converted, .shown_hz = 1 / period_s_, .source_hz = ratio / period_s_});
      }
    }
  }

  double step() const { return 1 / (4 * span_); }  // of ratios: a quarter of a picture at the end

  std::vector<Sample> samples_;
  std::vector<Window> windows_;
  double usual_step_s_ = 0, period_s_ = 0, span_ = 0;  // span: frames
  double as_is_ = 0, across_cost_ = 0;
  double best_cost_ = 0, least_gain_ = 0;
  std::optional<Mistake> best_;
};

}  // namespace

void PathTimes::see(const Sample& sample) {
  if (!samples_.empty() && (sample.number <= samples_.back().number || sample.t_s <= samples_.back().t_s)) return;
  samples_.push_back(sample);
  if (samples_.size() > most_seen) samples_.pop_front();
}

std::optional<Mistake> PathTimes::judge(int camera) {
  if (++new_ < most_seen / 4) return std::nullopt;
  new_ = 0;
  std::vector<Sample> all(samples_.begin(), samples_.end()), targets;
  std::ranges::copy_if(all, std::back_inserter(targets), &Sample::is_target);
  // Pictures that repeat another are often not associated; others that are not are often something else.
  for (auto* samples : {&all, &targets}) {
    Path path(std::move(*samples));
    if (!path.is_enough() || !path.is_suspicious()) continue;
    if (auto fault = path.fault(camera)) return fault;
  }
  return std::nullopt;
}

}  // namespace huetrack::view_watch
