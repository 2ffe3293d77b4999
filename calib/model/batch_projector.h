// Projects many world points into one camera, lens distortion included, in single precision: for particle filters,
// which project every particle into every view. Reference: Camera::project_world().
#pragma once

#include <cstddef>

#include "calib/model/camera_rig.h"

namespace huetrack::calib {

// Pure value; safe from any thread.
class BatchProjector {
 public:
  // u and v of a point without a pixel: behind the camera, beyond CameraModel::limit(), or not finite. Lies outside
  // every image, so that a test for "in the image" suffices.
  static constexpr float outside = -1e9f;

  explicit BatchProjector(const Camera& camera);

  //   x, y, z   (n,) points in the world, metres
  //   u, v      (n,) out, raw pixels (may lie outside the image); must not overlap the inputs or each other
  // Any n, any alignment. Error: some 1e-7 of the focal length and of the distance to the principal point, below 1e-3
  // px for images up to 2000 px. Bit-identical on every x86-64 machine. Pinhole: points more than 89.9 degrees off the
  // axis are outside.
  void project(const float* x, const float* y, const float* z, std::size_t n, float* u, float* v) const noexcept {
    kernel_(coefficients_, x, y, z, n, u, v);
  }

  struct Coefficients {  // shared by all kernels
    float rotation[9];   // cam_from_world, row by row
    float translation[3];
    float fx, fy, cx, cy;
    float k1, k2, p1, p2, k3, k4, k5, k6;  // fisheye: k1..k4; stereographic: k5, k6 are s1, s2
    float limit;
  };

 private:
  using Kernel = void (*)(const Coefficients&, const float*, const float*, const float*, std::size_t, float*, float*);

  Coefficients coefficients_;
  Kernel kernel_;  // the cheapest kernel with all coefficients of this lens
};

}  // namespace huetrack::calib
