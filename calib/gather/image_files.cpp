#include "calib/gather/image_files.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <map>
#include <set>

#include "calib/files/file_order.h"
#include "calib/files/nearest_word.h"
#include "calib/files/number_text.h"
#include "calib/gather/picture_source.h"

namespace huetrack::gather {
namespace {

namespace fs = std::filesystem;

using files::is_digit;

std::optional<long> last_number(const fs::path& file) {
  const std::string stem = file.stem().string();
  std::size_t end = stem.size();
  while (end > 0 && !is_digit(stem[end - 1])) --end;
  std::size_t begin = end;
  while (begin > 0 && is_digit(stem[begin - 1])) --begin;
  if (begin == end || end - begin > 15) return std::nullopt;
  return std::stol(stem.substr(begin, end - begin));
}

// Matches a printf pattern: digits in place of %d, %04d.
std::string as_glob(const std::string& pattern) {
  std::string glob;
  for (std::size_t i = 0; i < pattern.size();) {
    std::size_t end = i + 1;
    while (end < pattern.size() && is_digit(pattern[end])) ++end;
    if (pattern[i] == '%' && end < pattern.size() && pattern[end] == 'd') {
      glob += "[0-9]*";
      i = end + 1;
    } else {
      glob += pattern[i++];
    }
  }
  return glob;
}

}  // namespace

bool is_image_file(const fs::path& file) {
  static constexpr std::array extensions{".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".pgm", ".ppm", ".webp"};
  return std::ranges::find(extensions, files::to_lower_ascii(file.extension().string())) != extensions.end();
}

bool is_video_file(const fs::path& file) {
  static constexpr std::array extensions{".mkv", ".mp4",  ".avi",   ".mov", ".webm", ".mpg", ".mpeg",
                                         ".m4v", ".mjpg", ".mjpeg", ".mts", ".m2ts", ".ts"};
  return std::ranges::find(extensions, files::to_lower_ascii(file.extension().string())) != extensions.end();
}

std::vector<fs::path> image_files(const fs::path& given) {
  std::vector<fs::path> files;
  std::error_code error;
  const std::string text = given.string();
  if (fs::is_directory(given, error)) {
    for (const auto& entry : fs::directory_iterator(given)) {
      if (entry.is_regular_file() && is_image_file(entry.path())) files.push_back(entry.path());
    }
  } else if (fs::exists(given, error)) {
    if (is_image_file(given)) files.push_back(given);
  } else if (text.find_first_of("*?[") != std::string::npos || text.find('%') != std::string::npos) {
    std::ranges::copy_if(files::files_of_glob(as_glob(text)), std::back_inserter(files), is_image_file);
  }
  files::sort_by_numbers(files);
  return files;
}

std::vector<ImageSet> paired_images(const std::vector<std::string>& cameras,
                                    const std::vector<std::vector<fs::path>>& files) {
  std::map<long, ImageSet> by_number;
  bool numbered = true;
  for (std::size_t c = 0; c < files.size() && numbered; ++c) {
    std::set<long> own;
    for (const fs::path& file : files[c]) {
      const auto number = last_number(file);
      numbered = numbered && number && own.insert(*number).second;
      if (!numbered) break;
      ImageSet& set = by_number[*number];
      set.number = *number;
      set.files.resize(files.size());
      set.files[c] = file;
    }
  }
  const auto shared = std::ranges::count_if(by_number, [](const auto& entry) {
    return std::ranges::count_if(entry.second.files, [](const auto& file) { return file.has_value(); }) > 1;
  });
  std::vector<ImageSet> sets;
  if (numbered && (files.size() == 1 || shared > 0)) {
    for (auto& [number, set] : by_number) sets.push_back(std::move(set));
    return sets;
  }
  for (std::size_t c = 1; c < files.size(); ++c) {
    if (files[c].size() != files[0].size()) {
      throw InputError("the images cannot be grouped: camera " + cameras[0] + " has " +
                       std::to_string(files[0].size()) + ", camera " + cameras[c] + " has " +
                       std::to_string(files[c].size()) +
                       "; give images of the same moment the same number: left07.jpg, right07.jpg");
    }
  }
  for (std::size_t k = 0; k < files[0].size(); ++k) {
    sets.push_back({static_cast<long>(k), {}});
    for (const auto& own : files) sets.back().files.emplace_back(own[k]);
  }
  return sets;
}

}  // namespace huetrack::gather
