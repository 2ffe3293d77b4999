#include "pipeline/picture_folder.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <stdexcept>

namespace huetrack::pipeline {
namespace {

// Pictures of an earlier run would be taken for this one's. A person's own pictures have other names.
void remove_earlier_pictures(const std::filesystem::path& folder) {
  const auto is_ours = [](const std::string& name) {
    for (const std::string_view kind : {"set_", "camera_"})
      if (name.starts_with(kind) && name.ends_with(".png") &&
          name.find_first_not_of("0123456789", kind.size()) == name.size() - std::string_view(".png").size())
        return true;
    return name == "track_3d.png" || name == "camera_3d.png";
  };
  std::error_code none;
  std::vector<std::filesystem::path> earlier;
  for (const auto& entry : std::filesystem::directory_iterator(folder, none))
    if (is_ours(entry.path().filename().string())) earlier.push_back(entry.path());
  for (const auto& picture : earlier)
    if (!std::filesystem::remove(picture, none) || none)
      throw std::runtime_error(picture.string() +
                               ", a picture of an earlier run, cannot be removed: " + none.message());
  if (!earlier.empty()) spdlog::info("{}: replaced the earlier run's {} pictures", folder.string(), earlier.size());
}

}  // namespace

PictureFolder::PictureFolder(const config::ServiceConfig& config, const std::filesystem::path& folder)
    : config_(config), tracks_(config.targets.size()) {
  remove_earlier_pictures(folder);
  if (!config.targets.empty()) sets_.emplace(config, folder);
  if (!config.camera_tracking.camera.empty()) camera_.emplace(config, folder);
}

void PictureFolder::on_set(const TrackedSet& set) {
  for (const auto& estimate : set.estimates) {
    tracks_[estimate.target].push_back(estimate);
    tracks_[estimate.target].back().per_view.clear();
  }
}

void PictureFolder::on_camera_pose(const TrackedFrame& frame) {
  path_.push_back(frame.estimate);
}

void PictureFolder::on_picture(const pictures::PictureJob& job) {
  sets_->write(job);
}

void PictureFolder::on_camera_picture(const pictures::CameraPictureJob& job) {
  camera_->write(job);
}

void PictureFolder::finish(const std::string& name, const tracks::Truth* truth,
                           const camera_tracking::CameraTracker* tracker) {
  if (sets_) {
    for (auto& track : tracks_) std::ranges::stable_sort(track, {}, &object_tracking::ObjectEstimate::object);
    sets_->write("track_3d.png", pictures::draw_track_3d(config_, "Track in 3-D: " + name, tracks_, truth));
    written_ += sets_->written() + 1;
  }
  if (camera_ && tracker != nullptr) {
    camera_->finish("The path of " + config_.camera_tracking.camera + ": " + name, path_, tracker->map());
    written_ += camera_->written();
  }
}

}  // namespace huetrack::pipeline
