#include "config/room_file.h"

#include <fmt/format.h>

#include <charconv>
#include <system_error>

#include "calib/files/output_file.h"
#include "calib/files/text_file.h"
#include "calib/model/camera_rig.h"
#include "calib/yaml/yaml_reader.h"

namespace huetrack::config {
namespace {

constexpr double farthest_px = 32768;

room_watch::SeenPatch read_seen(const yaml::YamlReader& patch) {
  const std::string text = patch.string("seen");
  room_watch::SeenPatch seen;
  bool is_hex = text.size() == 2 * seen.size();
  for (std::size_t k = 0; is_hex && k < seen.size(); ++k) {
    const char* const from = text.data() + 2 * k;
    const auto [end, error] = std::from_chars(from, from + 2, seen[k], 16);
    is_hex = error == std::errc{} && end == from + 2;
  }
  if (!is_hex) patch.fail("seen", fmt::format("must be {} hexadecimal digits", 2 * seen.size()));
  return seen;
}

}  // namespace

std::vector<KeptRoom> read_room(const std::filesystem::path& file, const std::string& rig_identity) {
  if (!std::filesystem::exists(file)) return {};
  const yaml::YamlReader root = yaml::YamlReader::file(file);
  root.version(1);
  const bool is_of_this_rig = root.string("rig") == rig_identity;
  std::vector<KeptRoom> room;
  for (const auto& [camera, reader] : root.named_maps("cameras")) {
    if (!calib::is_camera_name(camera)) root.fail("cameras", calib::camera_name_rule);
    KeptRoom& kept = room.emplace_back();
    kept.camera = camera;
    for (const yaml::YamlReader& patch : reader.maps("patches")) {
      const auto px = patch.numbers("px", 2, 2, {.min = -farthest_px, .max = farthest_px});
      kept.patches.push_back(
          {.px = {px[0], px[1]}, .cell = int(patch.integer("cell", {.min = 0, .max = 1e6})), .seen = read_seen(patch)});
      patch.finish();
    }
    reader.finish();
  }
  root.finish();
  return is_of_this_rig ? room : std::vector<KeptRoom>{};
}

void write_room(const std::filesystem::path& file, const std::vector<KeptRoom>& room, const std::string& rig_identity) {
  files::write_whole_file(file, room_to_yaml(room, rig_identity));
}

std::string room_to_yaml(const std::vector<KeptRoom>& room, const std::string& rig_identity) {
  std::string text =
      "# The still room as the cameras saw it at the poses of the rig. Written and read by huetrackd; delete it to "
      "learn\n"
      "# the room again.\nversion: 1\n";
  text += fmt::format("rig: \"{}\"  # this one only\ncameras:\n", rig_identity);
  for (const KeptRoom& kept : room) {
    text +=
        fmt::format("  {}:\n    patches:{}\n", files::in_yaml_quotes(kept.camera), kept.patches.empty() ? " []" : "");
    for (const room_watch::KeptPatch& patch : kept.patches) {
      text += fmt::format("      - {{px: [{}, {}], cell: {}, seen: \"", patch.px.x(), patch.px.y(), patch.cell);
      for (const std::uint8_t value : patch.seen) text += fmt::format("{:02x}", value);
      text += "\"}\n";
    }
  }
  return text;
}

}  // namespace huetrack::config
