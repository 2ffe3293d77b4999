#include "calib/model/lens_derivatives.h"

#include <algorithm>
#include <cmath>

namespace huetrack::calib {

LensParameters parameters_of(const CameraModel& model) {
  LensParameters l = LensParameters::Zero();
  l.head<4>() << model.fx(), model.fy(), model.cx(), model.cy();
  std::visit([&](const auto& lens) { std::ranges::copy(lens.distortion, l.data() + 4); }, model.lens());
  return l;
}

CameraModel model_like(const CameraModel& model, const LensParameters& l) {
  return std::visit(
      [&](auto lens) {
        lens.fx = l(0), lens.fy = l(1), lens.cx = l(2), lens.cy = l(3);
        std::copy_n(l.data() + 4, lens.distortion.size(), lens.distortion.begin());
        return CameraModel(lens);
      },
      model.lens());
}

bool project_radtan(const LensParameters& l, const Eigen::Vector3d& p, Eigen::Vector2d& px, PixelByPoint* by_point,
                    PixelByLens* by_lens) {
  if (!(p.z() > 1e-9)) return false;
  const double inverse_z = 1 / p.z(), x = p.x() * inverse_z, y = p.y() * inverse_z;
  const double xx = x * x, yy = y * y, xy = x * y, s = xx + yy;
  const double k1 = l(4), k2 = l(5), p1 = l(6), p2 = l(7), k3 = l(8), k4 = l(9), k5 = l(10), k6 = l(11);
  const double n = 1 + s * (k1 + s * (k2 + s * k3)), d = 1 + s * (k4 + s * (k5 + s * k6)), inverse_d = 1 / d;
  const double f = n * inverse_d;
  const double dx = x * f + 2 * p1 * xy + p2 * (s + 2 * xx), dy = y * f + p1 * (s + 2 * yy) + 2 * p2 * xy;
  px = {l(0) * dx + l(2), l(1) * dy + l(3)};
  if (!px.allFinite()) return false;
  if (by_point) {
    const double df = (k1 + s * (2 * k2 + s * 3 * k3) - f * (k4 + s * (2 * k5 + s * 3 * k6))) * inverse_d;
    const double cross = 2 * xy * df + 2 * p1 * x + 2 * p2 * y;
    Eigen::Matrix2d by_xy;
    by_xy << f + 2 * xx * df + 2 * p1 * y + 6 * p2 * x, cross, cross, f + 2 * yy * df + 6 * p1 * y + 2 * p2 * x;
    Eigen::Matrix<double, 2, 3> xy_by_p;
    xy_by_p << inverse_z, 0, -x * inverse_z, 0, inverse_z, -y * inverse_z;
    *by_point = Eigen::Vector2d(l(0), l(1)).asDiagonal() * by_xy * xy_by_p;
  }
  if (by_lens) {
    const double a = l(0) * x * inverse_d, b = l(1) * y * inverse_d, ss = s * s, sss = ss * s;
    by_lens->row(0) << dx, 0, 1, 0, a * s, a * ss, l(0) * 2 * xy, l(0) * (s + 2 * xx), a * sss, -a * f * s, -a * f * ss,
        -a * f * sss;
    by_lens->row(1) << 0, dy, 0, 1, b * s, b * ss, l(1) * (s + 2 * yy), l(1) * 2 * xy, b * sss, -b * f * s, -b * f * ss,
        -b * f * sss;
  }
  return true;
}

bool project_fisheye(const LensParameters& l, const Eigen::Vector3d& p, Eigen::Vector2d& px, PixelByPoint* by_point,
                     PixelByLens* by_lens) {
  const double rho = std::hypot(p.x(), p.y()), n2 = p.squaredNorm();
  if (!(n2 > 1e-18) || (rho == 0 && p.z() <= 0)) return false;
  const double theta = std::atan2(rho, p.z()), s = theta * theta;
  const double value = theta * (1 + s * (l(4) + s * (l(5) + s * (l(6) + s * l(7)))));
  const bool on_axis = rho < 1e-9 * p.z();
  const double g = on_axis ? 1 / p.z() : value / rho;
  px = {l(0) * g * p.x() + l(2), l(1) * g * p.y() + l(3)};
  if (!px.allFinite()) return false;
  if (by_point) {
    const double slope = 1 + s * (3 * l(4) + s * (5 * l(5) + s * (7 * l(6) + s * 9 * l(7))));
    const double h = on_axis ? 0 : (slope * p.z() / n2 - g) / (rho * rho);
    Eigen::Matrix<double, 2, 3> by_p;
    by_p << g + p.x() * p.x() * h, p.x() * p.y() * h, -p.x() * slope / n2, p.x() * p.y() * h, g + p.y() * p.y() * h,
        -p.y() * slope / n2;
    *by_point = Eigen::Vector2d(l(0), l(1)).asDiagonal() * by_p;
  }
  if (by_lens) {
    const double t = on_axis ? 0 : theta / rho * s;  // theta^3 / rho
    const double a = l(0) * p.x() * t, b = l(1) * p.y() * t;
    by_lens->row(0) << g * p.x(), 0, 1, 0, a, a * s, a * s * s, a * s * s * s, 0, 0, 0, 0;
    by_lens->row(1) << 0, g * p.y(), 0, 1, b, b * s, b * s * s, b * s * s * s, 0, 0, 0, 0;
  }
  return true;
}

bool project_stereographic(const LensParameters& l, const Eigen::Vector3d& p, Eigen::Vector2d& px,
                           PixelByPoint* by_point, PixelByLens* by_lens) {
  const double rho2 = p.head<2>().squaredNorm(), length = p.norm();
  if (!(length > 1e-9) || (rho2 == 0 && p.z() <= 0)) return false;
  const double q = p.z() >= 0 ? 2 / (length + p.z()) : 2 * (length - p.z()) / rho2;
  const double x = q * p.x(), y = q * p.y(), xx = x * x, yy = y * y, xy = x * y, s = xx + yy;
  const double p1 = l(6), p2 = l(7), s1 = l(10), s2 = l(11);
  const double f = 1 + s * (l(4) + s * (l(5) + s * (l(8) + s * l(9))));
  const double dx = x * f + 2 * p1 * xy + p2 * (s + 2 * xx) + s1 * s;
  const double dy = y * f + p1 * (s + 2 * yy) + 2 * p2 * xy + s2 * s;
  px = {l(0) * dx + l(2), l(1) * dy + l(3)};
  if (!px.allFinite()) return false;
  if (by_point) {
    const double df = l(4) + s * (2 * l(5) + s * (3 * l(8) + s * 4 * l(9)));
    const double cross = 2 * xy * df + 2 * p1 * x + 2 * p2 * y;
    Eigen::Matrix2d by_xy;
    by_xy << f + 2 * xx * df + 2 * p1 * y + (6 * p2 + 2 * s1) * x, cross + 2 * s1 * y, cross + 2 * s2 * x,
        f + 2 * yy * df + (6 * p1 + 2 * s2) * y + 2 * p2 * x;
    const Eigen::RowVector3d q_by_p = -q * q / 2 * (p / length + Eigen::Vector3d::UnitZ()).transpose();
    Eigen::Matrix<double, 2, 3> xy_by_p = p.head<2>() * q_by_p;
    xy_by_p.leftCols<2>() += q * Eigen::Matrix2d::Identity();
    *by_point = Eigen::Vector2d(l(0), l(1)).asDiagonal() * by_xy * xy_by_p;
  }
  if (by_lens) {
    const double a = l(0) * x, b = l(1) * y, ss = s * s;
    by_lens->row(0) << dx, 0, 1, 0, a * s, a * ss, l(0) * 2 * xy, l(0) * (s + 2 * xx), a * s * ss, a * ss * ss,
        l(0) * s, 0;
    by_lens->row(1) << 0, dy, 0, 1, b * s, b * ss, l(1) * (s + 2 * yy), l(1) * 2 * xy, b * s * ss, b * ss * ss, 0,
        l(1) * s;
  }
  return true;
}

bool project_like(const CameraModel& model, const LensParameters& lens, const Eigen::Vector3d& p_cam,
                  Eigen::Vector2d& px, PixelByPoint* by_point, PixelByLens* by_lens) {
  constexpr std::array projects{project_radtan, project_fisheye, project_stereographic};
  return projects[model.lens().index()](lens, p_cam, px, by_point, by_lens);
}

}  // namespace huetrack::calib
