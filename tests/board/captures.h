// The captures in /work/shared that several tests calibrate with, their boards detected once per test program.
#pragma once

#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "board/rendered_corners.h"
#include "calib/board/board_detector.h"
#include "calib/board/grey_view.h"
#include "calib/solver/bundle_adjustment.h"

namespace huetrack::board {

inline std::filesystem::path shared_data(const std::string& folder) {
  return std::filesystem::path(HUETRACK_SHARED_DATA) / folder;
}

// Nothing when the board is not in it.
inline void add_view(std::vector<solver::BoardView>& views, const BoardDetector& detector,
                     const std::filesystem::path& file, int camera, int set) {
  const cv::Mat image = cv::imread(file.string(), cv::IMREAD_GRAYSCALE);
  ASSERT_FALSE(image.empty()) << file;
  BoardDetection found = detector.detect(view_of(image));
  if (found.found())
    views.push_back({camera, set, file.filename().string(), std::move(found.ids), std::move(found.px)});
}

inline Board rendered_board() {
  return {.columns = 9, .rows = 6, .pitch = {0.06, 0.06}};
}

inline const std::vector<solver::BoardView>& rendered_views() {
  static const std::vector<solver::BoardView> views = [] {
    std::vector<solver::BoardView> all;
    const BoardDetector detector(rendered_board());
    for (int camera = 0; camera < 3; ++camera) {
      for (int pose = 0; pose < 25; ++pose) {
        std::array<char, 64> name;
        std::snprintf(name.data(), name.size(), "rendered/chessboard/cam%d/%06d.jpg", camera, pose);
        add_view(all, detector, shared_data(name.data()), camera, pose);
      }
    }
    return all;
  }();
  return views;
}

// The exact corners of the rendered boards.
inline std::vector<solver::BoardView> rendered_truth() {
  std::vector<solver::BoardView> all;
  for (RenderedCorners& corners : rendered_corners(shared_data("rendered/chessboard"))) {
    solver::BoardView view;
    view.camera = corners.camera;
    view.set = corners.pose;
    view.image = "cam" + std::to_string(corners.camera) + " pose " + std::to_string(corners.pose);
    view.ids = std::move(corners.ids);
    view.px = std::move(corners.px);
    all.push_back(std::move(view));
  }
  return all;
}

inline Board stereo_board() {
  return {.columns = 9, .rows = 6, .pitch = {0.025, 0.025}};
}

inline const std::vector<solver::BoardView>& stereo_views() {
  static const std::vector<solver::BoardView> views = [] {
    std::vector<solver::BoardView> all;
    const BoardDetector detector(stereo_board());
    for (int camera = 0; camera < 2; ++camera) {
      for (int n = 1; n <= 14; ++n) {
        if (n == 10) continue;
        std::array<char, 64> name;
        std::snprintf(name.data(), name.size(), "opencv_chessboard_stereo/%s%02d.jpg", camera == 0 ? "left" : "right",
                      n);
        add_view(all, detector, shared_data(name.data()), camera, n);
      }
    }
    return all;
  }();
  return views;
}

inline std::vector<solver::BoardView> views_of(const std::vector<solver::BoardView>& views, int camera) {
  std::vector<solver::BoardView> own;
  for (const solver::BoardView& view : views) {
    if (view.camera != camera) continue;
    own.push_back(view);
    own.back().camera = 0;
  }
  return own;
}

}  // namespace huetrack::board
