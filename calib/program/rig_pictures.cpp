#include "calib/program/rig_pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

namespace huetrack::program {

gather::FoundBoards board_views_of(const calib::CameraRig& rig, const std::filesystem::path& rig_file,
                                   const board::Board& board, std::span<const std::string> inputs,
                                   const gather::FindBoardsOptions& options, std::stop_token stop) {
  std::vector<std::string> there, common;
  {
    const auto all = gather::open_pictures(inputs, {});
    there = all->cameras();
  }
  for (const std::string& name : there) {
    if (rig.index_of(name)) {
      common.push_back(name);
    } else {
      std::fprintf(stderr, "huetrack-calibrate: camera %s is not in %s: omitted\n", name.c_str(), rig_file.c_str());
    }
  }
  if (common.empty())
    throw gather::InputError(rig_file.string() + ": has none of the cameras of the images: are the names the same?");
  for (const calib::Camera& camera : rig.cameras) {
    if (std::ranges::find(common, camera.name) == common.end())
      std::fprintf(stderr, "huetrack-calibrate: there are no images of camera %s: omitted\n", camera.name.c_str());
  }
  const auto source = gather::open_pictures(inputs, {.only = common, .tolerance_s = {}});
  gather::FoundBoards found = gather::find_boards(*source, board::BoardDetector(board), options, std::move(stop));
  for (std::size_t c = 0; c < common.size(); ++c) {
    const calib::Camera& camera = rig.cameras[static_cast<std::size_t>(*rig.index_of(common[c]))];
    require_size(camera, found.cameras[c].image_size, rig_file);
  }
  for (solver::BoardView& view : found.views)
    view.camera = *rig.index_of(common[static_cast<std::size_t>(view.camera)]);
  return found;
}

void require_size(const calib::Camera& camera, calib::ImageSize pictures, const std::filesystem::path& rig_file) {
  if (camera.image_size != pictures)
    throw gather::InputError(fmt::format("{}: camera {} was calibrated at {}x{}, but its images are {}x{}",
                                         rig_file.string(), camera.name, camera.image_size.width,
                                         camera.image_size.height, pictures.width, pictures.height));
}

void note_in(calib::CameraRig& rig, const std::string& key, const std::string& text) {
  const auto known = std::ranges::find(rig.made_by, key, &std::pair<std::string, std::string>::first);
  if (known == rig.made_by.end()) {
    rig.made_by.emplace_back(key, text);
  } else {
    known->second = text;
  }
}

}  // namespace huetrack::program
