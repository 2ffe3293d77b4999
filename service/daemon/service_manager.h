// What a service manager (systemd) is told, and how the log looks under it. Without one, nothing happens.
#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "config/service_config.h"

namespace huetrack::daemon {

// Assignments as in sd_notify(3), "READY=1\nSTATUS=...", to $NOTIFY_SOCKET. thread-safe.
void notify_service_manager(const std::string& assignments);

// What is not ready for a while, and says READY=1 then.
void tell_reloading();

// How often WATCHDOG=1 is wanted at the latest (WatchdogSec= of the unit); nullopt: not at all.
std::optional<std::chrono::microseconds> watchdog_period();

// The default logger: to the journal with its priority prefixes ("<4>..."), to a terminal in colour, to a file plainly.
void set_up_log();
// What makes a line on stderr an error to the journal; empty where stderr is something else.
const char* journal_prefix();
void set_log_level(config::LogLevel level);

}  // namespace huetrack::daemon
