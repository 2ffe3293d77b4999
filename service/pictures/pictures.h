// Pictures of the object tracker, for people: one PNG per frame set with every view, particles and estimate, and one
// PNG of the whole track in 3-D.
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "config/service_config.h"
#include "drawing/canvas.h"
#include "pictures/picture_job.h"
#include "tracks/truth_comparison.h"

namespace huetrack::pictures {

// A drawing colour for a target: the middle of its hues.
drawing::Color color_of(const color::HsiRange& range, double saturation, double value);

// The whole image in 8-bit BGR (BT.601).
cv::Mat bgr_of(const capture::Image& image);

// All views side by side: particles in the target's colour, the target's estimated outline and 95 % ellipse.
cv::Mat draw_views(const config::ServiceConfig& config, const PictureJob& job);

// The tracks: a 3-D view with cameras and volume, a plan, coordinates over time, and the error if there is a truth.
//   title    the headline
//   tracks   per target (in the order of config.targets), the estimates object by object, each in time order
cv::Mat draw_track_3d(const config::ServiceConfig& config, const std::string& title,
                      const std::vector<std::vector<object_tracking::ObjectEstimate>>& tracks,
                      const tracks::Truth* truth);

// thread-compatible.
class PictureWriter {
 public:
  // Creates the folder if needed. throws std::runtime_error, naming it
  PictureWriter(const config::ServiceConfig& config, std::filesystem::path folder);

  void write(const PictureJob& job);                                       // <folder>/set_<number>.png
  void write(const std::string& file_name, const cv::Mat& picture) const;  // throws std::runtime_error, naming the file
  const std::filesystem::path& folder() const { return folder_; }
  std::size_t written() const { return written_; }

 private:
  const config::ServiceConfig& config_;
  std::filesystem::path folder_;
  std::size_t written_ = 0;
};

}  // namespace huetrack::pictures
