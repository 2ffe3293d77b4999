// A dark room with LEDs, seen by a camera that moves: poses, and images with a dot per lit LED.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "calib/model/camera_rig.h"
#include "capture/frames/frame.h"

namespace huetrack::scene {

struct LedScene {
  calib::Camera camera;
  std::vector<Eigen::Vector3d> leds;
  double fps = 90;

  capture::Timestamp at(int frame) const { return capture::Timestamp(capture::duration_of(frame / fps)); }
};

inline LedScene led_scene() {
  LedScene scene;
  scene.camera.name = "cam0";
  scene.camera.image_size = {320, 240};
  scene.camera.model = calib::CameraModel(
      calib::PinholeRadtan{.fx = 250, .fy = 251, .cx = 158.5, .cy = 121, .distortion = {-0.11, 0.02, 0.0004, -0.0005}});
  scene.leds = {{-0.22, -0.20, 0.05}, {0.04, -0.19, 0.02}, {0.24, -0.18, 0.12}, {0.20, 0.03, 0.04},
                {0.25, 0.18, 0.09},   {-0.04, 0.21, 0.03}, {-0.24, 0.15, 0.14}, {-0.18, -0.02, 0.07}};
  return scene;
}

inline calib::Rigid3d looking(const Eigen::Vector3d& from, const Eigen::Vector3d& at) {
  const Eigen::Vector3d z = (at - from).normalized(), x = z.cross(Eigen::Vector3d::UnitZ()).normalized(),
                        y = z.cross(x);
  Eigen::Matrix3d r;
  r << x, y, z;
  return {Eigen::Quaterniond(r).normalized(), from};
}

// Around the LEDs at 1 rad/s, up and down.
inline calib::Rigid3d led_scene_pose(double t) {
  return looking({0.75 * std::cos(t), 0.75 * std::sin(t), 0.65 + 0.08 * std::sin(2 * t)}, {0, 0, 0.05});
}

// A soft dot at each pixel, in the dark. Sensor noise from the seed.
inline capture::Image led_image(const LedScene& scene, const std::vector<Eigen::Vector2d>& dots, std::uint64_t seed,
                                capture::PixelFormat format = capture::PixelFormat::grey) {
  const auto [width, height] = scene.camera.image_size;
  capture::WritableImage image = capture::make_image(format, capture::ColorRange::full, width, height);
  std::mt19937_64 random(seed);
  const int step = format == capture::PixelFormat::yuyv ? 2 : format == capture::PixelFormat::bgr ? 3 : 1;
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) {
      double y = 6 + static_cast<double>(random() % 5);
      for (const auto& dot : dots) y += 190 * std::exp(-(Eigen::Vector2d(u, v) - dot).squaredNorm() / (2 * 1.6 * 1.6));
      std::uint8_t* const p = image.data[0] + v * image.image.planes[0].stride + u * step;
      for (int channel = 0; channel < (format == capture::PixelFormat::bgr ? 3 : 1); ++channel)
        p[channel] = static_cast<std::uint8_t>(std::min(255.0, y));
    }
  return image.image;
}

// Where the LED lies in the image; nothing when it is not in view.
inline std::vector<Eigen::Vector2d> led_dots(const LedScene& scene, const calib::Rigid3d& world_from_camera,
                                             const std::vector<int>& lit) {
  std::vector<Eigen::Vector2d> dots;
  for (const int led : lit) {
    const auto px =
        scene.camera.model.project(calib::inverse(world_from_camera) * scene.leds[static_cast<std::size_t>(led)]);
    if (px && scene.camera.contains(*px)) dots.push_back(px->px);
  }
  return dots;
}

}  // namespace huetrack::scene
