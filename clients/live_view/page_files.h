// The page's files, linked into the program. Pure.
#pragma once

#include <optional>
#include <string_view>

namespace huetrack::live_view {

struct PageFile {
  std::string_view content;
  const char* type;  // MIME
};
std::optional<PageFile> page_file(std::string_view path);  // "/", "/page.js", ...

}  // namespace huetrack::live_view
