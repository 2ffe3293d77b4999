#include "recordings/image_series.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <optional>
#include <string_view>
#include <utility>

#include "calib/files/config_error.h"
#include "calib/files/file_order.h"
#include "calib/files/files_beside.h"
#include "calib/files/number_text.h"

namespace huetrack::recordings {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view digits = "0123456789";

// The number that a name has in place of a pattern's %d, as printf writes it: zero-padded up to the width.
std::optional<std::int64_t> printed_number(std::string_view text, std::size_t width) {
  const bool is_padded_enough = text.size() >= width;
  const std::string_view unsigned_part = text.substr(text.starts_with('-') ? 1 : 0);
  if (!is_padded_enough || unsigned_part.empty() || unsigned_part.find_first_not_of(digits) != std::string_view::npos ||
      (text.size() > std::max<std::size_t>(width, 1) && unsigned_part.size() > 1 && unsigned_part.front() == '0'))
    return std::nullopt;
  std::int64_t number = 0;
  const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), number);
  return problem == std::errc{} && end == text.data() + text.size() ? std::optional(number) : std::nullopt;
}

// The files of a printf pattern like cam0/%06d.png, by number; the pattern has exactly one %d in its last part.
std::vector<ImageFile> files_of_pattern(const fs::path& pattern) {
  const std::string name = pattern.filename().string();
  const std::size_t begin = name.find('%');
  std::size_t at = begin == std::string::npos ? name.size() : begin + 1;
  std::size_t width = 0;
  while (at < name.size() && name[at] >= '0' && name[at] <= '9' && width < 100)
    width = 10 * width + static_cast<std::size_t>(name[at++] - '0');
  if (at >= name.size() || name[at] != 'd' || name.find('%', at) != std::string::npos)
    throw files::ConfigError(pattern, 0,
                             "is not a pattern of image files: its last part must have one number like %06d; for other "
                             "numbers (%x) give a glob, like *.png");
  const std::string_view prefix = std::string_view(name).substr(0, begin);
  const std::string_view suffix = std::string_view(name).substr(at + 1);

  std::vector<ImageFile> files;
  std::optional<fs::path> padded_otherwise;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(pattern.parent_path(), error)) {
    const std::string file = entry.path().filename().string();
    if (file.size() <= prefix.size() + suffix.size() || !file.starts_with(prefix) || !file.ends_with(suffix)) continue;
    const auto text = std::string_view(file).substr(prefix.size(), file.size() - prefix.size() - suffix.size());
    const auto number = printed_number(text, width);
    if (number)
      files.push_back({*number, *number, entry.path()});
    else if (text.find_first_not_of(digits) == std::string_view::npos)
      padded_otherwise = padded_otherwise ? std::min(*padded_otherwise, entry.path()) : entry.path();
  }
  if (padded_otherwise && !files.empty())
    throw files::ConfigError(*padded_otherwise, 0,
                             fmt::format("has other leading zeros than the pattern {}, which takes {}, so it would be "
                                         "left out: for both give the glob \"{}*{}\", which counts by numbers",
                                         name, files.front().path.filename().string(), prefix, suffix));
  std::ranges::sort(files, {}, &ImageFile::number);
  if (!files.empty() && files.back().number < 0)
    throw files::ConfigError(pattern, 0,
                             "all its numbers are negative, such as " + files.front().path.filename().string() +
                                 ": if the - is a separator, write it into the pattern, before the %");
  if (!files.empty())
    for (const std::int64_t first = files.front().number; auto& file : files) file.number -= first;
  return files;
}

// A glob counts files, so a missing one shifts the times of all that follow. Index of the first file after a gap in
// numbers that otherwise go up by one.
std::optional<std::size_t> after_a_gap(const std::vector<fs::path>& files) {
  const auto numbers = files::last_numbers(files);
  std::optional<std::size_t> after;
  std::size_t gaps = 0;
  for (std::size_t k = 1; k < numbers.size(); ++k) {
    if (numbers[k] <= numbers[k - 1]) return std::nullopt;
    if (numbers[k] != numbers[k - 1] + 1 && ++gaps == 1) after = k;
  }
  constexpr std::size_t one_in = 5;  // more gaps: numbered in steps
  return gaps * one_in < files.size() ? after : std::nullopt;
}

// Cameras count to IMG_9999 and begin again: by numbers, the last pictures come first.
bool is_counter_begun_again(const std::vector<fs::path>& files) {
  const auto digits_of = [](const fs::path& file) {
    const std::string name = file.stem().string();
    const std::size_t above = name.find_last_not_of(digits);
    return name.substr(above == std::string::npos ? 0 : above + 1);
  };
  if (!after_a_gap(files)) return false;
  const std::string first = digits_of(files.front()), last = digits_of(files.back());
  return last.size() > 1 && last.find_first_not_of('9') == std::string::npos &&
         files::number_of<std::int64_t>(first).value_or(2) <= 1;
}

// left_*[0-9].jpg of left_0001.jpg, which right_0001.jpg and left_0001_copy.jpg do not match.
std::string glob_of_series(const fs::path& file) {
  std::string name = file.filename().string();
  const std::size_t end = file.stem().string().find_last_of(digits) + 1;  // npos + 1 is 0
  const std::size_t above = end > 0 ? name.find_last_not_of(digits, end - 1) : 0;
  const std::size_t begin = above == std::string::npos ? 0 : above + 1;
  return end > 0 ? name.replace(begin, end - begin, "*[0-9]") : name;
}

// frame_*.jpg of frame_*[0-9].jpg and frame_%04d.jpg.
std::string with_any_number(const fs::path& pattern) {
  std::string name = pattern.filename().string();
  for (const auto& [from, to] : {std::pair{'[', ']'}, {'%', 'd'}})
    for (std::size_t begin = 0; (begin = name.find(from, begin)) != std::string::npos;) {
      const std::size_t end = name.find(to, begin);
      if (end == std::string::npos) break;
      name.replace(begin, end + 1 - begin, "*");
    }
  while (name.find("**") != std::string::npos) name.erase(name.find("**"), 1);
  return (pattern.parent_path() / name).string();
}

// Throws if the pattern leaves out pictures with letters in a hexadecimal number: the rest is not the series.
void refuse_a_part_of_hexadecimal(const RecordedCamera& camera, const std::vector<ImageFile>& files) {
  const std::string wider = with_any_number(camera.frames);
  if (wider == camera.frames || camera.trusts_times || !camera.timestamps.empty()) return;
  std::vector<fs::path> paths, all;
  for (const ImageFile& file : files) paths.push_back(file.path);
  try {
    all = files::files_of_glob(wider);
  } catch (const files::ConfigError&) {  // of other files
    return;
  }
  if (const auto left_out = files::hexadecimal_left_out(paths, std::move(all)))
    throw files::ConfigError(camera.frames, 0,
                             "leaves out " + left_out->filename().string() +
                                 ": the numbers of the pictures are hexadecimal: give \"" +
                                 fs::path(wider).filename().string() + "\" (frames of camera " + camera.name + ")");
}

std::vector<ImageFile> files_of_glob(const RecordedCamera& camera) {
  const auto paths = files::files_of_glob(camera.frames.string());
  if (is_counter_begun_again(paths))
    throw files::ConfigError(camera.frames, 0,
                             "the numbers of the pictures begin again after " + paths.back().filename().string() +
                                 ": by numbers the later ones would come first; rename those from " +
                                 paths.front().filename().string() + " on, as to 10000 and so on (frames of camera " +
                                 camera.name + ")");
  if (const auto series = files::several_series(paths); camera.timestamps.empty() && !series.empty())
    throw files::ConfigError(camera.frames, 0,
                             "matches several series of pictures, which count the same: that of " +
                                 series[0].filename().string() + " and that of " + series[1].filename().string() +
                                 ": name one, as \"" + glob_of_series(series[0]) + "\" (frames of camera " +
                                 camera.name + ")");
  if (const auto two = files::letters_in_numbers(paths); camera.timestamps.empty() && !two.empty())
    throw files::ConfigError(camera.frames, 0,
                             "the order of the files is not known: " + two[1].filename().string() +
                                 " has a letter where " + two[0].filename().string() +
                                 " has a digit, as hexadecimal numbers have, of which others are missing: if " +
                                 two[1].filename().string() +
                                 " is no picture of the series, move it to another folder; otherwise number all in the "
                                 "order in which they were taken (frames of camera " +
                                 camera.name + ")");
  // Whoever lists times for the files knows their order.
  if (camera.timestamps.empty() && !files::hold_an_order(paths))
    throw files::ConfigError(camera.frames, 0,
                             "the names of the files hold no order, such as " + paths.front().filename().string() +
                                 " and " + paths.back().filename().string() +
                                 ": number them in the order in which they were taken (frames of camera " +
                                 camera.name + ")");
  std::vector<ImageFile> files;
  for (const fs::path& path : paths) {
    const auto number = static_cast<std::int64_t>(files.size());
    files.push_back({number, number, path});
  }
  if (const auto named = files::last_numbers(paths); after_a_gap(paths))
    for (std::size_t k = 0; k < files.size(); ++k) files[k].named = static_cast<std::int64_t>(named[k]);
  return files;
}

}  // namespace

std::vector<ImageFile> image_files_of(const RecordedCamera& camera) {
  const bool is_pattern = camera.frames.filename().string().find('%') != std::string::npos;
  const bool is_glob = camera.frames.string().find_first_of("*?[") != std::string::npos;
  std::error_code error;
  if ((!is_pattern && !is_glob) || fs::exists(camera.frames, error)) return {};
  auto files = is_pattern ? files_of_pattern(camera.frames) : files_of_glob(camera);
  if (files.empty())
    throw files::ConfigError(camera.frames, 0,
                             "no file matches this pattern" + files::files_beside(camera.frames) +
                                 " (frames of camera " + camera.name + ")");
  refuse_a_part_of_hexadecimal(camera, files);
  return files;
}

}  // namespace huetrack::recordings
