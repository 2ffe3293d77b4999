// A file as bytes at an offset, and bytes as numbers. Private to this module.
#pragma once

#include <array>
#include <bit>
#include <concepts>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string_view>
#include <type_traits>
#include <vector>

namespace huetrack::bags {

static_assert(std::endian::native == std::endian::little);

using Buffer = std::shared_ptr<std::vector<std::uint8_t>>;
inline constexpr std::size_t buffer_padding = 64;  // FFmpeg reads up to that far behind a picture

Buffer make_buffer(std::size_t size);  // size bytes and the padding, all 0

// thread-compatible.
class ByteFile {
 public:
  explicit ByteFile(const std::filesystem::path& file);  // throws ConfigError: not a regular file, or unreadable
  ~ByteFile();
  ByteFile(const ByteFile&) = delete;
  ByteFile& operator=(const ByteFile&) = delete;

  std::uint64_t size() const { return size_; }
  bool has(std::uint64_t at, std::uint64_t count) const { return at <= size_ && count <= size_ - at; }
  // False: the file is shorter, or cannot be read there.
  bool read(std::uint64_t at, std::span<std::uint8_t> to) const;
  // count bytes and the padding; nullptr: as above, or more than largest_bytes.
  Buffer read(std::uint64_t at, std::uint64_t count) const;

 private:
  int fd_;
  std::uint64_t size_ = 0;
};

struct CursorOptions {
  bool is_big_endian = false;
  bool is_aligned = false;  // numbers at multiples of their size, as in CDR
};

// Reads numbers and counted bytes; after the first that is not there ok() is false and all others are 0 or empty.
class Cursor {
 public:
  explicit Cursor(std::span<const std::uint8_t> bytes, CursorOptions options = {}) : bytes_(bytes), options_(options) {}

  bool ok() const { return ok_; }
  bool at_end() const { return at_ == bytes_.size(); }
  std::size_t at() const { return at_; }

  template <typename Number>
  requires std::integral<Number> || std::floating_point<Number> Number number() {
    if (options_.is_aligned) bytes((sizeof(Number) - at_ % sizeof(Number)) % sizeof(Number));
    const auto raw = bytes(sizeof(Number));
    if (!ok_) return {};
    std::array<std::uint8_t, sizeof(Number)> own{};
    for (std::size_t i = 0; i < own.size(); ++i) own[i] = raw[options_.is_big_endian ? own.size() - 1 - i : i];
    return std::bit_cast<Number>(own);
  }
  std::span<const std::uint8_t> bytes(std::uint64_t count) {
    if (!ok_ || count > bytes_.size() - at_) {
      ok_ = false;
      return {};
    }
    at_ += count;
    return bytes_.subspan(at_ - count, count);
  }
  // With its length before it, in 32 bits.
  std::span<const std::uint8_t> counted() { return bytes(number<std::uint32_t>()); }
  std::string_view text() {
    const auto own = counted();
    return {reinterpret_cast<const char*>(own.data()), own.size()};
  }

 private:
  std::span<const std::uint8_t> bytes_;
  CursorOptions options_;
  std::size_t at_ = 0;
  bool ok_ = true;
};

}  // namespace huetrack::bags
