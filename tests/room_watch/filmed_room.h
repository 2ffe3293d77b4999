// A room of 4 x 4 x 3 metres with painted walls, filmed by a camera at any pose in it, with correct parallax. Light and
// lens are functions of the time.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "calib/model/camera_rig.h"
#include "calib/model/rigid3.h"
#include "capture/frames/frame.h"

namespace huetrack::room_watch {

constexpr double degree = std::numbers::pi / 180;

inline calib::Camera camera_in_room() {
  calib::Camera camera;
  camera.name = "cam0";
  camera.image_size = {240, 180};
  calib::PinholeRadtan lens;
  lens.fx = lens.fy = 170;
  lens.cx = 119.5, lens.cy = 89.5;
  lens.distortion = {-0.11, 0.018, 0.0005, -0.0004, 0, 0, 0, 0};
  camera.model = calib::CameraModel(lens);
  const Eigen::Vector3d centre(-1.7, -1.5, 1.7), ahead = (Eigen::Vector3d(0, 0, 1.1) - centre).normalized();
  Eigen::Matrix3d rows;
  rows.row(2) = ahead;
  rows.row(0) = ahead.cross(Eigen::Vector3d::UnitZ()).normalized();
  rows.row(1) = ahead.cross(rows.row(0).transpose());
  camera.cam_from_world = {Eigen::Quaterniond(rows), -(rows * centre)};
  return camera;
}

// Turned about its centre by a rotation vector, and its centre moved, both in the camera's axes.
inline calib::Rigid3d moved(const calib::Rigid3d& pose, const Eigen::Vector3d& rotation,
                            const Eigen::Vector3d& shift = Eigen::Vector3d::Zero()) {
  calib::Tangent6d turn;
  turn << rotation, Eigen::Vector3d::Zero();
  return calib::Rigid3d{Eigen::Quaterniond::Identity(), -shift} * calib::exp(turn) * pose;
}

struct Film {
  double fps = 15;
  double noise = 2;  // grey levels
  capture::PixelFormat format = capture::PixelFormat::grey;
  double texture = 1;                               // 0: walls of one colour
  double spot_m = 0.22;                             // size of what is painted on the walls
  unsigned room = 1;                                // another number is another room
  std::function<calib::Rigid3d(double)> pose = {};  // cam_from_world; none: where it stands
  std::function<double(double)> zoom = [](double) { return 1.0; };
  std::function<double(double, double)> light = [](double, double) { return 1.0; };  // at a time, in a row (0..1)
  // Gaussian sigma in pixels at a time, in a column (0..1).
  std::function<double(double, double)> blur = {};
  // Columns occluded by a person, [from, to) as shares of the width; the texture moves along.
  std::function<std::pair<double, double>(double)> person = [](double) { return std::pair(0.0, 0.0); };
};

class FilmedRoom {
 public:
  explicit FilmedRoom(Film film = {}) : film_(std::move(film)), camera_(camera_in_room()) {}

  const calib::Camera& camera() const { return camera_; }

  // Shows `watch` what is seen from one moment to another, and calls each(t) after every frame.
  template <typename Watch, typename Each>
  void show(Watch& watch, double from_s, double to_s, Each&& each) {
    for (int k = int(std::lround(from_s * film_.fps)); k < int(std::lround(to_s * film_.fps)); ++k) {
      const double t = k / film_.fps;
      watch.look(frame(t), {});
      each(t);
    }
  }
  template <typename Watch>
  void show(Watch& watch, double from_s, double to_s) {
    show(watch, from_s, to_s, [](double) {});
  }

  capture::Frame frame(double t) {
    capture::Frame frame;
    frame.captured_at = capture::Timestamp{capture::duration_of(t)};
    const int width = camera_.image_size.width, height = camera_.image_size.height;
    const capture::WritableImage out = capture::make_image(film_.format, capture::ColorRange::full, width, height);
    const int step = film_.format == capture::PixelFormat::yuyv ? 2 : film_.format == capture::PixelFormat::bgr ? 3 : 1;
    const int first = film_.format == capture::PixelFormat::bgr ? 1 : 0;
    const calib::Rigid3d pose = film_.pose ? film_.pose(t) : camera_.cam_from_world;
    const Eigen::Vector3d centre = inverse(pose).translation;
    const Eigen::Matrix3d to_world = pose.rotation.toRotationMatrix().transpose();
    const double zoom = film_.zoom(t);
    const auto [left, right] = film_.person(t);
    std::vector<double> values;
    for (int v = 0; v < height; ++v) {
      const double light = film_.light(t, double(v) / (height - 1));
      for (int u = 0; u < width; ++u) {
        double value = 0;
        if (u >= left * width && u < right * width) {
          value = 40 + 60 * painted(u - left * width, v, 9.0, 77);
        } else {
          value = wall(centre, to_world * ray(u, v, zoom));
        }
        values.push_back(value * light);
      }
    }
    if (film_.blur) values = blurred_along(blurred_along(values, t, 1, width), t, width, height);
    for (int v = 0; v < height; ++v) {
      for (int u = 0; u < width; ++u) {
        const double value = values[std::size_t(v * width + u)] + noise_(random_) * film_.noise;
        out.data[0][v * out.image.planes[0].stride + std::ptrdiff_t(u) * step + first] =
            static_cast<std::uint8_t>(std::clamp(std::lround(value), 0L, 255L));
      }
    }
    frame.pixels = out.image;
    return frame;
  }

 private:
  Eigen::Vector3d ray(int u, int v, double zoom) {
    if (zoom == 1.0 && !rays_.empty()) return rays_[std::size_t(v * camera_.image_size.width + u)];
    const Eigen::Vector2d axis(camera_.model.cx(), camera_.model.cy());
    const auto at = [&](int x, int y, double by) {
      return camera_.model.ray({axis + (Eigen::Vector2d(x, y) - axis) / by}).value();
    };
    if (rays_.empty() && zoom == 1.0) {
      for (int y = 0; y < camera_.image_size.height; ++y)
        for (int x = 0; x < camera_.image_size.width; ++x) rays_.push_back(at(x, y, 1));
      return ray(u, v, zoom);
    }
    return at(u, v, zoom);
  }

  // Along columns (step 1, count: the width) or rows (step: the width, count: the height).
  std::vector<double> blurred_along(const std::vector<double>& values, double t, int step, int count) const {
    const int width = camera_.image_size.width;
    std::vector<double> out = values;
    for (int k = 0; k < int(values.size()); ++k) {
      const int column = k % width, place = step == 1 ? column : k / width;
      const double sigma = film_.blur(t, double(column) / (width - 1));
      if (sigma <= 0) continue;
      double sum = 0, weights = 0;
      for (int d = -int(3 * sigma) - 1; d <= int(3 * sigma) + 1; ++d) {
        const double weight = std::exp(-0.5 * d * d / (sigma * sigma));
        sum += weight * values[std::size_t(k + (std::clamp(place + d, 0, count - 1) - place) * step)];
        weights += weight;
      }
      out[std::size_t(k)] = sum / weights;
    }
    return out;
  }

  double wall(const Eigen::Vector3d& from, const Eigen::Vector3d& along) const {
    const Eigen::Vector3d low(-2, -2, 0), high(2, 2, 3);
    double nearest = 1e9;
    int axis = 0;
    for (int k = 0; k < 3; ++k) {
      if (std::abs(along[k]) < 1e-9) continue;
      const double s = ((along[k] > 0 ? high[k] : low[k]) - from[k]) / along[k];
      if (s < nearest) nearest = s, axis = k;
    }
    const Eigen::Vector3d p = from + nearest * along;
    const unsigned face = film_.room * 16 + unsigned(2 * axis + (along[axis] > 0 ? 1 : 0));
    return 110 + film_.texture * 100 * (painted(p[(axis + 1) % 3], p[(axis + 2) % 3], film_.spot_m, face) - 0.5);
  }

  // 0..1: spots of about that size.
  static double painted(double x, double y, double pitch, unsigned seed) {
    const auto at = [seed](int i, int j) {
      auto h =
          static_cast<std::uint32_t>(i) * 374761393u + static_cast<std::uint32_t>(j) * 668265263u + seed * 2246822519u;
      h = (h ^ (h >> 13)) * 1274126177u;
      return double((h ^ (h >> 16)) & 0xffff) / 65535;
    };
    const double u = x / pitch + 100, v = y / pitch + 100;
    const int i = int(std::floor(u)), j = int(std::floor(v));
    const auto smooth = [](double s) { return s * s * (3 - 2 * s); };
    const double a = smooth(u - i), b = smooth(v - j);
    return (1 - b) * ((1 - a) * at(i, j) + a * at(i + 1, j)) + b * ((1 - a) * at(i, j + 1) + a * at(i + 1, j + 1));
  }

  const Film film_;
  const calib::Camera camera_;
  std::vector<Eigen::Vector3d> rays_;
  std::mt19937 random_{5};
  std::normal_distribution<double> noise_{0, 1};
};

}  // namespace huetrack::room_watch
