#include "capture/jpeg/entropy_bytes.h"

#include <cstring>

namespace huetrack::capture {

bool EntropyBytes::take(std::span<const std::uint8_t> jpeg, std::size_t scan, std::size_t expected_intervals) {
  const std::uint8_t* from = jpeg.data() + scan;
  const std::uint8_t* const end = jpeg.data() + jpeg.size();
  const std::size_t needed = static_cast<std::size_t>(end - from) + padding;
  if (bytes.size() < needed) bytes.resize(needed + needed / 4);
  std::uint8_t* const first = bytes.data();
  std::uint8_t* to = first;
  intervals.clear();
  std::size_t begin = 0;
  for (;;) {
    const void* const found = std::memchr(from, 0xFF, static_cast<std::size_t>(end - from));
    if (found == nullptr) return false;
    const auto* const last = static_cast<const std::uint8_t*>(found);
    const std::size_t run = static_cast<std::size_t>(last - from) + 1;
    std::memcpy(to, from, run);
    to += run;
    from = last + 1;
    while (from < end && *from == 0xFF) ++from;  // fill bytes, which only a marker may follow
    if (from == end) return false;
    const std::uint8_t marker = *from++;
    if (marker == 0) {  // the byte is 0xFF
      // After fill bytes libjpeg-turbo decodes the block twice, and keeps coefficients of its first attempt.
      if (from - last > 2) return false;
      continue;
    }
    --to;
    intervals.push_back({begin, static_cast<std::size_t>(to - first)});
    if (intervals.size() == expected_intervals) break;
    if (marker != 0xD0 + (intervals.size() - 1) % 8) return false;
    begin = static_cast<std::size_t>(to - first);
  }
  end_of_scan = static_cast<std::size_t>(from - jpeg.data()) - 2;
  std::memset(to, 0, padding);
  return true;
}

}  // namespace huetrack::capture
