#include "camera_tracking/corners.h"

#include <algorithm>
#include <cmath>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "particle_filter/random.h"

namespace huetrack::camera_tracking {
namespace {

struct Pair {
  float u0, v0, u1, v1;
};
// Drawn once from a fixed seed: normal about the centre, within a disc of 11 pixels.
const std::array<Pair, 256>& pairs() {
  static const std::array<Pair, 256> drawn = [] {
    std::array<Pair, 256> out{};
    particle_filter::Rng rng(20140226);
    std::vector<float> normal(4096);
    rng.fill_normal(normal);
    std::size_t next = 0;
    const auto point = [&](float& u, float& v) {
      do u = 5 * normal[next++], v = 5 * normal[next++];
      while (u * u + v * v > 121);
    };
    for (Pair& p : out) {
      do point(p.u0, p.v0), point(p.u1, p.v1);
      while (std::hypot(p.u0 - p.u1, p.v0 - p.v1) < 3);
    }
    return out;
  }();
  return drawn;
}

// Mean of 3 x 3, times 9.
int smooth(const GreyImage& image, int u, int v) {
  int sum = 0;
  for (int j = -1; j <= 1; ++j) {
    const std::uint8_t* row = image.row(v + j) + u;
    sum += row[-1] + row[0] + row[1];
  }
  return sum;
}

}  // namespace

float corner_score(const GreyImage& image, int u, int v) {
  int uu = 0, uv = 0, vv = 0;
  for (int j = -3; j <= 3; ++j) {
    const std::uint8_t* row = image.row(v + j) + u;
    for (int i = -3; i <= 3; ++i) {
      const int gu = row[i + 1] - row[i - 1], gv = row[i + image.stride] - row[i - image.stride];
      uu += gu * gu, uv += gu * gv, vv += gv * gv;
    }
  }
  const double half = 0.5 * (uu + vv), diff = 0.5 * (uu - vv);
  return static_cast<float>((half - std::sqrt(diff * diff + static_cast<double>(uv) * uv)) / (4 * 49));
}

std::vector<Corner> detect_corners(const GreyImage& image, int threshold, int margin, float min_score, int u0, int v0,
                                   int u1, int v1) {
  margin = std::max(margin, 4);
  u0 = std::max(u0, margin), v0 = std::max(v0, margin);
  u1 = std::min(u1, image.width - 1 - margin), v1 = std::min(v1, image.height - 1 - margin);
  std::vector<Corner> out;
  if (u1 - u0 < 1 || v1 - v0 < 1) return out;
  const cv::Mat grey(image.height, image.width, CV_8UC1, const_cast<std::uint8_t*>(image.data),
                     static_cast<std::size_t>(image.stride));
  const int ring = 4;  // FAST looks 3 pixels further, non-maximum suppression one more
  const cv::Rect part(u0 - ring, v0 - ring, u1 - u0 + 1 + 2 * ring, v1 - v0 + 1 + 2 * ring);
  std::vector<cv::KeyPoint> keypoints;
  cv::FAST(grey(part), keypoints, threshold, true);
  for (const cv::KeyPoint& k : keypoints) {
    const int u = part.x + static_cast<int>(k.pt.x), v = part.y + static_cast<int>(k.pt.y);
    if (u < u0 || v < v0 || u > u1 || v > v1) continue;
    const float score = corner_score(image, u, v);
    if (score >= min_score) out.push_back({{u, v}, score});
  }
  std::ranges::stable_sort(out, std::greater{}, &Corner::score);
  return out;
}

std::vector<Corner> detect_corners(const GreyImage& image, int threshold, int margin, float min_score) {
  return detect_corners(image, threshold, margin, min_score, 0, 0, image.width - 1, image.height - 1);
}

Descriptor describe(const GreyImage& image, const Eigen::Vector2d& px) {
  const int u = static_cast<int>(std::lround(px.x())), v = static_cast<int>(std::lround(px.y()));
  std::int64_t mu = 0, mv = 0;
  for (int j = -7; j <= 7; ++j) {
    const std::uint8_t* row = image.row(v + j) + u;
    const int reach = static_cast<int>(std::sqrt(static_cast<double>(56 - j * j)));
    for (int i = -reach; i <= reach; ++i) mu += i * row[i], mv += j * row[i];
  }
  const double length = std::hypot(static_cast<double>(mu), static_cast<double>(mv));
  const float c = length > 0 ? static_cast<float>(static_cast<double>(mu) / length) : 1.0f;
  const float s = length > 0 ? static_cast<float>(static_cast<double>(mv) / length) : 0.0f;
  Descriptor out{};
  std::size_t bit = 0;
  for (const Pair& p : pairs()) {
    const auto at = [&](float a, float b) {
      return smooth(image, u + static_cast<int>(std::lround(c * a - s * b)),
                    v + static_cast<int>(std::lround(s * a + c * b)));
    };
    if (at(p.u0, p.v0) < at(p.u1, p.v1)) out[bit / 64] |= std::uint64_t{1} << (bit % 64);
    ++bit;
  }
  return out;
}

}  // namespace huetrack::camera_tracking
