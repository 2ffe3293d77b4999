#include "calib/gather/write_file.h"

#include "calib/yaml/output_file.h"

namespace huetrack::gather {

void write_file(const std::filesystem::path& file, const std::string& text) {
  yaml::refuse_other_kind(file, {"page or report of huetrack's", [](std::string_view begin) {
                                   return begin.starts_with("<!doctype html") || begin.find("USABLE") != begin.npos ||
                                          begin.find("DOUBTFUL") != begin.npos || begin.find("FAILED") != begin.npos;
                                 }});
  yaml::write_whole_file(file, text);
}

}  // namespace huetrack::gather
