// Tells cameras whose hosts say which pixels match (`send: matches`) what the trackers look for in them, and where they
// expect outlines.
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

// The colours of the configuration from the start, and of another one from when it is in force; the trackers' own when
// these change them (`color: adapt`). A frame tells of which colours it is, so none is taken for what it is not.
class ColorsLookedFor final : public Output {
 public:
  // Tells the first ones. cameras: of `config`'s rig; of those with look_for, which it keeps.
  ColorsLookedFor(const config::ServiceConfig& config, std::span<const capture::LiveCamera> cameras);

  void on_set(const TrackedSet& set) override;
  void on_config(const config::ServiceConfig& config) noexcept override;

 private:
  struct Camera {
    std::size_t index;
    std::string name;
    std::function<void(std::span<const capture::MatchedColor>)> look_for;
    std::function<void(std::uint32_t, std::span<const capture::ExpectedOutline>)> expect_outlines;
    std::function<void()> tell_outlines;
    std::vector<capture::MatchedColor> coming, told;  // of the configuration whose trackers may not be there yet
  };
  void expect(const config::ServiceConfig& config);

  std::mutex mutex_;
  std::vector<Camera> cameras_;  // guarded by mutex_
  std::size_t sets_ = 0;         // guarded by mutex_; since that configuration
  // Work space of on_set().
  std::vector<capture::MatchedColor> wanted_;
  std::vector<capture::ExpectedOutline> outlines_;
};

}  // namespace huetrack::pipeline
