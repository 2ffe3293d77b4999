#include "clients/plot/track_chart.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <ranges>

#include "calib/model/covariance_ellipse.h"
#include "calib/model/median.h"
#include "drawing/axes.h"

namespace huetrack::plot {

using namespace drawing;

namespace {

constexpr double normal_95 = 1.96;  // standard deviations
constexpr double near_m = 0.05;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

// Lengths in pixels.
constexpr double margin = 70, gap = 52, plane_height = 440, series_height = 128, series_gap = 34;
constexpr double text_row = 20, state_row = 24, foot = 60;
constexpr double track_width = 1.7, rim_width = 5, truth_width = 4;

constexpr Color truth_color{140, 145, 153};
constexpr Color target_colors[] = {{33, 107, 204}, {212, 89, 26}, {33, 140, 84}, {148, 69, 179}, {179, 128, 13}};

Color color_of(std::size_t target) {
  return target_colors[target % std::size(target_colors)];
}

Color truth_color_of(std::size_t target, std::size_t targets) {
  if (targets == 1) return truth_color.faded(0.5);
  const Color own = color_of(target);
  return {(own.r + truth_color.r) / 2, (own.g + truth_color.g) / 2, (own.b + truth_color.b) / 2, 0.5};
}

Color state_color(const std::string& state) {
  if (state == "tracking") return {51, 153, 92};
  if (state == "coasting") return {230, 158, 31};
  if (state == "searching") return {92, 133, 217};
  return {204, 66, 56};
}

double seconds(std::chrono::nanoseconds d) {
  return std::chrono::duration<double>(d).count();
}

// ---------------------------------------------------------------------------------------------------------------------
// Data

std::optional<Eigen::Vector3d> truth_at(const ChartTarget& target, const TrackRow& row) {
  return target.truth != nullptr ? target.truth->position(target.name, row.at) : std::nullopt;
}

// Its truth; nothing where there is none.
std::span<const truth::Truth::Sample> samples_of(const ChartTarget& target) {
  if (target.truth == nullptr) return {};
  return target.truth->targets().find(target.name)->second;
}

double error_of(const ChartTarget& target, const TrackRow& row) {
  const auto truth = truth_at(target, row);
  return truth ? (row.position - *truth).norm() : nan;
}

// Of the largest axis.
double sigma_of(const TrackRow& row) {
  if (!row.has_position() || !row.covariance.allFinite()) return nan;
  return std::sqrt(std::max(0.0, row.covariance.selfadjointView<Eigen::Lower>().eigenvalues().maxCoeff()));
}

bool has_truth(const std::vector<ChartTarget>& targets) {
  return std::ranges::any_of(targets, [](const ChartTarget& t) { return t.truth != nullptr; });
}

// A longer gap breaks a line: a few times the usual step.
std::chrono::nanoseconds longest_step(const std::vector<TrackRow>& rows) {
  constexpr std::chrono::nanoseconds shortest = std::chrono::milliseconds(1);
  std::vector<std::chrono::nanoseconds> steps;
  for (std::size_t i = 1; i < rows.size(); ++i) steps.push_back(rows[i].at - rows[i - 1].at);
  if (steps.empty()) return std::chrono::seconds(1);
  return std::max(calib::median(std::move(steps), shortest), shortest) * 5 / 2;
}

// A line without a break, in one colour.
struct Run {
  Color color;
  std::vector<Point> points;
};

// ---------------------------------------------------------------------------------------------------------------------
// Layout

bool is_narrow(const ChartStyle& style) {
  return style.width < 900;
}

double plane_height_of(const ChartStyle& style) {
  return is_narrow(style) ? 320 : plane_height;
}

struct Key {
  std::string name;
  Color color;
  double height;
  double width() const { return 40 + 7.6 * static_cast<double>(name.size()); }
};

// What the colours mean: targets (and their truths), then states; as many to a row as fit.
std::vector<std::vector<Key>> keys_of(const std::vector<ChartTarget>& targets, const ChartStyle& style) {
  std::vector<Key> keys;
  for (std::size_t k = 0; k < targets.size(); ++k) {
    keys.push_back({targets[k].name, color_of(k), 3});
    if (targets[k].truth != nullptr)
      keys.push_back({targets[k].name + ", truth", truth_color_of(k, targets.size()), 6});
  }
  for (const char* state : {"tracking", "coasting", "searching", "lost"})
    keys.push_back({state, state_color(state), 12});
  std::vector<std::vector<Key>> rows(1);
  double x = 0;
  for (Key& key : keys) {
    const double width = key.width();
    if (x > 0 && x + width > style.width - margin - 20) {
      rows.emplace_back();
      x = 0;
    }
    x += width;
    rows.back().push_back(std::move(key));
  }
  return rows;
}

int height_of(const std::vector<ChartTarget>& targets, const ChartStyle& style) {
  const double count = static_cast<double>(targets.size()), panels = has_truth(targets) ? 5 : 4;
  const double head = style.title.empty() ? 40 : 62 + text_row * count;
  const double planes = is_narrow(style) ? 2 : 1;
  return static_cast<int>(head + text_row * static_cast<double>(keys_of(targets, style).size()) + 34 +
                          planes * (plane_height_of(style) + gap) + panels * (series_height + series_gap) + 34 +
                          state_row * count + foot);
}

// One drawing: a cursor goes down it.
class Chart {
 public:
  Chart(const std::vector<ChartTarget>& targets, const ChartStyle& style, Canvas::Kind kind)
      : targets_(targets),
        style_(style),
        canvas_(style.width, height_of(targets, style), drawing::white, kind),
        left_(is_narrow(style) ? 48 : margin),
        width_(style.width - left_ - (is_narrow(style) ? 12 : margin)) {
    for (const ChartTarget& target : targets_) {
      for (const TrackRow& row : target.rows) {
        time_.add(t(row.at));
        for (int i = 0; i < 3; ++i) space_[i].add(row.position[i]);
      }
      for (const auto& sample : samples_of(target))
        for (int i = 0; i < 3; ++i) space_[i].add(sample.position[i]);
    }
    time_.pad(0, 1e-3);
    for (Span& span : space_) span.pad(0.06, 0.05);
    draw_head();
    draw_planes();
    draw_coordinates();
    draw_uncertainty();
    if (has_truth(targets_)) draw_error();
    draw_states();
  }
  Canvas take() { return std::move(canvas_); }

 private:
  using ValueAndBand = std::pair<double, double>;  // and half the width of its 95 % band; NaN: none

  double t(truth::Timestamp at) const { return seconds(at - style_.zero); }

  void draw_head() {
    y_ = 24;
    if (!style_.title.empty()) {
      canvas_.text({left_, 40}, style_.title, 20, ink, Align::left, Weight::bold);
      y_ = 62;
      for (const ChartTarget& target : targets_) {
        canvas_.text({left_, y_}, to_text(figures_of(target)), 12.5, muted);
        y_ += text_row;
      }
    }
    for (const auto& row : keys_of(targets_, style_)) {
      double x = left_;
      for (const Key& key : row) {
        canvas_.rectangle({x, y_ - 10 + (12 - key.height) / 2, 14, key.height}, key.color);
        canvas_.text({x + 19, y_}, key.name, 12, ink);
        x += key.width();
      }
      y_ += text_row;
    }
    y_ += 24;
  }

  // From above and from the side, at one scale.
  void draw_planes() {
    const bool are_stacked = is_narrow(style_);
    constexpr double between = 60;
    const double width = are_stacked ? width_ : (width_ - between) / 2, height = plane_height_of(style_);
    for (const bool is_plan : {true, false}) {
      const int a = 0, b = is_plan ? 1 : 2;
      const double x = left_ + (is_plan || are_stacked ? 0 : width + between);
      Axes axes{{x, y_, width, height}, space_[a], space_[b]};
      const double scale = std::max(axes.x.size() / width, axes.y.size() / height);  // metres per pixel
      axes.x.pad(0, scale * width);
      axes.y.pad(0, scale * height);
      draw_axes(canvas_, axes, {is_plan ? "From above: y over x, m" : "From the side: z over x, m", true, ""});
      draw_plane(axes, a, b);
      if (are_stacked || !is_plan) y_ += height + gap;
    }
  }

  // A plane through space: two of the axes. Lines in the colour of the state; ellipses now and then.
  void draw_plane(const Axes& axes, int a, int b) {
    const Canvas::Clip clip(canvas_, axes.box);
    const auto at = [&](const Eigen::Vector3d& p) { return axes(p[a], p[b]); };
    for (std::size_t k = 0; k < targets_.size(); ++k) {
      std::vector<Point> truth;
      for (const auto& sample : samples_of(targets_[k])) truth.push_back(at(sample.position));
      canvas_.polyline(truth, truth_color_of(k, targets_.size()), truth_width);
    }
    for (const ChartTarget& target : targets_) draw_ellipses(axes, a, b, target.rows);
    for (std::size_t k = 0; k < targets_.size(); ++k) {
      const std::vector<TrackRow>& rows = targets_[k].rows;
      // The line's colour is the state; with several targets its rim is the target's colour.
      if (targets_.size() > 1)
        for (const Run& run : runs_of(rows, at, [&](const TrackRow&) { return color_of(k).faded(0.45); }))
          canvas_.polyline(run.points, run.color, rim_width);
      for (const Run& run : runs_of(rows, at, [](const TrackRow& row) { return state_color(row.state); }))
        canvas_.polyline(run.points, run.color, track_width);
      // The name at the last position.
      const auto backwards = std::views::reverse(rows);
      const auto last = std::ranges::find_if(backwards, &TrackRow::has_position);
      if (last == backwards.end()) continue;
      const auto first = std::ranges::find_if(rows, &TrackRow::has_position);
      canvas_.circle(at(first->position), 3.5, color_of(k), 1.2);
      canvas_.disc(at(last->position), 4.5, color_of(k));
      canvas_.text(at(last->position) + Point(7, -5), targets_[k].name, 12, color_of(k), Align::left, Weight::bold);
    }
  }

  void draw_ellipses(const Axes& axes, int a, int b, const std::vector<TrackRow>& rows) {
    constexpr std::size_t most = 40;
    constexpr double least_px = 0.3;
    const double px_per_m = axes.box.width / axes.x.size();
    for (std::size_t i = 0; i < rows.size(); i += std::max<std::size_t>(1, rows.size() / most)) {
      const TrackRow& row = rows[i];
      Eigen::Matrix2d in_plane;
      in_plane << row.covariance(a, a), row.covariance(a, b), row.covariance(b, a), row.covariance(b, b);
      if (!row.has_position() || !in_plane.allFinite()) continue;
      calib::CovarianceEllipse ellipse = calib::ellipse_95(in_plane);
      ellipse.half_axes = ellipse.half_axes.cwiseMax(least_px / px_per_m);
      std::vector<Point> ring;
      for (const Eigen::Vector2d& p : ellipse.ring(64))
        ring.push_back(axes(row.position[a] + p.x(), row.position[b] + p.y()));
      canvas_.polygon(ring, state_color(row.state).faded(0.16));
    }
  }

  // Segments without a gap; a line has the colour of the row at its end.
  static std::vector<Run> runs_of(const std::vector<TrackRow>& rows,
                                  const std::function<Point(const Eigen::Vector3d&)>& at,
                                  const std::function<Color(const TrackRow&)>& color) {
    const auto longest = longest_step(rows);
    std::vector<Run> runs;
    for (std::size_t i = 1; i < rows.size(); ++i) {
      const TrackRow &from = rows[i - 1], &to = rows[i];
      if (!from.has_position() || !to.has_position() || to.at - from.at > longest) continue;
      const bool goes_on =
          i >= 2 && !runs.empty() && rows[i - 2].has_position() && rows[i - 1].at - rows[i - 2].at <= longest;
      if (!goes_on || color(from) != color(to)) runs.push_back({color(to), {at(from.position)}});
      runs.back().points.push_back(at(to.position));
    }
    return runs;
  }

  void draw_panel(const std::string& title, const Span& values, const std::function<void(const Axes&)>& draw) {
    const Axes axes{{left_, y_, width_, series_height}, time_, values};
    draw_axes(canvas_, axes, {title, false, ""});
    {
      const Canvas::Clip clip(canvas_, axes.box);
      draw(axes);
    }
    y_ += series_height + series_gap;
  }

  void draw_coordinates() {
    const char* const titles[] = {"x, m (band: 95 %)", "y, m", "z, m"};
    for (int i = 0; i < 3; ++i) {
      draw_panel(titles[i], space_[i], [&](const Axes& axes) {
        for (std::size_t k = 0; k < targets_.size(); ++k) {
          std::vector<Point> truth;
          for (const auto& sample : samples_of(targets_[k])) truth.push_back(axes(t(sample.at), sample.position[i]));
          canvas_.polyline(truth, truth_color_of(k, targets_.size()), truth_width);
          draw_series(axes, k, [&](const TrackRow& row) {
            return ValueAndBand(row.position[i], normal_95 * std::sqrt(row.covariance(i, i)));
          });
        }
      });
    }
  }

  void draw_uncertainty() {
    draw_millimetres("uncertainty: 1\xCF\x83 of the largest axis, mm",
                     [](const ChartTarget&, const TrackRow& row) { return 1e3 * sigma_of(row); });
  }

  void draw_error() {
    draw_millimetres("error against the truth, mm",
                     [](const ChartTarget& target, const TrackRow& row) { return 1e3 * error_of(target, row); });
  }

  void draw_millimetres(const std::string& title,
                        const std::function<double(const ChartTarget&, const TrackRow&)>& value) {
    std::vector<double> values;
    for (const ChartTarget& target : targets_)
      for (const TrackRow& row : target.rows)
        if (const double v = value(target, row); std::isfinite(v)) values.push_back(v);
    Span span{0, 1};
    if (!values.empty()) {
      std::ranges::sort(values);
      // A few coasting samples of half a metre must not flatten all the others.
      const double most = 4 * values[static_cast<std::size_t>(0.9 * static_cast<double>(values.size() - 1))];
      span.high = std::max(1.0, 1.15 * std::min(values.back(), most));
    }
    draw_panel(title, span, [&](const Axes& axes) {
      for (std::size_t k = 0; k < targets_.size(); ++k)
        draw_series(axes, k, [&](const TrackRow& row) { return ValueAndBand(value(targets_[k], row), 0); });
    });
  }

  void draw_series(const Axes& axes, std::size_t k, const std::function<ValueAndBand(const TrackRow&)>& value) {
    struct Stretch {  // without a gap
      std::vector<Point> middle, above, below;
    };
    const auto longest = longest_step(targets_[k].rows);
    std::vector<Stretch> stretches;
    std::optional<truth::Timestamp> last;
    for (const TrackRow& row : targets_[k].rows) {
      const auto [v, half] = value(row);
      if (!std::isfinite(v)) {
        last.reset();
        continue;
      }
      if (!last || row.at - *last > longest) stretches.emplace_back();
      const double band = std::isfinite(half) ? half : 0;
      stretches.back().middle.push_back(axes(t(row.at), v));
      stretches.back().above.push_back(axes(t(row.at), v + band));
      stretches.back().below.push_back(axes(t(row.at), v - band));
      last = row.at;
    }
    for (Stretch& stretch : stretches) {
      std::vector<Point>& band = stretch.above;
      band.insert(band.end(), stretch.below.rbegin(), stretch.below.rend());
      canvas_.polygon(band, color_of(k).faded(0.18));
      canvas_.polyline(stretch.middle, color_of(k), 1.6);
    }
  }

  void draw_states() {
    const Axes axes{{left_, y_, width_, state_row * static_cast<double>(targets_.size())}, time_, {0, 1}};
    const auto u = [&](truth::Timestamp at) { return axes(t(at), 0).x(); };
    canvas_.text({left_, y_ - 7}, "state", 12.5, ink, Align::left, Weight::bold);
    double top = y_;
    for (const ChartTarget& target : targets_) {
      const std::vector<TrackRow>& rows = target.rows;
      const auto longest = longest_step(rows);
      const auto last_lasts = rows.size() > 1 ? longest * 2 / 5 : truth::Timestamp::duration(0);
      canvas_.text({left_ - 7, top + state_row / 2 + 4}, target.name, 11, muted, Align::right);
      for (std::size_t i = 0; i < rows.size();) {
        const auto is_followed = [&](std::size_t j) {
          return j + 1 < rows.size() && rows[j + 1].at - rows[j].at <= longest;
        };
        std::size_t j = i;
        while (is_followed(j) && rows[j + 1].state == rows[i].state) ++j;
        const double from = u(rows[i].at),
                     to = std::min(u(is_followed(j) ? rows[j + 1].at : rows[j].at + last_lasts), left_ + width_);
        canvas_.rectangle({from, top + 2, std::max(1.0, to - from), state_row - 4}, state_color(rows[i].state));
        i = j + 1;
      }
      top += state_row;
    }
    draw_x_labels(canvas_, axes, style_.time_title);
  }

  const std::vector<ChartTarget>& targets_;
  const ChartStyle& style_;
  Canvas canvas_;
  double left_, width_, y_ = 0;
  Span time_, space_[3];
};

}  // namespace

ChartFigures figures_of(const ChartTarget& target) {
  ChartFigures f{.name = target.name, .rows = target.rows.size()};
  double sum = 0, tracking_sum = 0;
  std::size_t inside = 0;
  for (const TrackRow& row : target.rows) {
    ++(row.state == "tracking"    ? f.tracking
       : row.state == "coasting"  ? f.coasting
       : row.state == "searching" ? f.searching
                                  : f.lost);
    f.positions += row.has_position() ? 1 : 0;
    const auto truth = truth_at(target, row);
    f.in_truth += truth ? 1 : 0;
    if (!truth || !row.has_position()) continue;
    const Eigen::Vector3d error = row.position - *truth;
    ++f.compared;
    f.is_ever_near |= row.state == "tracking" && error.norm() <= near_m;
    sum += error.squaredNorm();
    if (row.state == "tracking") {
      ++f.compared_tracking;
      tracking_sum += error.squaredNorm();
    }
    f.max_m = std::max(f.max_m, error.norm());
    inside += truth::nees(error, row.covariance) <= calib::chi2_95_in_3d ? 1 : 0;
  }
  if (f.compared > 0) {
    f.rms_m = std::sqrt(sum / static_cast<double>(f.compared));
    f.tracking_rms_m = std::sqrt(tracking_sum / static_cast<double>(std::max<std::size_t>(1, f.compared_tracking)));
    f.inside_95 = static_cast<double>(inside) / static_cast<double>(f.compared);
  }
  return f;
}

std::string to_text(const ChartFigures& f) {
  const auto share = [&](std::size_t n) {
    return 100.0 * static_cast<double>(n) / static_cast<double>(std::max<std::size_t>(1, f.rows));
  };
  std::string text = fmt::format(
      "{}: {} sample{}; tracking {:.1f} %, coasting {:.1f} %, searching {:.1f} %, lost {:.1f} %", f.name, f.rows,
      f.rows == 1 ? "" : "s", share(f.tracking), share(f.coasting), share(f.searching), share(f.lost));
  if (f.compared > 0)
    text += fmt::format("; error rms {:.1f} mm{}, max {:.1f} mm; truth in the 95 % ellipsoid {:.1f} %", 1e3 * f.rms_m,
                        f.compared_tracking > 0 && f.compared_tracking < f.compared
                            ? fmt::format(" ({:.1f} mm while tracking)", 1e3 * f.tracking_rms_m)
                            : "",
                        1e3 * f.max_m, 100 * f.inside_95);
  if (f.compared > 0 && f.compared < f.positions)
    text += fmt::format("; compared where there is a truth, {} of {} positions", f.compared, f.positions);
  return text;
}

Canvas draw_chart(const std::vector<ChartTarget>& targets, const ChartStyle& style, Canvas::Kind kind) {
  return Chart(targets, style, kind).take();
}

}  // namespace huetrack::plot
