#include "calib/model/missing_links.h"

#include <algorithm>
#include <tuple>

namespace huetrack::calib {

std::vector<CameraLink> missing_links(std::size_t cameras, const std::function<int(std::size_t, std::size_t)>& shared,
                                      int enough) {
  std::vector<CameraLink> links;
  for (std::size_t a = 0; a < cameras; ++a)
    for (std::size_t b = a + 1; b < cameras; ++b) links.push_back({a, b, shared(a, b)});
  std::ranges::stable_sort(links, std::ranges::greater{}, &CameraLink::shared);
  std::vector<std::size_t> group(cameras);
  for (std::size_t c = 0; c < cameras; ++c) group[c] = c;
  std::vector<CameraLink> missing;
  for (const CameraLink& link : links) {
    const std::size_t into = group[link.a], from = group[link.b];
    if (into == from) continue;
    std::ranges::replace(group, from, into);
    if (link.shared < enough) missing.push_back(link);
  }
  std::ranges::sort(missing, {}, [](const CameraLink& link) { return std::tuple(link.a, link.b); });
  return missing;
}

}  // namespace huetrack::calib
