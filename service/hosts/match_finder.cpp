#include "hosts/match_finder.h"

#include <algorithm>
#include <utility>

#include "capture/frames/jpeg_encoder.h"
#include "color/match_tiles.h"

namespace huetrack::hosts {
namespace {

constexpr std::size_t most_header_and_picture = std::size_t{64} * 1024;
constexpr int most_new_tables = 4;   // per frame: 20 ms, less than a frame period
constexpr int picture_quality = 85;  // of a camera that sends no JPEG
// Enough for a ball of 55 px radius; for a nearer one the region's centre is accurate enough.
constexpr std::int64_t most_pixels_of_patches = 140 * 140;

}  // namespace

std::size_t most_bytes_of_matches(int width, int height) {
  return static_cast<std::size_t>(width) * static_cast<std::size_t>(height) / 2 + most_header_and_picture;
}

std::optional<std::span<const std::uint8_t>> MatchFinder::find(const capture::Frame& frame,
                                                               const MatchFinderOptions& options) {
  if (frame.matches) {
    if (!frame.encoded) return std::nullopt;
    return *frame.encoded;
  }
  capture::Image image = frame.pixels;
  if (!capture::has_pixels(image)) {
    if (!frame.encoded) return std::nullopt;
    capture::JpegResult decoded = reader_.read(frame.encoded);
    if (!decoded.image) return std::nullopt;
    image = std::move(*decoded.image);
  }
  if (repeats_.is_repeated(image)) return std::nullopt;
  if (light_.is_wanted(frame.stamped_at)) light_.look(image, frame.stamped_at);
  std::erase_if(known_, [&](const Known& known) { return std::ranges::count(options.colors, known.color) == 0; });
  found_.resize(options.colors.size());
  std::size_t found = 0;
  int may_make = most_new_tables;
  for (const capture::MatchedColor& color : options.colors) {
    const color::ColorTable* table = table_for(color, image, may_make);
    if (table == nullptr) continue;  // made with one of the next frames
    found_[found].color = color;
    color::match_tiles(image, *table, found_[found++].tiles);
  }
  std::span<const capture::Matches::OfColor> colors(found_.data(), found);
  const std::size_t most = most_bytes_of_matches(image.width, image.height);
  cut_to(image, options.patches);
  capture::encode_matches(image, colors, picture(frame, image, options.picture_every), bytes_, patches_);
  if (bytes_.size() > most) capture::encode_matches(image, colors, {}, bytes_, patches_);
  if (bytes_.size() > most) capture::encode_matches(image, colors, {}, bytes_);
  while (bytes_.size() > most && !colors.empty()) {
    colors = colors.first(colors.size() - 1);
    capture::encode_matches(image, colors, {}, bytes_);
  }
  return bytes_;
}

// Clips the places to the image, up to the frame's budget of pixels.
void MatchFinder::cut_to(const capture::Image& image, const std::vector<capture::PatchPlace>& wanted) {
  patches_.clear();
  const auto even = [](int n) { return n / 2 * 2; };
  std::int64_t left = most_pixels_of_patches;
  for (const capture::PatchPlace& place : wanted) {
    const int u = even(std::clamp(place.u, 0, image.width)), v = even(std::clamp(place.v, 0, image.height));
    const capture::PatchPlace cut{.u = u,
                                  .v = v,
                                  .width = even(std::min(place.u + place.width, image.width) - u),
                                  .height = even(std::min(place.v + place.height, image.height) - v)};
    if (cut.width <= 0 || cut.height <= 0) continue;
    left -= std::int64_t{cut.width} * cut.height;
    if (left < 0) return;
    patches_.push_back(cut);
  }
}

const color::ColorTable* MatchFinder::table_for(const capture::MatchedColor& color, const capture::Image& image,
                                                int& may_make) {
  auto known = std::ranges::find(known_, color, &Known::color);
  if (known == known_.end()) known = known_.insert(known_.end(), {.color = color, .table = nullptr});
  if (!known->table || !known->table->is_for(image.format, image.range)) {
    if (may_make-- <= 0) return nullptr;
    known->table = std::make_unique<const color::ColorTable>(color::range_of(color), image.format, image.range);
  }
  return known->table.get();
}

std::span<const std::uint8_t> MatchFinder::picture(const capture::Frame& frame, const capture::Image& image,
                                                   capture::Duration every) {
  if (every <= capture::Duration::zero()) return {};
  const std::int64_t now = frame.stamped_at.time_since_epoch() / every;
  if (last_picture_ == now) return {};
  last_picture_ = now;
  if (frame.encoded) return *frame.encoded;
  if (image.width % 2 != 0 || image.height % 2 != 0) return {};  // the picture would have another size
  jpeg_ = capture::encode_picture(image, {.width = image.width, .height = image.height}, picture_quality);
  return jpeg_;
}

}  // namespace huetrack::hosts
