// Where the MCUs of a scan begin, their DC coefficients and bounds of their samples, by one pass over its bits.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "capture/jpeg/entropy_bytes.h"
#include "capture/jpeg/mcu_kernels.h"

namespace huetrack::capture {

struct Scan {
  const EntropyBytes& data;
  McuBlocks blocks;
  std::size_t mcus = 0;
  std::size_t restart_interval = 0;  // MCUs; 0: none
};

// The members of SkippedMcus as arrays.
struct McuArrays {
  std::vector<std::uint32_t> begins, chroma_begins;
  std::vector<std::int16_t> dc;
  std::vector<std::uint16_t> swings;

  void resize(std::size_t mcus, std::size_t blocks, bool with_swings);
  SkippedMcus from(std::size_t mcu, std::size_t blocks);
};

class McuIndex {
 public:
  // Overwrites the content, in its memory where it suffices. False: an MCU is not decodable. with_swings: costs a third
  // more.
  bool make(const Scan& scan, bool with_swings);

  // dc: values instead of differences, modulo 2^16.
  const McuArrays& mcus() const { return mcus_; }
  std::span<const std::size_t> interval_ends() const { return interval_ends_; }  // bits behind their last MCUs

 private:
  void skip_intervals(const Scan& scan, std::size_t first, std::size_t count);
  bool skip_interval(const Scan& scan, bool with_swings);
  bool join(const Scan& scan, McuLane lane, std::span<const McuLane> guessed, std::size_t end);
  bool sum_differences(const Scan& scan);

  McuArrays mcus_;
  std::vector<std::size_t> interval_ends_;
  std::array<McuArrays, most_mcu_lanes - 1> guesses_;  // of the lanes that begin at an arbitrary bit
};

}  // namespace huetrack::capture
