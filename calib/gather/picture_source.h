// Images for a calibration, from recordings, videos or folders of images.
#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <vector>

#include "calib/model/camera_rig.h"
#include "capture/frames/frame.h"

namespace huetrack::gather {

// An input cannot be used. what(): one line with the input, what is wrong, and what to do.
class InputError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct LabelledPicture {
  cv::Mat grey;                     // 8 bit
  std::string label;                // for people: "left07.jpg", "left at 3.20 s"
  std::optional<double> stamp_s{};  // time stamp without jitter; nullopt: none (a still)
};

// The images of one moment; a camera without an image is absent.
struct PictureSet {
  int number = 0;  // ascending; number in the recording
  double at_s = 0;
  std::vector<std::optional<LabelledPicture>> pictures;  // per camera
};

// thread-compatible.
class PictureSource {
 public:
  virtual ~PictureSource() = default;
  virtual const std::vector<std::string>& cameras() const = 0;
  virtual std::optional<PictureSet> next(std::stop_token stop) = 0;  // nullopt: ended or stopped
  virtual std::optional<int> expected_sets() const = 0;              // approximate; nullopt: unknown
  virtual bool has_stamps() const = 0;                               // images have stamp_s
  virtual std::vector<std::string> take_warnings() = 0;              // damaged inputs, one line each
};

struct PictureOptions {
  std::vector<std::string> only;      // these cameras, in this order; empty: all
  std::optional<double> tolerance_s;  // maximum time difference within a set; nullopt: from the frame rates
};

// inputs: all of one kind:
// - one recording: its folder or recording.yaml, or a ROS bag;
// - one folder with a sub-folder of images, or a video, per camera;
// - NAME=FRAMES per camera; FRAMES: a video, a folder of images, a pattern (*.jpg, %06d.png), an image, BAG:/topic;
// each also with @u,v,width,height for a part of every picture. A name may occur
//   repeatedly. Images of several cameras with the same last number in their names form a set.
// throws InputError, files::ConfigError
std::unique_ptr<PictureSource> open_pictures(std::span<const std::string> inputs, const PictureOptions& options);

// Images of a single camera `name`; inputs need no NAME=: images, a video, a folder, or a recording with this camera.
// Every image is a set of its own.
std::unique_ptr<PictureSource> open_pictures_of(const std::string& name, std::span<const std::string> inputs);

cv::Mat board_grey_of(const capture::Image& image);  // the grey image for a board detector

}  // namespace huetrack::gather
