#include "calib/model/camera_rig.h"

#include <algorithm>
#include <cmath>

namespace huetrack::calib {

bool is_camera_name(std::string_view name) {
  const auto is_word = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
  };
  return !name.empty() && name.size() <= 64 && is_word(name.front()) &&
         std::ranges::all_of(name, [&](char c) { return is_word(c) || c == '-' || c == '.'; });
}

std::vector<std::string> CameraTiming::problems() const {
  std::vector<std::string> problems;
  const auto check = [&](const char* what, const std::optional<double>& value, const std::optional<double>& sigma) {
    if (value && !(std::abs(*value) <= 1))
      problems.push_back(std::string("timing: ") + what + "_s must be from -1 to 1");
    if (sigma && !value) problems.push_back(std::string("timing: ") + what + "_sigma_s needs " + what + "_s");
    if (sigma && !(*sigma >= 0 && *sigma <= 1))
      problems.push_back(std::string("timing: ") + what + "_sigma_s must be from 0 to 1");
  };
  check("latency", latency_s, latency_sigma_s);
  check("readout", readout_s, readout_sigma_s);
  return problems;
}

std::vector<std::string> Camera::problems() const {
  std::vector<std::string> problems = timing.problems();
  if (!is_camera_name(name)) problems.emplace_back(camera_name_rule);
  const auto [width, height] = image_size;
  if (width < 1 || height < 1 || width > 32768 || height > 32768) {
    problems.emplace_back("image_size must be from 1 to 32768 pixels in both directions");
    return problems;
  }
  if (model.limit() < 0) {
    problems.emplace_back("the intrinsics and the distortion must be finite numbers");
  } else if (!(model.fx() > 0) || !(model.fy() > 0)) {
    problems.emplace_back("fx and fy must be > 0");
  } else {
    // Generous: from 180 degrees in a third of the image to a telescope.
    const auto is_sane_focal = [](double f, int size) { return f > 0.02 * size && f < 1000.0 * size; };
    if (!is_sane_focal(model.fx(), width) || !is_sane_focal(model.fy(), height)) {
      problems.emplace_back("fx and fy do not fit the image size: are they in pixels of this image?");
    }
    const auto is_sane_centre = [](double c, int size) { return c > -1.0 * size && c < 2.0 * size; };
    if (!is_sane_centre(model.cx(), width) || !is_sane_centre(model.cy(), height)) {
      problems.emplace_back("the principal point (cx, cy) is far outside the image: is it in pixels of this image?");
    }
  }
  if (!(std::abs(cam_from_world.rotation.norm() - 1) < 1e-6)) {
    problems.emplace_back("the rotation of cam_from_world is not a unit quaternion");
  }
  if (!cam_from_world.translation.allFinite()) {
    problems.emplace_back("the translation of cam_from_world must be finite numbers");
  }
  return problems;
}

std::optional<int> CameraRig::index_of(std::string_view name) const {
  const auto camera = std::ranges::find(cameras, name, &Camera::name);
  if (camera == cameras.end()) return std::nullopt;
  return static_cast<int>(camera - cameras.begin());
}

std::vector<std::string> CameraRig::camera_names() const {
  std::vector<std::string> names;
  for (const Camera& camera : cameras) names.push_back(camera.name);
  return names;
}

std::vector<std::string> CameraRig::problems() const {
  std::vector<std::string> problems;
  if (cameras.empty()) problems.emplace_back("a rig has at least one camera");
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const Camera& camera = cameras[i];
    for (const auto& problem : camera.problems()) problems.push_back("camera " + camera.name + ": " + problem);
    for (std::size_t j = 0; j < i; ++j) {
      if (cameras[j].name == camera.name) problems.push_back("two cameras have the name " + camera.name);
      if ((cameras[j].centre() - camera.centre()).norm() < 1e-6) {
        problems.push_back("cameras " + cameras[j].name + " and " + camera.name +
                           " are at the same place in the world: one pose is copied, or not calibrated");
      }
    }
  }
  if (uncertainty && problems.empty()) {
    for (const auto& problem : uncertainty->problems(*this)) problems.push_back("uncertainty: " + problem);
  }
  for (const RigCheckNote& check : made.checks) {
    if (check.verdict.empty()) problems.emplace_back("made: a check has no verdict");
  }
  for (const auto& [key, value] : made_by) {
    if (key.empty() || value.empty()) problems.emplace_back("made_by has an empty key or an empty value");
    if (std::ranges::count(made_by, key, &std::pair<std::string, std::string>::first) > 1) {
      problems.push_back("made_by has the key " + key + " more than once");
    }
  }
  return problems;
}

}  // namespace huetrack::calib
