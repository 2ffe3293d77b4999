#include "recordings/bags/bag.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <string_view>
#include <utility>

#include "calib/files/config_error.h"
#include "calib/files/file_order.h"
#include "calib/files/nearest_word.h"
#include "recordings/bags/bag_file.h"
#include "recordings/bags/decompress.h"

namespace huetrack::bags {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view zstd_magic = "\x28\xb5\x2f\xfd";  // CDR begins with 0

using Opener = std::unique_ptr<BagFile> (*)(const fs::path&, std::string_view);
constexpr std::array<std::pair<std::string_view, Opener>, 3> kinds{
    {{"\x89MCAP", open_mcap}, {"SQLite format 3", open_sqlite}, {"#ROSBAG V", open_ros1}}};

Opener opener_of(const fs::path& file) {
  std::error_code unreadable;
  if (!fs::is_regular_file(file, unreadable)) return nullptr;
  std::array<char, 16> bytes{};
  std::ifstream(file, std::ios::binary).read(bytes.data(), bytes.size());
  const std::string_view begin(bytes.data(), bytes.size());
  for (const auto& [magic, opener] : kinds)
    if (begin.starts_with(magic)) return opener;
  return nullptr;
}

// rosbag2 numbers its files: bag_0.db3 ... bag_10.db3.
std::vector<fs::path> files_in(const fs::path& folder, std::string_view ending) {
  std::vector<fs::path> files;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error))
    if (entry.path().filename().string().ends_with(ending)) files.push_back(entry.path());
  files::sort_by_numbers(files);
  return files;
}

std::unique_ptr<BagFile> open_part(const fs::path& part, std::string_view wanted) {
  const Opener opener = opener_of(part);
  std::error_code error;
  if (opener == nullptr && fs::exists(part, error) && fs::file_size(part, error) == 0)
    throw files::ConfigError(part, 0, "is empty");
  if (opener == nullptr) throw files::ConfigError(part, 0, "is neither an MCAP, a rosbag2 nor a bag of ROS 1");
  return opener(part, wanted);
}

std::vector<fs::path> parts_or_fail(const fs::path& bag) {
  const auto parts = parts_of(bag);
  if (!parts.empty()) return parts;
  const auto compressed = files_in(bag, ".zstd");
  if (!compressed.empty())
    throw files::ConfigError(
        bag, 0,
        "its files are compressed as a whole: `unzstd --rm " + (bag / "*.zstd").string() + "` makes them readable");
  throw files::ConfigError(bag, 0, "holds neither .mcap nor .db3 files");
}

}  // namespace

std::string plain_type(std::string type) {
  if (const auto at = type.find("/msg/"); at != std::string::npos) type.erase(at, 4);
  return type;
}

bool is_bag(const fs::path& path) {
  std::error_code error;
  if (!fs::is_directory(path, error)) return opener_of(path) != nullptr;
  if (fs::exists(path / "recording.yaml", error)) return false;
  return !parts_of(path).empty() || (fs::exists(path / "metadata.yaml", error) && !files_in(path, ".zstd").empty());
}

std::string problem_of_beginning(const fs::path& file) {
  const std::string ending = files::to_lower_ascii(file.extension().string());
  static constexpr std::array<std::string_view, 3> endings{".mcap", ".db3", ".bag"};
  std::error_code unreadable;
  if (std::ranges::find(endings, ending) == endings.end() || !fs::is_regular_file(file, unreadable) || is_bag(file))
    return {};
  return "is called like a ROS bag (" + ending +
         "), but does not begin like one: it was not copied completely, or is another file: copy it again";
}

std::vector<fs::path> parts_of(const fs::path& bag) {
  std::error_code error;
  if (!fs::is_directory(bag, error)) return {bag};
  auto parts = files_in(bag, ".mcap");
  return parts.empty() ? files_in(bag, ".db3") : parts;
}

namespace {

// Calls with_file(file) for every file of a bag that can be opened; the errors of the others become warnings. throws
// ConfigError: that of the first, if none can
template <typename WithFile>
void for_each_file(const fs::path& bag, std::string_view wanted, std::vector<std::string>& warnings,
                   const WithFile& with_file) {
  std::optional<files::ConfigError> first_error;
  bool is_any_open = false;
  for (const fs::path& part : parts_or_fail(bag)) {
    try {
      with_file(*open_part(part, wanted));
      is_any_open = true;
    } catch (const files::ConfigError& error) {
      warnings.emplace_back(error.what());
      if (!first_error) first_error = error;
    }
  }
  if (!is_any_open) throw *first_error;
}

}  // namespace

Contents contents_of(const fs::path& bag) {
  Contents contents;
  for_each_file(bag, "", contents.warnings, [&](BagFile& file) {
    if (!file.has_index())
      while (file.next()) {
      }
    for (const BagTopic& topic : file.topics()) {
      const auto known = std::ranges::find(contents.topics, topic.name, &BagTopic::name);
      if (known == contents.topics.end())
        contents.topics.push_back(topic);
      else
        known->messages += topic.messages;
    }
    std::ranges::move(file.warnings, std::back_inserter(contents.warnings));
  });
  return contents;
}

struct TopicReader::Impl {
  // False: there is no other file.
  bool open_next() {
    file.reset();
    if (at == parts.size()) return false;
    try {
      file = open_part(parts[at++], topic);
    } catch (const files::ConfigError& error) {  // it was there at the start
      warnings.emplace_back(error.what());
    }
    return true;
  }

  std::vector<fs::path> parts;
  std::string topic;
  std::size_t at = 0;             // in parts
  std::unique_ptr<BagFile> file;  // one at a time: a bag may have thousands
  std::optional<std::int64_t> messages = 0;
  std::vector<std::string> warnings;
};

TopicReader::TopicReader(const fs::path& bag, std::string topic) : impl_(std::make_unique<Impl>()) {
  impl_->parts = parts_or_fail(bag);
  impl_->topic = std::move(topic);
  std::vector<std::string> reported_by_next;
  for_each_file(bag, impl_->topic, reported_by_next, [&](BagFile& file) {
    if (!file.has_index()) impl_->messages.reset();
    for (const BagTopic& known : file.topics())
      if (known.name == impl_->topic && impl_->messages) *impl_->messages += known.messages;
  });
  if (!reported_by_next.empty()) impl_->messages.reset();
}
TopicReader::~TopicReader() = default;

std::optional<BagMessage> TopicReader::next() {
  while (impl_->file || impl_->open_next()) {
    if (!impl_->file) continue;
    auto message = impl_->file->next();
    std::ranges::move(impl_->file->warnings, std::back_inserter(impl_->warnings));
    impl_->file->warnings.clear();
    if (!message) {
      impl_->file.reset();
      continue;
    }
    // rosbag2's compression mode "message"
    if (std::string_view(reinterpret_cast<const char*>(message->data.data()), message->data.size())
            .starts_with(zstd_magic)) {
      const Decompressed out = decompress("zstd", message->data, std::nullopt);
      message->data = std::span(*out.buffer).first(out.size);
      message->owner = out.buffer;
    }
    return message;
  }
  return std::nullopt;
}

std::optional<std::int64_t> TopicReader::messages() const {
  return impl_->messages;
}

std::vector<std::string> TopicReader::take_warnings() {
  return std::exchange(impl_->warnings, {});
}

}  // namespace huetrack::bags
