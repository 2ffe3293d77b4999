// Finds which pixels of a frame have the colours that trackers request; a camera host sends that instead of the pixels.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "capture/frames/frame.h"
#include "capture/frames/light_watch.h"
#include "capture/frames/matches.h"
#include "capture/frames/repeat_watch.h"
#include "capture/jpeg/jpeg_reader.h"
#include "color/color_model.h"

namespace huetrack::hosts {

// Size limit of one frame's message, bytes: four colours that match all over a noisy picture, or as many runs, and its
// JPEG. A sender leaves out the picture first, then patches, then colours; a receiver accepts no more.
std::size_t most_bytes_of_matches(int width, int height);

struct MatchFinderOptions {
  std::vector<capture::MatchedColor> colors;  // at most capture::Matches::most, none twice; each a valid range
  capture::Duration picture_every{0};         // >= 0; 0: none
  // Places whose pixels are sent, too; at most capture::Matches::most_patches, within the image or not.
  std::vector<capture::PatchPlace> patches = {};
};

// One per camera. A new colour or format costs a table (some 5 ms, for BGR 100). At most four are made per frame, which
// then goes without the other new colours, so that requests of ever new colours do not block the camera. Nothing else
// allocates after the first frames. thread-compatible.
class MatchFinder {
 public:
  // frame: with pixels, or only a JPEG, which is decoded; one with matches is passed on. Returns the bytes described in
  // matches.h; nullopt: the frame does not decode, or repeats the camera's previous picture. A picture goes with the
  // first frame whose stamp is beyond the next multiple of picture_every, so that all cameras' pictures show nearly the
  // same moment. The result is valid until the next call, and while the frame is.
  std::optional<std::span<const std::uint8_t>> find(const capture::Frame& frame, const MatchFinderOptions& options);
  // Light in these frames. A tracker, which gets one picture in thirty, could not detect it.
  const capture::LightFindings& light() const { return light_.findings(); }

 private:
  struct Known {
    capture::MatchedColor color;
    std::unique_ptr<const color::ColorTable> table;
  };
  // nullptr: a new colour, and this frame's limit of new tables is reached.
  const color::ColorTable* table_for(const capture::MatchedColor& color, const capture::Image& image, int& may_make);
  void cut_to(const capture::Image& image, const std::vector<capture::PatchPlace>& wanted);
  std::span<const std::uint8_t> picture(const capture::Frame& frame, const capture::Image& image,
                                        capture::Duration every);

  capture::JpegReader reader_;
  capture::LightWatch light_;
  capture::RepeatWatch repeats_;
  std::vector<Known> known_;
  std::vector<capture::Matches::OfColor> found_;
  std::vector<capture::PatchPlace> patches_;
  std::vector<std::uint8_t> jpeg_, bytes_;
  std::optional<std::int64_t> last_picture_;  // its multiple of picture_every
};

}  // namespace huetrack::hosts
