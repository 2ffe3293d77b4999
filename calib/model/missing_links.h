// Which pairs of cameras still need common views, for advice while a board is carried or a ball is waved.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

namespace huetrack::calib {

struct CameraLink {
  std::size_t a = 0, b = 0;  // camera indices, a < b
  int shared = 0;            // views (or moments) that both saw
};

// The links still needed to connect all cameras, directly or through others: those of the maximum spanning tree
// (Kruskal) with fewer than `enough` shared views, in camera order.
//   shared  number of shared views of two cameras, the smaller index first
std::vector<CameraLink> missing_links(std::size_t cameras, const std::function<int(std::size_t, std::size_t)>& shared,
                                      int enough);

}  // namespace huetrack::calib
