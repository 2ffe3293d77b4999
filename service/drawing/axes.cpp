#include "drawing/axes.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace huetrack::drawing {
namespace {

constexpr double label_size = 11, title_size = 12.5;
constexpr double x_label_room = 90, y_label_room = 32;  // minimum pixels between ticks

double x_step(const Axes& axes) {
  return tick_step(axes.x.size(), static_cast<int>(axes.box.width / x_label_room));
}

// The middle of a pixel, where a line of one pixel is sharp.
double sharp(double value) {
  return std::floor(value) + 0.5;
}

}  // namespace

void Span::add(double value) {
  if (!std::isfinite(value)) return;
  low = std::min(low, value);
  high = std::max(high, value);
}

void Span::pad(double share, double least) {
  if (!(low <= high)) low = 0, high = 1;
  const double more = std::max({0.0, share * size(), (least - size()) / 2});
  low -= more;
  high += more;
}

double tick_step(double range, int most) {
  const double raw = range / std::max(1, most), power = std::pow(10, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0})
    if (factor * power >= raw) return factor * power;
  return 10 * power;
}

std::string tick_label(double value, double step) {
  const int decimals = std::max(0, static_cast<int>(std::ceil(-std::log10(step) - 1e-9)));
  return fmt::format("{:.{}f}", std::abs(value) < step / 2 ? 0.0 : value, decimals);
}

void draw_x_labels(Canvas& canvas, const Axes& axes, const std::string& x_title) {
  const double bottom = axes.box.y + axes.box.height, step = x_step(axes);
  for_each_tick(axes.x, step, [&](double x) {
    canvas.text({axes(x, axes.y.low).x(), bottom + 16}, tick_label(x, step), label_size, muted, Align::centre);
  });
  canvas.text({axes.box.x + axes.box.width, bottom + 33}, x_title, label_size, muted, Align::right);
}

void draw_axes(Canvas& canvas, const Axes& axes, const AxesTitles& titles) {
  const Box& box = axes.box;
  const double right = box.x + box.width, bottom = box.y + box.height;
  canvas.rectangle(box, white);
  for_each_tick(axes.x, x_step(axes), [&](double x) {
    const double u = sharp(axes(x, axes.y.low).x());
    canvas.line({u, box.y}, {u, bottom}, grid, 1);
  });
  const double step = tick_step(axes.y.size(), static_cast<int>(box.height / y_label_room));
  for_each_tick(axes.y, step, [&](double y) {
    const double v = sharp(axes(axes.x.low, y).y());
    canvas.line({box.x, v}, {right, v}, grid, 1);
    canvas.text({box.x - 7, v + 4}, tick_label(y, step), label_size, muted, Align::right);
  });
  const std::array<Point, 4> frame{{{sharp(box.x), sharp(box.y)},
                                    {sharp(right), sharp(box.y)},
                                    {sharp(right), sharp(bottom)},
                                    {sharp(box.x), sharp(bottom)}}};
  canvas.polyline(frame, rule, 1, true);
  canvas.text({box.x, box.y - 8}, titles.title, title_size, ink, Align::left, Weight::bold);
  if (titles.has_x_labels) draw_x_labels(canvas, axes, titles.x_title);
}

}  // namespace huetrack::drawing
