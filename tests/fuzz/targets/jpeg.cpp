#include <stdexcept>

#include "capture/frames/jpeg_decoder.h"
#include "fuzz/fuzz_target.h"

using namespace huetrack;

HUETRACK_FUZZ_TARGET(jpeg) {
  if (fuzz::is_long_to_decode(input)) return;
  capture::JpegDecoder decoder;
  const std::span bytes(reinterpret_cast<const std::uint8_t*>(input.data()), input.size());
  const auto first = decoder.decode(bytes), again = decoder.decode(bytes);  // one decoder serves many frames
  if (first.image.has_value() != again.image.has_value()) throw std::logic_error("the same bytes, another answer");
}
