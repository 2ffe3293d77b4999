#include "calib/gather/write_file.h"

#include <string_view>

#include "calib/files/output_file.h"
#include "calib/report/calibration_report.h"

namespace huetrack::gather {
namespace {

constexpr files::FileKind page{"page", [](std::string_view text) { return text.starts_with("<!doctype html"); }},
    pdf{"PDF", [](std::string_view text) { return text.starts_with("%PDF"); }},
    report_text{"report of huetrack's", report::begins_a_report};

const files::FileKind& kind_of(std::string_view text) {
  return page.begins(text) ? page : pdf.begins(text) ? pdf : report_text;
}

}  // namespace

void write_files(const std::vector<FileToWrite>& files) {
  for (const FileToWrite& one : files) files::refuse_other_kind(one.file, kind_of(one.text));
  for (const FileToWrite& one : files) files::write_whole_file(one.file, one.text);
}

}  // namespace huetrack::gather
