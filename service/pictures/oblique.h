// Oblique parallel projection of a scene.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "drawing/canvas.h"

namespace huetrack::pictures {

struct Oblique {
  Eigen::Vector3d right, up, towards;  // unit, world; towards: to the viewer
  drawing::Point origin{0, 0};         // where the world's origin is drawn
  double zoom = 1;                     // pixels per metre

  static Oblique from(double azimuth_deg, double elevation_deg) {
    const double a = azimuth_deg * std::numbers::pi / 180, e = elevation_deg * std::numbers::pi / 180;
    Oblique oblique;
    oblique.right = {-std::sin(a), std::cos(a), 0};
    oblique.towards = {std::cos(e) * std::cos(a), std::cos(e) * std::sin(a), std::sin(e)};
    oblique.up = oblique.towards.cross(oblique.right);
    return oblique;
  }
  // Onto the plane of the picture, metres: to the right, upwards.
  Eigen::Vector2d flat(const Eigen::Vector3d& p) const { return {right.dot(p), up.dot(p)}; }
  Eigen::Matrix2d flat(const Eigen::Matrix3d& covariance) const {
    Eigen::Matrix<double, 2, 3> rows;
    rows << right.transpose(), up.transpose();
    return rows * covariance * rows.transpose();
  }
  drawing::Point at(const Eigen::Vector2d& flat_p) const {
    return origin + zoom * drawing::Point(flat_p.x(), -flat_p.y());
  }
  drawing::Point operator()(const Eigen::Vector3d& p) const { return at(flat(p)); }

  // Fits the rectangle between these two points of the plane into the box.
  void fit(const Eigen::Vector2d& low, const Eigen::Vector2d& high, const drawing::Box& box) {
    const Eigen::Vector2d size = (high - low).cwiseMax(1e-3), middle = (low + high) / 2;
    zoom = std::min(box.width / size.x(), box.height / size.y());
    origin =
        drawing::Point(box.x + box.width / 2, box.y + box.height / 2) + zoom * drawing::Point(-middle.x(), middle.y());
  }
};

}  // namespace huetrack::pictures
