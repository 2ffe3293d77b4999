// Sentences about setup mistakes. Pure.
#pragma once

#include <string>
#include <vector>

#include "object_tracking/tracker_options.h"
#include "view_watch/view_watch.h"

namespace huetrack::reports {

// "cam1 disagrees with the others by 8 px, and by more the faster ball moves: it is about 0.20 s late: ...".
// cameras: names, in the order of the rig. is_recorded: the advice is about files and videos; otherwise about cameras.
// are_times_in_doubt: other warnings name time stamps that are wrong or unknown, which are to be corrected first.
std::string mistake_text(const view_watch::Mistake& mistake, const object_tracking::TargetOptions& target,
                         const std::vector<std::string>& cameras, bool is_recorded, bool are_times_in_doubt = false);

}  // namespace huetrack::reports
