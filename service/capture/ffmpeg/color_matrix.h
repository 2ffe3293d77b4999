// Colour matrices of YUV pictures: our YUV formats imply BT.601. Private to this module.
#pragma once

#include "capture/ffmpeg/ffmpeg_objects.h"
#include "capture/frames/pixel_format.h"

namespace huetrack::capture {

// Another one than BT.601's, and known: HD video has BT.709's.
bool has_other_matrix(const AVFrame& frame);

// Gives an 8-bit i420, i422 or i444 picture BT.601's matrix, sample by sample, so that every row keeps the colours of
// its own moment. by_fields: neighbouring rows are of two (i420 shares colours within a field). False: there is no
// memory.
bool to_bt601(AVFrame& frame, AVColorSpace matrix, PixelFormat format, ColorRange range, bool by_fields);

}  // namespace huetrack::capture
