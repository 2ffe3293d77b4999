#include "drawing/markup.h"

#include <map>

namespace huetrack::drawing {

std::string escaped(std::string_view text) {
  static const std::map<char, std::string> marks{{'&', "&amp;"}, {'<', "&lt;"}, {'>', "&gt;"}, {'"', "&quot;"}};
  std::string out;
  for (const char c : text) {
    const auto mark = marks.find(c);
    out += mark == marks.end() ? std::string(1, c) : mark->second;
  }
  return out;
}

}  // namespace huetrack::drawing
