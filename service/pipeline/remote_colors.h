// The output that sends the trackers' colours, and the places where they expect outlines, to remote cameras with `send:
// matches`.
#pragma once

#include <cstddef>
#include <functional>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "capture/live_camera.h"
#include "pipeline/output.h"

namespace huetrack::pipeline {

// Sends the colours of the configuration, after a reload the old and new ones until the new trackers are in use, and
// the trackers' own when these change (`color: adapt`). Each frame names the colours that it was matched with.
class RemoteColors final : public Output {
 public:
  // Sends the first colours. cameras: of `config`'s rig; uses (and copies) the functions of those with look_for.
  RemoteColors(const config::ServiceConfig& config, std::span<const capture::LiveCamera> cameras);

  void on_set(const TrackedSet& set) override;
  void on_config(const config::ServiceConfig& config) noexcept override;

 private:
  struct Camera {
    std::size_t index;
    std::string name;
    std::function<void(std::span<const capture::MatchedColor>)> look_for;
    std::function<void(std::uint32_t, std::span<const capture::ExpectedOutline>)> expect_outlines;
    std::function<void()> flush_outlines;
    std::vector<capture::MatchedColor> next, sent;  // next: of a configuration whose trackers may not be in use yet
  };
  void expect(const config::ServiceConfig& config);

  std::mutex mutex_;
  std::vector<Camera> cameras_;  // guarded by mutex_
  std::size_t sets_ = 0;         // guarded by mutex_; since the configuration changed
  // Buffers of on_set().
  std::vector<capture::MatchedColor> wanted_;
  std::vector<capture::ExpectedOutline> outlines_;
};

}  // namespace huetrack::pipeline
