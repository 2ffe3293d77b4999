#include "recordings/blend_watch.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <utility>
#include <vector>

#include "capture/frames/brightness.h"

namespace huetrack::recordings {
namespace {

struct BlendTuning {
  int across = 320;         // samples; more of a picture say the same
  int block = 8;            // samples: some of a target's edge
  std::size_t blocks = 12;  // those that change most: the outline of a target
  double moves = 8;  // levels, rms, from the picture before to the one after: coders leave out up to 6 (x265, crf 30)
  // Of what changes, in squares, at most, that a mean leaves. Cameras' pictures leave 0.1 to 0.5, blends 0.002 to 0.02.
  double left = 0.05;
  double even = 0.15;                    // a mean's weights are within this of a half
  std::int64_t enough = 20, most = 150;  // pictures of either kind
  double mostly = 0.75, seldom = 0.25;   // of the pictures of a kind
};
constexpr BlendTuning blend{};

// Sums over a block: the change from the picture before, to the one after, their product, and their sum's square.
struct Changes {
  std::int64_t before = 0, after = 0, product = 0;
  std::int64_t both() const { return before + after + 2 * product; }
};

std::vector<Changes> changes_of(const capture::Image& before, const capture::Image& now, const capture::Image& after) {
  const capture::Brightness a = capture::brightness_of(before), b = capture::brightness_of(now),
                            c = capture::brightness_of(after);
  const int step = std::max(1, now.width / blend.across), size = step * blend.block;
  const int columns = now.width / size, rows = now.height / size;
  std::vector<Changes> blocks(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
  for (int y = 0; y < rows * size; y += step)
    for (int x = 0; x < columns * size; x += step) {
      const int level = b.data[y * b.stride + x * b.step];
      const int d1 = level - a.data[y * a.stride + x * a.step], d2 = c.data[y * c.stride + x * c.step] - level;
      Changes& block = blocks[static_cast<std::size_t>(y / size * columns + x / size)];
      block.before += d1 * d1, block.after += d2 * d2, block.product += d1 * d2;
    }
  return blocks;
}

}  // namespace

void BlendWatch::see(std::int64_t index, const capture::Image& image) {
  if (std::min(moving_[0], moving_[1]) >= blend.most || image.on_demand || !capture::has_pixels(image)) return;
  const Picture before = std::exchange(before_[0], before_[1]);
  const Picture now = std::exchange(before_[1], {index, image});
  if (before.index < 0 || now.index != before.index + 1 || index != now.index + 1) return;
  if (before.image.width != image.width || before.image.height != image.height || before.image.format != image.format ||
      now.image.format != image.format || now.image.width != image.width)
    return;
  std::vector<Changes> blocks = changes_of(before.image, now.image, image);
  if (blocks.size() < blend.blocks) return;
  std::ranges::nth_element(blocks, blocks.begin() + blend.blocks, std::greater{}, &Changes::both);
  Changes sum;
  for (std::size_t k = 0; k < blend.blocks; ++k)
    sum.before += blocks[k].before, sum.after += blocks[k].after, sum.product += blocks[k].product;
  const auto both = static_cast<double>(sum.both());
  if (both < blend.moves * blend.moves * static_cast<double>(blend.blocks) * blend.block * blend.block) return;
  const auto kind = static_cast<std::size_t>(now.index % 2);
  ++moving_[kind];
  // now = w before + (1 - w) after, least squares
  const double w = (static_cast<double>(sum.after + sum.product)) / both;
  const double left = w * w * static_cast<double>(sum.before) + (1 - w) * (1 - w) * static_cast<double>(sum.after) -
                      2 * w * (1 - w) * static_cast<double>(sum.product);
  means_[kind] += left < blend.left * both && std::abs(w - 0.5) < blend.even;
}

std::optional<std::string> BlendWatch::problem() const {
  for (const std::size_t kind : {0u, 1u}) {
    const std::size_t other = 1 - kind;
    if (std::min(moving_[0], moving_[1]) < blend.enough ||
        static_cast<double>(means_[kind]) < blend.mostly * static_cast<double>(moving_[kind]) ||
        static_cast<double>(means_[other]) > blend.seldom * static_cast<double>(moving_[other]))
      continue;
    return fmt::format(
        "every second picture is a mean of its neighbours, as programs make that double the frame rate (motion "
        "smoothing, ffmpeg's minterpolate and framerate), so the target is not where it shows it: give the film as the "
        "camera recorded it, or play the others: first_frame: {}, every: 2",
        other);
  }
  return std::nullopt;
}

}  // namespace huetrack::recordings
