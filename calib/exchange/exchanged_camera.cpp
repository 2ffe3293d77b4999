#include "calib/exchange/exchanged_camera.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cctype>
#include <cmath>

#include "calib/files/config_error.h"
#include "calib/files/number_text.h"

namespace huetrack::exchange {

calib::CameraModel opencv_lens(std::span<const double> intrinsics, std::string_view intrinsics_key,
                               std::span<const double> coefficients, std::string_view coefficients_key, bool fisheye,
                               const Fail& fail) {
  if (intrinsics.size() != 9)
    fail(intrinsics_key, "must be a 3x3 matrix, got " + std::to_string(intrinsics.size()) + " numbers");
  for (const double value : intrinsics) {
    if (!std::isfinite(value)) fail(intrinsics_key, "must be numbers");
  }
  for (const double value : coefficients) {
    if (!std::isfinite(value)) fail(coefficients_key, "must be numbers");
  }
  if (intrinsics[3] != 0 || intrinsics[6] != 0 || intrinsics[7] != 0 || intrinsics[8] != 1)
    fail(intrinsics_key, "is not a camera matrix: it must be [fx 0 cx; 0 fy cy; 0 0 1]");
  if (intrinsics[1] != 0) fail(intrinsics_key, "has a skew of " + exact(intrinsics[1]) + ", which a rig cannot hold");
  if (!(intrinsics[0] > 0) || !(intrinsics[4] > 0)) fail(intrinsics_key, "has a focal length that is not > 0");
  // Tools fill up with zeros, to 8, 12 or 14: the shortest usual count that loses nothing.
  const std::size_t given = coefficients.size();
  std::size_t used = given;
  while (used > 0 && coefficients[used - 1] == 0) --used;
  const auto fits = [&](std::size_t count) { return given >= count && used <= count; };
  if (fisheye) {
    if (given != 0 && !fits(4))
      fail(coefficients_key, "a fisheye has 4 coefficients (k1 k2 k3 k4), got " + std::to_string(given));
    calib::FisheyeKannalaBrandt lens{intrinsics[0], intrinsics[4], intrinsics[2], intrinsics[5], {}};
    std::ranges::copy(coefficients.first(std::min<std::size_t>(given, 4)), lens.distortion.begin());
    return calib::CameraModel(lens);
  }
  const std::size_t n = given == 0 ? 0 : fits(4) ? 4 : fits(5) ? 5 : 8;
  if (n > given || used > 8 || given > 14) {
    fail(coefficients_key,
         given == 12 || given == 14
             ? std::string("has thin prism or tilt coefficients, which a rig cannot hold: calibrate with 8 or fewer")
             : "must have 4 (k1 k2 p1 p2), 5 (k3) or 8 (k4 k5 k6) coefficients, got " + std::to_string(given));
  }
  calib::PinholeRadtan lens{intrinsics[0], intrinsics[4], intrinsics[2], intrinsics[5], {}};
  std::ranges::copy(coefficients.first(n), lens.distortion.begin());
  return calib::CameraModel(lens);
}

Eigen::Quaterniond rotation_of(std::span<const double> m, std::string_view key, const Fail& fail) {
  if (m.size() != 9) fail(key, "must be a 3x3 matrix");
  const Eigen::Matrix3d r = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(m.data());
  const double off = (r * r.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(off <= 1e-4)) {
    fail(key, fmt::format("is not a rotation: its rows must be orthogonal and of length 1 (off by {:.2g})", off));
  }
  if (r.determinant() < 0) {
    fail(key,
         "is mirrored (determinant -1): the tool's y or z axis points the other way; a camera is right-handed, x "
         "right, y down, z forward");
  }
  return Eigen::Quaterniond(r).normalized();
}

Eigen::Quaterniond rotation_of_vector(std::span<const double> v) {
  const Eigen::Vector3d omega(v[0], v[1], v[2]);
  const double angle = omega.norm();
  if (angle < 1e-300) return Eigen::Quaterniond::Identity();
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, omega / angle));
}

Eigen::Vector3d vector_of(const Eigen::Quaterniond& rotation) {
  const Eigen::AngleAxisd turn(rotation);
  return turn.angle() * turn.axis();
}

bool is_fisheye(const calib::CameraModel& model) {
  return std::holds_alternative<calib::FisheyeKannalaBrandt>(model.lens());
}

std::vector<double> intrinsics_of(const calib::CameraModel& model) {
  return {model.fx(), 0, model.cx(), 0, model.fy(), model.cy(), 0, 0, 1};
}

std::vector<double> coefficients_of(const calib::CameraModel& model) {
  if (const auto* fisheye = std::get_if<calib::FisheyeKannalaBrandt>(&model.lens()))
    return {fisheye->distortion.begin(), fisheye->distortion.end()};
  const auto& k = std::get<calib::PinholeRadtan>(model.lens()).distortion;
  const bool rational = k[5] != 0 || k[6] != 0 || k[7] != 0;
  return {k.begin(), k.begin() + (rational ? 8 : 5)};
}

std::string exact(double value) {
  const std::string text = files::shortest_text(value);
  // TOML and some YAML readers distinguish integers and floats.
  return text.find_first_of(".en") == std::string::npos ? text + ".0" : text;
}

std::string exact_list(std::span<const double> values) {
  std::vector<std::string> texts;
  for (const double value : values) texts.push_back(exact(value));
  return fmt::format("[{}]", fmt::join(texts, ", "));
}

std::string clean_name(std::string name) {
  std::ranges::replace_if(
      name, [](unsigned char c) { return !(std::isalnum(c) || c == '_' || c == '-' || c == '.'); }, '_');
  if (name.empty() || name.front() == '-' || name.front() == '.') name.insert(0, "_");
  return name.substr(0, 64);
}

void require_valid(const calib::CameraRig& rig, const std::filesystem::path& file) {
  for (const calib::Camera& camera : rig.cameras) {
    for (const auto& problem : camera.problems()) throw files::ConfigError(file, 0, camera.name + ": " + problem);
  }
  for (const auto& problem : rig.problems()) throw files::ConfigError(file, 0, problem);
}

std::string text_of(const std::filesystem::path& file, files::Keys keys) {
  std::string text = files::read_text_file(file);
  files::refuse_deep_nesting(text, file, keys);
  return text;
}

}  // namespace huetrack::exchange
