// The entropy-coded bytes of a scan without stuffed bytes and restart markers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace huetrack::capture {

struct EntropyBytes {
  // The bytes between two restart markers, [begin, end) in `bytes`.
  struct Interval {
    std::size_t begin = 0, end = 0;
  };
  // Readable bytes behind the last interval: more than an MCU takes.
  static constexpr std::size_t padding = 4096;

  // Copies the scan that begins at offset `scan`. False: its markers are not those of so many intervals.
  bool take(std::span<const std::uint8_t> jpeg, std::size_t scan, std::size_t expected_intervals);

  std::vector<std::uint8_t> bytes;  // larger than needed: kept for the next scan
  std::vector<Interval> intervals;
  std::size_t end_of_scan = 0;  // offset in the JPEG of the marker behind the scan
};

}  // namespace huetrack::capture
