// What trackers look for in one camera of a camera host.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "capture/frames/frame.h"
#include "hosts/match_finder.h"
#include "idl/camera_host.h"

namespace huetrack::hosts {

// What one tracker does.
struct Wanted {
  std::vector<capture::MatchedColor> colors;
  capture::Duration picture_every{0};  // 0: none
};
// As it is said: the colours and the time between pictures, and nothing else, of `out`.
void to_message(const Wanted& wanted, msg::LookedForColors& out);
// Anybody may have said it. nullopt: it makes no sense.
std::optional<Wanted> wanted_of(const msg::LookedForColors& said);

// thread-compatible.
class WantedMatches {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::size_t most_trackers = 16;
  static constexpr std::chrono::seconds forgotten_after{5};  // trackers say it every two

  // False: it makes no sense, or too many trackers have said something.
  bool hear(const msg::LookedForColors& said, Clock::time_point now);
  // Of all trackers that were heard of late, each colour once, and the shortest time between pictures. Colours beyond
  // capture::Matches::most are left out: each frame tells which are in it.
  void all(Clock::time_point now, MatchFinderOptions& out);

 private:
  struct Heard {
    Wanted wanted;
    Clock::time_point at;
  };
  std::map<std::int64_t, Heard> by_tracker_;
};

}  // namespace huetrack::hosts
