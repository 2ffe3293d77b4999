#include "recordings/jpeg_stream.h"

#include <algorithm>
#include <cctype>
#include <string_view>
#include <utility>

#include "capture/ffmpeg/ffmpeg_objects.h"

namespace huetrack::recordings {
namespace {

constexpr std::size_t longest_headers = 1U << 16;      // capacity: bytes before the first picture
constexpr std::size_t largest_jpeg = 64U << 20;        // capacity: bytes
constexpr std::size_t largest_cut_picture = 4U << 20;  // capacity: bytes
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

bool is_text(char c) {
  return std::isprint(static_cast<unsigned char>(c)) != 0 || c == '\r' || c == '\n' || c == '\t';
}

// A file's first bytes, and where its first picture begins; npos: none does.
struct Beginning {
  std::string bytes;
  std::size_t first = std::string::npos;

  bool is_text_before_first() const {
    return first != std::string::npos && std::all_of(bytes.begin(), bytes.begin() + std::ptrdiff_t(first), is_text);
  }
};

// Leaves the file at its beginning.
Beginning beginning_of(std::ifstream& in, std::size_t at_most) {
  std::string bytes(at_most, '\0');
  in.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<std::size_t>(in.gcount()));
  in.clear();
  in.seekg(0);
  const std::size_t first = bytes.find("\xff\xd8\xff");
  return {std::move(bytes), first};
}

// The picture's beginning was not saved: before the first whole one there is an end of a picture, and perhaps headers
// or padding. (Inside a container other bytes are before the first one.)
bool begins_inside_a_picture(const Beginning& begin) {
  std::size_t end = begin.first == std::string::npos ? 0 : begin.first;
  while (end > 0 && (is_text(begin.bytes[end - 1]) || begin.bytes[end - 1] == '\0')) --end;
  return end >= 2 && begin.bytes.compare(end - 2, 2, "\xff\xd9") == 0;
}

// Bytes of no kind before the first picture, as a cut dump of a network has them: by the pictures' own structure, and
// since it is no container that FFmpeg knows.
bool is_taken_for_jpegs(Beginning begin, const std::filesystem::path& file) {
  if (begin.first == std::string::npos) return false;
  const auto size = static_cast<int>(begin.bytes.size());
  begin.bytes.resize(begin.bytes.size() + AVPROBE_PADDING_SIZE);  // zeros, as FFmpeg wants them
  const AVProbeData probe{.filename = file.c_str(),
                          .buf = reinterpret_cast<unsigned char*>(begin.bytes.data()),
                          .buf_size = size,
                          .mime_type = nullptr};
  const AVInputFormat* format = av_probe_input_format(&probe, 1);
  return format != nullptr && std::string_view(format->name) == "mjpeg";
}

}  // namespace

bool is_jpeg_stream(const std::filesystem::path& file) {
  std::error_code unreadable;  // opening a pipe would block
  if (!std::filesystem::is_regular_file(file, unreadable)) return false;
  std::ifstream in(file, std::ios::binary);
  Beginning head = beginning_of(in, longest_headers);
  if (!head.is_text_before_first() && !begins_inside_a_picture(beginning_of(in, largest_cut_picture)) &&
      !is_taken_for_jpegs(std::move(head), file))
    return false;
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
      in_(camera.frames, std::ios::binary) {
  const Beginning begin = beginning_of(in_, largest_cut_picture);
  begins_inside_ = begins_inside_a_picture(begin);
  if (begins_inside_ || begin.first == std::string::npos || begin.is_text_before_first()) return;
  warnings_.push_back(camera_.frames.string() + ": the " + std::to_string(begin.first) +
                      " bytes before its first picture are left out");
}

std::optional<Shown> JpegStream::next() {
  const auto last = selection_.last();
  while (!last || index_ <= *last) {
    if (std::exchange(begins_inside_, false)) {  // which keeps the numbers, and times, of those that follow
      warnings_.push_back(camera_.frames.string() + ": begins inside a picture, which counts as frame 0");
      if (selection_.contains(index_++)) return Shown{.index = 0, .stamp = {}, .image = {}};
      continue;
    }
    auto next = next_jpeg(in_, splitter_);
    if (!next) return std::nullopt;
    const std::int64_t number = index_++;
    if (!selection_.contains(number)) continue;
    Shown shown{.index = number, .stamp = {}, .image = {}};
    const auto jpeg = std::make_shared<const std::vector<std::uint8_t>>(std::move(*next));
    if (auto image = decoder_.decode(jpeg)) {
      shown.image = std::move(*image);
      if (keeps_encoded_ && !decoder_.turns()) shown.jpeg = jpeg;
      for (const std::string& note : decoder_.take_notes()) warnings_.push_back(camera_.frames.string() + ": " + note);
    } else if (!std::exchange(has_warned_, true)) {
      warnings_.push_back(camera_.frames.string() + ": frame " + std::to_string(number) +
                          " and perhaps others do not decode: " + decoder_.take_problem());
    }
    return shown;
  }
  return std::nullopt;
}

}  // namespace huetrack::recordings
