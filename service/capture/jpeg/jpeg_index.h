// A baseline JPEG that is decoded on demand. One pass over its bits finds where each MCU begins and the mean of each
// 8x8 block; single MCUs are decoded later.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "capture/frames/pixel_format.h"
#include "capture/frames/recycler.h"

namespace huetrack::capture {

class JpegIndex;
// One per source: its next frames reuse the memory and the Huffman tables of its indices.
using JpegIndexPool = Recycler<JpegIndex>;

// Immutable and thread-safe. Memory: about the JPEG's size, 4 bytes per MCU and 2 per block.
class JpegIndex : public std::enable_shared_from_this<JpegIndex> {
 public:
  JpegIndex();  // for JpegIndexPool: of no JPEG
  ~JpegIndex();
  JpegIndex(const JpegIndex&) = delete;
  JpegIndex& operator=(const JpegIndex&) = delete;

  // The pixels are bit for bit those of JpegDecoder (libjpeg-turbo's accurate integer transform), which accepts all
  // that is accepted here. nullptr: pass the bytes to JpegDecoder, which decodes or refuses them. The JPEG is then not
  // baseline (8 bit, Huffman), has several scans, does not fit Image, has another size, is damaged, or is unusual
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

  // The image at 1/8 of its size, by DC coefficients alone (as a 1/8 decode by libjpeg): each pixel is the mean of an
  // 8x8 block of its component. Same format and range. Size: whole MCUs / 8; beyond the image's edge is the encoder's
  // padding. The image keeps this index alive.
  Image eighth() const;

  // Of each MCU, row by row: bounds of its samples, by the DC and the sum of the AC coefficients. build() computes most
  // of it already in memory whose last two frames were asked for their bounds.
  std::vector<PixelBounds> bounds() const;
  // Narrows the bounds of an MCU's chroma to the range of its samples, the padding included. mcu: counted row by row.
  void narrow_chroma(std::size_t mcu, PixelBounds& bounds) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace huetrack::capture
