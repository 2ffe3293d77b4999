// A hand-held camera over a desk with things on it, rendered from its exact poses: every row of a frame is exposed at
// its own time.
//   const DeskScene desk(3);
//   const HandHeld hand({.seed = 3});
//   const std::vector<capture::Frame> frames = render(desk, hand, {.readout_s = 0.03});
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "calib/model/camera_rig.h"
#include "capture/frames/frame.h"

namespace huetrack::scene {

// A room of 3.2 x 3.2 x 2.4 m over a desk at z = 0 with papers and boxes on it, and a black rectangle of 0.20 x 0.15 m
// on a white sheet about the origin. The seed draws what lies where.
class DeskScene {
 public:
  explicit DeskScene(std::uint64_t seed);

  // Light, linear, 0..1, that comes from where a ray first meets something.
  float seen(const Eigen::Vector3f& from, const Eigen::Vector3f& direction) const;
  // World, metres, clockwise as seen from above.
  static std::vector<Eigen::Vector3d> rectangle_corners();

  calib::Camera camera;  // 320x240, its pose is not used

 private:
  struct Box {  // upright, its underside on the desk
    Eigen::Vector3f centre, half;
    float cosine, sine;                                       // of its turn about the vertical
    Eigen::Vector2f printed;                                  // where on the print its sides begin
    Eigen::Vector3f turned(const Eigen::Vector3f& p) const {  // into its axes
      return {cosine * p.x() + sine * p.y(), cosine * p.y() - sine * p.x(), p.z()};
    }
  };
  float print(float x, float y) const;  // what is printed on things; metres, repeats itself
  std::vector<std::uint8_t> print_;
  std::vector<Box> boxes_;
};

// How a hand moves a camera: sines on all six axes, from `still_s` of rest at the beginning to as much at the end.
struct HandHeldOptions {
  std::uint64_t seed = 1;
  double length_s = 8;
  double fastest_deg_s = 130;  // turning; reached once or more
  double sway_m = 0.1;         // of the position, per axis, about
  double still_s = 0.4;        // 0: it moves in the first frame already
  double tremor_deg = 0;       // besides, per axis, 6 to 10 times a second
};
class HandHeld {
 public:
  explicit HandHeld(const HandHeldOptions& options);
  calib::Rigid3d world_from_camera(double t_s) const;

 private:
  struct Wave {
    double amplitude, hertz, phase;
  };
  double envelope(double t_s) const;
  HandHeldOptions options_;
  std::array<std::array<Wave, 2>, 6> waves_;  // turns about the camera's axes, radians; shifts, metres
  std::array<Wave, 3> tremor_;                // turns
};

struct DeskRenderOptions {
  double fps = 30;
  int frames = 240;
  double readout_s = 0;  // from the first row to the last; < 0: it reads upwards
  double exposure_s = 0.008;
  double noise_stddev = 2;  // grey levels
  std::uint64_t seed = 1;   // of the noise
};
// Frame i is exposed about i / fps, its middle row's time. Frame::readout is left 0.
std::vector<capture::Frame> render(const DeskScene& scene, const HandHeld& hand, const DeskRenderOptions& options);

}  // namespace huetrack::scene
