// One file of a bag. Private to this module.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "recordings/bags/bag.h"

namespace huetrack::bags {

class BagFile {
 public:
  virtual ~BagFile() = default;
  virtual const std::vector<BagTopic>& topics() const = 0;  // those known so far: from the index, or met while reading
  virtual bool has_index() const = 0;                       // topics() is complete, with its numbers of messages
  virtual std::optional<BagMessage> next() = 0;  // of the wanted topic, or of any; nullopt at the end. Never throws.

  std::vector<std::string> warnings;  // one line each

 protected:
  void warn(const std::string& text) {
    constexpr int most = 5;
    if (++warned_ <= most) warnings.push_back(text + (warned_ == most ? " (further ones are not listed)" : ""));
  }

 private:
  int warned_ = 0;
};

// wanted: a topic's name; empty: all messages. throw ConfigError: it cannot be opened, or is of another kind
std::unique_ptr<BagFile> open_mcap(const std::filesystem::path& file, std::string_view wanted);
std::unique_ptr<BagFile> open_sqlite(const std::filesystem::path& file, std::string_view wanted);
std::unique_ptr<BagFile> open_ros1(const std::filesystem::path& file, std::string_view wanted);

std::string plain_type(std::string type);  // without ROS 2's "/msg"

}  // namespace huetrack::bags
