#include "calib/wave/background.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "calib/model/median.h"
#include "capture/frames/image_copy.h"
#include "object_tracking/ball_outline.h"

namespace huetrack::wave {
namespace {

constexpr std::size_t most_samples = 24, least_samples = 8;

// Begins with the robust mean, and learns the noise, and what is rounded, from the samples themselves.
outline::Background background_of(const BackgroundImage& mean, const std::vector<capture::Image>& samples) {
  const outline::Picture like = object_tracking::picture_of(samples[0]);
  std::vector<std::uint8_t> light, blue, red;
  const auto byte = [](float grey) { return static_cast<std::uint8_t>(std::clamp(std::lround(grey), 0L, 255L)); };
  for (const Eigen::Vector3f& p : mean.light) {
    light.push_back(byte(p[0]));
    blue.push_back(byte(p[1] + 128));
    red.push_back(byte(p[2] + 128));
  }
  outline::Picture picture;
  picture.width = mean.width, picture.height = mean.height;
  picture.columns = like.columns, picture.rows = like.rows;
  picture.light = {light.data(), mean.width, 1};
  picture.blue = {blue.data(), mean.width * like.rows, like.columns};
  picture.red = {red.data(), mean.width * like.rows, like.columns};
  outline::Background out(mean.width, mean.height, std::numeric_limits<std::int16_t>::max());
  for (std::size_t i = 0; i < least_samples; ++i) out.learn_all(picture, nullptr, 0);
  for (const capture::Image& sample : samples) out.learn_all(object_tracking::picture_of(sample), nullptr, 0);
  return out;
}

}  // namespace

Eigen::Vector3f light_at(const capture::Image& image, int u, int v) {
  if (image.format == capture::PixelFormat::bgr) {
    const capture::Bgr p = capture::bgr_at(image, u, v);
    const float y = 0.299f * p.r + 0.587f * p.g + 0.114f * p.b;
    return {y, 0.564f * (p.b - y), 0.713f * (p.r - y)};
  }
  const capture::Yuv p = capture::yuv_at(image, u, v);
  if (image.range == capture::ColorRange::full) return {float(p.y), p.u - 128.f, p.v - 128.f};
  return {(p.y - 16.f) * (255.f / 219), (p.u - 128.f) * (255.f / 224), (p.v - 128.f) * (255.f / 224)};
}

void BackgroundSamples::add(const capture::Frame& frame) {
  const auto camera = static_cast<std::size_t>(frame.camera);
  if (frame.status != capture::FrameStatus::ok || camera >= of_camera_.size()) return;
  PerCamera& of = of_camera_[camera];
  if (!of.samples.empty() && (frame.pixels.width != of.samples[0].width || frame.pixels.height != of.samples[0].height))
    return;
  if (of.seen++ % of.every != 0) return;
  of.samples.push_back(capture::copy_of(frame.pixels));
  if (of.samples.size() < most_samples) return;
  for (std::size_t i = 1; 2 * i < of.samples.size(); ++i) of.samples[i] = of.samples[2 * i];
  of.samples.resize((of.samples.size() + 1) / 2);
  of.every *= 2;
}

std::optional<CameraBackground> BackgroundSamples::of(std::size_t camera) const {
  const std::vector<capture::Image>& samples = of_camera_.at(camera).samples;
  if (samples.size() < least_samples) return std::nullopt;
  BackgroundImage out;
  out.width = samples[0].width, out.height = samples[0].height;
  out.light.reserve(static_cast<std::size_t>(out.width) * static_cast<std::size_t>(out.height));
  const std::size_t from = samples.size() / 4, to = samples.size() - from;
  std::array<std::vector<float>, 3> values, spread;
  for (int v = 0; v < out.height; ++v) {
    for (int u = 0; u < out.width; ++u) {
      for (auto& of_channel : values) of_channel.clear();
      for (const capture::Image& sample : samples) {
        const Eigen::Vector3f light = light_at(sample, u, v);
        for (int k = 0; k < 3; ++k) values[static_cast<std::size_t>(k)].push_back(light[k]);
      }
      Eigen::Vector3f mean;
      for (std::size_t k = 0; k < 3; ++k) {
        std::ranges::sort(values[k]);
        float sum = 0;
        for (std::size_t i = from; i < to; ++i) sum += values[k][i];
        mean[static_cast<int>(k)] = sum / static_cast<float>(to - from);
        // Half of what is normal lies between the quarters: 1.35 standard deviations.
        if ((u + v) % 7 == 0) spread[k].push_back((values[k][to - 1] - values[k][from]) / 1.35f);
      }
      out.light.push_back(mean);
    }
  }
  for (std::size_t k = 0; k < 3; ++k) {
    out.noise[static_cast<int>(k)] = std::max(1.f, calib::median(std::move(spread[k])));
  }
  return CameraBackground{out, background_of(out, samples)};
}

}  // namespace huetrack::wave
