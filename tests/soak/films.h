// A rendered world for FilmCamera: a folder with rig.yaml and CAMERA.yuyv of N cameras on a ring around a lime ball
// that goes round in two seconds; the films can be looped.
// is_spread: taken as film_service plays them with --phases spread, one camera after the other within a frame's time. A
// film that is played at other times shows the ball where it is not: 2 cm off, by the 16 ms between two cameras.
#pragma once

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>
#include <vector>

#include "calib/model/rig_yaml.h"
#include "scene/scene.h"

namespace huetrack::soak {

// FOLDER/CAMERA.yuyv of what a scene's cameras see, and its rig.yaml.
inline void write_films(const std::filesystem::path& folder, const scene::Scene& scene,
                        const scene::RenderOptions& options) {
  std::filesystem::create_directories(folder);
  calib::write_rig(scene.rig, folder / "rig.yaml");
  std::vector<std::ofstream> films;
  for (const auto& camera : scene.rig.cameras) films.emplace_back(folder / (camera.name + ".yuyv"), std::ios::binary);
  for (const capture::FrameSet& set : scene::render(scene, options))
    for (const auto& frame : set.frames) {
      const capture::Image& image = frame->pixels;
      for (int v = 0; v < image.height; ++v)
        films[std::size_t(frame->camera)].write(
            reinterpret_cast<const char*>(image.planes[0].data + v * image.planes[0].stride), 2 * image.width);
    }
}

// Round in two seconds, so that a film of it can be looped.
inline Eigen::Vector3d round_path(double t_s) {
  const double angle = std::numbers::pi * t_s;
  return {0.4 * std::cos(angle), 0.4 * std::sin(angle), 1 + 0.2 * std::sin(2 * angle)};
}

inline void make_films(const std::filesystem::path& folder, int cameras, int width, int height, bool is_spread = true) {
  constexpr int frames = 60;
  constexpr double fps = 30;
  scene::BallOptions ball;
  ball.path = round_path;
  const scene::Scene scene =
      scene::SceneBuilder{}
          .cameras_on_ring({.count = cameras, .image_size = {width, height}, .focal_px = 0.75 * width})
          .ball(ball)
          .build();
  scene::RenderOptions options{.set_count = frames, .fps = fps};
  for (int c = 0; is_spread && c < cameras; ++c) options.offset_s.push_back(c / (cameras * fps));
  write_films(folder, scene, options);
}

// A configuration for those films. more: further keys of the first level.
inline std::string film_config(const std::filesystem::path& folder, int particles, const std::string& more = "") {
  const calib::CameraRig rig = calib::read_rig(folder / "rig.yaml");
  std::string text = "version: 1\nrig: " + (folder / "rig.yaml").string() +
                     "\ntargets: {lime: {color: {hue_deg: [65, 115]}}}\nobject_tracking: {particle_count: " +
                     std::to_string(particles) + "}\ncameras:\n";
  for (const auto& camera : rig.cameras)
    text += "  " + camera.name + ": {device: /dev/film/" + camera.name + ", fps: 30}\n";
  return text + more;
}

}  // namespace huetrack::soak
