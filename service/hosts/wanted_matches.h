// The colours that trackers request from one camera of a camera host.
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

// One tracker's request.
struct Wanted {
  std::vector<capture::MatchedColor> colors;
  capture::Duration picture_every{0};  // 0: none
};
// Sets the colours and the time between pictures of `out`.
void to_message(const Wanted& wanted, msg::LookedForColors& out);
// The message is untrusted. nullopt: invalid.
std::optional<Wanted> wanted_of(const msg::LookedForColors& message);

// thread-compatible.
class WantedMatches {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::size_t most_trackers = 16;
  static constexpr std::chrono::seconds forgotten_after{5};  // trackers repeat their request every two

  // False: the request is invalid, or there are too many trackers.
  bool update(const msg::LookedForColors& message, Clock::time_point now);
  // Of all recent requests: each colour once, and the shortest time between pictures. Colours beyond
  // capture::Matches::most are left out: each frame lists its colours.
  void all(Clock::time_point now, MatchFinderOptions& out);

 private:
  struct Request {
    Wanted wanted;
    Clock::time_point at;
  };
  std::map<std::int64_t, Request> by_tracker_;
};

}  // namespace huetrack::hosts
