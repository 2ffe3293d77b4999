// Notifications to a service manager (systemd), and the log's format under it. Without one, no effect.
#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "config/service_config.h"

namespace huetrack::daemon {

// Assignments as in sd_notify(3), "READY=1\nSTATUS=...", to $NOTIFY_SOCKET. thread-safe.
void notify_service_manager(const std::string& assignments);

// Reloading begins; READY=1 ends it.
void notify_reloading();

// Longest allowed period of WATCHDOG=1 (WatchdogSec= of the unit); nullopt: no watchdog.
std::optional<std::chrono::microseconds> watchdog_period();

// Sets the default logger: with priority prefixes ("<4>...") for the journal, in colour for a terminal, plain for a
// file.
void set_up_log();
// Prefix of an error line for the journal; empty if stderr is not the journal.
const char* journal_prefix();
void set_log_level(config::LogLevel level);

}  // namespace huetrack::daemon
