#include "recordings/jpeg_stream.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <string_view>
#include <utility>

namespace huetrack::recordings {
namespace {

constexpr std::size_t longest_headers = 4096;    // capacity: bytes before the first picture
constexpr std::size_t largest_jpeg = 64U << 20;  // capacity: bytes
constexpr std::size_t read_bytes = 1U << 16;

// nullopt: the file ends, or has too many bytes without a picture's end.
std::optional<std::vector<std::uint8_t>> next_jpeg(std::ifstream& in, capture::JpegSplitter& splitter) {
  auto jpeg = splitter.next();
  std::vector<char> some(read_bytes);
  while (!jpeg && in && splitter.pending() < largest_jpeg) {
    in.read(some.data(), static_cast<std::streamsize>(some.size()));
    splitter.add({reinterpret_cast<const std::uint8_t*>(some.data()), static_cast<std::size_t>(in.gcount())});
    jpeg = splitter.next();
  }
  return jpeg ? jpeg : splitter.rest();
}

}  // namespace

bool is_jpeg_stream(const std::filesystem::path& file) {
  std::error_code unreadable;  // opening a pipe would block
  if (!std::filesystem::is_regular_file(file, unreadable)) return false;
  std::ifstream in(file, std::ios::binary);
  std::string head(longest_headers, '\0');
  in.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(in.gcount()));
  const auto begin = head.find("\xff\xd8\xff");
  if (begin == std::string::npos ||
      !std::all_of(head.begin(), head.begin() + static_cast<std::ptrdiff_t>(begin),
                   [](unsigned char c) { return std::isprint(c) != 0 || c == '\r' || c == '\n' || c == '\t'; }))
    return false;
  in.clear();
  in.seekg(0);
  capture::JpegSplitter splitter;
  const auto first = next_jpeg(in, splitter);
  if (!first) return false;
  const std::string_view whole(reinterpret_cast<const char*>(first->data()), std::min(first->size(), read_bytes));
  if (whole.find(std::string_view("MPF\0", 4)) != std::string_view::npos) return false;
  return next_jpeg(in, splitter).has_value();
}

JpegStream::JpegStream(const RecordedCamera& camera, std::vector<std::string>& warnings, bool keeps_encoded)
    : camera_(camera),
      selection_(camera),
      warnings_(warnings),
      keeps_encoded_(keeps_encoded),
      in_(camera.frames, std::ios::binary) {}

std::optional<Shown> JpegStream::next() {
  const auto last = selection_.last();
  while (!last || index_ <= *last) {
    auto next = next_jpeg(in_, splitter_);
    if (!next) return std::nullopt;
    const std::int64_t number = index_++;
    if (!selection_.contains(number)) continue;
    Shown shown{.index = number, .stamp = {}, .image = {}};
    const auto jpeg = std::make_shared<const std::vector<std::uint8_t>>(std::move(*next));
    if (auto image = decoder_.decode(jpeg)) {
      shown.image = std::move(*image);
      if (keeps_encoded_) shown.jpeg = jpeg;
    } else if (!std::exchange(has_warned_, true)) {
      warnings_.push_back(camera_.frames.string() + ": frame " + std::to_string(number) +
                          " and perhaps others do not decode: " + decoder_.take_problem());
    }
    return shown;
  }
  return std::nullopt;
}

}  // namespace huetrack::recordings
