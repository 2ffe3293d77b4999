// Text in SVG and HTML.
#pragma once

#include <string>
#include <string_view>

namespace huetrack::drawing {

std::string escaped(std::string_view text);  // for an element's text, and for attributes in double quotes

}  // namespace huetrack::drawing
