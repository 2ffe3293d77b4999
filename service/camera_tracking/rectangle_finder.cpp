#include "camera_tracking/rectangle_finder.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace huetrack::camera_tracking {
namespace {

constexpr double corner_sigma_px = 0.1;
constexpr double least_share = 0.01;  // of the image's area
constexpr double fits_px = 0.6;       // rms of the corners, of a rectangle of this size
constexpr double same_px = 1.5;       // corners of the same quadrangle in two thresholds
constexpr double least_contrast = 1.5;
using Quad = std::array<Eigen::Vector2d, 4>;

struct Line {  // n . p = d, in ideal pixels; n unit
  Eigen::Vector2d n = Eigen::Vector2d::Zero();
  double d = 0;
  double from = 0, to = 0;  // the visible part of the edge, 0..1
  bool good = false;
};

std::optional<Eigen::Vector2d> raw_of(const calib::CameraModel& lens, const Eigen::Vector2d& ideal) {
  const auto px = lens.project({(ideal.x() - lens.cx()) / lens.fx(), (ideal.y() - lens.cy()) / lens.fy(), 1});
  if (!px) return std::nullopt;
  return px->px;
}

// Linear light of a gamma-coded grey level (sRGB, approximately BT.601, too). A blurred edge lies where half of the
// light is; located in grey levels it has a bias towards the dark side (EXPERIMENTS.md: 0.3 px).
const std::array<float, 256>& light_of(capture::ColorRange range) {
  static const auto table = [](double black, double white) {
    std::array<float, 256> t{};
    for (int i = 0; i < 256; ++i) {
      const double x = std::clamp((i - black) / (white - black), 0.0, 1.0);
      t[static_cast<std::size_t>(i)] =
          static_cast<float>(x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4));
    }
    return t;
  };
  static const std::array<float, 256> full = table(0, 255), limited = table(16, 235);
  return range == capture::ColorRange::full ? full : limited;
}

double light_at(const GreyImage& image, const std::array<float, 256>& light, const Eigen::Vector2d& p) {
  const int u = static_cast<int>(p.x()), v = static_cast<int>(p.y());
  const double fu = p.x() - u, fv = p.y() - v;
  const std::uint8_t* a = image.row(v) + u;
  const std::uint8_t* b = a + image.stride;
  const auto l = [&light](std::uint8_t x) { return static_cast<double>(light[x]); };
  return (1 - fv) * ((1 - fu) * l(a[0]) + fu * l(a[1])) + fv * ((1 - fu) * l(b[0]) + fu * l(b[1]));
}

// Sub-pixel offset of the steepest step of the expected sign along a normal; nullopt: no clear one.
std::optional<double> steepest(const GreyImage& image, const Eigen::Vector2d& at, const Eigen::Vector2d& outward,
                               double search_px, bool dark) {
  constexpr double spacing = 0.5;
  const int half = static_cast<int>(std::ceil(search_px / spacing));
  const int n = 2 * half + 1;
  std::vector<double> slope(static_cast<std::size_t>(n), 0.0);
  const double sign = dark ? 1 : -1;
  const auto& light = light_of(image.range);
  for (int i = 0; i < n; ++i) {  // difference over 2 pixels: less noise, the same centre
    const Eigen::Vector2d p = at + spacing * (i - half) * outward;
    const Eigen::Vector2d a = p - outward, b = p + outward;
    if (!image.contains(a.x(), a.y(), 1.5) || !image.contains(b.x(), b.y(), 1.5)) return std::nullopt;
    slope[static_cast<std::size_t>(i)] = sign * (light_at(image, light, b) - light_at(image, light, a));
  }
  const auto peak = std::ranges::max_element(slope);
  const auto k = static_cast<int>(peak - slope.begin());
  const Eigen::Vector2d there = at + spacing * (k - half) * outward;
  const auto brightness = [&](const Eigen::Vector2d& p) {
    return static_cast<double>(sample(image, static_cast<float>(p.x()), static_cast<float>(p.y())));
  };
  if (sign * (brightness(there + outward) - brightness(there - outward)) < 12) return std::nullopt;
  double sum = 0, moment = 0;  // centroid of the step
  for (int i = std::max(0, k - 5); i <= std::min(n - 1, k + 5); ++i) {
    const double w = std::max(0.0, slope[static_cast<std::size_t>(i)] - 0.25 * *peak);
    sum += w, moment += w * (i - half);
  }
  if (k < 2 || k > n - 3) return std::nullopt;
  return spacing * moment / sum;
}

struct EdgePoint {
  Eigen::Vector2d ideal;
  double part;  // of the edge, 0..1
};

// Measured points of the edge from a along `along`; asked: the number of places that were tried.
std::vector<EdgePoint> points_of_edge(const GreyImage& image, const calib::CameraModel& lens, const Eigen::Vector2d& a,
                                      const Eigen::Vector2d& along, const Eigen::Vector2d& outward, double search_px,
                                      bool dark, int& asked) {
  const int samples = std::clamp(static_cast<int>(along.norm()), 10, 80);
  std::vector<EdgePoint> points;
  asked = 0;
  for (int i = 0; i < samples; ++i) {
    const double part = 0.06 + 0.88 * (i + 0.5) / samples;  // not near the corners
    const auto raw = raw_of(lens, a + part * along);
    const auto outside = raw_of(lens, a + part * along + outward);
    if (!raw || !outside || !image.contains(raw->x(), raw->y(), 3)) continue;
    ++asked;
    const Eigen::Vector2d normal = (*outside - *raw).normalized();
    const auto offset = steepest(image, *raw, normal, search_px, dark);
    if (!offset) continue;
    if (const auto ideal = lens.undistort({*raw + *offset * normal})) points.push_back({ideal->px, part});
  }
  return points;
}

// The largest consensus set of a line through two of the points.
std::vector<EdgePoint> most_in_a_line(const std::vector<EdgePoint>& points) {
  std::vector<EdgePoint> best;
  const std::size_t n = points.size();
  for (std::size_t i = 0; i < n; i += 1 + n / 24) {
    for (std::size_t j = i + n / 4 + 1; j < n; j += 1 + n / 24) {
      const Eigen::Vector2d d = (points[j].ideal - points[i].ideal).normalized();
      std::vector<EdgePoint> close;
      for (const EdgePoint& p : points) {
        const Eigen::Vector2d r = p.ideal - points[i].ideal;
        if (std::abs(d.x() * r.y() - d.y() * r.x()) < 0.6) close.push_back(p);
      }
      if (close.size() > best.size()) best = std::move(close);
    }
  }
  return best;
}

Line fit_edge(const GreyImage& image, const calib::CameraModel& lens, const Eigen::Vector2d& a,
              const Eigen::Vector2d& b, const Eigen::Vector2d& inside, double search_px, bool dark) {
  constexpr std::size_t fewest = 8;
  Line line;
  const Eigen::Vector2d along = b - a;
  const double length = along.norm();
  if (!(length > 6)) return line;
  Eigen::Vector2d outward(-along.y() / length, along.x() / length);
  if (outward.dot(inside - a) > 0) outward = -outward;
  int asked = 0;
  const std::vector<EdgePoint> points = points_of_edge(image, lens, a, along, outward, search_px, dark, asked);
  if (points.size() < fewest) return line;
  const std::vector<EdgePoint> best = most_in_a_line(points);
  if (static_cast<double>(best.size()) < 0.6 * asked || best.size() < fewest) return line;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const EdgePoint& p : best) mean += p.ideal / static_cast<double>(best.size());
  Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
  for (const EdgePoint& p : best) spread += (p.ideal - mean) * (p.ideal - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(spread);
  if (axes.eigenvalues()[0] / static_cast<double>(best.size()) > 0.3 * 0.3) return line;
  line.n = axes.eigenvectors().col(0);
  line.d = line.n.dot(mean);
  line.from = best.front().part, line.to = best.back().part;
  line.good = line.to - line.from > 0.5;
  return line;
}

double rms_px(const PoseFit& fit) {
  double sum = 0;
  for (const double e : fit.error) sum += e * e;
  return corner_sigma_px * std::sqrt(sum / static_cast<double>(fit.error.size()));
}

std::optional<PoseFit> pose_of(const calib::CameraModel& lens, std::span<const Eigen::Vector3d> world, const Quad& px) {
  std::vector<PoseObservation> observations;
  for (std::size_t i = 0; i < 4; ++i) observations.push_back({world[i], px[i], corner_sigma_px});
  return solve_pose(lens, observations);
}

// Contrast between the inside and a ring around it, over the standard deviations of both.
double contrast(const GreyImage& image, const Quad& px, bool dark) {
  const Eigen::Vector2d centre = (px[0] + px[1] + px[2] + px[3]) / 4;
  double sum[2] = {}, square[2] = {};
  int count[2] = {};
  for (int ring = 0; ring < 2; ++ring) {
    for (const double grow : ring == 0 ? std::array{0.35, 0.8} : std::array{1.10, 1.18}) {
      for (std::size_t k = 0; k < 4; ++k) {
        for (int i = 0; i < 12; ++i) {
          const Eigen::Vector2d edge = px[k] + (px[(k + 1) % 4] - px[k]) * (i + 0.5) / 12;
          const Eigen::Vector2d p = centre + grow * (edge - centre);
          if (!image.contains(p.x(), p.y(), 0)) continue;
          const double x = static_cast<double>(sample(image, static_cast<float>(p.x()), static_cast<float>(p.y())));
          sum[ring] += x, square[ring] += x * x, ++count[ring];
        }
      }
    }
  }
  if (count[0] < 20 || count[1] < 20) return 0;
  const double inside = sum[0] / count[0], outside = sum[1] / count[1];
  const double noise = std::sqrt(std::max(0.0, square[0] / count[0] - inside * inside)) +
                       std::sqrt(std::max(0.0, square[1] / count[1] - outside * outside));
  const double step = dark ? outside - inside : inside - outside;
  return step < 20 ? 0 : step / (noise + 4);
}

// The corners of a convex quadrangular contour, clockwise; nullopt: another shape.
std::optional<Quad> quad_of(const std::vector<cv::Point>& contour) {
  std::vector<cv::Point> corners;
  for (const double tolerance : {0.02, 0.035, 0.05}) {  // of its length
    cv::approxPolyDP(contour, corners, tolerance * cv::arcLength(contour, true), true);
    if (corners.size() == 4) break;
  }
  if (corners.size() != 4 || !cv::isContourConvex(corners)) return std::nullopt;
  Quad quad;
  for (std::size_t i = 0; i < 4; ++i) quad[i] = {corners[i].x, corners[i].y};
  double twice_area = 0;  // > 0: clockwise, v being down
  for (std::size_t i = 0; i < 4; ++i)
    twice_area += quad[i].x() * quad[(i + 1) % 4].y() - quad[i].y() * quad[(i + 1) % 4].x();
  if (twice_area < 0) std::swap(quad[1], quad[3]);
  return quad;
}

// Up to the choice of the first corner.
bool are_the_same(const Quad& a, const Quad& b) {
  return std::ranges::any_of(std::array<std::size_t, 4>{0, 1, 2, 3}, [&](std::size_t turn) {
    double far = 0;
    for (std::size_t i = 0; i < 4; ++i) far = std::max(far, (a[i] - b[(i + turn) % 4]).norm());
    return far < same_px;
  });
}

// Quadrangles at several thresholds about Otsu's, for uneven illumination.
std::vector<Quad> quads_in(const GreyImage& image) {
  const cv::Mat grey(image.height, image.width, CV_8UC1, const_cast<std::uint8_t*>(image.data),
                     static_cast<std::size_t>(image.stride));
  cv::Mat binary;
  const double otsu = cv::threshold(grey, binary, 0, 255, cv::THRESH_BINARY | cv::THRESH_OTSU);
  std::vector<Quad> quads;
  for (const double threshold : {otsu, 0.7 * otsu, 0.5 * otsu, 1.25 * otsu, 1.5 * otsu}) {
    cv::threshold(grey, binary, threshold, 255, cv::THRESH_BINARY);
    std::vector<std::vector<cv::Point>> contours;
    cv::findContours(binary, contours, cv::RETR_LIST, cv::CHAIN_APPROX_NONE);
    for (const auto& contour : contours) {
      if (cv::contourArea(contour) < least_share * image.width * image.height) continue;
      const auto quad = quad_of(contour);
      if (quad && std::ranges::none_of(quads, [&](const Quad& other) { return are_the_same(*quad, other); }))
        quads.push_back(*quad);
    }
  }
  return quads;
}

struct CornerOrder {  // one choice of the first corner
  PoseFit pose;
  Quad px;
  double rms_px;
};
// The best fitting one; of two that differ by half a turn, and fit equally well, as documented at find_rectangle().
std::optional<CornerOrder> best_order(const calib::CameraModel& lens, std::span<const Eigen::Vector3d> corners_world,
                                      const Quad& seen, const calib::Rigid3d* near) {
  std::vector<CornerOrder> orders;
  for (std::size_t turn = 0; turn < 4; ++turn) {
    Quad px;
    for (std::size_t i = 0; i < 4; ++i) px[i] = seen[(i + turn) % 4];
    if (auto pose = pose_of(lens, corners_world, px); pose && rms_px(*pose) < fits_px)
      orders.push_back({*pose, px, rms_px(*pose)});
  }
  if (orders.empty()) return std::nullopt;
  const double least = std::ranges::min(orders, {}, &CornerOrder::rms_px).rms_px;
  std::erase_if(orders, [least](const CornerOrder& w) { return w.rms_px > least + 0.25 * fits_px; });
  return *std::ranges::min_element(orders, {}, [near](const CornerOrder& w) {
    return near != nullptr ? w.pose.cam_from_world.rotation.angularDistance(near->rotation) : w.px[0].sum();
  });
}

}  // namespace

RectangleCorners measure_rectangle(const GreyImage& image, const calib::CameraModel& lens, const Quad& about,
                                   double search_px, bool dark) {
  RectangleCorners out;
  out.px.fill(Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN()));
  Quad ideal;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto p = lens.undistort({about[i]});
    if (!p) return out;
    ideal[i] = p->px;
  }
  const Eigen::Vector2d centre = (ideal[0] + ideal[1] + ideal[2] + ideal[3]) / 4;
  std::array<Line, 4> line;
  for (std::size_t i = 0; i < 4; ++i)
    line[i] = fit_edge(image, lens, ideal[i], ideal[(i + 1) % 4], centre, search_px, dark);
  for (std::size_t i = 0; i < 4; ++i) {
    const Line& before = line[(i + 3) % 4];
    const Line& after = line[i];
    if (!before.good || !after.good || before.to < 0.75 || after.from > 0.25) continue;
    const double det = before.n.x() * after.n.y() - before.n.y() * after.n.x();
    if (std::abs(det) < 0.2) continue;
    const Eigen::Vector2d corner((before.d * after.n.y() - after.d * before.n.y()) / det,
                                 (after.d * before.n.x() - before.d * after.n.x()) / det);
    if (!((corner - ideal[i]).norm() < 2 * search_px + 2)) continue;
    if (const auto raw = raw_of(lens, corner); raw && image.contains(raw->x(), raw->y(), 2))
      out.px[i] = *raw, out.measured[i] = true;
  }
  return out;
}

std::optional<FoundRectangle> rectangle_at(const GreyImage& image, const calib::CameraModel& lens,
                                           std::span<const Eigen::Vector3d> corners_world, const Quad& about) {
  std::optional<FoundRectangle> best;
  double best_rms = 2 * fits_px;
  for (const bool dark : {true, false}) {
    for (const double search : {3.0, 6.0, 12.0}) {
      RectangleCorners corners = measure_rectangle(image, lens, about, search, dark);
      if (corners.count() < 4) continue;
      corners = measure_rectangle(image, lens, corners.px, 3, dark);
      if (corners.count() < 4) continue;
      const auto pose = pose_of(lens, corners_world, corners.px);
      if (!pose || !(rms_px(*pose) < best_rms)) continue;
      best_rms = rms_px(*pose);
      best = FoundRectangle{corners, *pose, dark};
      break;
    }
  }
  return best;
}

std::optional<FoundRectangle> find_rectangle(const GreyImage& image, const calib::CameraModel& lens,
                                             std::span<const Eigen::Vector3d> corners_world,
                                             const calib::Rigid3d* near) {
  std::optional<FoundRectangle> best;
  double best_contrast = least_contrast;
  for (const Quad& quad : quads_in(image)) {
    for (const bool dark : {true, false}) {
      RectangleCorners measured = measure_rectangle(image, lens, quad, 4, dark);
      if (measured.count() < 4) continue;
      measured = measure_rectangle(image, lens, measured.px, 2.5, dark);
      if (measured.count() < 4) continue;
      const double clear = contrast(image, measured.px, dark);
      if (!(clear > best_contrast)) continue;
      const auto order = best_order(lens, corners_world, measured.px, near);
      if (!order) continue;
      best_contrast = clear;
      best = FoundRectangle{{order->px, {true, true, true, true}}, order->pose, dark};
    }
  }
  return best;
}

}  // namespace huetrack::camera_tracking
