// The pictures that a calibration looks at, from wherever the user has them: recordings, videos, folders of images.
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

// What was given as input cannot be used. what() is one readable line: which input, what is wrong, what to do.
class InputError : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct LabelledPicture {
  cv::Mat grey;                     // 8 bit
  std::string label;                // for people: "left07.jpg", "left at 3.20 s"
  std::optional<double> stamp_s{};  // the camera's time stamp, freed of jitter; nullopt: it has none, as a still
};

// What the cameras saw at (nearly) one time; a camera that gave nothing is absent.
struct PictureSet {
  int number = 0;  // ascending; a moment's number in the recording
  double at_s = 0;
  std::vector<std::optional<LabelledPicture>> pictures;  // per camera
};

// thread-compatible.
class PictureSource {
 public:
  virtual ~PictureSource() = default;
  virtual const std::vector<std::string>& cameras() const = 0;
  virtual std::optional<PictureSet> next(std::stop_token stop) = 0;  // nullopt: ended or stopped
  virtual std::optional<int> expected_sets() const = 0;              // about; nullopt: not known
  virtual bool has_stamps() const = 0;                               // its pictures have stamp_s
  virtual std::vector<std::string> take_warnings() = 0;              // what was damaged; one line each
};

struct PictureOptions {
  std::vector<std::string> only;      // these cameras, in this order; empty: all
  std::optional<double> tolerance_s;  // frames of different cameras this far apart are one set; nullopt: from the rates
};

// inputs: what the user gave, all of one kind:
// - one recording: its folder or recording.yaml;
// - one folder with a sub-folder of images, or a video, per camera;
// - NAME=FRAMES per camera; FRAMES: a video, a folder of images, a pattern (*.jpg, %06d.png), an image. A name may come
//   more than once. Images of several cameras belong together when the last numbers in their names are the same.
// throws InputError, ConfigError
std::unique_ptr<PictureSource> open_pictures(std::span<const std::string> inputs, const PictureOptions& options);

// Pictures of a single camera called `name`, where inputs need no NAME=: images, a video, a folder, or a recording that
// has the camera. Every picture is a set of its own.
std::unique_ptr<PictureSource> open_pictures_of(const std::string& name, std::span<const std::string> inputs);

cv::Mat board_grey_of(const capture::Image& image);  // what a board detector sees of it

}  // namespace huetrack::gather
