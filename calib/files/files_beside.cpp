#include "calib/files/files_beside.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <system_error>
#include <vector>

#include "calib/files/file_order.h"
#include "calib/files/text_file.h"

namespace huetrack::files {

namespace fs = std::filesystem;

std::string files_beside(const fs::path& missing) {
  constexpr std::size_t shown = 4, most = 10000;  // capacity: names in a message, and names to choose from
  const fs::path folder = missing.has_parent_path() ? missing.parent_path() : fs::path(".");
  std::error_code error;
  const auto status = fs::status(folder, error);
  const bool is_glob = folder.string().find_first_of("*?[") != std::string::npos;
  if (status.type() == fs::file_type::not_found && is_glob) return {};
  if (status.type() == fs::file_type::not_found) return "; there is no folder " + printable(folder.string());
  std::vector<std::string> alike, others;
  for (fs::directory_iterator entry(folder, error), end; entry != end && !error; entry.increment(error)) {
    if (alike.size() + others.size() == most) break;
    const std::string name = entry->path().filename().string();
    std::error_code unknown;
    if (name.starts_with('.')) continue;
    if (!missing.has_extension() && entry->is_directory(unknown)) alike.push_back(name + "/");
    if (!entry->is_regular_file(unknown)) continue;
    (entry->path().extension() == missing.extension() ? alike : others).push_back(name);
  }
  std::vector<std::string>& names = alike.empty() ? others : alike;
  if (names.empty()) return {};
  std::ranges::sort(names);
  std::ranges::stable_sort(names, numbers_ascend);
  const bool has_more = names.size() > shown;
  if (has_more) names.resize(shown);
  for (std::string& name : names) name = printable(name);
  return fmt::format("; in that folder {} {}{}", names.size() == 1 ? "is" : "are", fmt::join(names, ", "),
                     has_more ? ", ..." : "");
}

}  // namespace huetrack::files
