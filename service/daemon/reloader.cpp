#include "daemon/reloader.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "daemon/service_manager.h"

namespace huetrack::daemon {

std::string reload(pipeline::Session& session) {
  const std::string file = session.config().file.string();
  try {
    const pipeline::Session::TakenOver result = session.take_over(config::load_service_config(file));
    if (!result.waiting.empty())
      spdlog::warn("reload: {} changed, too: that takes effect at the next start", fmt::join(result.waiting, ", "));
    set_log_level(session.config().log_level);
    if (result.searched_anew.empty()) {
      spdlog::info("reloaded {}: nothing to change", file);
    } else {
      spdlog::info("reloaded {}: searching anew for {}", file, fmt::join(result.searched_anew, ", "));
    }
  } catch (const std::exception& error) {  // the file is not fit to run on, for whatever reason
    spdlog::error("reload refused, running on with the old configuration: {}", error.what());
    return error.what();
  }
  return "";
}

}  // namespace huetrack::daemon
