// What bags are compressed with. Private to this module.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "recordings/bags/byte_file.h"

namespace huetrack::bags {

struct Decompressed {
  Buffer buffer;             // bytes and the padding
  std::size_t size = 0;      // bytes that were decompressed: less than requested from damaged or truncated input
  std::string problem = {};  // what is wrong with the input; empty: it is complete
};

// method: "zstd", "lz4" (a frame of each), or "bz2". size: what the file declares; nullopt: unknown, up to
// largest_bytes.
Decompressed decompress(std::string_view method, std::span<const std::uint8_t> bytes, std::optional<std::size_t> size);

}  // namespace huetrack::bags
