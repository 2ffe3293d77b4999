#include "recordings/blend_watch.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <numbers>
#include <utility>
#include <vector>

#include "calib/files/median.h"
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

struct ShareTuning {
  int changes = 32;           // levels from the picture before to the one after: beyond noise and flicker
  double still = 0.25;        // of that change: at most so much of it before, after, or beyond either
  double least = 0.15;        // a share of the change between this and the rest is that of a mixture, or an edge
  std::size_t pixels = 8;     // fewer of a picture show little of its share
  std::size_t pictures = 60;  // with these shares, two seconds of motion
  std::size_t most = 300;
  // Periods per picture: below are the motion's own; above, every second picture differs, as means do.
  double lowest = 0.1, highest = 0.45;
  double most_pixels = 3;  // medians, that count of a picture: of a camera that is knocked all change
  double chance = 1e-6;    // that a film of a camera is named
  // Amplitude. Conversions of ours have 0.035 to 0.25; edges of a camera that cross its pixels at one speed up to 0.02.
  double amplitude = 0.03;
};
constexpr ShareTuning share_tuning{};

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

using Share = BlendWatch::Share;

bool is_alike(const capture::Image& a, const capture::Image& b) {
  return a.width == b.width && a.height == b.height && a.format == b.format;
}

// Of the middle one of five pictures. Where a pixel changes again too soon, its change is not known.
Share share_of(const std::array<const capture::Image*, 5>& images) {
  std::array<capture::Brightness, 5> planes;
  std::ranges::transform(images, planes.begin(), [](const capture::Image* image) { return brightness_of(*image); });
  const int step = std::max(1, images[2]->width / blend.across);
  Share share;
  for (int y = 0; y < images[2]->height; y += step)
    for (int x = 0; x < images[2]->width; x += step) {
      const auto level = [&](std::size_t k) -> int {
        return planes[k].data[y * planes[k].stride + x * planes[k].step];
      };
      const int change = level(3) - level(1);
      if (std::abs(change) < share_tuning.changes) continue;
      const double before = double(level(1) - level(0)) / change, after = double(level(4) - level(3)) / change;
      const double at = double(level(2) - level(1)) / change;
      // A small target has left before the second picture after it came.
      if (std::max(before, after) > share_tuning.still) continue;
      if (std::min(std::abs(before), std::abs(after)) > share_tuning.still) continue;
      if (at < share_tuning.least || at > 1 - share_tuning.least) continue;
      ++share.pixels, share.mean += at;
    }
  share.mean /= std::max(1.0, share.pixels);
  return share;
}

struct Sine {
  double explained = 0;  // of the shares' scatter, 0 to 1
  double amplitude = 0;
};

Sine sine_of(const std::vector<Share>& shares, double frequency) {
  using Row = std::array<double, 3>;  // the share, cosine, sine
  const auto row_of = [&](const Share& share) {
    const double phase = 2 * std::numbers::pi * frequency * static_cast<double>(share.index);
    return Row{share.mean, std::cos(phase), std::sin(phase)};
  };
  double pixels = 0;
  Row mean{};
  for (const Share& share : shares) {
    const Row row = row_of(share);
    pixels += share.pixels;
    for (std::size_t i = 0; i < row.size(); ++i) mean[i] += share.pixels * row[i];
  }
  std::array<Row, 3> products{};
  for (const Share& share : shares) {
    const Row row = row_of(share);
    for (std::size_t i = 0; i < row.size(); ++i)
      for (std::size_t k = 0; k < row.size(); ++k)
        products[i][k] += share.pixels * (row[i] - mean[i] / pixels) * (row[k] - mean[k] / pixels);
  }
  const auto& [of_share, of_cosine, of_sine] = products;
  const double determinant = of_cosine[1] * of_sine[2] - of_cosine[2] * of_sine[1];
  const double cosine = of_share[1] * of_sine[2] - of_share[2] * of_cosine[2];
  const double sine = of_share[2] * of_cosine[1] - of_share[1] * of_cosine[2];
  if (determinant <= 0 || of_share[0] <= 0) return {};
  return {(cosine * of_share[1] + sine * of_share[2]) / determinant / of_share[0],
          std::hypot(cosine, sine) / determinant};
}

// The period in pictures with which the shares change, if they hardly do so by chance.
std::optional<double> period_of(std::vector<Share> shares) {
  if (shares.size() < share_tuning.pictures) return std::nullopt;
  std::vector<double> pixels;
  for (const Share& share : shares) pixels.push_back(share.pixels);
  const double most = share_tuning.most_pixels * files::median(std::move(pixels));
  for (Share& share : shares) share.pixels = std::min(share.pixels, most);
  const double step = 0.25 / static_cast<double>(shares.back().index - shares.front().index);
  double frequency = 0;
  Sine best;
  int tried = 0;
  for (double f = share_tuning.lowest; f < share_tuning.highest; f += step, ++tried)
    if (const Sine sine = sine_of(shares, f); sine.explained > best.explained) best = sine, frequency = f;
  // Of normal scatter, with as many independent frequencies as a quarter of those tried.
  const double chance = tried / 4. * std::pow(1 - best.explained, (static_cast<double>(shares.size()) - 3) / 2);
  if (best.amplitude < share_tuning.amplitude || chance > share_tuning.chance) return std::nullopt;
  return 1 / frequency;
}

}  // namespace

void BlendWatch::see(std::int64_t index, const capture::Image& image) {
  const bool is_enough = std::min(moving_[0], moving_[1]) >= blend.most && shares_.size() >= share_tuning.most;
  if (is_enough || image.on_demand || !capture::has_pixels(image)) return;
  std::ranges::rotate(last_, last_.begin() + 1);
  last_.back() = {index, image};
  const auto are_one_film = [&](std::size_t first) {
    for (std::size_t k = first; k + 1 < last_.size(); ++k)
      if (last_[k].index < 0 || last_[k].index + 1 != last_[k + 1].index || !is_alike(last_[k].image, image))
        return false;
    return true;
  };
  if (!are_one_film(2)) return;
  compare(last_[2], last_[3], last_[4]);
  if (!are_one_film(0) || shares_.size() >= share_tuning.most) return;
  std::array<const capture::Image*, 5> images{};
  std::ranges::transform(last_, images.begin(), [](const Picture& picture) { return &picture.image; });
  Share share = share_of(images);
  share.index = last_[2].index;
  if (share.pixels >= static_cast<double>(share_tuning.pixels)) shares_.push_back(share);
}

void BlendWatch::compare(const Picture& before, const Picture& now, const Picture& after) {
  if (std::min(moving_[0], moving_[1]) >= blend.most) return;
  std::vector<Changes> blocks = changes_of(before.image, now.image, after.image);
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
  if (const auto period = period_of(shares_))
    return fmt::format(
        "looks converted from another frame rate: its pictures lie between their neighbours unevenly, with a period of "
        "{:.1f} pictures, as programs make them that blend or drop pictures (ffmpeg's framerate, minterpolate, fps; an "
        "editor's frame blending); a moving target is seen twice, or at another time: give the film as the camera "
        "recorded it",
        *period);
  return std::nullopt;
}

}  // namespace huetrack::recordings
