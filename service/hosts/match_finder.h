// What a camera host says of a frame in place of its pixels: which of them have the colours that trackers look for.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "capture/frames/frame.h"
#include "capture/frames/jpeg_decoder.h"
#include "capture/frames/light_watch.h"
#include "capture/frames/matches.h"
#include "capture/frames/repeat_watch.h"
#include "color/color_model.h"

namespace huetrack::hosts {

// The most that is sent of one frame, bytes: four colours that match all over a noisy picture, or as many runs, and its
// JPEG. A sender leaves out what is beyond, first the picture, then patches; a reader takes no more.
std::size_t most_bytes_of_matches(int width, int height);

struct MatchFinderOptions {
  std::vector<capture::MatchedColor> colors;  // at most capture::Matches::most, none twice; each a valid range
  capture::Duration picture_every{0};         // >= 0; 0: none
  // Where the frame's own pixels are to go along, too; at most capture::Matches::most_patches, within the image or not.
  std::vector<capture::PatchPlace> patches = {};
};

// One per camera. A new colour, or a new format, costs a table: some 5 ms, for BGR 100; of a frame no more than four
// are made, and it goes without the other colours, so that who asks for ever new ones holds no camera up. Nothing else
// allocates once it has run. thread-compatible.
class MatchFinder {
 public:
  // frame: of pixels, or of a JPEG alone, which is decoded; one of matches goes on as it came. The bytes are those of
  // capture/matches.h; nullopt: it does not decode, or shows the camera's picture before it once more. A picture goes
  // with the first frame whose stamp is beyond the next multiple of picture_every: so the cameras of a hall show nearly
  // one moment. Valid until the next call, and while the frame is.
  std::optional<std::span<const std::uint8_t>> find(const capture::Frame& frame, const MatchFinderOptions& options);
  // What light does in these frames: a tracker, which has one picture in thirty of them, could not see it.
  const capture::LightFindings& light() const { return light_.findings(); }

 private:
  struct Known {
    capture::MatchedColor color;
    std::unique_ptr<const color::ColorTable> table;
  };
  // nullptr: it is a new one, and no more may be made for this frame.
  const color::ColorTable* table_for(const capture::MatchedColor& color, const capture::Image& image, int& may_make);
  void cut_to(const capture::Image& image, const std::vector<capture::PatchPlace>& wanted);
  std::span<const std::uint8_t> picture(const capture::Frame& frame, const capture::Image& image,
                                        capture::Duration every);

  capture::JpegDecoder decoder_;
  capture::LightWatch light_;
  capture::RepeatWatch repeats_;
  std::vector<Known> known_;
  std::vector<capture::Matches::OfColor> found_;
  std::vector<capture::PatchPlace> patches_;
  std::vector<std::uint8_t> jpeg_, bytes_;
  std::optional<std::int64_t> last_picture_;  // the multiple that it was beyond
};

}  // namespace huetrack::hosts
