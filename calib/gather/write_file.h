// Pages and reports: there whole or not at all.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace huetrack::gather {

struct FileToWrite {
  std::filesystem::path file;
  std::string text;  // HTML, a PDF, or report::to_text()
};

// Each replaces what is of its own form (a page, a PDF, a report as text), and nothing else: where one may not be
// written, none is. throws std::system_error, std::runtime_error; both name the file
void write_files(const std::vector<FileToWrite>& files);

}  // namespace huetrack::gather
