// The output that collects the figures of a replay's summary.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/output.h"
#include "reports/tracked_sets.h"
#include "tracks/objects_comparison.h"
#include "tracks/truth_comparison.h"

namespace huetrack::daemon {

struct TargetSummary {
  std::string name;
  double radius_m = 0;     // in force
  std::string color = {};  // what its hue_deg means; empty: it has none yet
  reports::TrackedSets tracked = {};
  std::map<object_tracking::TrackState, std::uint64_t> sets = {};  // per state
  // With `count`, sets counts each object; these are the number found, and the most at once.
  std::uint64_t objects = 0, most_objects = 0;
  std::optional<std::uint64_t> first_tracking_set = {};  // from 1
  double first_tracking_s = 0;                           // capture time from the first set to that one
  std::optional<tracks::TruthFigures> truth = {};
  std::optional<tracks::ObjectsFigures> objects_truth = {};  // with `count`, instead of truth
  std::optional<truth::Explanation> explanation = {};        // of most of its error
  object_tracking::OutlineFindings outlines = {};            // radius by its outlines
  bool is_radius_known = true;                               // false: assumed, and the outlines have shown none
  std::optional<double> shown_radius_m = {};                 // in force instead of the assumed one
  std::string unset_radius = {};                             // none was given; its outlines have shown it
  std::uint64_t delivered_sets = 0, lost_sets = 0;           // with cameras enough; of them without a position
  bool is_seen_in_vain = false;  // reports::is_seen_in_vain(), where it has no position in a large share of them
  std::string advice = {};       // if it was never tracked, late, or perhaps something else

  double lost_share() const { return delivered_sets > 0 ? double(lost_sets) / double(delivered_sets) : 0; }
};

struct CameraSummary {
  std::string name;
  std::map<camera_tracking::PoseState, std::uint64_t> frames;  // per state
  std::optional<std::uint64_t> first_pose_frame;               // from 0
};

// Getters: after the run.
class Tally final : public pipeline::Output {
 public:
  // truth: null for none; outlives this
  Tally(const config::ServiceConfig& config, const tracks::Truth* truth);

  void on_set(const pipeline::TrackedSet& set) override;
  void on_camera_pose(const pipeline::TrackedFrame& frame) override;

  std::vector<TargetSummary> targets() const;
  const std::optional<CameraSummary>& camera() const { return camera_; }         // nullopt: none
  const std::optional<capture::Timestamp>& last_at() const { return last_at_; }  // capture time of the last set
  // of the last estimate; begin() if none
  std::chrono::steady_clock::time_point last_out() const { return std::max(sets_until_, camera_until_); }
  void begin(std::chrono::steady_clock::time_point at) { sets_until_ = camera_until_ = at; }

 private:
  struct Target {
    TargetSummary summary;
    std::optional<tracks::TruthComparison> comparison = {};
    std::optional<tracks::ObjectsComparison> objects = {};
    std::optional<capture::Timestamp> first_at = {};
    std::uint64_t objects_now = 0;
    void add(const object_tracking::ObjectEstimate& estimate, std::uint64_t set);
  };
  void note_lost(const pipeline::TrackedSet& set);

  const std::optional<int> moving_camera_;  // of the rig: object tracking does not use it
  std::vector<Target> targets_;             // this and all up to sets_until_: the tracking thread's
  std::uint64_t sets_ = 0;
  std::optional<capture::Timestamp> last_at_;
  std::chrono::steady_clock::time_point sets_until_;
  std::optional<CameraSummary> camera_;  // this and all below: the camera thread's
  pipeline::NoPoseLog no_pose_log_;
  std::chrono::steady_clock::time_point camera_until_;
};

}  // namespace huetrack::daemon
