// A recording's pictures as ROS 2 has them: a CompressedImage of every frame, as the camera gave it, and with a rig its
// CameraInfo.
#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "calib/model/camera_rig.h"
#include "clients/bag/bag.h"

namespace huetrack::bag {

// thread-compatible.
class RecordedPictures {
 public:
  // recording: its folder, or its yaml file. rig: with the cameras' lenses and times; empty: rig.yaml beside the
  // recording, or none. first_topic: of these, in the bag. throws files::ConfigError, std::runtime_error
  RecordedPictures(const std::filesystem::path& recording, std::filesystem::path rig, std::size_t first_topic,
                   std::chrono::nanoseconds offset);
  ~RecordedPictures();
  RecordedPictures(const RecordedPictures&) = delete;
  RecordedPictures& operator=(const RecordedPictures&) = delete;

  const std::vector<Topic>& topics() const;
  const calib::CameraRig& rig() const;  // without cameras: none is known

  // In ascending time; nullopt: that was all. throws as ros_time() does.
  std::optional<Message> next();

  std::vector<std::string> take_warnings();  // one line each
  // UNIX time at which the recording's clock began, seconds; nullopt: it does not say.
  std::optional<double> started_at_s() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace huetrack::bag
