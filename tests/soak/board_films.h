// What a new user's cameras see: first a board that is carried before them, then, once they are calibrated, the ball of
// films.h. A folder with CAMERA.board.yuyv and CAMERA.yuyv of two cameras, and with the truth, rig.yaml.
#pragma once

#include <filesystem>
#include <fstream>
#include <vector>

#include "gather/pictured_rig.h"
#include "soak/films.h"

namespace huetrack::soak {

// Grey pixels as YUYV of limited range, of no colour.
inline std::vector<char> yuyv_of(const cv::Mat& grey) {
  std::vector<char> bytes;
  bytes.reserve(2 * grey.total());
  for (int v = 0; v < grey.rows; ++v)
    for (int u = 0; u < grey.cols; ++u) {
      bytes.push_back(static_cast<char>(16 + grey.at<std::uint8_t>(v, u) * 219 / 255));
      bytes.push_back(static_cast<char>(128));
    }
  return bytes;
}

// Few: every one of them is looked at.
inline constexpr int board_fps = 20;

// The board rests at each of the places for 0.65 s.
inline void make_board_films(const std::filesystem::path& folder, int places) {
  constexpr int rest = 13, round_s = 2;
  calib::CameraRig rig = gather::pictured_rig();
  rig.cameras.erase(rig.cameras.begin() + 1);  // those that stand farthest apart
  rig.cameras[1].name = "cam1";
  scene::SceneBuilder builder;
  for (const calib::Camera& camera : rig.cameras) builder.camera(camera);
  scene::BallOptions ball;
  ball.path = round_path;
  write_films(folder, builder.ball(ball).build(), {.set_count = round_s * board_fps, .fps = board_fps});
  const auto poses = gather::pictured_poses(places);
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    std::ofstream film(folder / (rig.cameras[c].name + ".board.yuyv"), std::ios::binary);
    for (std::size_t p = 0; p < poses.size(); ++p) {
      const cv::Mat picture = gather::picture_of(rig.cameras[c], gather::pictured_board(), poses[p], 100 * c + p);
      const std::vector<char> bytes = yuyv_of(picture);
      for (int i = 0; i < rest; ++i) film.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    }
  }
}

}  // namespace huetrack::soak
