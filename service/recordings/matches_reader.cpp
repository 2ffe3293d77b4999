#include "recordings/matches_reader.h"

#include <array>
#include <memory>
#include <utility>

namespace huetrack::recordings {
namespace {

constexpr std::uint32_t largest = std::uint32_t{1} << 26;  // bytes of a frame; a damaged length must not cost gigabytes

}  // namespace

bool is_matches_file(const std::filesystem::path& file) {
  std::error_code unreadable;  // opening a pipe would block
  if (!std::filesystem::is_regular_file(file, unreadable)) return false;
  std::string head(matches_file_begins.size(), '\0');
  std::ifstream in(file, std::ios::binary);
  return in.read(head.data(), static_cast<std::streamsize>(head.size())) && head == matches_file_begins;
}

MatchesReader::MatchesReader(const RecordedCamera& camera, std::vector<std::string>& warnings, bool keeps_encoded)
    : camera_(camera),
      selection_(camera),
      warnings_(warnings),
      keeps_encoded_(keeps_encoded),
      in_(camera.frames, std::ios::binary) {
  in_.seekg(static_cast<std::streamoff>(matches_file_begins.size()));
}

// False: the file ends here.
bool MatchesReader::read(std::vector<std::uint8_t>& bytes) {
  std::array<char, 4> length{};
  in_.read(length.data(), length.size());
  if (in_.gcount() == 0) return false;
  std::uint32_t count = 0;
  for (std::size_t i = 0; i < length.size(); ++i)
    count |= static_cast<std::uint32_t>(static_cast<unsigned char>(length[i])) << (8 * i);
  if (in_ && count <= largest) {
    bytes.resize(count);
    if (in_.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(count))) return true;
  }
  warnings_.push_back(camera_.frames.string() + ": is cut off or damaged: " + std::to_string(index_) + " frames");
  return false;
}

std::optional<Shown> MatchesReader::next() {
  auto bytes = std::make_shared<std::vector<std::uint8_t>>();
  while (read(*bytes)) {
    const std::int64_t index = index_++;
    if (const auto last = selection_.last(); last && index > *last) return std::nullopt;
    // Decode skipped frames, too: a later one may need their picture.
    auto decoded = capture::decode_matches(*bytes, decoder_, picture_);
    if (!selection_.contains(index)) continue;
    Shown shown{.index = index, .stamp = std::nullopt, .image = {}};
    if (decoded) {
      shown.image = std::move(decoded->source);
      shown.matches = std::move(decoded->matches);
      if (keeps_encoded_) shown.jpeg = std::move(bytes);
    } else if (!std::exchange(has_warned_, true)) {
      warnings_.push_back(camera_.frames.string() + ": frame " + std::to_string(index) +
                          " and perhaps others do not decode");
    }
    return shown;
  }
  return std::nullopt;
}

}  // namespace huetrack::recordings
