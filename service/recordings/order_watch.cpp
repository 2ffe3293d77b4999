#include "recordings/order_watch.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "calib/files/file_order.h"
#include "capture/frames/brightness.h"

namespace huetrack::recordings {
namespace {

struct OrderTuning {
  // Pixels: a ball of 8 pixels covers some blocks, and the noise of a webcam (5 levels) is a quarter in a mean of 16.
  int least_block_px = 4;
  int blocks_across = 160;  // at most
  int changed = 10;         // levels: eight times that noise, in a difference
  // Pictures, evenly over the series, whose successors in two orders are compared; those that differ by a fifth count.
  std::size_t compared = 48;
  double clear = 0.8;
  // By chance 15 of 16 are closer in one order once in 4,000 series.
  std::size_t least_votes = 16;
  double share = 0.9;
  // A seam: the longest step, this many times as long as its two neighbours (a dropped picture doubles one), while the
  // last picture goes on to the first one as others do.
  double seam = 2.5, wrap = 2;
  std::size_t least_steps = 10;
};
constexpr OrderTuning order_tuning{};

// Of a row or column of blocks.
struct Change {
  double brighter = 0, darker = 0;
};

// How far what became darker is to be moved along the line to where it became brighter, times how much. Both sums are
// made equal, since an object's shading changes with its place.
double transported(const std::vector<Change>& line, double brighter, double darker) {
  const double common = std::min(brighter, darker);
  if (!(common > 0)) return 0;
  double sum = 0, carried = 0;
  for (const Change& change : line)
    sum += std::abs(carried += change.brighter * common / brighter - change.darker * common / darker);
  return sum;
}

}  // namespace

Blocks blocks_of(const capture::Image& image) {
  capture::require_all(image);
  const int px = std::max(order_tuning.least_block_px,
                          (image.width + order_tuning.blocks_across - 1) / order_tuning.blocks_across);
  Blocks blocks{.width = image.width / px, .height = image.height / px, .levels = {}};
  const capture::Brightness pixels = capture::brightness_of(image);
  std::vector<int> sums(static_cast<std::size_t>(blocks.width));
  for (int row = 0; row < blocks.height; ++row) {
    std::ranges::fill(sums, 0);
    for (int y = row * px; y < (row + 1) * px; ++y) {
      const std::uint8_t* p = pixels.data + y * pixels.stride;
      for (int& sum : sums)
        for (int i = 0; i < px; ++i, p += pixels.step) sum += *p;
    }
    for (const int sum : sums) blocks.levels.push_back(static_cast<std::uint8_t>(sum / (px * px)));
  }
  return blocks;
}

double moved_between(const Blocks& a, const Blocks& b) {
  if (a.width != b.width || a.height != b.height) return std::numeric_limits<double>::infinity();
  std::vector<Change> columns(static_cast<std::size_t>(a.width)), rows(static_cast<std::size_t>(a.height));
  double brighter = 0, darker = 0;
  std::size_t i = 0;
  for (Change& row : rows)
    for (Change& column : columns) {
      const int change = b.levels[i] - a.levels[i];
      ++i;
      if (change > order_tuning.changed) row.brighter += change, column.brighter += change, brighter += change;
      if (change < -order_tuning.changed) row.darker -= change, column.darker -= change, darker -= change;
    }
  return transported(columns, brighter, darker) + transported(rows, brighter, darker);
}

OrderWatch::OrderWatch(std::vector<std::filesystem::path> files) : files_(std::move(files)) {
  for (std::vector<std::size_t>& order : files::other_orders(files_)) {
    std::vector<std::size_t> next(files_.size(), files_.size());  // size(): none
    for (std::size_t k = 1; k < order.size(); ++k) next[order[k - 1]] = order[k];
    Candidate candidate{std::move(order), {}};
    const std::size_t every = std::max<std::size_t>(1, files_.size() / order_tuning.compared);
    for (std::size_t file = 0; file + 1 < files_.size(); file += every) {
      if (next[file] == files_.size() || next[file] == file + 1) continue;
      candidate.successors.emplace_back(file, next[file]);
      wanted_.insert({file, file + 1, next[file]});
    }
    candidates_.push_back(std::move(candidate));
  }
}

void OrderWatch::see(std::size_t file, const capture::Image& image) {
  if (!capture::has_pixels(image)) return;
  Blocks blocks = blocks_of(image);
  if (last_.width > 0)
    steps_.emplace_back(file, moved_between(last_, blocks));
  else
    first_ = blocks;
  if (wanted_.contains(file)) blocks_[file] = blocks;
  last_ = std::move(blocks);
}

double OrderWatch::advantage(const Candidate& candidate) const {
  std::size_t better = 0, worse = 0;
  double moved_by_play = 0, moved_by_other = 0;
  for (const auto& [file, other] : candidate.successors) {
    const auto here = blocks_.find(file), played = blocks_.find(file + 1), in_order = blocks_.find(other);
    if (here == blocks_.end() || played == blocks_.end() || in_order == blocks_.end()) continue;
    const double by_play = moved_between(here->second, played->second);
    const double by_other = moved_between(here->second, in_order->second);
    moved_by_play += by_play, moved_by_other += by_other;
    better += by_other < order_tuning.clear * by_play ? 1 : 0;
    worse += by_play < order_tuning.clear * by_other ? 1 : 0;
  }
  const bool is_sure = better + worse >= order_tuning.least_votes &&
                       static_cast<double>(better) >= order_tuning.share * static_cast<double>(better + worse);
  return is_sure && moved_by_other > 0 ? moved_by_play / moved_by_other : 1;
}

// The file before which the pictures jump, while the last one goes on to the first one.
std::optional<std::size_t> OrderWatch::seam() const {
  if (steps_.size() < order_tuning.least_steps) return std::nullopt;
  const auto longest = std::ranges::max_element(steps_, {}, &std::pair<std::size_t, double>::second);
  if (longest == steps_.begin() || longest + 1 == steps_.end()) return std::nullopt;
  const double before = (longest - 1)->second, after = (longest + 1)->second, at_wrap = moved_between(last_, first_);
  const bool is_jump = longest->second > order_tuning.seam * std::max(before, after);
  const bool goes_on =
      at_wrap > 0 && at_wrap < order_tuning.wrap * std::max(steps_.front().second, steps_.back().second);
  return is_jump && goes_on ? std::optional(longest->first) : std::nullopt;
}

std::optional<std::string> OrderWatch::problem() const {
  const auto best = std::ranges::max_element(candidates_, {}, [&](const auto& other) { return advantage(other); });
  if (best != candidates_.end() && advantage(*best) > 1) {
    const auto& order = best->order;
    return fmt::format(
        "its names have several numbers, and things move less from picture to picture in another order: "
        "{}, {}, {}, ... instead of {}, {}, {}, ...: rename the files so that the leading number comes first, or, if "
        "the order is right, add trust_times: true",
        name(order[0]), name(order[1]), name(order[2]), name(0), name(1), name(2));
  }
  if (const auto first = seam())
    return fmt::format(
        "its pictures jump from {} to {}, and go on from the last one, {}, to the first one, {}: if the series begins "
        "at {}, rename the files; if the order is right, add trust_times: true",
        name(*first - 1), name(*first), name(files_.size() - 1), name(0), name(*first));
  return std::nullopt;
}

}  // namespace huetrack::recordings
