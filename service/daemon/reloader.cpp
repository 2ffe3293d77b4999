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
      spdlog::warn("reload: {} also changed: restart to apply", fmt::join(result.waiting, ", "));
    set_log_level(session.config().log_level);
    if (result.searched_anew.empty()) {
      spdlog::info("reloaded {}: nothing has changed", file);
    } else {
      spdlog::info("reloaded {}: searching again for {}", file, fmt::join(result.searched_anew, ", "));
    }
  } catch (const std::exception& error) {  // invalid file
    spdlog::error("reload refused, continuing with the old configuration: {}", error.what());
    return error.what();
  }
  return "";
}

}  // namespace huetrack::daemon
