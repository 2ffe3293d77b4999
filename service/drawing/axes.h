// Linear axes in a rectangle of a picture: mapping, grid, ticks and titles.
#pragma once

#include <cmath>
#include <limits>
#include <string>

#include "drawing/canvas.h"

namespace huetrack::drawing {

inline constexpr Color ink{24, 27, 32}, muted{98, 106, 118}, grid{226, 229, 234}, rule{190, 194, 200};
inline constexpr Color white{255, 255, 255}, black{0, 0, 0};

// A range of values; empty until one is added.
struct Span {
  double low = std::numeric_limits<double>::infinity(), high = -std::numeric_limits<double>::infinity();
  double size() const { return high - low; }
  void add(double value);  // ignores non-finite values
  // Widens both sides by a share of the size, and to at least `least`. An empty span becomes 0 to 1 first.
  void pad(double share, double least);
};

// 1, 2 or 5 times a power of ten, for at most `most` steps in the range.
double tick_step(double range, int most);
std::string tick_label(double value, double step);  // with as many decimals as the step needs; never "-0"
// Calls f with every multiple of the step in the span, ends included.
template <typename F>
void for_each_tick(const Span& span, double step, F&& f);

struct Axes {
  Box box;
  Span x, y;
  Point operator()(double x_value, double y_value) const {
    return {box.x + (x_value - x.low) / x.size() * box.width,
            box.y + box.height - (y_value - y.low) / y.size() * box.height};
  }
};

struct AxesTitles {
  std::string title;  // above the box
  bool has_x_labels = true;
  std::string x_title;  // below the labels; empty: none
};
void draw_axes(Canvas& canvas, const Axes& axes, const AxesTitles& titles);
// The labels of the x axis alone, below the box.
void draw_x_labels(Canvas& canvas, const Axes& axes, const std::string& x_title);

template <typename F>
void for_each_tick(const Span& span, double step, F&& f) {
  constexpr double rounding = 1e-9;  // of a step: an end that is a multiple of the step counts
  const double last = span.high + rounding * step;
  for (double value = std::ceil(span.low / step - rounding) * step; value <= last; value += step) f(value);
}

}  // namespace huetrack::drawing
