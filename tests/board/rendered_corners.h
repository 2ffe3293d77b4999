// Where the corners of the rendered boards truly are: the file beside the pictures of data/rendered/chessboard.
#pragma once

#include <Eigen/Core>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace huetrack::board {

struct RenderedCorners {
  int camera = 0, pose = 0;
  std::vector<int> ids;
  std::vector<Eigen::Vector2d> px;  // raw pixels, one per id
};

// By pose, then by camera; empty when the file is not there.
inline std::vector<RenderedCorners> rendered_corners(const std::filesystem::path& folder) {
  std::map<std::pair<int, int>, RenderedCorners> views;
  std::ifstream csv(folder / "corners_gt.csv");
  std::string line;
  std::getline(csv, line);
  while (std::getline(csv, line)) {
    int pose = 0, camera = 0, corner = 0;
    double u = 0, v = 0;
    if (std::sscanf(line.c_str(), "%d,cam%d,%d,%*f,%*f,%*f,%lf,%lf", &pose, &camera, &corner, &u, &v) != 5) continue;
    RenderedCorners& view = views[{pose, camera}];
    view.camera = camera, view.pose = pose;
    view.ids.push_back(corner);
    view.px.emplace_back(u, v);
  }
  std::vector<RenderedCorners> all;
  for (auto& [_, view] : views) all.push_back(std::move(view));
  return all;
}

}  // namespace huetrack::board
