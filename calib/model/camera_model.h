// Lens models: pinhole with Brown-Conrady distortion and Kannala-Brandt fisheye, both as OpenCV defines them, and a
// stereographic model for lenses that neither fits up to the image's edge. Camera frame: x right, y down, z forward.
// Pixel (0,0) is the CENTRE of the top-left pixel. Pure values; thread-safe; nothing throws.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string_view>
#include <variant>

namespace huetrack::calib {

struct RawPixel {
  Eigen::Vector2d px;
};  // with distortion: what images and detectors use
struct IdealPixel {
  Eigen::Vector2d px;
};  // without distortion, same K: what pinhole algebra uses

// OpenCV calib3d, "pinhole_radtan". Rational when any of k4..k6 is not 0.
//   x'' = x (1 + k1 r2 + k2 r4 + k3 r6) / (1 + k4 r2 + k5 r4 + k6 r6) + 2 p1 x y + p2 (r2 + 2 x2), y'' likewise
struct PinholeRadtan {
  double fx = 1, fy = 1, cx = 0, cy = 0;  // pixels
  std::array<double, 8> distortion{};     // k1 k2 p1 p2 k3 k4 k5 k6, OpenCV's order
};

// OpenCV fisheye, "fisheye_kb": theta_d = theta (1 + k1 theta2 + k2 theta4 + k3 theta6 + k4 theta8)
struct FisheyeKannalaBrandt {
  double fx = 1, fy = 1, cx = 0, cy = 0;
  std::array<double, 4> distortion{};  // k1 k2 k3 k4
};

// "stereographic": a polynomial on the stereographic projection (x, y) = 2 (X, Y) / (|P| + Z), whose radius is
// 2 tan(theta / 2). A pinhole's tan(theta) and a fisheye's theta are both short polynomials in it, so that four
// coefficients fit lenses from tele to 160 degrees. With s = x2 + y2,
//   x'' = x (1 + k1 s + k2 s2 + k3 s3 + k4 s4) + 2 p1 x y + p2 (s + 2 x2) + s1 s, y'' likewise with p1, p2 and s2:
// Brown's (1966) decentring and a thin prism, which together model a tilted sensor. mrcal's splined stereographic model
// has the same base and a spline surface instead of the polynomial.
struct Stereographic {
  double fx = 1, fy = 1, cx = 0, cy = 0;
  std::array<double, 8> distortion{};  // k1 k2 p1 p2 k3 k4 s1 s2
};

class CameraModel {
 public:
  CameraModel() : CameraModel(PinholeRadtan{}) {}
  explicit CameraModel(const PinholeRadtan& lens);
  explicit CameraModel(const FisheyeKannalaBrandt& lens);
  explicit CameraModel(const Stereographic& lens);

  // nullopt: behind the camera, or beyond limit(), where the distortion folds back (the pixel would show another
  // direction). The pixel may lie outside the image.
  std::optional<RawPixel> project(const Eigen::Vector3d& p_cam) const;

  using Jacobian = Eigen::Matrix<double, 2, 3>;  // d px / d p_cam
  std::optional<RawPixel> project(const Eigen::Vector3d& p_cam, Jacobian& jacobian) const;

  // Direction of a pixel: unit vector in the camera frame; nullopt: outside the model.
  std::optional<Eigen::Vector3d> ray(const RawPixel& pixel) const;

  std::optional<IdealPixel> undistort(const RawPixel& pixel) const;

  double fx() const;  // pixels
  double fy() const;
  double cx() const;
  double cy() const;
  std::string_view name() const;  // "pinhole_radtan", "fisheye_kb" or "stereographic"
  using Lens = std::variant<PinholeRadtan, FisheyeKannalaBrandt, Stereographic>;
  const Lens& lens() const { return lens_; }

  // Pinhole: the largest x^2 + y^2 (x = X/Z) that the model covers. Fisheye: the largest theta, radians. Stereographic:
  // the largest 4 tan^2(theta / 2), at most that of 160 degrees off the axis. Beyond it the distorted radius decreases;
  // infinity (or pi): it always grows; -1: a parameter is not finite.
  double limit() const { return limit_; }

 private:
  Lens lens_;
  double limit_;
};

}  // namespace huetrack::calib
