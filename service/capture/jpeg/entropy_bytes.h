// The entropy-coded bytes of a scan without what is between them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace huetrack::capture {

struct EntropyBytes {
  // What lies between two restart markers, [begin, end) in `bytes`.
  struct Interval {
    std::size_t begin = 0, end = 0;
  };
  // Readers may run on into this much behind the last interval: more than the bits of an MCU.
  static constexpr std::size_t padding = 4096;

  // Takes `intervals` intervals of a scan that begins at `scan`. Returns the offset of the first byte behind them: of
  // the marker's 0xFF. False: the markers are not those of so many intervals.
  bool take(std::span<const std::uint8_t> jpeg, std::size_t scan, std::size_t expected_intervals);

  std::vector<std::uint8_t> bytes;  // larger than what is used, for the next scan
  std::vector<Interval> intervals;
  std::size_t end_of_scan = 0;  // in the JPEG
};

}  // namespace huetrack::capture
