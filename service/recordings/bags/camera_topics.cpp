#include "recordings/bags/camera_topics.h"

#include <algorithm>
#include <cctype>
#include <set>
#include <string_view>

#include "recordings/bags/messages.h"

namespace huetrack::bags {
namespace {

std::vector<std::string> parts_of_topic(std::string_view topic) {
  std::vector<std::string> parts(1);
  for (const char c : topic)
    if (c == '/')
      parts.emplace_back();
    else
      parts.back() += std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '.' ? c : '_';
  std::erase(parts, "");
  return parts;
}

// /left/image_raw/compressed: /left
std::string camera_path(std::string topic) {
  for (auto slash = topic.rfind('/'); slash != std::string::npos; slash = topic.rfind('/')) {
    const std::string last = topic.substr(slash + 1);
    if (!last.starts_with("image") && last != "compressed" && last != "raw") break;
    topic.resize(slash);
  }
  return topic;
}

// Of several topics of one camera the lowest: as the sensor saw it (a rectified image has another lens), in colour, not
// compressed.
int rank_of(std::string_view topic) {
  const auto has = [&](std::string_view word) { return topic.find(word) != std::string_view::npos ? 1 : 0; };
  return 4 * has("image_rect") + 2 * has("image_mono") + has("compressed");
}

}  // namespace

std::vector<CameraTopics> cameras_of(std::span<const BagTopic> topics) {
  std::vector<CameraTopics> cameras;
  std::vector<std::vector<std::string>> names;
  for (const BagTopic& topic : topics) {
    // of a depth image, by the names that image_transport and the drivers give it
    const bool is_depth =
        topic.name.find("depth") != std::string::npos || topic.name.find("disparity") != std::string::npos;
    if (!is_picture(topic) || topic.messages == 0 || is_depth || topic.name.ends_with("/theora")) continue;
    const std::string path = camera_path(topic.name);
    const auto same = std::ranges::find(cameras, path, [](const auto& c) { return camera_path(c.picture.name); });
    if (same != cameras.end()) {
      if (rank_of(topic.name) < rank_of(same->picture.name)) same->picture = topic;
      continue;
    }
    const auto lens = std::ranges::find(topics, path + "/camera_info", &BagTopic::name);
    cameras.push_back(
        {.camera = {}, .picture = topic, .lens = lens != topics.end() && is_lens(*lens) ? lens->name : ""});
    names.push_back(parts_of_topic(path));
    if (names.back().empty()) names.back() = parts_of_topic(topic.name);
    if (names.back().empty()) names.back() = {"camera"};  // a topic "/", of a damaged file
  }
  const auto are_all = [&](const auto& test) { return names.size() > 1 && std::ranges::all_of(names, test); };
  while (are_all([&](const auto& parts) { return parts.size() > 1 && parts.back() == names.front().back(); }))
    for (auto& parts : names) parts.pop_back();
  std::set<std::string> last, taken;
  for (const auto& parts : names) last.insert(parts.back());
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    std::string name;
    if (last.size() == names.size())
      name = names[i].back();
    else  // the whole path
      for (const std::string& part : names[i]) name += (name.empty() ? "" : "_") + part;
    cameras[i].camera = name;
    for (int number = 2; !taken.insert(cameras[i].camera).second; ++number)  // a_b of /a/b and of /a_b
      cameras[i].camera = name + "_" + std::to_string(number);
  }
  return cameras;
}

}  // namespace huetrack::bags
