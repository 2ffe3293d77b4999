#include "calib/program/rig_pictures.h"

#include <algorithm>
#include <cstdio>

namespace huetrack {

FoundBoards board_views_of(const CameraRig& rig, const std::filesystem::path& rig_file, const Board& board,
                           std::span<const std::string> inputs, const FindBoardsOptions& options,
                           std::stop_token stop) {
  std::vector<std::string> there, common;
  {
    const auto all = open_pictures(inputs, {});
    there = all->cameras();
  }
  for (const std::string& name : there) {
    if (rig.index_of(name)) {
      common.push_back(name);
    } else {
      std::fprintf(stderr, "huetrack-calibrate: camera %s is not in %s: left out\n", name.c_str(), rig_file.c_str());
    }
  }
  if (common.empty())
    throw InputError(rig_file.string() + ": has none of the cameras in the pictures: are the names the same?");
  for (const Camera& camera : rig.cameras) {
    if (std::ranges::find(common, camera.name) == common.end())
      std::fprintf(stderr, "huetrack-calibrate: there are no pictures of camera %s: left out\n", camera.name.c_str());
  }
  const auto source = open_pictures(inputs, {.only = common, .tolerance_s = {}});
  FoundBoards found = find_boards(*source, BoardDetector(board), options, std::move(stop));
  for (std::size_t c = 0; c < common.size(); ++c) {
    const Camera& camera = rig.cameras[static_cast<std::size_t>(*rig.index_of(common[c]))];
    const ImageSize size = found.cameras[c].image_size;
    if (size == camera.image_size) continue;
    throw InputError(rig_file.string() + ": camera " + camera.name + " was calibrated at " +
                     std::to_string(camera.image_size.width) + "x" + std::to_string(camera.image_size.height) +
                     ", its pictures are " + std::to_string(size.width) + "x" + std::to_string(size.height));
  }
  for (BoardView& view : found.views) view.camera = *rig.index_of(common[static_cast<std::size_t>(view.camera)]);
  return found;
}

void note_in(CameraRig& rig, const std::string& key, const std::string& text) {
  const auto known = std::ranges::find(rig.made_by, key, &std::pair<std::string, std::string>::first);
  if (known == rig.made_by.end()) {
    rig.made_by.emplace_back(key, text);
  } else {
    known->second = text;
  }
}

}  // namespace huetrack
