// Reads a bundle of Open Sound Control, strictly, as its specification (1.0) says. Throws std::out_of_range or
// std::runtime_error where it is not one.
#pragma once

#include <bit>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

namespace huetrack::client {

struct OscMessage {
  std::string address, tags, text;
  std::vector<float> values;
};
struct OscBundle {
  std::uint64_t time_tag = 0;
  std::vector<OscMessage> messages;
};

class OscBytes {
 public:
  explicit OscBytes(std::string bytes) : bytes_(std::move(bytes)) {
    if (bytes_.size() % 4 != 0) throw std::runtime_error("not a multiple of four bytes");
  }
  bool at_end() const { return at_ == bytes_.size(); }
  std::uint32_t integer() {
    std::uint32_t value = 0;
    for (int i = 0; i < 4; ++i) value = value << 8U | static_cast<unsigned char>(bytes_.at(at_++));
    return value;
  }
  std::string text() {
    std::string out;
    while (bytes_.at(at_) != '\0') out += bytes_[at_++];
    do
      if (bytes_.at(at_++) != '\0') throw std::runtime_error("padded with something");
    while (at_ % 4 != 0);
    return out;
  }
  std::string take(std::size_t size) {
    if (size > bytes_.size() - at_) throw std::out_of_range("size");
    at_ += size;
    return bytes_.substr(at_ - size, size);
  }

 private:
  std::string bytes_;
  std::size_t at_ = 0;
};

inline OscBundle read_osc(const std::string& datagram) {
  OscBytes bytes(datagram);
  if (bytes.text() != "#bundle") throw std::runtime_error("no bundle");
  OscBundle bundle;
  bundle.time_tag = std::uint64_t{bytes.integer()} << 32U;
  bundle.time_tag |= bytes.integer();
  while (!bytes.at_end()) {
    OscBytes part(bytes.take(bytes.integer()));
    OscMessage& message = bundle.messages.emplace_back();
    message.address = part.text();
    message.tags = part.text();
    for (const char tag : message.tags.substr(1))
      if (tag == 'f')
        message.values.push_back(std::bit_cast<float>(part.integer()));
      else if (tag == 's')
        message.text = part.text();
      else
        throw std::runtime_error("an unknown tag");
    if (!part.at_end()) throw std::runtime_error("bytes that are left over");
  }
  return bundle;
}

}  // namespace huetrack::client
