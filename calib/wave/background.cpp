#include "calib/wave/background.h"

#include <algorithm>
#include <array>

#include "calib/model/median.h"
#include "capture/frames/image_copy.h"

namespace huetrack::wave {
namespace {

constexpr std::size_t most_samples = 24, least_samples = 8;

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

std::optional<BackgroundImage> BackgroundSamples::of(std::size_t camera) const {
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
        // Interquartile range of a normal distribution: 1.35 sigma.
        if ((u + v) % 7 == 0) spread[k].push_back((values[k][to - 1] - values[k][from]) / 1.35f);
      }
      out.light.push_back(mean);
    }
  }
  for (std::size_t k = 0; k < 3; ++k) {
    out.noise[static_cast<int>(k)] = std::max(1.f, calib::median(std::move(spread[k])));
  }
  return out;
}

}  // namespace huetrack::wave
