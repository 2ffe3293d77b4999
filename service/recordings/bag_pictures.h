// Reads one camera's pictures from a topic of a ROS bag, numbered by position. Private to this module.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "recordings/bags/bag.h"
#include "recordings/bags/messages.h"
#include "recordings/picture_decoder.h"
#include "recordings/recording.h"
#include "recordings/video_reader.h"

namespace huetrack::recordings {

// A recording of a bag, with a camera for every topic of pictures. throws ConfigError: it has none
Recording recording_of_bag(const std::filesystem::path& bag);

// The topic that a camera of a recording means: topic if it is not empty; else the bag's only one with pictures, or the
// one of this name (camera_topics.h). throws ConfigError
std::string topic_of(const std::filesystem::path& bag, const std::string& camera, const std::string& topic);

// thread-compatible.
class BagPictures final : public PictureStream {
 public:
  // camera and warnings must outlive it; its frames are a bag. keeps_encoded: see ReplayOptions. throws ConfigError
  BagPictures(const RecordedCamera& camera, std::vector<std::string>& warnings, bool keeps_encoded);

  std::optional<Shown> next() override;
  std::int64_t position() const override { return index_; }
  bool is_turned() const override { return decoder_.turns(); }
  std::optional<int> unexplained_largest() const override { return decoder_.depth().unexplained_largest(); }
  std::optional<std::int64_t> frame_count() const override { return messages_.messages(); }
  capture::Duration frame_period() const override { return period_; }  // the median of the first; 0: unknown

 private:
  std::optional<capture::Image> raw(const bags::BagMessage& message, const bags::PictureMessage& picture);
  void measure_period();
  std::int64_t time_of(const bags::BagMessage& message) const;
  std::optional<bags::BagMessage> next_by_time();
  void warn(const std::string& text) {
    warnings_.push_back(camera_.frames.string() + ": " + camera_.topic + ": " + text);
  }

  const RecordedCamera& camera_;
  FrameSelection selection_;
  std::vector<std::string>& warnings_;
  bool keeps_encoded_;
  bags::TopicReader messages_;
  std::multimap<std::int64_t, bags::BagMessage> waiting_;  // by time
  capture::Duration period_{0};
  std::int64_t index_ = 0;
  std::int64_t lost_ = 0;    // frames that do not decode
  bool is_stamped_ = false;  // some header.stamp is not 0: a simulated clock begins at 0
  bool has_warned_of_stamps_ = false;
  PictureDecoder decoder_;
  std::string problem_;  // why the last picture has no image
};

}  // namespace huetrack::recordings
