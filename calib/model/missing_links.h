// Which cameras are not yet held together by what they saw together: for people who carry a board or wave a ball.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

namespace huetrack::calib {

struct CameraLink {
  std::size_t a = 0, b = 0;  // numbers of cameras, a < b
  int shared = 0;            // views, or moments, that both saw
};

// The links that still have to be made so that every camera hangs together with every other one, over others if need
// be; of all that would do it, those that lack least: their sum is the largest. In the order of their cameras.
//   shared  of two cameras, the first number the smaller
//   enough  of what is shared, for a link that holds
std::vector<CameraLink> missing_links(std::size_t cameras, const std::function<int(std::size_t, std::size_t)>& shared,
                                      int enough);

}  // namespace huetrack::calib
