#include "recordings/stream_parts.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "calib/files/config_error.h"
#include "calib/files/file_order.h"
#include "calib/files/nearest_word.h"
#include "capture/ffmpeg/ffmpeg_log.h"
#include "capture/ffmpeg/ffmpeg_objects.h"
#include "recordings/recording.h"

namespace huetrack::recordings {
namespace {

namespace fs = std::filesystem;

// Between two parts of one film; takes begin anew, or later. Sound ends a little later, or earlier, than the picture.
constexpr double longest_break_s = 1, longest_overlap_s = 0.2;

bool is_transport_stream(const fs::path& file) {
  const std::string ending = files::to_lower_ascii(file.extension().string());
  static constexpr std::array endings{".mts", ".m2ts", ".m2t", ".ts"};
  std::error_code error;
  return std::ranges::find(endings, ending) != endings.end() && fs::is_regular_file(file, error);
}

bool has_parts(const fs::path& folder) {
  std::error_code error;
  const fs::directory_iterator entries(folder, error);
  return !error && std::ranges::any_of(entries, [](const auto& entry) { return is_transport_stream(entry.path()); });
}

// A camcorder's card, or a folder of it.
std::optional<fs::path> folder_of_parts(const fs::path& folder) {
  for (const char* inner : {"", "STREAM", "BDMV/STREAM", "AVCHD/BDMV/STREAM", "PRIVATE/AVCHD/BDMV/STREAM"})
    if (has_parts(folder / inner)) return folder / inner;
  return std::nullopt;
}

struct TimeSpan {
  double from_s = 0, to_s = 0;
};

// By the container; nullopt: it does not say, which its reader will report.
std::optional<TimeSpan> time_span_of(const fs::path& part) {
  capture::FfmpegLog log;
  const capture::FfmpegLogScope scope(log);
  AVDictionary* options = nullptr;
  av_dict_set(&options, "protocol_whitelist", "file", 0);
  av_dict_set(&options, "format_whitelist", "mpegts", 0);
  AVFormatContext* opened = nullptr;
  const int error = avformat_open_input(&opened, ("file:" + part.string()).c_str(), nullptr, &options);
  av_dict_free(&options);
  if (error < 0) return std::nullopt;
  const capture::InputPtr format(opened);
  if (avformat_find_stream_info(opened, nullptr) < 0 || opened->start_time == AV_NOPTS_VALUE || opened->duration <= 0)
    return std::nullopt;
  const double from = static_cast<double>(opened->start_time) / AV_TIME_BASE;
  return TimeSpan{from, from + static_cast<double>(opened->duration) / AV_TIME_BASE};
}

}  // namespace

std::vector<fs::path> stream_parts(const fs::path& frames, std::vector<std::string>& warnings) {
  std::vector<fs::path> parts;
  std::error_code error;
  if (fs::is_directory(frames, error)) {
    for (const auto& entry : fs::directory_iterator(folder_of_parts(frames).value_or(frames), error))
      if (is_transport_stream(entry.path())) parts.push_back(entry.path());
    files::sort_by_numbers(parts);
  } else if (frames.string().find_first_of("*?[") != std::string::npos) {
    parts = files::files_of_glob(frames.string());
    if (!std::ranges::all_of(parts, is_transport_stream)) return {};
  }
  capture::take_over_ffmpeg_log();
  std::optional<TimeSpan> before;
  for (std::size_t i = 0; i < parts.size() && parts.size() > 1; ++i) {
    const auto span = time_span_of(parts[i]);
    if (span && before &&
        (span->from_s > before->to_s + longest_break_s || span->from_s < before->to_s - longest_overlap_s))
      throw files::ConfigError(parts[i], 0,
                               fmt::format("begins at {:.1f} s by its time stamps, and {} ends at {:.1f} s: these are "
                                           "several takes, not the parts of one: put the parts of one take into a "
                                           "folder of their own; if its clock begins anew in every part, {}",
                                           span->from_s, parts[i - 1].filename().string(), before->to_s, how_to_join));
    if (span && before && span->from_s > before->to_s + longest_overlap_s)
      warnings.push_back(
          fmt::format("{}: begins {:.2f} s after {} ends, by their time stamps: a part is missing between them; give "
                      "neither fps nor timestamps, so that later pictures keep their times",
                      parts[i].string(), span->from_s - before->to_s, parts[i - 1].filename().string()));
    before = span;
  }
  return parts;
}

bool is_split_film(const fs::path& folder) {
  std::error_code error;
  return fs::is_directory(folder, error) && folder_of_parts(folder);
}

}  // namespace huetrack::recordings
