// The JPEGs of one camera as images whose pixels are decoded on demand.
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
  poisoned,  // the same, with random bytes until they are decoded: a reader without require() gives other results
  whole,     // by JpegDecoder, as JPEGs that JpegIndex refuses
};

// thread-compatible; its images are thread-safe and may outlive it. Their memory is reused.
class JpegReader {
 public:
  // A copy of the bytes, for read().
  std::shared_ptr<const std::vector<std::uint8_t>> keep(std::span<const std::uint8_t> jpeg);

  // Same verdict and pixels as JpegDecoder::decode(). This call checks all bytes and indexes them; the image's readers
  // decode pixels in their threads (Image::on_demand).
  JpegResult read(std::shared_ptr<const std::vector<std::uint8_t>> jpeg, int width = 0, int height = 0);

  // For JPEGs that need all of their pixels.
  JpegDecoder& decoder() { return decoder_; }

  // For all readers in the process; by default on_demand.
  static void set_reading(JpegReading reading);

 private:
  JpegIndexPool indices_;
  Recycler<FrameMemory> memory_;
  Recycler<std::vector<std::uint8_t>> bytes_;
  JpegDecoder decoder_;
};

}  // namespace huetrack::capture
