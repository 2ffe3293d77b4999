#include "recordings/recording.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <string_view>

#include "calib/files/csv_table.h"
#include "calib/files/number_text.h"
#include "calib/files/text_file.h"
#include "recordings/bag_pictures.h"
#include "recordings/bags/bag.h"

namespace huetrack::recordings {
namespace {

constexpr std::int64_t longest_sigma_ns = 1'000'000'000;  // tracking is impossible with less certain clocks
constexpr double longest_s = 4e9;  // |time|; far beyond any recording, and within 64 bits of nanoseconds

// Nanoseconds survive even when the times are UNIX seconds.
capture::Duration exact_duration_of(double s) {
  return capture::Duration(std::llround(static_cast<long double>(s) * 1e9L));
}

// A CSV with a header line and the columns frame and t_s, optionally our own; others are ignored. A truncated last row
// (a full disk, a crash) is skipped with a warning.
class TimestampFile {
 public:
  TimestampFile(const std::filesystem::path& csv, RecordedCamera& camera)
      : csv_(csv), table_(csv, columns), camera_(camera) {}

  // Fills the camera.
  void read(std::vector<std::string>& warnings) {
    camera_.is_listed = true;
    camera_.times_file = csv_;
    camera_.times_unit = files::time_unit_of(table_.name(t_s)).value_or(0);
    if (is_ours()) table_.skip_truncated_row();  // our complete rows end with a line end
    while (table_.next())
      if (const auto problem = problem_of_row()) table_.fail(*problem);
    if (const auto line = table_.truncated_line())
      warnings.push_back(csv_.string() + ":" + std::to_string(*line) + ": the last row is cut off: it is left out");
    // Empty is valid only in our recordings, for a camera that delivered nothing.
    if (!is_ours() && camera_.timestamps.empty()) throw files::ConfigError(csv_, 0, "lists no frames");
  }

 private:
  enum Column : std::size_t { frame, t_s, sequence, arrival, stamp_s, clock, clock_sigma_ns };
  static constexpr std::string_view columns[] = {"frame",    "t_s|@time", "sequence?",      "arrival?",
                                                 "stamp_s?", "clock?",    "clock_sigma_ns?"};

  bool is_ours() const { return table_.has(sequence) && table_.has(arrival); }
  std::string quoted(Column column) const { return table_.quoted(column); }

  // Adds the row, or returns what is wrong with it.
  std::optional<std::string> problem_of_row() {
    const capture::Timestamp at = table_.time(t_s);
    if (is_too_long(at)) return table_.name(t_s) + " is " + quoted(t_s) + ", longer than any recording";
    RecordedCamera::Received received;
    if (is_ours()) {
      const auto sequence_number = files::number_of<std::uint32_t>(table_.text(sequence));
      const auto arrival_number = files::number_of<std::uint64_t>(table_.text(arrival));
      if (!sequence_number) return "sequence is " + quoted(sequence) + ", not an integer >= 0";
      if (!arrival_number) return "arrival is " + quoted(arrival) + ", not an integer >= 0";
      received = {.sequence = *sequence_number, .arrival = *arrival_number, .stamped_at = std::nullopt};
      if (table_.has(stamp_s)) {
        received.stamped_at = table_.time(stamp_s);
        if (is_too_long(*received.stamped_at)) return "stamp_s is " + quoted(stamp_s) + ", longer than any recording";
      }
      if (table_.has(clock) && table_.has(clock_sigma_ns)) {
        const auto of = files::number_of<std::uint16_t>(table_.text(clock));
        const auto sigma = files::number_of<std::int64_t>(table_.text(clock_sigma_ns));
        if (!of) return "clock is " + quoted(clock) + ", not an integer from 0 to 65535";
        if (!sigma || *sigma < 0 || *sigma > longest_sigma_ns)
          return "clock_sigma_ns is " + quoted(clock_sigma_ns) + ", not a time in nanoseconds from 0 to 10^9";
        received.clock = {.of = *of, .sigma = capture::Duration(*sigma)};
      }
    }
    if (table_.text(frame).empty() && is_ours()) {
      if (last_at_ && at <= *last_at_) return not_later(table_.quoted(t_s));
      camera_.corrupted.emplace_back(at, received);
      last_at_ = at;
      return std::nullopt;
    }
    const auto number = table_.whole_number(frame);
    if (!number || *number < 0) return "frame is " + quoted(frame) + ", not an integer >= 0";
    auto& rows = camera_.timestamps;
    if (!rows.empty() && *number <= rows.back().first)
      return "frame " + std::to_string(*number) + " does not come after frame " + std::to_string(rows.back().first) +
             " of the row before: sort the rows";
    if (last_at_ && at <= *last_at_) return not_later(table_.quoted(t_s));
    rows.emplace_back(*number, at);
    if (is_ours()) camera_.received.push_back(received);
    last_at_ = at;
    return std::nullopt;
  }

  static bool is_too_long(capture::Timestamp at) { return std::abs(capture::seconds(at)) >= longest_s; }
  std::string not_later(const std::string& t_s_text) const {
    return table_.name(t_s) + " " + t_s_text + " is not later than that of the row before: capture times must ascend";
  }

  std::filesystem::path csv_;
  files::CsvTable table_;
  RecordedCamera& camera_;
  std::optional<capture::Timestamp> last_at_;
};

// u, v, width, height. nullopt: they are none.
std::optional<capture::Crop> crop_of(std::span<const double> numbers) {
  for (const double number : numbers)
    if (number != std::floor(number) || number < 0 || number > 1e6) return std::nullopt;
  const capture::Crop crop{int(numbers[0]), int(numbers[1]), int(numbers[2]), int(numbers[3])};
  return crop.width > 0 && crop.height > 0 ? std::optional(crop) : std::nullopt;
}

void refuse_videos(const std::filesystem::path& file) {
  if (!is_video_or_picture(file)) return;  // the file's reader reports other problems
  throw files::ConfigError(file, 0,
                           "is a video or a picture, not a recording: that is a recording.yaml, which names the frames "
                           "of every camera: version: 1, cameras: {left: {frames: a.mp4, fps: 30}, right: ...}; in a "
                           "command, left=a.mp4 right=b.mp4 says the same");
}

}  // namespace

bool is_video_or_picture(const std::filesystem::path& file) {
  std::error_code unreadable;  // opening a pipe would block; the file's reader reports other problems
  if (!std::filesystem::is_regular_file(file, unreadable)) return false;
  std::ifstream stream(file, std::ios::binary);
  std::array<char, 12> bytes{};
  if (!stream.read(bytes.data(), bytes.size())) return false;
  const std::string_view head(bytes.data(), bytes.size());
  return head.starts_with("\x1a\x45\xdf\xa3") || head.starts_with("RIFF") || head.substr(4, 4) == "ftyp" ||
         head.starts_with("\xff\xd8\xff") || head.starts_with("\x89PNG");
}

capture::Crop crop_in(const yaml::YamlReader& mapping, std::string_view key) {
  const auto crop = crop_of(mapping.numbers(key, 4, 4, yaml::non_negative));
  if (!crop) mapping.fail(key, "is not [u, v, width, height] in whole pixels");
  return *crop;
}

std::pair<std::string, std::optional<capture::Crop>> split_crop(const std::string& frames,
                                                                const std::filesystem::path& file) {
  const auto at = frames.rfind('@');
  std::error_code none;
  if (at == std::string::npos || std::filesystem::exists(frames, none)) return {frames, std::nullopt};
  std::vector<double> numbers;
  std::string_view rest = std::string_view(frames).substr(at + 1);
  if (rest.find_first_not_of("0123456789.,- ") != std::string_view::npos) return {frames, std::nullopt};  // me@home.mp4
  for (auto comma = rest.find(','); !rest.empty(); comma = rest.find(',')) {
    const auto number = files::number_of<double>(std::string(rest.substr(0, comma)));
    if (!number) break;
    numbers.push_back(*number);
    rest.remove_prefix(comma == std::string_view::npos ? rest.size() : comma + 1);
  }
  const auto crop = rest.empty() && numbers.size() == 4 ? crop_of(numbers) : std::nullopt;
  if (!crop)
    throw files::ConfigError(file, 0,
                             "\"" + files::printable(frames) +
                                 "\" has no part of a picture behind its @: write @u,v,width,height in whole pixels, "
                                 "such as @640,0,640,480");
  return {frames.substr(0, at), crop};
}

RecordedCamera recorded_camera(const std::string& name, const std::string& frames, const std::filesystem::path& file) {
  RecordedCamera camera;
  camera.name = name;
  auto [path, crop] = split_crop(frames, file);
  camera.crop = crop;
  std::string topic;
  std::error_code none;
  if (const auto colon = path.rfind(":/");
      colon != std::string::npos && !std::filesystem::exists(path, none) && bags::is_bag(path.substr(0, colon))) {
    topic = path.substr(colon + 1);
    path.resize(colon);
  }
  camera.frames = std::filesystem::absolute(path).lexically_normal();
  if (bags::is_bag(camera.frames)) camera.topic = topic_of(camera.frames, name, topic);
  return camera;
}

Recording read_recording(const std::filesystem::path& path) {
  const auto absolute = std::filesystem::absolute(path);
  std::error_code unreadable;  // reported by the reader, with the file's name
  Recording recording{
      .file = std::filesystem::is_directory(absolute, unreadable) ? absolute / "recording.yaml" : absolute,
      .cameras = {},
      .warnings = {},
      .started_at = {}};
  recording.file = recording.file.lexically_normal();
  if (bags::is_bag(absolute)) return recording_of_bag(absolute.lexically_normal());
  const auto folder = recording.file.parent_path();
  refuse_videos(recording.file);
  if (const auto advice = advice_to_convert(recording.file); !advice.empty())
    throw files::ConfigError(recording.file, 0, advice);
  const auto yaml = yaml::YamlReader::file(recording.file);
  if (yaml.has("rosbag2_bagfile_information") && bags::is_bag(folder)) return recording_of_bag(folder);
  if (yaml.has("rig") || yaml.has("targets"))
    yaml.fail("",
              "this is a configuration, not a recording: a recording is a folder with a recording.yaml, which names "
              "each camera's frames");
  yaml.version(1);
  if (yaml.has("started_at"))
    recording.started_at =
        capture::Timestamp{exact_duration_of(yaml.number("started_at", {.min = 0, .max = longest_s}))};
  for (const auto& [name, entry] : yaml.named_maps("cameras")) {
    RecordedCamera camera;
    camera.name = name;
    if (entry.has("intrinsics"))
      yaml.fail("",
                "this is a rig, not a recording: a recording is a folder with a recording.yaml, which names each "
                "camera's frames");
    camera.frames = (folder / entry.string("frames")).lexically_normal();
    const std::string topic = entry.string("topic", "");
    if (bags::is_bag(camera.frames))
      camera.topic = topic_of(camera.frames, name, topic);
    else if (!topic.empty())
      entry.fail("topic", "is for a bag of ROS, and " + camera.frames.string() + " is none");
    if (entry.has("crop")) camera.crop = crop_in(entry, "crop");
    if (entry.has("fields")) {
      static constexpr std::array<std::string_view, 2> fields{"top", "bottom"};
      const bool is_top = entry.choice("fields", fields) == fields[0];
      camera.first_field = is_top ? capture::FirstField::top : capture::FirstField::bottom;
    }
    camera.bits = static_cast<int>(entry.integer("bits", {.min = 1, .max = 16}, 0));
    if (entry.has("fps")) camera.fps = entry.number("fps", {.min = 1e-3, .max = 1e6});
    camera.offset = exact_duration_of(entry.number("offset_s", {.min = -longest_s, .max = longest_s}, 0));
    camera.first_frame = entry.integer("first_frame", {.min = 0, .max = 1e12}, 0);
    camera.every = entry.integer("every", {.min = 1, .max = 1e9}, 1);
    if (entry.has("timestamps")) {
      if (camera.fps > 0) entry.fail("timestamps", "is given together with fps: keep the one that is true");
      const auto csv = (folder / entry.string("timestamps")).lexically_normal();
      TimestampFile(csv, camera).read(recording.warnings);
      if (camera.timestamps.empty() && camera.corrupted.empty())
        recording.warnings.push_back(csv.string() + ": lists no frames: camera " + name + " delivered none");
    }
    camera.trusts_times = entry.boolean("trust_times", false);
    if (camera.trusts_times && camera.fps == 0 && !entry.has("timestamps"))
      entry.fail("trust_times", "is for fps or timestamps, and neither is given");
    entry.finish();
    recording.cameras.push_back(std::move(camera));
  }
  if (recording.cameras.empty()) yaml.fail("cameras", "names no camera");
  if (std::ranges::all_of(recording.cameras,
                          [](const RecordedCamera& c) { return c.is_listed && c.timestamps.empty(); }))
    yaml.fail("cameras", "have no frames: the time-stamp file of none of them lists any");
  yaml.finish();
  return recording;
}

Recording read_recording(std::span<const std::string> words) {
  std::error_code none;
  if (words.size() == 1 && (words[0].find('=') == std::string::npos || std::filesystem::exists(words[0], none)))
    return read_recording(std::filesystem::path(words[0]));
  Recording recording{
      .file = fmt::format("{}", fmt::join(words, " ")), .cameras = {}, .warnings = {}, .started_at = {}};
  for (const std::string& word : words) {
    const auto equals = word.find('=');
    if (equals == std::string::npos || equals == 0 || equals + 1 == word.size() || files::has_control_characters(word))
      throw files::ConfigError(recording.file, 0,
                               "\"" + files::printable(word) +
                                   "\" is no CAMERA=FILE: a recording is a recording.yaml, or the folder that holds "
                                   "it, a ROS bag, or one CAMERA=FILE per camera: left=a.mp4 right=b.mp4");
    RecordedCamera camera = recorded_camera(word.substr(0, equals), word.substr(equals + 1), recording.file);
    if (std::ranges::find(recording.cameras, camera.name, &RecordedCamera::name) != recording.cameras.end())
      throw files::ConfigError(recording.file, 0, "names camera " + camera.name + " twice");
    recording.cameras.push_back(std::move(camera));
  }
  return recording;
}

}  // namespace huetrack::recordings
