// Shared by all HTML reports. Private to this module.
#pragma once

#include <string>
#include <string_view>

#include "drawing/markup.h"

namespace huetrack::report {

using drawing::escaped;
std::string html_head(std::string_view title);  // up to the content of the body

}  // namespace huetrack::report
