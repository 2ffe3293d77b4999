#include "object_tracking/trackers/shared_times.h"

#include <vector>

namespace huetrack::object_trackers {

using object_tracking::TimesInformation;

void share_times(std::span<const TimesHolder> holders) {
  if (holders.empty()) return;
  std::vector<TimesInformation> shown;
  TimesInformation all = holders.front().filter->motion().unshared_times();
  all.matrix.setZero(), all.vector.setZero();
  const ObjectFilter* sure = nullptr;
  for (const auto& [filter, is_sure] : holders) {
    shown.push_back(filter->motion().unshared_times());
    if (!is_sure) continue;
    all.matrix += shown.back().matrix, all.vector += shown.back().vector;
    sure = filter;
  }
  if (sure == nullptr) return;
  for (std::size_t i = 0; i < holders.size(); ++i) {
    const auto& [filter, is_sure] = holders[i];
    TimesInformation by_others = all;
    if (is_sure) by_others.matrix -= shown[i].matrix, by_others.vector -= shown[i].vector;
    filter->adopt_shared(*sure, by_others);
    if (is_sure) filter->motion().set_times_shared();
  }
}

}  // namespace huetrack::object_trackers
