// The JPEGs of one camera as images whose pixels are decoded where they are looked at.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "capture/frames/jpeg_decoder.h"
#include "capture/frames/recycler.h"
#include "capture/jpeg/jpeg_index.h"

namespace huetrack::capture {

// For tests and benchmarks.
enum class JpegReading : std::uint8_t {
  on_demand,
  poisoned,  // the same, and what is not decoded yet has random bytes: a reader that forgot require() gives other
             // results
  whole,     // by JpegDecoder, as what JpegIndex does not take
};

// thread-compatible; its images are thread-safe and may outlive it. Their memory is used again.
class JpegReader {
 public:
  // A copy of the bytes, for read().
  std::shared_ptr<const std::vector<std::uint8_t>> keep(std::span<const std::uint8_t> jpeg);

  // Same verdict and pixels as JpegDecoder::decode(). Here, in the calling thread, the bytes are checked to the last
  // one and indexed; pixels are decoded by the readers of the image, in their threads (Image::on_demand).
  JpegResult read(std::shared_ptr<const std::vector<std::uint8_t>> jpeg, int width = 0, int height = 0);

  // For JPEGs that need all of their pixels.
  JpegDecoder& decoder() { return decoder_; }

  // Of all readers in the process; by default on_demand.
  static void set_reading(JpegReading reading);

 private:
  JpegIndexPool indices_;
  Recycler<FrameMemory> memory_;
  Recycler<std::vector<std::uint8_t>> bytes_;
  JpegDecoder decoder_;
};

}  // namespace huetrack::capture
