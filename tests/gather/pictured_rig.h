// Known cameras and boards, as image files that a user would have.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <string>
#include <vector>

#include "board/drawn_board.h"
#include "calib/board/board.h"
#include "calib/model/camera_rig.h"
#include "solver/synthetic_rig.h"

namespace huetrack::gather {

inline board::Board pictured_board() {
  return {.columns = 7, .rows = 5, .pitch = {0.08, 0.08}};
}

// Three cameras without distortion on an arc, 320x240, of different focal lengths; z up, the floor is z = 0.
inline calib::CameraRig pictured_rig() {
  calib::CameraRig rig;
  const std::array<double, 3> focal{300, 340, 270};
  for (int c = 0; c < 3; ++c) {
    const double angle = 0.5 * (c - 1);
    const Eigen::Vector3d place(1.9 * std::cos(angle), 1.9 * std::sin(angle), 1.5);
    const double f = focal[static_cast<std::size_t>(c)];
    rig.cameras.push_back({"cam" + std::to_string(c),
                           {320, 240},
                           calib::CameraModel(calib::PinholeRadtan{f, f, 158.5 + c, 121.0 - c}),
                           solver::looking_at(place, {0, 0, 0.9}),
                           {}});
  }
  return rig;
}

// Places that cover the images, tilted by up to 45 degrees.
inline std::vector<calib::Rigid3d> pictured_poses(int count, std::uint64_t seed = 3) {
  std::mt19937_64 rng(seed);
  const board::Board board = pictured_board();
  const Eigen::Vector3d middle = (board.point(0) + board.point(board.point_count() - 1)) / 2;
  Eigen::Matrix3d facing;
  facing.col(2) = -Eigen::Vector3d::UnitX();
  facing.col(0) = Eigen::Vector3d::UnitY();
  facing.col(1) = facing.col(2).cross(facing.col(0));
  std::vector<calib::Rigid3d> poses;
  for (int k = 0; k < count; ++k) {
    const Eigen::Vector3d place(1.0 * solver::uniform(rng) - 0.4, 0.9 * solver::uniform(rng) - 0.45,
                                0.55 + 0.7 * solver::uniform(rng));
    const Eigen::Vector3d tilt(0.8 * (2 * solver::uniform(rng) - 1), 0.6 * (2 * solver::uniform(rng) - 1),
                               0.6 * (2 * solver::uniform(rng) - 1));
    const Eigen::Quaterniond rotation = Eigen::AngleAxisd(tilt.norm(), tilt.normalized()) * Eigen::Quaterniond(facing);
    poses.push_back({rotation, place - rotation * middle});
  }
  return poses;
}

// What a camera sees of it.
inline cv::Mat picture_of(const calib::Camera& camera, const board::Board& board,
                          const calib::Rigid3d& world_from_board, std::uint64_t seed) {
  const board::DrawnBoard drawn = board::draw_board(board, 40);
  const calib::Rigid3d cam_from_board = camera.cam_from_world * world_from_board;
  const Eigen::Matrix3d r = cam_from_board.rotation.toRotationMatrix();
  Eigen::Matrix3d k, plane, scale;
  k << camera.model.fx(), 0, camera.model.cx(), 0, camera.model.fy(), camera.model.cy(), 0, 0, 1;
  plane << r.col(0), r.col(1), cam_from_board.translation;
  scale << 1 / drawn.px_per_m, 0, -drawn.origin_px.x() / drawn.px_per_m, 0, 1 / drawn.px_per_m,
      -drawn.origin_px.y() / drawn.px_per_m, 0, 0, 1;
  const Eigen::Matrix3d h = k * plane * scale;
  const cv::Matx33d m(h(0, 0), h(0, 1), h(0, 2), h(1, 0), h(1, 1), h(1, 2), h(2, 0), h(2, 1), h(2, 2));
  return board::seen_through(drawn.image, m, {camera.image_size.width, camera.image_size.height}, 1.5, seed);
}

// By motion over `px`, `degrees` from the image's x axis.
inline cv::Mat smeared(const cv::Mat& picture, double px, double degrees) {
  const double angle = degrees * CV_PI / 180;
  cv::Mat kernel = cv::Mat::zeros(31, 31, CV_32F), out;
  constexpr int moments = 101;
  for (int k = 0; k < moments; ++k) {
    const double along = px * (k / (moments - 1.0) - 0.5);
    kernel.at<float>(cvRound(15 + along * std::sin(angle)), cvRound(15 + along * std::cos(angle))) += 1.0F / moments;
  }
  cv::filter2D(picture, out, -1, kernel, {-1, -1}, 0, cv::BORDER_REPLICATE);
  return out;
}

inline std::string picture_name(int pose) {  // "07.png"
  std::array<char, 16> name{};
  std::snprintf(name.data(), name.size(), "%02d.png", pose);
  return name.data();
}

// folder/camN/00.png, ...: of every pose, unless `spoil` changes the picture (an empty one is left out).
using Spoil = std::function<void(int camera, int pose, cv::Mat& picture)>;
inline void write_pictures(const std::filesystem::path& folder, const calib::CameraRig& rig,
                           const std::vector<calib::Rigid3d>& poses, const Spoil& spoil = {},
                           const board::Board& board = pictured_board()) {
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    std::filesystem::create_directories(folder / rig.cameras[c].name);
    for (std::size_t p = 0; p < poses.size(); ++p) {
      cv::Mat picture = picture_of(rig.cameras[c], board, poses[p], 100 * c + p);
      if (spoil) spoil(static_cast<int>(c), static_cast<int>(p), picture);
      const std::string name = picture_name(static_cast<int>(p));
      if (!picture.empty()) cv::imwrite((folder / rig.cameras[c].name / name).string(), picture);
    }
  }
}

}  // namespace huetrack::gather
