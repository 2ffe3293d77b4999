#include "capture/jpeg/mcu_index.h"

#include <algorithm>

namespace huetrack::capture {
namespace {

// Least bits of a lane: one that begins at an arbitrary bit synchronises with the true codes after some 2000.
constexpr std::size_t least_lane_bits = 16384;

// A lane that begins at another block than it assumes decodes chroma with luma's tables, fails, and so changes its
// assumption. With one table for all blocks it would not: then there is one lane.
std::size_t lanes_of(const Scan& scan, const EntropyBytes::Interval& interval) {
  const auto& blocks = scan.blocks.all;
  const auto has_first_tables = [&](const SkippedBlock& block) { return block.tables == blocks.front().tables; };
  if (blocks.size() > 1 && std::ranges::all_of(blocks, has_first_tables)) return 1;
  return std::clamp<std::size_t>(8 * (interval.end - interval.begin) / least_lane_bits, 1, most_mcu_lanes);
}

McuLane lane_of(const EntropyBytes::Interval& interval, std::size_t mcus, const SkippedMcus& out) {
  return {.bit = 8 * interval.begin, .stop = 8 * interval.end, .left = mcus, .next = out};
}

}  // namespace

void McuArrays::resize(std::size_t mcus, std::size_t blocks, bool with_swings) {
  begins.resize(mcus);
  chroma_begins.resize(mcus);
  dc.resize(mcus * blocks);
  swings.resize(with_swings ? mcus * blocks : 0);
}

SkippedMcus McuArrays::from(std::size_t mcu, std::size_t blocks) {
  return {.begins = begins.data() + mcu,
          .chroma_begins = chroma_begins.data() + mcu,
          .differences = dc.data() + mcu * blocks,
          .swings = swings.empty() ? nullptr : swings.data() + mcu * blocks};
}

bool McuIndex::make(const Scan& scan, bool with_swings) {
  mcus_.resize(scan.mcus, scan.blocks.all.size(), with_swings);
  interval_ends_.clear();
  if (scan.restart_interval == 0) {
    if (!skip_interval(scan, with_swings)) return false;
  } else {
    const std::size_t intervals = scan.data.intervals.size();
    for (std::size_t first = 0; first < intervals; first += most_mcu_lanes)
      skip_intervals(scan, first, std::min(most_mcu_lanes, intervals - first));
  }
  return std::ranges::all_of(mcus_.begins, is_decodable) && sum_differences(scan);
}

// Each interval is a lane.
void McuIndex::skip_intervals(const Scan& scan, std::size_t first, std::size_t count) {
  std::array<McuLane, most_mcu_lanes> lanes;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t mcu = (first + i) * scan.restart_interval;
    lanes[i] = lane_of(scan.data.intervals[first + i], std::min(scan.restart_interval, scan.mcus - mcu),
                       mcus_.from(mcu, scan.blocks.all.size()));
  }
  skip_mcus(scan.data.bytes.data(), scan.blocks, std::span(lanes).first(count));
  for (std::size_t i = 0; i < count; ++i) {
    if (lanes[i].left > 0) *lanes[i].next.begins = not_decodable;  // the interval is too short
    interval_ends_.push_back(lanes[i].bit);
  }
}

// All MCUs of a scan without restart markers. Lane 0 begins where the scan does, the others in between, where each
// assumes the first block of an MCU.
bool McuIndex::skip_interval(const Scan& scan, bool with_swings) {
  const EntropyBytes::Interval& interval = scan.data.intervals.front();
  const std::size_t blocks = scan.blocks.all.size(), n = lanes_of(scan, interval);
  std::array<McuLane, most_mcu_lanes> lanes;
  lanes[0] = lane_of(interval, scan.mcus, mcus_.from(0, blocks));
  for (std::size_t i = 1; i < n; ++i) {
    guesses_[i - 1].resize(scan.mcus, blocks, with_swings);
    lanes[i] = lane_of(interval, scan.mcus, guesses_[i - 1].from(0, blocks));
    lanes[i].bit += 8 * (i * ((interval.end - interval.begin) / n));
    lanes[i - 1].stop = lanes[i].bit;
  }
  skip_mcus(scan.data.bytes.data(), scan.blocks, std::span(lanes).first(n));
  return join(scan, lanes[0], std::span(lanes).subspan(1, n - 1), 8 * interval.end);
}

// `lane` is true up to an MCU that begins at the same bit as an MCU of the next lane: from there on, the next lane is
// true, too, because it is in the same state. And so on.
bool McuIndex::join(const Scan& scan, McuLane lane, std::span<const McuLane> guessed, std::size_t end) {
  const std::uint8_t* const bytes = scan.data.bytes.data();
  const std::size_t blocks = scan.blocks.all.size();
  for (std::size_t i = 0; i < guessed.size(); ++i) {
    const auto begins = std::span(guesses_[i].begins).first(scan.mcus - guessed[i].left);
    auto begin = begins.begin();
    while (lane.left > 0) {
      while (begin != begins.end() && (*begin < lane.bit || !is_decodable(*begin))) ++begin;
      if (begin == begins.end() || *begin == lane.bit) break;
      lane.stop = std::min(std::size_t{*begin}, end);
      skip_mcus(bytes, scan.blocks, std::span(&lane, 1));
      if (lane.bit >= end) break;
    }
    const auto first = static_cast<std::size_t>(begin - begins.begin());
    const std::size_t taken = std::min(begins.size() - first, lane.left);
    if (taken == 0) continue;
    lane.bit = first + taken == begins.size() ? guessed[i].bit : begins[first + taken] & ~not_decodable;
    lane.left -= taken;
    lane.next.append(guesses_[i].from(first, blocks), taken, blocks);
  }
  lane.stop = end;
  skip_mcus(bytes, scan.blocks, std::span(&lane, 1));
  interval_ends_.push_back(lane.bit);
  return lane.left == 0;
}

// Differences to values. False: one that 32 bits do not hold, which libjpeg refuses.
bool McuIndex::sum_differences(const Scan& scan) {
  const auto& blocks = scan.blocks.all;
  const std::size_t interval = scan.restart_interval == 0 ? scan.mcus : scan.restart_interval;
  for (std::size_t first = 0, end = 0; first < blocks.size(); first = end) {  // the blocks of a component
    for (end = first; end < blocks.size() && blocks[end].component == blocks[first].component;) ++end;
    std::int16_t* mcu = mcus_.dc.data();
    for (std::size_t begin = 0; begin < scan.mcus; begin += interval) {
      std::int32_t last = 0;
      for (std::size_t n = std::min(interval, scan.mcus - begin); n > 0; --n, mcu += blocks.size())
        for (std::size_t i = first; i < end; ++i) {
          if (__builtin_add_overflow(last, mcu[i], &last)) return false;
          mcu[i] = static_cast<std::int16_t>(last);
        }
    }
  }
  return true;
}

}  // namespace huetrack::capture
