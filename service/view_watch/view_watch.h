// Diagnoses mistakes in rig and configuration from one target's views: videos that are swapped, a camera that is late
// or was turned, another room's rig, a radius or colour that is not the object's. Returns facts and magnitudes only.
//
// The last seconds of all cameras' samples are kept. While all pairs of cameras are epipolar-consistent, nothing else
// is done. Otherwise fault hypotheses are tested one after the other (frames exchanged, one camera late, turned,
// zoomed, mirrored, ...); the one that makes all pairs consistent is named. See design.md.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "calib/model/camera_rig.h"
#include "object_tracking/trackers/object_tracker.h"
#include "view_watch/jump_watch.h"
#include "view_watch/pair_residuals.h"

namespace huetrack::view_watch {

enum class MistakeKind : std::uint8_t {
  swapped,        // frames are permuted among these cameras; size: none
  late,           // one camera; size: seconds, < 0: the others are late
  uneven_times,   // cameras whose time-stamp error varies; size: the largest error, seconds, if is_size_known()
  turned,         // one camera, or two if it cannot be decided which; size: radians
  zoomed,         // one camera; size: ratio of its focal length to the rig's
  mirrored,       // one camera; size: none
  upside_down,    // one camera, or all (none named), whose pictures are turned by 180 degrees; size: none
  other_rig,      // no two cameras are consistent
  contradiction,  // views are inconsistent, and nothing above explains it
  wrong_order,    // of pictures, in all views alike; size: the largest jump, metres
  converted,      // one camera's film, to another frame rate; size: error of its times, seconds, 1 sigma
  exchanged,      // one camera's pictures, two and two; size: the same
  delayed,        // one camera's stamps, unevenly, though its pictures were taken evenly; size: the same
  radius,         // size: the radius that the views agree on, metres
  shared_color,   // one camera; size: share of its picture that has the colour, 0..1
};

inline constexpr std::size_t mistake_kinds = std::size_t(MistakeKind::shared_color) + 1;
std::string_view name(MistakeKind kind);  // "swapped", ...

// True: poses, lenses, timing or assignment of cameras. False: the target's configuration.
bool is_of_rig(MistakeKind kind);

struct Mistake {
  MistakeKind kind = MistakeKind::other_rig;
  std::vector<int> cameras = {};  // of the rig
  double size = 0;
  double off_px = 0;  // median epipolar residual of the worst pair; 0: late, but compensated
  double zoom = 1;    // turned: this ratio of focal length to the rig's also explains it; 1: none
  // radius: the range of true ones, m, that the outlines or, without them, the regions leave.
  std::pair<double, double> range_m = {0, 0};
  bool do_some_agree = false;  // contradiction: two cameras are consistent: hardly their fault
  // late, uneven_times: per camera of the rig, the latency beyond the tracker's estimate.
  std::vector<double> extra_latency_s = {};
  double since_s = 0;                  // start of what jumped; 0: the whole window
  int jumps = 0;                       // wrong_order: in the last seconds
  double shown_hz = 0, source_hz = 0;  // converted: by its stamps; before. delayed: even ones. late: the camera's

  // uneven_times: no comparison of views finds a larger error; the tracker's estimate, which assumes a constant
  // velocity over it, has diverged.
  bool is_size_known() const { return kind != MistakeKind::uneven_times || size <= 2 * lateness_search.max_s; }
  // uneven_times: cameras may differ.
  bool is_same_as(const Mistake& other) const {
    return kind == other.kind && (cameras == other.cameras || kind == MistakeKind::uneven_times);
  }
};

// The true radii, m, that the outlines leave where this radius, m, was given: their views differ, blur, shade and hands
// change them all alike, and search and fit are drawn towards what was given. outlines.radius_m has a value.
std::pair<double, double> radius_range(const object_tracking::OutlineFindings& outlines, double radius_m);

// thread-compatible; one per target. Costs some microseconds per set; while views are inconsistent, some milliseconds
// twice a second.
class ViewWatch {
 public:
  ViewWatch(const calib::CameraRig& rig, const object_tracking::TargetOptions& target);

  // Call after each tracker update, in time order. moved: per camera, another test found that it stands elsewhere
  // than in the rig; its samples are then ignored. Empty: none.
  void look(const object_tracking::ObjectEstimate& estimate, const object_trackers::ObjectTracker& tracker,
            capture::Timestamp set_at, const std::vector<bool>& moved = {});

  // The next set does not continue the last one: forgets the motion, and keeps what was found.
  void begin_anew();

  // By the last look(), reported once: per camera of the rig, the latency beyond the tracker's estimate, for
  // ObjectTracker::correct_times(). Empty: no correction.
  const std::vector<double>& late_s() const { return late_s_; }
  // As of the last judgement: with this latency, the views of this target would be inconsistent. Then it is another
  // fault, as one timing holds for all targets.
  bool contradicts(const std::vector<double>& late_s) const;
  // All trackers' times were corrected by another target's late_s(): their estimates begin anew.
  void note_correction();
  // Confirmed.
  const std::vector<Mistake>& mistakes() const { return mistakes_; }
  // mistakes(), and unconfirmed ones of the last second: a reason to inflate a camera's covariance.
  const std::vector<Mistake>& suspected_mistakes() const { return suspected_mistakes_; }

 private:
  static constexpr double unknown_sigma_s = 1;  // maths: no information
  struct PerCamera {
    Track track;
    struct Spot {  // static clutter
      Eigen::Vector2d px;
      double first_s, last_s;
    };
    std::vector<Spot> spots;
    double period_s = 0;  // of frames in which it sees the target: a running mean
    std::size_t intervals = 0;
    double readout_s = 0, readout_sigma_s = 0;  // estimated by the tracker; its absolute value
    double seen_s = 0;                          // the target, last
    // surest_*: latency relative to the rig's, at its smallest sigma since the last correction.
    int moved_count = 0;  // consecutive judgements in which it was another one
    double surest_latency_s = 0, surest_sigma_s = unknown_sigma_s;
  };
  void keep(const object_tracking::ObjectEstimate& estimate, std::span<const object_tracking::SeenRegion> regions,
            double now_s);
  static void note_period(PerCamera& camera, double t_s);
  void forget_clutter(const object_tracking::ObjectEstimate& estimate, double now_s);
  bool is_still(PerCamera& camera, const Eigen::Vector2d& px, double now_s) const;
  void choose(const Track& all, double now_s, double shift_s, Track& chosen);
  std::optional<Mistake> of_rig(double now_s, const std::vector<bool>& moved);
  std::optional<Mistake> explained(const PairComparison::Agreement& as_is, bool is_clear, bool are_few) const;
  std::optional<Mistake> of_jump(double now_s);
  bool correct_times(Mistake& found, double now_s);
  std::optional<Mistake> of_uneven_times();
  std::optional<Mistake> of_learnt_times() const;
  static std::vector<Mistake> of_shared_color(std::span<const object_tracking::ColorShare> shares);
  std::optional<Mistake> of_radius(const object_tracking::OutlineFindings& outlines) const;
  bool has_moved() const;
  void confirm(const std::vector<Mistake>& found, double now_s);

  calib::CameraRig rig_;
  object_tracking::TargetOptions target_;
  std::vector<PerCamera> cameras_;
  JumpWatch jumps_;
  std::vector<Track> tracks_;  // of cameras_, less outliers and clutter: work space
  std::vector<bool> smooth_;   // per sample of one of cameras_: work space
  TimeSigmas time_sigmas_, time_shifts_, latency_sigmas_;
  std::optional<capture::Timestamp> first_at_;
  std::optional<double> found_s_;  // since when it has been tracked
  double next_s_ = 0, next_turn_s_ = 0, next_try_s_ = 0;
  int tries_ = 0;
  bool is_wrong_ = false;  // the views are inconsistent now
  // The times that would make them consistent, as found last.
  struct OtherTimes {
    std::vector<double> late_s;
    double found_s = 0;
  };
  std::optional<OtherTimes> other_times_;
  std::vector<double> late_s_;
  int corrections_ = 0;               // of times, so far
  TimeSigmas shifts_when_corrected_;  // time_shifts_, before the last one
  struct Suspected {
    Mistake mistake;
    int times = 0;
    double last_s = 0;
  };
  std::vector<Suspected> suspected_;
  std::vector<Mistake> mistakes_, suspected_mistakes_;
};

}  // namespace huetrack::view_watch
