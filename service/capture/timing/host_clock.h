// What is known of the clock of another host, whose cameras are used here. A plain value.
#pragma once

#include <optional>
#include <string>

namespace huetrack::capture {

struct HostClock {
  std::string host;
  bool is_known = false;         // what follows is nothing before
  double offset_s = 0;           // that is taken off the host's stamps: how far it is ahead of ours
  double sigma_s = 0;            // of what is left then, standard deviation
  double drift = 0;              // seconds per second, as measured
  double round_trip_s = 0;       // of the fastest exchange of late
  bool is_ours = false;          // the host is this machine
  std::optional<double> kept_s;  // to how much chrony, ntpd or PTP keep it with ours, as they tell both kernels
  bool is_contradicted = false;  // but the exchanges say otherwise, and are believed
  std::string advice;            // a sentence, when it is known worse than positions need; empty: all is well
};

}  // namespace huetrack::capture
