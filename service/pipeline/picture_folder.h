// The output of `replay --pictures`: a folder with pictures of frame sets and of the whole trajectory.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "pictures/camera_pictures.h"
#include "pictures/pictures.h"
#include "pipeline/output.h"
#include "tracks/truth_comparison.h"

namespace huetrack::pipeline {

class PictureFolder final : public Output {
 public:
  // Creates the folder if needed. config: outlives this. All functions throw std::runtime_error, naming the folder.
  PictureFolder(const config::ServiceConfig& config, const std::filesystem::path& folder);

  void on_set(const TrackedSet& set) override;
  void on_camera_pose(const TrackedFrame& frame) override;
  void on_picture(const pictures::PictureJob& job) override;
  void on_camera_picture(const pictures::CameraPictureJob& job) override;

  // After the run: draws track_3d.png and camera_3d.png. name: of the recording; truth and tracker may be null.
  void finish(const std::string& name, const tracks::Truth* truth, const camera_tracking::CameraTracker* tracker);
  std::size_t written() const { return written_; }  // after finish()

 private:
  const config::ServiceConfig& config_;
  std::optional<pictures::PictureWriter> sets_;                       // if there are targets
  std::optional<pictures::CameraPictureWriter> camera_;               // if a camera is tracked
  std::vector<std::vector<object_tracking::ObjectEstimate>> tracks_;  // the tracking thread's; per target
  std::vector<camera_tracking::CameraEstimate> path_;                 // the camera thread's
  std::size_t written_ = 0;
};

}  // namespace huetrack::pipeline
