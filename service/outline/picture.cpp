#include "outline/picture.h"

namespace huetrack::outline {
namespace {

constexpr float limited_light = 255.f / 219, limited_chroma = 255.f / 224;

void read(const Samples& samples, int u, int v, int n, float zero, float scale, float* out) {
  const std::uint8_t* from = samples.at(u, v);
  const std::ptrdiff_t step = samples.step;
  if (step == 1) {
    for (int i = 0; i < n; ++i) out[i] = (static_cast<float>(from[i]) - zero) * scale;
  } else {
    for (int i = 0; i < n; ++i) out[i] = (static_cast<float>(from[i * step]) - zero) * scale;
  }
}

}  // namespace

void read_light(const Picture& picture, int u, int v, int n, float* light) {
  if (picture.is_bgr) {
    const std::uint8_t* p = picture.light.at(u, v);
    for (int i = 0; i < n; ++i, p += picture.light.step) light[i] = y_blue * p[0] + y_green * p[1] + y_red * p[2];
    return;
  }
  read(picture.light, u, v, n, picture.is_limited ? 16.f : 0.f, picture.is_limited ? limited_light : 1.f, light);
}

void read_chroma(const Picture& picture, int u, int v, int n, float* blue, float* red) {
  if (picture.is_bgr) {
    const std::uint8_t* p = picture.light.at(u, v);
    for (int i = 0; i < n; ++i, p += picture.light.step) {
      const float y = y_blue * p[0] + y_green * p[1] + y_red * p[2];
      blue[i] = by_blue * (p[0] - y), red[i] = by_red * (p[2] - y);
    }
    return;
  }
  if (picture.is_grey) {
    for (int i = 0; i < n; ++i) blue[i] = red[i] = 0;
    return;
  }
  const float scale = picture.is_limited ? limited_chroma : 1.f;
  read(picture.blue, u, v, n, 128.f, scale, blue);
  read(picture.red, u, v, n, 128.f, scale, red);
}

}  // namespace huetrack::outline
