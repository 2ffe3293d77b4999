#include "capture/recording.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <string_view>

#include "calib/yaml/yaml_reader.h"

namespace huetrack {
namespace {

constexpr double longest_s = 4e9;  // |time|; far beyond any recording, and within 64 bits of nanoseconds

// Nanoseconds survive even when the times are UNIX seconds.
Duration exact_duration_of(long double s) {
  return Duration(std::llround(s * 1e9L));
}

std::vector<std::string_view> fields_of(std::string_view line) {
  std::vector<std::string_view> fields;
  for (std::size_t at = 0; at <= line.size();) {
    const std::size_t end = std::min(line.find(',', at), line.size());
    std::string_view field = line.substr(at, end - at);
    field.remove_prefix(std::min(field.find_first_not_of(" \t"), field.size()));
    field.remove_suffix(field.size() - std::min(field.find_last_not_of(" \t") + 1, field.size()));
    fields.push_back(field);
    at = end + 1;
  }
  return fields;
}

template <typename T>
std::optional<T> parse(std::string_view text) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

// A header line with the columns frame and t_s (others are ignored), then one row per frame.
std::vector<std::pair<std::int64_t, Timestamp>> read_timestamps(const std::filesystem::path& csv) {
  std::ifstream in(csv);
  if (!in || std::filesystem::is_directory(csv)) throw ConfigError(csv, 0, "cannot be read: no such time-stamp file");
  std::vector<std::pair<std::int64_t, Timestamp>> rows;
  std::string line;
  int number = 0;
  std::size_t frame_column = 0;
  std::size_t time_column = 0;
  while (std::getline(in, line)) {
    ++number;
    if (line.ends_with('\r')) line.pop_back();
    if (number == 1) {
      if (line.starts_with("\xEF\xBB\xBF")) line.erase(0, 3);  // the byte order mark that spreadsheets write
      const auto header = fields_of(line);
      const auto column = [&](std::string_view key) {
        const auto found = std::ranges::find(header, key);
        if (found == header.end())
          throw ConfigError(csv, 1, "the header has no column " + std::string(key) + ": it must be frame,t_s[,...]");
        return static_cast<std::size_t>(found - header.begin());
      };
      frame_column = column("frame");
      time_column = column("t_s");
      continue;
    }
    if (line.find_first_not_of(" \t") == std::string::npos) continue;
    const auto fields = fields_of(line);
    if (fields.size() <= std::max(frame_column, time_column))
      throw ConfigError(csv, number, "has " + std::to_string(fields.size()) + " columns, fewer than the header");
    const auto frame = parse<std::int64_t>(fields[frame_column]);
    if (!frame || *frame < 0)
      throw ConfigError(csv, number, "frame is '" + std::string(fields[frame_column]) + "', not an integer >= 0");
    const auto t_s = parse<long double>(fields[time_column]);
    if (!t_s || !(std::fabs(*t_s) < static_cast<long double>(longest_s)))
      throw ConfigError(csv, number, "t_s is '" + std::string(fields[time_column]) + "', not a time in seconds");
    const Timestamp at{exact_duration_of(*t_s)};
    if (!rows.empty() && *frame <= rows.back().first)
      throw ConfigError(csv, number,
                        "frame " + std::to_string(*frame) + " does not come after frame " +
                            std::to_string(rows.back().first) + " of the row before: sort the rows");
    if (!rows.empty() && at <= rows.back().second)
      throw ConfigError(csv, number,
                        "t_s " + std::string(fields[time_column]) +
                            " is not later than that of the row before: capture times must ascend");
    rows.emplace_back(*frame, at);
  }
  if (number == 0) throw ConfigError(csv, 0, "is empty: it must begin with the header frame,t_s");
  if (rows.empty()) throw ConfigError(csv, 0, "lists no frames");
  return rows;
}

}  // namespace

Recording read_recording(const std::filesystem::path& path) {
  const auto absolute = std::filesystem::absolute(path);
  Recording recording{.file = std::filesystem::is_directory(absolute) ? absolute / "recording.yaml" : absolute,
                      .cameras = {},
                      .started_at = {}};
  recording.file = recording.file.lexically_normal();
  const auto folder = recording.file.parent_path();
  const auto yaml = YamlReader::file(recording.file);
  if (const auto version = yaml.integer("version", any_number); version != 1)
    yaml.fail("version", "is " + std::to_string(version) + ", but this program reads version 1");
  if (yaml.has("started_at"))
    recording.started_at = Timestamp{exact_duration_of(yaml.number("started_at", {.min = 0, .max = longest_s}))};
  for (const auto& [name, entry] : yaml.named_maps("cameras")) {
    RecordedCamera camera;
    camera.name = name;
    camera.frames = (folder / entry.string("frames")).lexically_normal();
    if (entry.has("fps")) camera.fps = entry.number("fps", {.min = 1e-3, .max = 1e6});
    camera.offset = exact_duration_of(entry.number("offset_s", {.min = -longest_s, .max = longest_s}, 0));
    camera.first_frame = entry.integer("first_frame", {.min = 0, .max = 1e12}, 0);
    camera.every = entry.integer("every", {.min = 1, .max = 1e9}, 1);
    if (entry.has("timestamps")) {
      if (camera.fps > 0) entry.fail("timestamps", "is given together with fps: keep the one that is true");
      camera.timestamps = read_timestamps((folder / entry.string("timestamps")).lexically_normal());
    }
    entry.finish();
    recording.cameras.push_back(std::move(camera));
  }
  if (recording.cameras.empty()) yaml.fail("cameras", "names no camera");
  yaml.finish();
  return recording;
}

}  // namespace huetrack
