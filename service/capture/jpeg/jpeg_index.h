// A baseline JPEG, decoded only where it is looked at. One pass over its bits finds where each MCU begins and the mean
// of each 8x8 block; single MCUs are then decoded on demand.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "capture/frames/pixel_format.h"

namespace huetrack::capture {

// What indices need again for the next frame: their memory, and the tables made of the JPEG's Huffman codes. With one
// per source, frames of one size allocate nothing but a reference count. Thread-safe; indices may outlive it. Holds at
// most `most_free` indices.
class JpegIndexPool {
 public:
  explicit JpegIndexPool(int most_free = 8);
  ~JpegIndexPool();
  JpegIndexPool(const JpegIndexPool&) = delete;
  JpegIndexPool& operator=(const JpegIndexPool&) = delete;

 private:
  friend class JpegIndex;
  struct Impl;
  std::shared_ptr<Impl> impl_;
};

// Immutable and thread-safe. Memory: about the JPEG's size, 4 bytes per MCU and 2 per block.
class JpegIndex : public std::enable_shared_from_this<JpegIndex> {
 public:
  ~JpegIndex();
  JpegIndex(const JpegIndex&) = delete;
  JpegIndex& operator=(const JpegIndex&) = delete;

  // The pixels are bit for bit those of JpegDecoder (libjpeg-turbo's accurate integer transform). What is accepted here
  // is accepted by JpegDecoder, too. nullptr: give the bytes to JpegDecoder, which decodes or refuses them: the JPEG is
  // not baseline (8 bit, Huffman), not in one scan, of a kind that Image cannot hold, of another size, damaged, or odd
  // enough to be left to libjpeg. Does not throw, except std::bad_alloc. width, height: an image of another size is
  // refused by its header; 0: any. pool: may be nullptr.
  static std::shared_ptr<const JpegIndex> build(std::shared_ptr<const std::vector<std::uint8_t>> jpeg, int width = 0,
                                                int height = 0, JpegIndexPool* pool = nullptr);

  PixelFormat format() const;  // i420, i422, i444 or grey
  ColorRange range() const;    // full, unless the JPEG says otherwise (CS=ITU601)
  int width() const;
  int height() const;
  int mcu_width() const;  // pixels of luma: 8, 16, ...
  int mcu_height() const;
  int mcu_columns() const;  // MCUs that cover the image: ceil(width / mcu_width)
  int mcu_rows() const;

  // Decodes the MCUs [mcu_u0, mcu_u1) of MCU row mcu_v into the planes of an image of format(): planes[i] is the first
  // pixel of the whole plane, whose memory is padded to whole MCUs. Writes those MCUs' pixels and nothing else. Calls
  // from several threads may overlap in time if their MCUs differ. Unused planes are nullptr.
  void decode(int mcu_v, int mcu_u0, int mcu_u1, const std::array<std::uint8_t*, 3>& planes,
              const std::array<std::ptrdiff_t, 3>& strides) const;

  // The picture at 1/8 size: each pixel is the mean of an 8x8 block of its component, from the DC coefficient alone
  // (what a 1/8 decode of libjpeg gives). Same format and range. Size: whole MCUs / 8; what lies beyond the image's
  // edge is the encoder's padding. The image keeps this index.
  Image eighth() const;

  // Of each MCU, row by row: what its chroma surely lies within, by the DC and the sum of the AC coefficients.
  std::vector<ChromaBounds> chroma_bounds() const;
  // The same of the luma of these MCUs, which are counted row by row.
  void find_luma_bounds(std::span<const std::uint32_t> mcus, SampleBounds* out) const;

 private:
  friend class JpegIndexPool;
  JpegIndex();

  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace huetrack::capture
