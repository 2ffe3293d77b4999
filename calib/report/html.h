// What all reports' pages have in common. Private to this module.
#pragma once

#include <string>
#include <string_view>

namespace huetrack::report {

std::string escaped(std::string_view text);     // for HTML's text and for attributes in either quotes
std::string html_head(std::string_view title);  // up to where the body's contents begin

}  // namespace huetrack::report
