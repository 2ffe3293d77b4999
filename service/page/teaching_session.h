// Executes the page's teaching requests: keeps the frozen pictures and saves what was learnt.
#pragma once

#include <chrono>
#include <functional>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "capture/frames/frame.h"
#include "color_teaching/lesson.h"
#include "config/service_config.h"
#include "idl/huetrack_view.h"

namespace huetrack::page {

// thread-compatible; the page service's thread owns it.
class TeachingSession {
 public:
  struct Actions {
    // Reloads the saved configuration. Returns the reason of a failure, or an empty string.
    std::function<std::string()> reload;
    std::function<void()> resume;  // of a held replay; empty: none
    // Reads other moments of a replayed recording, until a stop. Called from a separate thread. Empty: live cameras,
    // which use add_moment().
    std::function<std::vector<capture::FrameSet>(const std::stop_token&)> moments = {};
  };
  explicit TeachingSession(Actions actions) : actions_(std::move(actions)) {}

  // The reason why teaching is not allowed; empty: it is.
  static std::string why_not(const config::ServiceConfig& config);

  // All actions except TEACH_ACTION_FREEZE.
  msg::TeachReply answer(const msg::TeachRequest& request, const config::ServiceConfig& config);
  // TEACH_ACTION_FREEZE with these pictures.
  msg::TeachReply freeze(const msg::TeachRequest& request, const config::ServiceConfig& config,
                         const capture::FrameSet& set);

  // Whether another moment is useful for the object's size: after freeze(), some times a second.
  bool wants_moment(std::chrono::steady_clock::time_point now) const {
    return takes_moments_ && now >= next_moment_ && now < last_moment_;
  }
  void add_moment(const capture::FrameSet& set);

  static msg::TeachReply refusal(const msg::TeachRequest& request, const std::string& reason);

 private:
  void read_moments();
  std::string take_read_moments();
  msg::TeachReply look(const msg::TeachRequest& request, const config::ServiceConfig& config, bool applies);
  msg::TeachReply ignore(const msg::TeachRequest& request, const config::ServiceConfig& config);
  msg::TeachReply undo(const msg::TeachRequest& request, const config::ServiceConfig& config);
  std::string why_not_saved(const std::function<void()>& save) const;  // empty: saved and reloaded

  const Actions actions_;
  std::optional<color_teaching::ColorTeacher> teacher_;
  std::string client_;  // owner of the pictures
  std::uint64_t set_number_ = 0, moment_number_ = 0;
  bool takes_moments_ = false;
  std::chrono::steady_clock::time_point next_moment_{}, last_moment_{};
  std::vector<std::pair<std::uint32_t, std::uint32_t>> picture_sizes_;  // per camera of the rig
  std::mutex read_mutex_;
  std::vector<capture::FrameSet> read_;  // actions_.moments, not yet taken
  std::string why_not_read_;
  std::jthread reading_;
};

}  // namespace huetrack::page
