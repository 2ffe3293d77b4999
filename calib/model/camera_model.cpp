#include "calib/model/camera_model.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <vector>

namespace huetrack::calib {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

// Coefficients of ascending powers.
using Polynomial = std::vector<double>;

double evaluate(std::span<const double> p, double s) {
  double value = 0;
  for (auto a = p.rbegin(); a != p.rend(); ++a) value = value * s + *a;
  return value;
}

Polynomial derivative(const Polynomial& p) {
  Polynomial d;
  for (std::size_t i = 1; i < p.size(); ++i) d.push_back(static_cast<double>(i) * p[i]);
  return d;
}

Polynomial product(const Polynomial& a, const Polynomial& b) {
  Polynomial c(a.size() + b.size() - 1, 0.0);
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t j = 0; j < b.size(); ++j) c[i + j] += a[i] * b[j];
  }
  return c;
}

Polynomial sum(Polynomial a, const Polynomial& b, double factor) {
  a.resize(std::max(a.size(), b.size()), 0.0);
  for (std::size_t i = 0; i < b.size(); ++i) a[i] += factor * b[i];
  return a;
}

// Sign changes of p in (0, end), ascending. Between neighbouring sign changes of its derivative p is monotone, so
// bisection finds every one. Roots without a sign change do not count.
std::vector<double> sign_changes(const Polynomial& p, double end) {
  if (p.size() < 2) return {};
  std::vector<double> stations = sign_changes(derivative(p), end);
  stations.push_back(end);
  std::vector<double> roots;
  double low = 0;
  for (const double high : stations) {
    const bool sign = std::signbit(evaluate(p, low));
    if (std::signbit(evaluate(p, high)) != sign) {
      double a = low, b = high;
      for (;;) {
        const double middle = a + (b - a) / 2;
        if (middle <= a || middle >= b) break;  // neighbouring doubles
        (std::signbit(evaluate(p, middle)) == sign ? a : b) = middle;
      }
      roots.push_back(a);  // the last double where p still has its old sign
    }
    low = high;
  }
  return roots;
}

double first_sign_change(const Polynomial& p, double end, double otherwise) {
  const auto roots = sign_changes(p, end);
  return roots.empty() ? otherwise : roots.front();
}

// Rays beyond 89.994 degrees off the axis have no pixel in any pinhole image.
constexpr double largest_r2 = 1e8;

// The radius r f(r^2), f = N/D, grows while d/dr = (N D + 2 s (N' D - N D')) / D^2 > 0 with s = r^2, up to a pole of f.
double find_limit(const PinholeRadtan& lens) {
  const auto& k = lens.distortion;
  const Polynomial n{1, k[0], k[1], k[4]}, d{1, k[5], k[6], k[7]};
  const Polynomial two_s{0, 2};
  const Polynomial slope =
      sum(product(n, d), product(two_s, sum(product(derivative(n), d), product(n, derivative(d)), -1)), 1);
  return std::min(first_sign_change(slope, largest_r2, infinity), first_sign_change(d, largest_r2, infinity));
}

double find_limit(const FisheyeKannalaBrandt& lens) {
  const auto& k = lens.distortion;
  constexpr double pi = std::numbers::pi;
  return std::sqrt(first_sign_change({1, 3 * k[0], 5 * k[1], 7 * k[2], 9 * k[3]}, pi * pi, pi * pi));
}

// 4 tan^2(80 degrees): no lens has a wider field of view.
constexpr double widest_s = 128.65;

double find_limit(const Stereographic& lens) {
  const auto& k = lens.distortion;
  return first_sign_change({1, 3 * k[0], 5 * k[1], 7 * k[4], 9 * k[5]}, widest_s, widest_s);
}

template <std::size_t size>
bool all_finite(double fx, double fy, double cx, double cy, const std::array<double, size>& distortion) {
  return std::isfinite(fx) && std::isfinite(fy) && std::isfinite(cx) && std::isfinite(cy) &&
         std::ranges::all_of(distortion, [](double k) { return std::isfinite(k); });
}

// A lens with NaN or infinite parameters covers nothing: every function below returns nullopt.
template <typename Lens>
double limit_of(const Lens& lens) {
  return all_finite(lens.fx, lens.fy, lens.cx, lens.cy, lens.distortion) ? find_limit(lens) : -1;
}

struct Radial {
  double factor;      // f(s)
  double derivative;  // df/ds
};

Radial radial(const PinholeRadtan& lens, double s) {
  const auto& k = lens.distortion;
  const double n = 1 + s * (k[0] + s * (k[1] + s * k[4]));
  const double dn = k[0] + s * (2 * k[1] + s * 3 * k[4]);
  const double inverse_d = 1 / (1 + s * (k[5] + s * (k[6] + s * k[7])));
  const double dd = k[5] + s * (2 * k[6] + s * 3 * k[7]);
  return {n * inverse_d, (dn - n * inverse_d * dd) * inverse_d};
}

Radial radial(const Stereographic& lens, double s) {
  const auto& k = lens.distortion;
  return {1 + s * (k[0] + s * (k[1] + s * (k[4] + s * k[5]))), k[0] + s * (2 * k[1] + s * (3 * k[4] + s * 4 * k[5]))};
}

// The distorted image of p = (x, y) on the plane z = 1, and its derivative by p.
Eigen::Vector2d distorted(const PinholeRadtan& lens, const Eigen::Vector2d& p, Eigen::Matrix2d& jacobian) {
  const double x = p.x(), y = p.y(), xy = x * y, r2 = p.squaredNorm();
  const double p1 = lens.distortion[2], p2 = lens.distortion[3];
  const auto [f, df] = radial(lens, r2);
  const double cross = 2 * xy * df + 2 * p1 * x + 2 * p2 * y;
  jacobian << f + 2 * x * x * df + 2 * p1 * y + 6 * p2 * x, cross, cross, f + 2 * y * y * df + 6 * p1 * y + 2 * p2 * x;
  return {x * f + 2 * p1 * xy + p2 * (r2 + 2 * x * x), y * f + p1 * (r2 + 2 * y * y) + 2 * p2 * xy};
}

// Distortion on the stereographic projection.
Eigen::Vector2d distorted(const Stereographic& lens, const Eigen::Vector2d& p, Eigen::Matrix2d& jacobian) {
  const double x = p.x(), y = p.y(), xy = x * y, s = p.squaredNorm();
  const double p1 = lens.distortion[2], p2 = lens.distortion[3], s1 = lens.distortion[6], s2 = lens.distortion[7];
  const auto [f, df] = radial(lens, s);
  const double cross = 2 * xy * df + 2 * p1 * x + 2 * p2 * y;
  jacobian << f + 2 * x * x * df + 2 * p1 * y + (6 * p2 + 2 * s1) * x, cross + 2 * s1 * y, cross + 2 * s2 * x,
      f + 2 * y * y * df + (6 * p1 + 2 * s2) * y + 2 * p2 * x;
  return {x * f + 2 * p1 * xy + p2 * (s + 2 * x * x) + s1 * s, y * f + p1 * (s + 2 * y * y) + 2 * p2 * xy + s2 * s};
}

struct ThetaD {
  double value;       // theta_d
  double derivative;  // by theta
};

ThetaD theta_d(const FisheyeKannalaBrandt& lens, double theta) {
  const auto& k = lens.distortion;
  const double s = theta * theta;
  return {theta * (1 + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3])))),
          1 + s * (3 * k[0] + s * (5 * k[1] + s * (7 * k[2] + s * 9 * k[3])))};
}

// Solves g(t) = target for t in [0, end], where g(0) = 0 <= target and g grows; g(t) returns {value, derivative}.
// Newton within a shrinking bracket. nullopt: target > g(end).
template <typename Function>
std::optional<double> invert_growing(const Function& g, double target, double start, double end) {
  double low = 0, high = end;
  if (!std::isfinite(high)) {
    high = std::max(1.0, 2 * start);
    while (g(high).value < target && high < 1e100) high *= 2;
  }
  if (!(g(high).value >= target)) return std::nullopt;
  double t = std::min(start, high);
  for (int i = 0; i < 200; ++i) {
    const auto [value, slope] = g(t);
    if (value == target) break;
    (value < target ? low : high) = t;
    double next = t - (value - target) / slope;
    if (!(next > low && next < high)) next = low + (high - low) / 2;
    if (std::abs(next - t) <= 1e-16 * t) break;
    t = next;
  }
  return t;
}

using OptionalPixel = std::optional<RawPixel>;
using Jacobian = CameraModel::Jacobian;

OptionalPixel checked(const Eigen::Vector2d& px) {
  return px.allFinite() ? OptionalPixel(RawPixel{px}) : std::nullopt;
}

OptionalPixel project_with(const PinholeRadtan& lens, double limit, const Eigen::Vector3d& p, Jacobian* jacobian) {
  if (!(p.z() > 0)) return std::nullopt;
  const double inverse_z = 1 / p.z();
  const Eigen::Vector2d xy = p.head<2>() * inverse_z;
  if (!(xy.squaredNorm() <= limit)) return std::nullopt;
  Eigen::Matrix2d by_xy;
  const Eigen::Vector2d d = distorted(lens, xy, by_xy);
  if (jacobian != nullptr) {
    Jacobian xy_by_p;
    xy_by_p << inverse_z, 0, -xy.x() * inverse_z, 0, inverse_z, -xy.y() * inverse_z;
    *jacobian = Eigen::Vector2d(lens.fx, lens.fy).asDiagonal() * by_xy * xy_by_p;
  }
  return checked({lens.fx * d.x() + lens.cx, lens.fy * d.y() + lens.cy});
}

OptionalPixel project_with(const FisheyeKannalaBrandt& lens, double limit, const Eigen::Vector3d& p,
                           Jacobian* jacobian) {
  const double rho = std::hypot(p.x(), p.y());
  const double theta = std::atan2(rho, p.z());
  // Straight behind the camera the direction in the image is undefined.
  if (!(theta <= limit) || (rho == 0 && p.z() <= 0)) return std::nullopt;
  const auto [value, slope] = theta_d(lens, theta);
  const bool on_axis = rho < 1e-9 * p.z();  // where theta_d / rho rounds to 1 / z
  const double g = on_axis ? 1 / p.z() : value / rho;
  if (jacobian != nullptr) {
    const double x = p.x(), y = p.y(), n2 = p.squaredNorm();
    const double h = on_axis ? 0 : (slope * p.z() / n2 - g) / (rho * rho);
    Jacobian by_p;
    by_p << g + x * x * h, x * y * h, -x * slope / n2, x * y * h, g + y * y * h, -y * slope / n2;
    *jacobian = Eigen::Vector2d(lens.fx, lens.fy).asDiagonal() * by_p;
  }
  return checked({lens.fx * g * p.x() + lens.cx, lens.fy * g * p.y() + lens.cy});
}

OptionalPixel project_with(const Stereographic& lens, double limit, const Eigen::Vector3d& p, Jacobian* jacobian) {
  const double n = p.norm(), rho2 = p.head<2>().squaredNorm();
  // Behind the camera |P| + Z cancels; it equals rho^2 / (|P| - Z).
  const double q = p.z() >= 0 ? 2 / (n + p.z()) : 2 * (n - p.z()) / rho2;
  const Eigen::Vector2d xy = q * p.head<2>();
  if (!(xy.squaredNorm() <= limit)) return std::nullopt;
  Eigen::Matrix2d by_xy;
  const Eigen::Vector2d d = distorted(lens, xy, by_xy);
  if (jacobian != nullptr) {
    const Eigen::RowVector3d q_by_p = -q * q / 2 * (p / n + Eigen::Vector3d::UnitZ()).transpose();
    Jacobian xy_by_p = p.head<2>() * q_by_p;
    xy_by_p.leftCols<2>() += q * Eigen::Matrix2d::Identity();
    *jacobian = Eigen::Vector2d(lens.fx, lens.fy).asDiagonal() * by_xy * xy_by_p;
  }
  return checked({lens.fx * d.x() + lens.cx, lens.fy * d.y() + lens.cy});
}

// (x, y) on the plane z = 1, or the stereographic projection, whose distorted image is `target`.
template <typename Lens>
std::optional<Eigen::Vector2d> undistorted(const Lens& lens, double limit, const Eigen::Vector2d& target) {
  // The radial part alone has a unique solution, which bracketing finds; from there Newton's method for the whole lens
  // stays on the right branch, as the tangential part is small.
  const double r_d = target.norm(), r_end = std::sqrt(limit);
  const auto radius = [&](double r) {
    const auto [f, df] = radial(lens, r * r);
    return ThetaD{r * f, f + 2 * r * r * df};
  };
  const double r = invert_growing(radius, r_d, std::min(r_d, r_end), r_end).value_or(r_end);
  if (!std::isfinite(r)) return std::nullopt;
  Eigen::Vector2d p = r_d > 0 ? Eigen::Vector2d(target * (r / r_d)) : Eigen::Vector2d::Zero();
  Eigen::Matrix2d jacobian;
  Eigen::Vector2d error = distorted(lens, p, jacobian) - target;
  const double enough = 1e-15 * (1 + r_d);
  for (int i = 0; i < 50 && error.norm() > enough; ++i) {
    const double determinant = jacobian.determinant();
    if (determinant == 0 || !std::isfinite(determinant)) break;
    Eigen::Vector2d step = jacobian.inverse() * error;
    bool better = false;
    for (int halvings = 0; halvings < 30 && !better; ++halvings, step /= 2) {
      Eigen::Matrix2d trial_jacobian;
      const Eigen::Vector2d trial = p - step;
      if (trial.squaredNorm() > limit) continue;
      const Eigen::Vector2d trial_error = distorted(lens, trial, trial_jacobian) - target;
      if (trial_error.norm() < error.norm()) {
        p = trial;
        error = trial_error;
        jacobian = trial_jacobian;
        better = true;
      }
    }
    if (!better) break;  // rounding, or no direction has this pixel
  }
  if (!(error.norm() <= 1e-12 * (1 + r_d))) return std::nullopt;
  return p;
}

std::optional<Eigen::Vector3d> ray_with(const PinholeRadtan& lens, double limit, const Eigen::Vector2d& m) {
  const auto p = undistorted(lens, limit, m);
  if (!p) return std::nullopt;
  return Eigen::Vector3d(p->x(), p->y(), 1).normalized();
}

std::optional<Eigen::Vector3d> ray_with(const FisheyeKannalaBrandt& lens, double limit, const Eigen::Vector2d& m) {
  const double r = m.norm();
  if (r == 0) return Eigen::Vector3d::UnitZ();
  const auto theta = invert_growing([&](double t) { return theta_d(lens, t); }, r, std::min(r, limit), limit);
  if (!theta) return std::nullopt;
  const Eigen::Vector2d side = m / r * std::sin(*theta);
  return Eigen::Vector3d(side.x(), side.y(), std::cos(*theta)).normalized();
}

std::optional<Eigen::Vector3d> ray_with(const Stereographic& lens, double limit, const Eigen::Vector2d& m) {
  const auto p = undistorted(lens, limit, m);
  if (!p) return std::nullopt;
  return Eigen::Vector3d(p->x(), p->y(), 1 - p->squaredNorm() / 4).normalized();
}

}  // namespace

CameraModel::CameraModel(const PinholeRadtan& lens) : lens_(lens), limit_(limit_of(lens)) {}
CameraModel::CameraModel(const FisheyeKannalaBrandt& lens) : lens_(lens), limit_(limit_of(lens)) {}
CameraModel::CameraModel(const Stereographic& lens) : lens_(lens), limit_(limit_of(lens)) {}

std::optional<RawPixel> CameraModel::project(const Eigen::Vector3d& p_cam) const {
  return std::visit([&](const auto& lens) { return project_with(lens, limit_, p_cam, nullptr); }, lens_);
}

std::optional<RawPixel> CameraModel::project(const Eigen::Vector3d& p_cam, Jacobian& jacobian) const {
  return std::visit([&](const auto& lens) { return project_with(lens, limit_, p_cam, &jacobian); }, lens_);
}

std::optional<Eigen::Vector3d> CameraModel::ray(const RawPixel& pixel) const {
  const Eigen::Vector2d m((pixel.px.x() - cx()) / fx(), (pixel.px.y() - cy()) / fy());
  if (!(limit_ > 0) || !m.allFinite()) return std::nullopt;
  return std::visit([&](const auto& lens) { return ray_with(lens, limit_, m); }, lens_);
}

std::optional<IdealPixel> CameraModel::undistort(const RawPixel& pixel) const {
  const auto direction = ray(pixel);
  if (!direction || direction->z() <= 0) return std::nullopt;  // a pinhole does not see sideways
  return IdealPixel{{fx() * direction->x() / direction->z() + cx(), fy() * direction->y() / direction->z() + cy()}};
}

double CameraModel::fx() const {
  return std::visit([](const auto& lens) { return lens.fx; }, lens_);
}
double CameraModel::fy() const {
  return std::visit([](const auto& lens) { return lens.fy; }, lens_);
}
double CameraModel::cx() const {
  return std::visit([](const auto& lens) { return lens.cx; }, lens_);
}
double CameraModel::cy() const {
  return std::visit([](const auto& lens) { return lens.cy; }, lens_);
}

std::string_view CameraModel::name() const {
  constexpr std::array<std::string_view, 3> names{"pinhole_radtan", "fisheye_kb", "stereographic"};
  return names[lens_.index()];
}

}  // namespace huetrack::calib
