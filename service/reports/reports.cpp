#include "reports/reports.h"

#include <algorithm>
#include <iterator>

namespace huetrack::reports {

Reports::Reports(pipeline::Session& session, const ReportsOptions& options)
    : light(session.config(), options.is_recorded),
      mistakes(session.config(), options.is_recorded),
      objects(session.config()),
      rig(session.config()),
      times(session.config(), options.write_rig, options.is_logging_times, &rig) {
  session.add(light);
  session.add(mistakes);
  session.add(objects);
  session.add(rig);
  session.add(times);
}

std::vector<std::string> Reports::warnings() const {
  std::vector<std::string> out = mistakes.warnings();
  for (const std::vector<std::string>& more : {objects.warnings(), light.warnings(), times.warnings(), rig.warnings()})
    std::ranges::copy(more, std::back_inserter(out));
  return out;
}

}  // namespace huetrack::reports
