#include "capture/recording.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <string_view>

#include "calib/yaml/yaml_reader.h"

namespace huetrack::capture {
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

std::optional<std::size_t> column_of(const std::vector<std::string_view>& header, std::string_view key) {
  const auto found = std::ranges::find(header, key);
  return found == header.end() ? std::nullopt : std::optional(static_cast<std::size_t>(found - header.begin()));
}

// Fills the camera with the rows of a file with a header line and the columns frame and t_s; sequence and arrival where
// they are there; others are ignored. A last row that is cut off (a full disk, a crash) is left out with a warning.
class TimestampFile {
 public:
  TimestampFile(std::filesystem::path csv, RecordedCamera& camera, std::vector<std::string>& warnings)
      : csv_(std::move(csv)), camera_(camera), warnings_(warnings) {
    std::ifstream in(csv_);
    if (!in || std::filesystem::is_directory(csv_)) fail(0, "cannot be read: no such time-stamp file");
    std::string line;
    while (std::getline(in, line)) {
      ++number_;
      if (in.eof() && is_ours() && !line.empty()) {  // our rows end with a line end, or were not written to their end
        warnings_.push_back(csv_.string() + ":" + std::to_string(number_) +
                            ": the last row is cut off: it is left out");
        break;
      }
      if (line.ends_with('\r')) line.pop_back();
      if (number_ == 1)
        read_header(line);
      else if (line.find_first_not_of(" \t") != std::string::npos)
        if (const auto problem = problem_of(fields_of(line))) fail(number_, *problem);
    }
    if (number_ == 0) fail(0, "is empty: it must begin with the header frame,t_s");
    // A camera of ours may have delivered nothing; others' files without rows are a mistake.
    if (!is_ours() && camera_.timestamps.empty()) fail(0, "lists no frames");
  }

 private:
  bool is_ours() const { return sequence_column_ && arrival_column_; }
  [[noreturn]] void fail(int line, const std::string& what) const { throw yaml::ConfigError(csv_, line, what); }

  void read_header(std::string line) {
    if (line.starts_with("\xEF\xBB\xBF")) line.erase(0, 3);  // the byte order mark that spreadsheets write
    const auto header = fields_of(line);
    const auto required = [&](std::string_view key) {
      const auto column = column_of(header, key);
      if (!column) fail(1, "the header has no column " + std::string(key) + ": it must be frame,t_s[,...]");
      return *column;
    };
    frame_column_ = required("frame");
    time_column_ = required("t_s");
    sequence_column_ = column_of(header, "sequence");
    arrival_column_ = column_of(header, "arrival");
    column_count_ = header.size();
  }

  // Takes the row, or says what is wrong with it.
  std::optional<std::string> problem_of(const std::vector<std::string_view>& fields) {
    const std::size_t needed = is_ours() ? column_count_ : std::max(frame_column_, time_column_) + 1;
    if (fields.size() < needed) return "has " + std::to_string(fields.size()) + " columns, fewer than the header";
    const auto text_of = [&](std::size_t column) { return std::string("'").append(fields[column]).append("'"); };

    const auto t_s = parse<long double>(fields[time_column_]);
    if (!t_s || !(std::fabs(*t_s) < static_cast<long double>(longest_s)))
      return "t_s is " + text_of(time_column_) + ", not a time in seconds";
    const Timestamp at{exact_duration_of(*t_s)};
    RecordedCamera::Received received;
    if (is_ours()) {
      const auto sequence = parse<std::uint32_t>(fields[*sequence_column_]);
      const auto arrival = parse<std::uint64_t>(fields[*arrival_column_]);
      if (!sequence) return "sequence is " + text_of(*sequence_column_) + ", not an integer >= 0";
      if (!arrival) return "arrival is " + text_of(*arrival_column_) + ", not an integer >= 0";
      received = {.sequence = *sequence, .arrival = *arrival};
    }
    if (fields[frame_column_].empty() && is_ours()) {
      if (last_at_ && at <= *last_at_) return not_later(fields[time_column_]);
      camera_.corrupted.emplace_back(at, received);
      last_at_ = at;
      return std::nullopt;
    }
    const auto frame = parse<std::int64_t>(fields[frame_column_]);
    if (!frame || *frame < 0) return "frame is " + text_of(frame_column_) + ", not an integer >= 0";
    auto& rows = camera_.timestamps;
    if (!rows.empty() && *frame <= rows.back().first)
      return "frame " + std::to_string(*frame) + " does not come after frame " + std::to_string(rows.back().first) +
             " of the row before: sort the rows";
    if (last_at_ && at <= *last_at_) return not_later(fields[time_column_]);
    rows.emplace_back(*frame, at);
    if (is_ours()) camera_.received.push_back(received);
    last_at_ = at;
    return std::nullopt;
  }

  static std::string not_later(std::string_view t_s) {
    return "t_s " + std::string(t_s) + " is not later than that of the row before: capture times must ascend";
  }

  const std::filesystem::path csv_;
  RecordedCamera& camera_;
  std::vector<std::string>& warnings_;
  int number_ = 0;
  std::size_t frame_column_ = 0, time_column_ = 0, column_count_ = 0;
  std::optional<std::size_t> sequence_column_, arrival_column_;
  std::optional<Timestamp> last_at_;
};

}  // namespace

Recording read_recording(const std::filesystem::path& path) {
  const auto absolute = std::filesystem::absolute(path);
  Recording recording{.file = std::filesystem::is_directory(absolute) ? absolute / "recording.yaml" : absolute,
                      .cameras = {},
                      .warnings = {},
                      .started_at = {}};
  recording.file = recording.file.lexically_normal();
  const auto folder = recording.file.parent_path();
  const auto yaml = yaml::YamlReader::file(recording.file);
  if (const auto version = yaml.integer("version", yaml::any_number); version != 1)
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
      const auto csv = (folder / entry.string("timestamps")).lexically_normal();
      TimestampFile(csv, camera, recording.warnings);
      camera.is_listed = true;
      if (camera.timestamps.empty() && camera.corrupted.empty())
        recording.warnings.push_back(csv.string() + ": lists no frames: camera " + name + " delivered none");
    }
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

}  // namespace huetrack::capture
