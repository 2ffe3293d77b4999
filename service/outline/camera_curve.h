// The camera's tone curve, sRGB, between grey values 0..1 and linear light 0..1: a cubic, inverted by one Newton step.
#pragma once

#include <cmath>

#include "outline/picture.h"

namespace huetrack::outline {

inline constexpr float white = 255;  // unit: grey values of R' = 1
// layout: shares of a Bayer mosaic. The edge of this grey is as sharp as the lens; what colour adds is softer.
inline constexpr float grey_red = 0.25f, grey_green = 0.5f, grey_blue = 0.25f;
// maths: range in which the curve is inverted, linear light and grey values.
inline constexpr float darkest = 1e-4f, brightest_grey = 1.2f;
// maths: least-squares cubic of sRGB, and a polynomial of the square root from which the Newton step starts.
inline constexpr float curve1 = 0.012522878f, curve2 = 0.682171111f, curve3 = 0.305306011f;
inline constexpr float root1 = 1.17f, root2 = -0.17f;

[[gnu::always_inline]] inline float light_of(float grey) {
  return grey * (curve1 + grey * (curve2 + grey * curve3));
}

[[gnu::always_inline]] inline float grey_of(float light) {
  const float root = std::sqrt(light);
  const float grey = root * (root1 + root2 * root);
  return grey - (light_of(grey) - light) / (curve1 + grey * (2 * curve2 + grey * 3 * curve3));
}

struct LightChroma {
  float light, blue, red;
};
[[gnu::always_inline]] inline LightChroma ycc(float r, float g, float b) {
  const float y = y_red * r + y_green * g + y_blue * b;
  return {y, by_blue * (b - y), by_red * (r - y)};
}

struct LinearLight {
  float red, green, blue;
};
// Of light and chroma in grey values.
[[gnu::always_inline]] inline LinearLight linear_light(float light, float blue, float red) {
  const float gr = (light + red / by_red) / white, gb = (light + blue / by_blue) / white;
  const float gg = (light / white - y_red * gr - y_blue * gb) / y_green;
  const auto lit = [](float grey) __attribute__((always_inline)) {
    const float c = grey < 0 ? 0 : grey > brightest_grey ? brightest_grey : grey;
    const float l = light_of(c);
    return l < darkest ? darkest : l;
  };
  return {lit(gr), lit(gg), lit(gb)};
}

}  // namespace huetrack::outline
