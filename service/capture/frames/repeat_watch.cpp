#include "capture/frames/repeat_watch.h"

#include <bit>
#include <functional>
#include <string_view>

namespace huetrack::capture {
namespace {

// So many say what a camera's pictures are like: the first one and two that differed everywhere. More would leave a
// camera that shows every picture twice believed for longer, which is confidently wrong; a picture left out wrongly is
// one of something that rests, for it is the one before, and costs little.
constexpr int enough = 3;
// But a run of them is a camera that hangs, or a video that has settled on a still room after its first pictures: so
// many by the rule of succession, with which the next is like them with 97 %.
constexpr int enough_for_a_run = 30;
constexpr int most_remembered = 10 * enough_for_a_run;
// A camera that cannot keep up shows a picture four times at most; from key frame to key frame are ten and more. What
// a run counts for is more than the first, and so little that a camera that hangs for long stays known as what it was.
constexpr int most_alike_between = 3, most_of_run = 12;

}  // namespace

bool RepeatWatch::is_repeated(const Image& image) {
  // Brightness has the noise of all channels; packed formats have all of them in the one plane.
  const std::size_t bytes = plane_row_bytes(image.format, 0, image.width);
  std::array<std::uint64_t, across * down> cells{};
  std::array<std::uint64_t, across> first_row{};
  bool is_flat = true;
  for (std::size_t row = 0; row < down * rows_of_cell; ++row) {
    const auto v =
        static_cast<std::ptrdiff_t>((2 * row + 1) * static_cast<std::size_t>(image.height) / (2 * down * rows_of_cell));
    const char* at = reinterpret_cast<const char*>(image.planes[0].data + v * image.planes[0].stride);
    for (std::size_t column = 0; column < across; ++column) {
      const std::size_t first = column * bytes / across, end = (column + 1) * bytes / across;
      std::uint64_t& cell = cells[row / rows_of_cell * across + column];
      const std::uint64_t shown = std::hash<std::string_view>()({at + first, end - first});
      if (row == 0) first_row[column] = shown;
      is_flat = is_flat && shown == first_row[column];
      cell = std::rotl(cell, 1) ^ shown;
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
    return false;
  }
  if (is_flat) return false;
  alike_ += ++run_ <= most_of_run;
  return differing_ >= (run_ <= most_alike_between ? enough : enough_for_a_run) &&
         noisy_ >= differing_ - differing_ / 10 && alike_ <= most_alike_between * differing_;
}

}  // namespace huetrack::capture
