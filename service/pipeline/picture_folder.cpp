#include "pipeline/picture_folder.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <system_error>

namespace huetrack::pipeline {
namespace {

void warn_of_other_pictures(const std::filesystem::path& folder) {
  std::error_code none;  // no folder yet
  const auto pictures = std::count_if(std::filesystem::directory_iterator(folder, none), {},
                                      [](const auto& entry) { return entry.path().extension() == ".png"; });
  if (pictures > 0)
    spdlog::warn("{} has {} pictures already: this run replaces those of the same names, and the others stay",
                 folder.string(), pictures);
}

}  // namespace

PictureFolder::PictureFolder(const config::ServiceConfig& config, const std::filesystem::path& folder)
    : config_(config), tracks_(config.targets.size()) {
  warn_of_other_pictures(folder);
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
