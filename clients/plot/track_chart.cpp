#include "clients/plot/track_chart.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <optional>

namespace huetrack::plot {
namespace {

constexpr double chi2_95_in_3d = 7.815;
constexpr double chi_95_in_2d = 2.4477;
constexpr double normal_95 = 1.96;

struct Rgb {
  double r, g, b;
};
constexpr Rgb ink{0.09, 0.10, 0.12}, muted{0.38, 0.42, 0.47}, grid{0.89, 0.90, 0.92}, truth_color{0.55, 0.57, 0.60};
constexpr Rgb target_colors[] = {
    {0.13, 0.42, 0.80}, {0.83, 0.35, 0.10}, {0.13, 0.55, 0.33}, {0.58, 0.27, 0.70}, {0.70, 0.50, 0.05}};

Rgb color_of(std::size_t target) {
  return target_colors[target % std::size(target_colors)];
}

Rgb truth_color_of(std::size_t target, std::size_t targets) {
  if (targets == 1) return truth_color;
  const Rgb own = color_of(target);
  return {(own.r + truth_color.r) / 2, (own.g + truth_color.g) / 2, (own.b + truth_color.b) / 2};
}

Rgb state_color(const std::string& state) {
  if (state == "tracking") return {0.20, 0.60, 0.36};
  if (state == "coasting") return {0.90, 0.62, 0.12};
  if (state == "searching") return {0.36, 0.52, 0.85};
  return {0.80, 0.26, 0.22};
}

struct Box {
  double x, y, w, h;
};
struct Span {
  double low = std::numeric_limits<double>::infinity(), high = -std::numeric_limits<double>::infinity();
  void add(double v) {
    if (!std::isfinite(v)) return;
    low = std::min(low, v);
    high = std::max(high, v);
  }
  void pad(double share, double least) {
    if (!(low <= high)) low = 0, high = 1;
    const double more = std::max(share * (high - low), (least - (high - low)) / 2);
    low -= std::max(0.0, more);
    high += std::max(0.0, more);
  }
};

class Pen {
 public:
  explicit Pen(cairo_t* c) : c_(c) {
    cairo_select_font_face(c_, "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_line_join(c_, CAIRO_LINE_JOIN_ROUND);
  }
  void color(const Rgb& rgb, double alpha = 1) { cairo_set_source_rgba(c_, rgb.r, rgb.g, rgb.b, alpha); }
  void text(double x, double y, const std::string& what, double size, const Rgb& rgb, double anchor = 0,
            bool bold = false) {
    cairo_select_font_face(c_, "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL,
                           bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(c_, size);
    cairo_text_extents_t extents;
    cairo_text_extents(c_, what.c_str(), &extents);
    color(rgb);
    cairo_move_to(c_, x - anchor * extents.x_advance, y);
    cairo_show_text(c_, what.c_str());
  }
  void line(double x0, double y0, double x1, double y1, const Rgb& rgb, double width) {
    cairo_move_to(c_, x0, y0);
    cairo_line_to(c_, x1, y1);
    stroke(rgb, width);
  }
  void stroke(const Rgb& rgb, double width, double alpha = 1) {
    color(rgb, alpha);
    cairo_set_line_width(c_, width);
    cairo_stroke(c_);
  }
  void rectangle(const Box& box, const Rgb& rgb, double alpha = 1) {
    color(rgb, alpha);
    cairo_rectangle(c_, box.x, box.y, box.w, box.h);
    cairo_fill(c_);
  }
  cairo_t* get() const { return c_; }

 private:
  cairo_t* c_;
};

double tick_step(double range, int count) {
  const double raw = range / std::max(1, count);
  const double power = std::pow(10, std::floor(std::log10(raw)));
  for (const double m : {1.0, 2.0, 5.0})
    if (m * power >= raw) return m * power;
  return 10 * power;
}

std::string number(double v, double step) {
  char text[32];
  std::snprintf(text, sizeof text, "%.*f", std::max(0, static_cast<int>(std::ceil(-std::log10(step) - 1e-9))),
                std::abs(v) < step / 1e6 ? 0 : v);
  return text;
}

// A frame with axes; returns how values become places.
struct Axes {
  Box box;
  Span x, y;
  double u(double v) const { return box.x + (v - x.low) / (x.high - x.low) * box.w; }
  double v(double value) const { return box.y + box.h - (value - y.low) / (y.high - y.low) * box.h; }
};

void draw_axes(Pen& pen, const Axes& axes, const std::string& title, bool has_x_labels,
               const std::string& x_title = "") {
  const Box& b = axes.box;
  const double dy = tick_step(axes.y.high - axes.y.low, static_cast<int>(b.h / 32)),
               dx = tick_step(axes.x.high - axes.x.low, static_cast<int>(b.w / 90));
  for (double v = std::ceil(axes.y.low / dy) * dy; v <= axes.y.high; v += dy) {
    pen.line(b.x, axes.v(v), b.x + b.w, axes.v(v), grid, 1);
    pen.text(b.x - 7, axes.v(v) + 4, number(v, dy), 11, muted, 1);
  }
  for (double v = std::ceil(axes.x.low / dx) * dx; v <= axes.x.high; v += dx) {
    pen.line(axes.u(v), b.y, axes.u(v), b.y + b.h, grid, 1);
    if (has_x_labels) pen.text(axes.u(v), b.y + b.h + 16, number(v, dx), 11, muted, 0.5);
  }
  pen.text(b.x, b.y - 7, title, 12.5, ink, 0, true);
  if (!x_title.empty()) pen.text(b.x + b.w, b.y + b.h + 32, x_title, 11, muted, 1);
}

void clip(Pen& pen, const Box& b) {
  cairo_save(pen.get());
  cairo_rectangle(pen.get(), b.x, b.y, b.w, b.h);
  cairo_clip(pen.get());
}

// The usual time between two rows: longer gaps break lines.
double gap_of(const std::vector<TrackRow>& rows) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < rows.size(); ++i) steps.push_back(rows[i].t - rows[i - 1].t);
  if (steps.empty()) return 1;
  std::nth_element(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2), steps.end());
  return 2.5 * std::max(steps[steps.size() / 2], 1e-3);
}

// A plane through space: two of the axes. Lines in the colour of the state; ellipses now and then.
void draw_plane(Pen& pen, const Axes& axes, std::size_t a, std::size_t b, const std::vector<ChartTarget>& targets) {
  constexpr std::size_t index[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};  // into xx xy xz yy yz zz
  clip(pen, axes.box);
  cairo_t* c = pen.get();
  for (std::size_t k = 0; k < targets.size(); ++k) {
    const auto& truth = targets[k].truth;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      const auto& p = truth[i].position;
      (i == 0 ? cairo_move_to : cairo_line_to)(c, axes.u(p[a]), axes.v(p[b]));
    }
    pen.stroke(truth_color_of(k, targets.size()), 4, 0.5);
  }
  for (std::size_t k = 0; k < targets.size(); ++k) {
    const auto& rows = targets[k].rows;
    const double gap = gap_of(rows);
    const std::size_t every = std::max<std::size_t>(1, rows.size() / 40);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const TrackRow& row = rows[i];
      if (!row.has_position()) continue;
      const double saa = row.covariance[index[a][a]], sbb = row.covariance[index[b][b]],
                   sab = row.covariance[index[a][b]];
      if (i % every == 0 && std::isfinite(saa + sbb + sab)) {
        const double mean = (saa + sbb) / 2, half = std::hypot((saa - sbb) / 2, sab);
        cairo_save(c);
        cairo_translate(c, axes.u(row.position[a]), axes.v(row.position[b]));
        cairo_rotate(c, -std::atan2(2 * sab, saa - sbb) / 2);
        const double scale = chi_95_in_2d * axes.box.w / (axes.x.high - axes.x.low);
        cairo_scale(c, std::max(0.3, scale * std::sqrt(std::max(0.0, mean + half))),
                    std::max(0.3, scale * std::sqrt(std::max(0.0, mean - half))));
        cairo_arc(c, 0, 0, 1, 0, 2 * 3.14159265358979);
        cairo_restore(c);
        pen.color(state_color(row.state), 0.16);
        cairo_fill(c);
      }
      if (i == 0 || !rows[i - 1].has_position() || row.t - rows[i - 1].t > gap) continue;
      cairo_move_to(c, axes.u(rows[i - 1].position[a]), axes.v(rows[i - 1].position[b]));
      cairo_line_to(c, axes.u(row.position[a]), axes.v(row.position[b]));
      // The line says the state; with more than one target, its rim says whose it is.
      if (targets.size() > 1) {
        const cairo_path_t* path = cairo_copy_path(c);
        pen.stroke(color_of(k), 5, 0.45);
        cairo_append_path(c, path);
        cairo_path_destroy(const_cast<cairo_path_t*>(path));
      }
      pen.stroke(state_color(row.state), 1.7);
    }
    const auto first = std::ranges::find_if(rows, &TrackRow::has_position);
    if (first == rows.end()) continue;
    cairo_arc(c, axes.u(first->position[a]), axes.v(first->position[b]), 4.5, 0, 2 * 3.14159265358979);
    pen.color(color_of(k));
    cairo_fill(c);
    pen.text(axes.u(first->position[a]) + 7, axes.v(first->position[b]) - 5, targets[k].name, 12, color_of(k), 0, true);
  }
  cairo_restore(c);
}

// value and half-width of its 95 % band per row; NaN: none.
void draw_series(Pen& pen, const Axes& axes, const ChartTarget& target, const Rgb& color,
                 const std::function<std::pair<double, double>(const TrackRow&)>& value) {
  clip(pen, axes.box);
  cairo_t* c = pen.get();
  const double gap = gap_of(target.rows);
  std::vector<std::vector<std::array<double, 3>>> runs;
  double last = -std::numeric_limits<double>::infinity();
  for (const TrackRow& row : target.rows) {
    const auto [v, half] = value(row);
    if (!std::isfinite(v)) {
      last = -std::numeric_limits<double>::infinity();
      continue;
    }
    if (row.t - last > gap) runs.emplace_back();
    runs.back().push_back({row.t, v, std::isfinite(half) ? half : 0});
    last = row.t;
  }
  for (const auto& run : runs) {
    for (const auto& p : run) cairo_line_to(c, axes.u(p[0]), axes.v(p[1] + p[2]));
    for (auto p = run.rbegin(); p != run.rend(); ++p) cairo_line_to(c, axes.u((*p)[0]), axes.v((*p)[1] - (*p)[2]));
    cairo_close_path(c);
    pen.color(color, 0.18);
    cairo_fill(c);
    for (const auto& p : run) cairo_line_to(c, axes.u(p[0]), axes.v(p[1]));
    pen.stroke(color, 1.6);
  }
  cairo_restore(c);
}

void draw_states(Pen& pen, const Box& box, const Span& time, const std::vector<ChartTarget>& targets) {
  const double row_height = box.h / static_cast<double>(std::max<std::size_t>(1, targets.size()));
  for (std::size_t k = 0; k < targets.size(); ++k) {
    const auto& rows = targets[k].rows;
    const double gap = gap_of(rows), y = box.y + static_cast<double>(k) * row_height;
    pen.text(box.x - 7, y + row_height / 2 + 4, targets[k].name, 11, muted, 1);
    for (std::size_t i = 0; i < rows.size();) {
      std::size_t j = i;
      while (j + 1 < rows.size() && rows[j + 1].state == rows[i].state && rows[j + 1].t - rows[j].t <= gap) ++j;
      const double from = rows[i].t,
                   to = j + 1 < rows.size() && rows[j + 1].t - rows[j].t <= gap ? rows[j + 1].t : rows[j].t + gap / 2.5;
      const auto u = [&](double t) { return box.x + (t - time.low) / (time.high - time.low) * box.w; };
      pen.rectangle({u(from), y + 2, std::max(1.0, std::min(u(to), box.x + box.w) - u(from)), row_height - 4},
                    state_color(rows[i].state));
      i = j + 1;
    }
  }
}

double sigma_of(
    const TrackRow& row) {  // the largest axis: by the trace's bound where the matrix is nearly a multiple of 1
  const auto& c = row.covariance;
  double v[3] = {1, 0.7, 0.4};
  double norm = 0;
  for (int i = 0; i < 30; ++i) {
    const double w[3] = {c[0] * v[0] + c[1] * v[1] + c[2] * v[2], c[1] * v[0] + c[3] * v[1] + c[4] * v[2],
                         c[2] * v[0] + c[4] * v[1] + c[5] * v[2]};
    norm = std::sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
    if (!(norm > 0)) return norm;
    for (int k = 0; k < 3; ++k) v[k] = w[k] / norm;
  }
  return std::sqrt(norm);
}

// The rule of `huetrackd compare` (service/tracks/truth.h): linear between samples that are at most 0.1 s apart; times
// may be rounded in the file.
constexpr double longest_truth_gap = 0.1, time_rounding = 5e-4;  // s

std::optional<std::array<double, 3>> truth_at(const ChartTarget& target, double t) {
  const auto after = std::ranges::lower_bound(target.truth, t, {}, &TruthPoint::t);
  if (after != target.truth.end() && after->t - t <= time_rounding) return after->position;
  if (after == target.truth.begin()) return std::nullopt;
  const auto before = std::prev(after);
  if (t - before->t <= time_rounding) return before->position;
  if (after == target.truth.end() || after->t - before->t > longest_truth_gap) return std::nullopt;
  const double share = (t - before->t) / (after->t - before->t);
  std::array<double, 3> p{};
  for (std::size_t i = 0; i < 3; ++i) p[i] = std::lerp(before->position[i], after->position[i], share);
  return p;
}

double error_of(const ChartTarget& target, const TrackRow& row) {
  const auto truth = truth_at(target, row.t);
  if (!truth || !row.has_position()) return std::numeric_limits<double>::quiet_NaN();
  return std::hypot(row.position[0] - (*truth)[0], row.position[1] - (*truth)[1], row.position[2] - (*truth)[2]);
}

// e^T C^-1 e by Cramer's rule.
double nees_of(const TrackRow& row, const std::array<double, 3>& e) {
  const auto& c = row.covariance;
  const double a = c[3] * c[5] - c[4] * c[4], b = c[2] * c[4] - c[1] * c[5], d = c[1] * c[4] - c[2] * c[3];
  const double f = c[0] * c[5] - c[2] * c[2], g = c[1] * c[2] - c[0] * c[4], h = c[0] * c[3] - c[1] * c[1];
  const double determinant = c[0] * a + c[1] * b + c[2] * d;
  return (e[0] * (a * e[0] + b * e[1] + d * e[2]) + e[1] * (b * e[0] + f * e[1] + g * e[2]) +
          e[2] * (d * e[0] + g * e[1] + h * e[2])) /
         determinant;
}

bool has_truth(const std::vector<ChartTarget>& targets) {
  return std::ranges::any_of(targets, [](const auto& t) { return !t.truth.empty(); });
}

constexpr double margin = 70, gap = 52, plane_height = 440, series_height = 128;
constexpr double near_m = 0.05;

bool is_narrow(const ChartStyle& style) {
  return style.width < 900;
}

double plane_height_of(const ChartStyle& style) {
  return is_narrow(style) ? 320 : plane_height;
}

struct Key {
  std::string name;
  Rgb color;
  double height, alpha;
};

double key_width(const Key& key) {
  return 40 + 7.6 * static_cast<double>(key.name.size());
}

// What the colours mean: targets (and their truths), then states; as many to a row as fit.
std::vector<std::vector<Key>> keys_of(const std::vector<ChartTarget>& targets, const ChartStyle& style) {
  std::vector<Key> keys;
  for (std::size_t k = 0; k < targets.size(); ++k) {
    keys.push_back({targets[k].name, color_of(k), 3, 1});
    if (!targets[k].truth.empty())
      keys.push_back({targets[k].name + ", truth", truth_color_of(k, targets.size()), 6, 0.5});
  }
  for (const char* state : {"tracking", "coasting", "searching", "lost"})
    keys.push_back({state, state_color(state), 12, 1});
  std::vector<std::vector<Key>> rows(1);
  double x = 0;
  for (Key& key : keys) {
    const double width = key_width(key);
    if (x > 0 && x + width > style.width - margin - 20) {
      rows.emplace_back();
      x = 0;
    }
    x += width;
    rows.back().push_back(std::move(key));
  }
  return rows;
}

double key_rows(const std::vector<ChartTarget>& targets, const ChartStyle& style) {
  return static_cast<double>(keys_of(targets, style).size());
}

}  // namespace

TargetFigures figures_of(const ChartTarget& target) {
  TargetFigures f{.name = target.name, .rows = target.rows.size()};
  double sum = 0;
  std::size_t inside = 0;
  for (const TrackRow& row : target.rows) {
    ++(row.state == "tracking"    ? f.tracking
       : row.state == "coasting"  ? f.coasting
       : row.state == "searching" ? f.searching
                                  : f.lost);
    f.positions += row.has_position() ? 1 : 0;
    f.in_truth += truth_at(target, row.t) ? 1 : 0;
    const double error = error_of(target, row);
    if (!std::isfinite(error)) continue;
    ++f.compared;
    f.is_ever_near |= row.state == "tracking" && error <= near_m;
    sum += error * error;
    f.max_m = std::max(f.max_m, error);
    const auto truth = *truth_at(target, row.t);
    const double nees =
        nees_of(row, {row.position[0] - truth[0], row.position[1] - truth[1], row.position[2] - truth[2]});
    inside += nees <= chi2_95_in_3d ? 1 : 0;
  }
  if (f.compared > 0) {
    f.rms_m = std::sqrt(sum / static_cast<double>(f.compared));
    f.inside_95 = static_cast<double>(inside) / static_cast<double>(f.compared);
  }
  return f;
}

std::string to_text(const TargetFigures& f) {
  const auto share = [&](std::size_t n) {
    return 100.0 * static_cast<double>(n) / static_cast<double>(std::max<std::size_t>(1, f.rows));
  };
  char text[320];
  int length = std::snprintf(
      text, sizeof text, "%s: %zu samples; tracking %.1f %%, coasting %.1f %%, searching %.1f %%, lost %.1f %%",
      f.name.c_str(), f.rows, share(f.tracking), share(f.coasting), share(f.searching), share(f.lost));
  if (f.compared > 0 && length > 0 && length < static_cast<int>(sizeof text))
    length += std::snprintf(text + length, sizeof text - static_cast<std::size_t>(length),
                            "; error rms %.1f mm, max %.1f mm; truth in the 95 %% ellipsoid %.1f %%", 1e3 * f.rms_m,
                            1e3 * f.max_m, 100 * f.inside_95);
  if (f.compared > 0 && f.compared < f.positions && length > 0 && length < static_cast<int>(sizeof text))
    std::snprintf(text + length, sizeof text - static_cast<std::size_t>(length),
                  "; compared where there is a truth, %zu of %zu positions", f.compared, f.positions);
  return text;
}

int chart_height(const std::vector<ChartTarget>& targets, const ChartStyle& style) {
  const double rows = has_truth(targets) ? 5 : 4;
  const double head = style.title.empty() ? 40 : 62 + 20.0 * static_cast<double>(targets.size());
  const double planes = is_narrow(style) ? 2 : 1;
  return static_cast<int>(head + 20.0 * key_rows(targets, style) + 34 + planes * (plane_height_of(style) + gap) +
                          rows * (series_height + 34) + 34 + 24.0 * static_cast<double>(targets.size()) + 60);
}

void draw_chart(cairo_t* cairo, const std::vector<ChartTarget>& targets, const ChartStyle& style) {
  Pen pen(cairo);
  const double width = style.width;
  const double margin_left = is_narrow(style) ? 48 : margin, margin_right = is_narrow(style) ? 12 : margin;
  pen.rectangle({0, 0, width, static_cast<double>(chart_height(targets, style))}, {1, 1, 1});
  double y = 24;
  if (!style.title.empty()) {
    pen.text(margin_left, 40, style.title, 20, ink, 0, true);
    y = 62;
    for (const ChartTarget& target : targets) {
      pen.text(margin_left, y, to_text(figures_of(target)), 12.5, muted);
      y += 20;
    }
  }
  for (const auto& row : keys_of(targets, style)) {
    double x = margin_left;
    for (const Key& key : row) {
      pen.rectangle({x, y - 10 + (12 - key.height) / 2, 14, key.height}, key.color, key.alpha);
      pen.text(x + 19, y, key.name, 12, ink);
      x += key_width(key);
    }
    y += 20;
  }

  Span time, all[3];
  for (const ChartTarget& target : targets) {
    for (const TrackRow& row : target.rows) {
      time.add(row.t);
      for (std::size_t i = 0; i < 3; ++i) all[i].add(row.position[i]);
    }
    for (const TruthPoint& point : target.truth)
      for (std::size_t i = 0; i < 3; ++i) all[i].add(point.position[i]);
  }
  time.pad(0, 1e-3);
  for (Span& s : all) s.pad(0.06, 0.05);

  // Two planes at one scale.
  y += 24;
  const bool stacked = is_narrow(style);
  const double half = stacked ? width - margin_left - margin_right : (width - margin_left - margin_right - 60) / 2;
  for (int side = 0; side < 2; ++side) {
    const std::size_t a = 0, b = side == 0 ? 1 : 2;
    const double across = stacked ? 0 : side * (half + 60), down = stacked ? side * (plane_height_of(style) + gap) : 0;
    Axes axes{{margin_left + across, y + down, half, plane_height_of(style)}, all[a], all[b]};
    const double scale = std::max((axes.x.high - axes.x.low) / axes.box.w, (axes.y.high - axes.y.low) / axes.box.h);
    const auto fit = [](Span& s, double range) {
      const double more = (range - (s.high - s.low)) / 2;
      s.low -= more;
      s.high += more;
    };
    fit(axes.x, scale * axes.box.w);
    fit(axes.y, scale * axes.box.h);
    draw_axes(pen, axes, side == 0 ? "From above: y over x, m" : "From the side: z over x, m", true);
    draw_plane(pen, axes, a, b, targets);
  }
  y += (stacked ? 2 : 1) * (plane_height_of(style) + gap);

  const auto panel = [&](const std::string& name, Span values, bool is_last,
                         const std::function<void(const Axes&)>& draw) {
    const Axes axes{{margin_left, y, width - margin_left - margin_right, series_height}, time, values};
    draw_axes(pen, axes, name, is_last, is_last ? style.time_title : "");
    draw(axes);
    y += series_height + 34;
  };
  const char* const names[] = {"x, m (band: 95 %)", "y, m", "z, m"};
  constexpr std::size_t diagonal[] = {0, 3, 5};
  for (std::size_t i = 0; i < 3; ++i) {
    panel(names[i], all[i], false, [&](const Axes& axes) {
      for (std::size_t k = 0; k < targets.size(); ++k) {
        clip(pen, axes.box);
        for (const TruthPoint& p : targets[k].truth) cairo_line_to(cairo, axes.u(p.t), axes.v(p.position[i]));
        pen.stroke(truth_color_of(k, targets.size()), 4, 0.5);
        cairo_restore(cairo);
        draw_series(pen, axes, targets[k], color_of(k), [&](const TrackRow& row) {
          return std::pair(row.position[i], normal_95 * std::sqrt(row.covariance[diagonal[i]]));
        });
      }
    });
  }
  const auto limited = [&](const std::function<double(const ChartTarget&, const TrackRow&)>& value) {
    std::vector<double> values;
    for (const ChartTarget& target : targets)
      for (const TrackRow& row : target.rows)
        if (const double v = value(target, row); std::isfinite(v)) values.push_back(v);
    Span span{0, 1};
    if (values.empty()) return span;
    std::ranges::sort(values);
    // A few coasting samples of half a metre must not flatten all the others.
    span.high = 1.15 * std::min(values.back(),
                                4 * values[static_cast<std::size_t>(0.9 * static_cast<double>(values.size() - 1))]);
    span.high = std::max(span.high, 1.0);
    return span;
  };
  const auto sigma_mm = [](const ChartTarget&, const TrackRow& row) {
    return row.has_position() ? 1e3 * sigma_of(row) : std::numeric_limits<double>::quiet_NaN();
  };
  panel("uncertainty: 1\xCF\x83 of the largest axis, mm", limited(sigma_mm), false, [&](const Axes& axes) {
    for (std::size_t k = 0; k < targets.size(); ++k)
      draw_series(pen, axes, targets[k], color_of(k),
                  [&](const TrackRow& row) { return std::pair(sigma_mm(targets[k], row), 0.0); });
  });
  if (has_truth(targets)) {
    const auto error_mm = [](const ChartTarget& target, const TrackRow& row) { return 1e3 * error_of(target, row); };
    panel("error against the truth, mm", limited(error_mm), false, [&](const Axes& axes) {
      for (std::size_t k = 0; k < targets.size(); ++k)
        draw_series(pen, axes, targets[k], color_of(k),
                    [&](const TrackRow& row) { return std::pair(error_mm(targets[k], row), 0.0); });
    });
  }
  const Axes strip{
      {margin_left, y, width - margin_left - margin_right, 24.0 * static_cast<double>(targets.size())}, time, {0, 1}};
  pen.text(margin_left, y - 7, "state", 12.5, ink, 0, true);
  draw_states(pen, strip.box, time, targets);
  const double dx = tick_step(time.high - time.low, is_narrow(style) ? 5 : 14);
  for (double t = std::ceil(time.low / dx) * dx; t <= time.high; t += dx)
    pen.text(strip.u(t), y + strip.box.h + 16, number(t, dx), 11, muted, 0.5);
  pen.text(width - margin_right, y + strip.box.h + 34, style.time_title, 11, muted, 1);
}

}  // namespace huetrack::plot
