// The estimated clock of another host whose cameras are used here. A plain value.
#pragma once

#include <optional>
#include <string>

namespace huetrack::capture {

struct HostClock {
  std::string host;
  bool is_known = false;         // false: the members below are not valid yet
  double offset_s = 0;           // how far the host's clock is ahead of ours; subtracted from its stamps
  double sigma_s = 0;            // 1 sigma of offset_s
  double drift = 0;              // seconds per second, as measured
  double round_trip_s = 0;       // of the fastest recent exchange
  bool is_ours = false;          // the host is this machine
  std::optional<double> kept_s;  // 1 sigma of the synchronisation by chrony, ntpd or PTP, as both kernels report it
  bool is_contradicted = false;  // the exchanges contradict that synchronisation, and are used instead
  std::string advice;            // a sentence, when sigma_s is too large for good positions; empty: fine
};

}  // namespace huetrack::capture
