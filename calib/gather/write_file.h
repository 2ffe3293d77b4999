// Writes pages and reports atomically.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace huetrack::gather {

struct FileToWrite {
  std::filesystem::path file;
  std::string text;  // HTML, a PDF, or report::to_text()
};

// Each file may replace only its own kind (page, PDF, report text); if one may not be written, none is.
// throws std::system_error, std::runtime_error; both name the file
void write_files(const std::vector<FileToWrite>& files);

}  // namespace huetrack::gather
