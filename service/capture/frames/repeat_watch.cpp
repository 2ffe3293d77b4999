#include "capture/frames/repeat_watch.h"

#include <bit>
#include <functional>
#include <string_view>

namespace huetrack::capture {
namespace {

// Differing pictures that are needed to judge a camera: the first, and two that differed everywhere. More would trust a
// camera that shows every picture twice for longer. A picture dropped by mistake costs little: it equals the previous
// one.
constexpr int enough = 3;
// A run of identical pictures is a camera that hangs, or a video that settled on a still room after its first pictures.
// By the rule of succession, after 30 noisy pictures the next one is noisy, too, with 97 %.
constexpr int enough_for_a_run = 30;
constexpr int most_remembered = 10 * enough_for_a_run;
// A camera that cannot keep up shows a picture at most four times; a video has ten or more from key frame to key frame.
// Only the first 12 of a run count, so that a camera that hangs for long is still known as noisy.
constexpr int most_alike_between = 3, most_of_run = 12;
// Shares of the picture that change: a film whose noise is coded changes in nearly all of it (0.63 to 1 up to MPEG-2 at
// quality 5), where it repeats a picture in 0 to 0.4. Films without noise are in between.
constexpr double repeats_below = 0.25, noisy_above = 0.6;

}  // namespace

bool RepeatWatch::is_repeated(const Image& shown) {
  // Of a compressed picture its means of 8x8 pixels: noise changes some of them in every cell, too.
  const Image eighth = shown.on_demand ? shown.on_demand->eighth() : Image{};
  const Image& image = has_pixels(eighth) && eighth.height >= int(down * rows_of_cell) ? eighth : shown;
  require_all(image);
  // Plane 0 suffices: luma has the noise of all channels, and packed formats have only this plane.
  const std::size_t bytes = plane_row_bytes(image.format, 0, image.width);
  std::array<std::uint64_t, across * down> cells{};
  bool is_flat = true;
  std::size_t fine_changed = 0;
  for (std::size_t row = 0; row < down * rows_of_cell; ++row) {
    const auto v =
        static_cast<std::ptrdiff_t>((2 * row + 1) * static_cast<std::size_t>(image.height) / (2 * down * rows_of_cell));
    const char* at = reinterpret_cast<const char*>(image.planes[0].data + v * image.planes[0].stride);
    for (std::size_t column = 0; column < fine_across; ++column) {
      const std::size_t first = column * bytes / fine_across, end = (column + 1) * bytes / fine_across;
      const std::uint64_t hash = std::hash<std::string_view>()({at + first, end - first});
      std::uint64_t& before = fine_[row * fine_across + column];
      is_flat = is_flat && (row == 0 || hash == fine_[column]);
      fine_changed += before != hash;
      before = hash;
      std::uint64_t& cell = cells[row / rows_of_cell * across + column * across / fine_across];
      cell = std::rotl(cell, 1) ^ hash;
    }
  }
  std::size_t changed = 0;
  for (std::size_t i = 0; i < cells.size(); ++i) changed += cells[i] != cells_[i];
  cells_ = cells;
  if (changed > 0) {
    ++differing_;
    noisy_ += changed > cells.size() / 2;
    run_ = 0;
    if (differing_ > most_remembered) differing_ /= 2, noisy_ /= 2, alike_ /= 2;
    // Of the means of a JPEG's cells many do not change; a JPEG that repeats another is the same.
    return &image == &shown && is_coded_again(static_cast<double>(fine_changed) / static_cast<double>(fine_.size()));
  }
  if (is_flat) return false;
  alike_ += ++run_ <= most_of_run;
  return differing_ >= (run_ <= most_alike_between ? enough : enough_for_a_run) &&
         noisy_ >= differing_ - differing_ / 10 && alike_ <= most_alike_between * differing_;
}

bool RepeatWatch::is_coded_again(double changed) {
  if (changed >= repeats_below) {
    ++(changed > noisy_above ? all_changed_ : some_changed_);
    hardly_run_ = 0;
    if (all_changed_ + some_changed_ > most_remembered) all_changed_ /= 2, some_changed_ /= 2, hardly_changed_ /= 2;
    return false;
  }
  ++hardly_changed_;
  if (++hardly_run_ > most_of_run) all_changed_ = 0;  // the film has lost its noise
  return all_changed_ >= enough_for_a_run && some_changed_ <= all_changed_ / 10 &&
         hardly_changed_ <= most_alike_between * all_changed_;
}

}  // namespace huetrack::capture
