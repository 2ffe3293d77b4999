#include "outline/picture.h"

namespace huetrack::outline {
namespace {

constexpr float limited_light = 255.f / 219, limited_chroma = 255.f / 224;

// Black and grey, and what a step of the samples is of a grey value.
struct Scale {
  float zero, by;
};
Scale scale_of_light(const Picture& picture) {
  return picture.is_limited ? Scale{16.f, limited_light} : Scale{0.f, 1.f};
}
Scale scale_of_chroma(const Picture& picture) {
  return {128.f, picture.is_limited ? limited_chroma : 1.f};
}

float luma(const std::uint8_t* bgr) {
  return y_blue * bgr[0] + y_green * bgr[1] + y_red * bgr[2];
}

// Eight at once, as far as there are so many.
template <int step>
void read(const std::uint8_t* __restrict from, int n, Scale scale, float* __restrict out) {
  int i = 0;
  for (; i + 8 <= n; i += 8) {
    float eight[8];
    for (int k = 0; k < 8; ++k) eight[k] = static_cast<float>(from[(i + k) * step]);
    for (int k = 0; k < 8; ++k) out[i + k] = (eight[k] - scale.zero) * scale.by;
  }
  for (; i < n; ++i) out[i] = (static_cast<float>(from[i * step]) - scale.zero) * scale.by;
}

void read(const Samples& samples, int u, int v, int n, Scale scale, float* out) {
  const std::uint8_t* from = samples.at(u, v);
  switch (samples.step) {
    case 1:
      return read<1>(from, n, scale, out);
    case 2:
      return read<2>(from, n, scale, out);
    case 4:
      return read<4>(from, n, scale, out);
    default:
      for (int i = 0; i < n; ++i) out[i] = (static_cast<float>(from[i * samples.step]) - scale.zero) * scale.by;
  }
}

void read(const Samples& samples, const Places& at, Scale scale, float* out) {
  for (int i = 0; i < at.n; ++i) out[i] = (static_cast<float>(*samples.at(at.u[i], at.v[i])) - scale.zero) * scale.by;
}

}  // namespace

void read_light(const Picture& picture, int u, int v, int n, float* light) {
  if (picture.is_bgr) {
    const std::uint8_t* p = picture.light.at(u, v);
    for (int i = 0; i < n; ++i, p += picture.light.step) light[i] = luma(p);
    return;
  }
  read(picture.light, u, v, n, scale_of_light(picture), light);
}

void read_chroma(const Picture& picture, int u, int v, int n, float* blue, float* red) {
  if (picture.is_bgr) {
    const std::uint8_t* p = picture.light.at(u, v);
    for (int i = 0; i < n; ++i, p += picture.light.step) {
      const float y = luma(p);
      blue[i] = by_blue * (p[0] - y), red[i] = by_red * (p[2] - y);
    }
    return;
  }
  if (picture.is_grey) {
    for (int i = 0; i < n; ++i) blue[i] = red[i] = 0;
    return;
  }
  read(picture.blue, u, v, n, scale_of_chroma(picture), blue);
  read(picture.red, u, v, n, scale_of_chroma(picture), red);
}

void read_light(const Picture& picture, const Places& at, float* light) {
  if (picture.is_bgr) {
    for (int i = 0; i < at.n; ++i) light[i] = luma(picture.light.at(at.u[i], at.v[i]));
    return;
  }
  read(picture.light, at, scale_of_light(picture), light);
}

void read_chroma(const Picture& picture, const Places& at, float* blue, float* red) {
  if (picture.is_bgr || picture.is_grey) {
    for (int i = 0; i < at.n; ++i) read_chroma(picture, at.u[i], at.v[i], 1, blue + i, red + i);
    return;
  }
  read(picture.blue, at, scale_of_chroma(picture), blue);
  read(picture.red, at, scale_of_chroma(picture), red);
}

}  // namespace huetrack::outline
