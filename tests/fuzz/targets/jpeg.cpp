#include <stdexcept>

#include "capture/frames/jpeg_decoder.h"
#include "capture/jpeg_compare.h"
#include "fuzz/fuzz_target.h"

using namespace huetrack;

HUETRACK_FUZZ_TARGET(jpeg) {
  if (fuzz::is_long_to_decode(input)) return;
  static capture::JpegDecoder decoder;  // one decoder, and one pool, serve many frames
  static capture::JpegIndexPool pool;
  const std::vector<std::uint8_t> bytes(input.begin(), input.end());
  const auto first = decoder.decode(bytes), again = decoder.decode(bytes);
  if (first.image.has_value() != again.image.has_value()) throw std::logic_error("the same bytes, another answer");
  std::string difference;
  if (capture::compare_with_decoder(decoder, bytes, &pool, difference) == capture::Indexed::otherwise)
    throw std::logic_error(difference);
}
