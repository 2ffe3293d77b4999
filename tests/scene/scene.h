// A known world: calibrated cameras, balls on known paths; rendered into frame sets, spoiled by a stated amount.
//   const Scene scene = SceneBuilder{}.cameras_on_ring({.count = 4}).ball({.name = "lime"}).build();
//   for (const FrameSet& set : render(scene, {.pixel_noise_stddev = 3})) ... scene.ball_at(0, set.at)
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "calib/model/camera_rig.h"
#include "capture/frames/frame.h"

namespace huetrack::scene {

struct RingOptions {
  int count = 3;
  double radius_m = 2.5;  // of the ring, around the world's z axis
  double height_m = 1.8;  // of the cameras; they look at (0, 0, look_at_height_m)
  double look_at_height_m = 1.0;
  calib::ImageSize image_size{320, 240};
  double focal_px = 240;
  std::array<double, 5> distortion{-0.12, 0.02, 0.0005, -0.0004, 0};  // OpenCV's k1 k2 p1 p2 k3
};

struct BallOptions {
  std::string name = "lime";
  double radius_m = 0.04;
  Eigen::Vector3d rgb{0.45, 0.80, 0.12};  // [0, 1]; lime: hue about 92 degrees
  std::function<Eigen::Vector3d(double t_s)> path =
      {};  // world, metres; a Lissajous figure within the cameras' view when empty
};

struct Wall {                         // an upright rectangle that hides what is behind it
  Eigen::Vector3d corner, along, up;  // metres: corner, corner + along, corner + up
};

struct Scene {
  calib::CameraRig rig;
  std::vector<BallOptions> balls;
  std::vector<Wall> walls;
  Eigen::Vector3d ball_at(std::size_t ball, capture::Timestamp at) const;
};

class SceneBuilder {
 public:
  SceneBuilder& cameras_on_ring(const RingOptions& options);
  SceneBuilder& camera(calib::Camera camera);
  SceneBuilder& ball(BallOptions options);
  SceneBuilder& wall(const Wall& wall);
  Scene build() const { return scene_; }

 private:
  Scene scene_;
};

struct RenderOptions {
  int set_count = 60;
  double fps = 30;
  capture::PixelFormat format = capture::PixelFormat::yuyv;
  capture::ColorRange range = capture::ColorRange::limited;
  double pixel_noise_stddev = 3;      // of Y, U and V, grey levels
  double dropped_frames = 0;          // [0, 1): share of frames that are absent
  std::vector<double> offset_s = {};  // per camera, added to its capture times (and so to where it sees the balls)
  std::uint64_t seed = 1;
};

// Sets of number 0, 1, ... with every camera's frame but the dropped ones; set.at is the newest capture time.
std::vector<capture::FrameSet> render(const Scene& scene, const RenderOptions& options);

}  // namespace huetrack::scene
