// One camera's recorded pictures, whatever they are stored in. Private to this module.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "capture/frames/frame.h"
#include "capture/frames/picture_layout.h"
#include "recordings/image_series.h"

namespace huetrack::recordings {

struct Shown {
  std::int64_t index = 0;                                      // in the stream; lost pictures count
  std::optional<capture::Timestamp> stamp;                     // the container's presentation time, if any
  capture::Image image;                                        // width 0: it does not decode
  std::shared_ptr<const std::vector<std::uint8_t>> jpeg = {};  // the file's JPEG bytes, if requested
  std::optional<capture::FirstField> tagged_field = {};        // of two in the image, which are of two moments
  std::shared_ptr<const capture::Matches> matches = {};  // from a file of matches (matches_reader.h); no planes then
};

// thread-compatible.
class PictureStream {
 public:
  virtual ~PictureStream() = default;
  virtual std::optional<Shown> next() = 0;  // the next selected picture; nullopt at the end. Never throws.
  // Pictures of the stream up to the next one to be read; at the end: all.
  virtual std::int64_t position() const = 0;
  // Of the whole stream, as declared by the file: may be wrong. nullopt: unknown
  virtual std::optional<std::int64_t> frame_count() const { return std::nullopt; }
  // Usual; 0 when unknown. Without a container it may be known after the first picture.
  virtual capture::Duration frame_period() const { return capture::Duration::zero(); }
  // SampleDepth::unexplained_largest() of its pictures.
  virtual std::optional<int> unexplained_largest() const { return std::nullopt; }
  // All files of a series of images, in the order in which they are played.
  virtual std::span<const ImageFile> series() const { return {}; }
  // Why its times cannot be right, known at its end.
  virtual std::optional<std::string> wrong_times() const { return std::nullopt; }
  virtual bool is_turned() const { return false; }  // its pictures, as a tag says
  // Of a container whose clock does not start at 0: its time at the first picture, whose stamp is 0.
  virtual std::optional<capture::Duration> clock_start() const { return std::nullopt; }
};

}  // namespace huetrack::recordings
