// A recording's pictures as ROS 2 messages: a CompressedImage of every frame and, with a rig, its CameraInfo.
#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calib/model/camera_rig.h"
#include "clients/bag/bag.h"

namespace huetrack::bag {

// thread-compatible.
class RecordedPictures {
 public:
  // recording: words, as recordings::read_recording() takes them. rig: empty: rig.yaml in the recording's folder, if
  // any. first_topic: index of the first topic in the bag. Throws files::ConfigError, std::runtime_error.
  RecordedPictures(std::span<const std::string> recording, std::filesystem::path rig, std::size_t first_topic,
                   std::chrono::nanoseconds offset);
  ~RecordedPictures();
  RecordedPictures(const RecordedPictures&) = delete;
  RecordedPictures& operator=(const RecordedPictures&) = delete;

  const std::vector<Topic>& topics() const;
  const calib::CameraRig& rig() const;  // without cameras: no rig

  // In ascending time; nullopt: end. Throws as ros_time().
  std::optional<Message> next();

  std::vector<std::string> take_warnings();  // one line each
  // UNIX time of the recording's zero, seconds; nullopt: unknown.
  std::optional<double> started_at_s() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace huetrack::bag
