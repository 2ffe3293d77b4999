// The JPEGs in a stream of bytes, by their own structure, whatever lies between them: nothing, or HTTP's multipart
// headers with any boundary or none. A thumbnail inside a JPEG is a part of it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace huetrack::capture {

// thread-compatible.
class JpegSplitter {
 public:
  void add(std::span<const std::uint8_t> bytes) { bytes_.insert(bytes_.end(), bytes.begin(), bytes.end()); }
  // The next JPEG that is complete; or that another one follows without its end, so that a decoder refuses it and its
  // number counts. nullopt: none in what was added.
  std::optional<std::vector<std::uint8_t>> next();
  // A JPEG that has begun, without its end: at the end of a stream it is cut off. Clears it.
  std::optional<std::vector<std::uint8_t>> rest();
  std::size_t pending() const { return bytes_.size(); }  // bytes that are kept

 private:
  enum class Inside { nothing, header, scan };
  // False: more bytes are needed.
  bool find_begin();
  bool step_over_segment();
  bool find_marker();
  std::vector<std::uint8_t> taken(std::size_t end);

  std::vector<std::uint8_t> bytes_;  // from the beginning of a JPEG, once it is found
  std::size_t at_ = 0;               // everything before is known
  Inside inside_ = Inside::nothing;
  std::optional<std::size_t> end_;  // of the JPEG at the beginning of bytes_
};

}  // namespace huetrack::capture
