#include "capture/frames/jpeg_splitter.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace huetrack::capture {
namespace {

constexpr std::uint8_t mark = 0xff, start_of_image = 0xd8, end_of_image = 0xd9, start_of_scan = 0xda, fill = 0xff;

bool is_alone(std::uint8_t marker) {  // has no length behind it
  return marker == 0x01 || (marker >= 0xd0 && marker <= 0xd7);
}

}  // namespace

std::optional<std::vector<std::uint8_t>> JpegSplitter::next() {
  while (!end_) {
    const bool goes_on = inside_ == Inside::nothing  ? find_begin()
                         : inside_ == Inside::header ? step_over_segment()
                                                     : find_marker();
    if (!goes_on) return std::nullopt;
  }
  return taken(*std::exchange(end_, std::nullopt));
}

std::optional<std::vector<std::uint8_t>> JpegSplitter::rest() {
  if (inside_ == Inside::nothing) return std::nullopt;
  return taken(bytes_.size());
}

std::vector<std::uint8_t> JpegSplitter::taken(std::size_t end) {
  std::vector<std::uint8_t> jpeg(bytes_.begin(), bytes_.begin() + static_cast<std::ptrdiff_t>(end));
  bytes_.erase(bytes_.begin(), bytes_.begin() + static_cast<std::ptrdiff_t>(end));
  at_ = 0;
  inside_ = Inside::nothing;
  return jpeg;
}

bool JpegSplitter::find_begin() {
  constexpr std::uint8_t begin[] = {mark, start_of_image, mark};
  const auto found = std::search(bytes_.begin(), bytes_.end(), std::begin(begin), std::end(begin));
  const bool is_found = found != bytes_.end();
  // The last two bytes may be the first two of it.
  bytes_.erase(bytes_.begin(),
               is_found ? found : bytes_.end() - static_cast<std::ptrdiff_t>(std::min<std::size_t>(2, bytes_.size())));
  at_ = 2;
  if (is_found) inside_ = Inside::header;
  return is_found;
}

bool JpegSplitter::step_over_segment() {
  if (bytes_.size() < at_ + 4) return false;
  const std::uint8_t marker = bytes_[at_ + 1];
  const std::size_t length = std::size_t{bytes_[at_ + 2]} << 8 | bytes_[at_ + 3];
  if (bytes_[at_] == mark && marker == start_of_image && at_ == 2) {  // nothing has begun before it
    bytes_.erase(bytes_.begin(), bytes_.begin() + 2);
    return true;
  }
  if (bytes_[at_] != mark || marker == start_of_image || marker == end_of_image || length < 2) {
    inside_ = Inside::scan;  // its end is where it ends, or where another begins
    return true;
  }
  if (marker == fill) {
    ++at_;
  } else if (is_alone(marker)) {
    at_ += 2;
  } else {
    if (bytes_.size() < at_ + 2 + length) return false;
    at_ += 2 + length;
    if (marker == start_of_scan) inside_ = Inside::scan;
  }
  return true;
}

bool JpegSplitter::find_marker() {
  for (; at_ + 1 < bytes_.size(); ++at_) {
    const void* const found = std::memchr(&bytes_[at_], mark, bytes_.size() - at_ - 1);
    at_ = found ? static_cast<std::size_t>(static_cast<const std::uint8_t*>(found) - bytes_.data()) : bytes_.size() - 1;
    if (found == nullptr) return false;
    const std::uint8_t marker = bytes_[at_ + 1];
    if (marker == 0 || marker == fill || is_alone(marker)) continue;
    if (marker == start_of_image)
      end_ = at_;
    else if (marker == end_of_image)
      end_ = at_ + 2;
    else
      inside_ = Inside::header;  // of another scan
    return true;
  }
  return false;
}

}  // namespace huetrack::capture
