// What one target's views show of mistakes that people make: videos that are swapped, a camera that is late or was
// turned, another room's rig, a radius or a colour that is not the object's. Facts, with their sizes; no sentences.
//
// The last seconds of what every camera saw of the target are kept, wherever in the picture it was. As long as the rays
// of all pairs of cameras meet as closely as they should, nothing else is done. Where they do not, one thing after the
// other is supposed to be otherwise than the rig says (two cameras' frames exchanged; one camera's times moved; one
// camera turned), and what makes all pairs agree is named. What nothing explains, and nobody agrees about, is another
// room's rig.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "calib/model/camera_rig.h"
#include "object_tracking/trackers/object_tracker.h"
#include "view_watch/pair_residuals.h"

namespace huetrack::view_watch {

enum class MistakeKind : std::uint8_t {
  swapped,        // cameras: [c] really is cameras[(k + 1) % n]; size: none
  late,           // one camera; size: seconds, < 0: the others are late
  uneven_times,   // cameras whose stamps are wrong, now by so much and now by so much; size: the largest, seconds
  turned,         // one camera, or two of which nobody can tell which; size: radians
  zoomed,         // one camera; size: its focal length, in the rig's
  mirrored,       // one camera; size: none
  other_rig,      // no camera agrees with another one
  contradiction,  // views do not agree, and nothing above explains it
  radius,         // size: the radius that the views agree about, metres
  shared_color,   // one camera; size: share of its picture that has the colour, 0..1
};

inline constexpr std::size_t mistake_kinds = std::size_t(MistakeKind::shared_color) + 1;
std::string_view name(MistakeKind kind);  // "swapped", ...

// Of how the cameras stand, and of when and whose their frames are.
bool is_of_rig(MistakeKind kind);

struct Mistake {
  MistakeKind kind = MistakeKind::other_rig;
  std::vector<int> cameras = {};  // of the rig
  double size = 0;
  double off_px = 0;            // how far the views are apart because of it, usually; 0: late, and learnt: they are not
  double zoom = 1;              // turned: a focal length of so many times the rig's explains it as well; 1: it does not
  bool is_of_outlines = false;  // radius: all views' outlines say so, and not only how large regions are
  bool do_some_agree = false;   // contradiction: two cameras agree, and it is hardly theirs
  // late, uneven_times: per camera of the rig, how much later its frames are than the tracker believes.
  std::vector<double> unlearnt_s = {};
  double since_s = 0;  // since when, of what jumped; 0: of all that was compared

  // Stamps that jump are now of this camera and now of that one.
  bool is_same_as(const Mistake& other) const {
    return kind == other.kind && (cameras == other.cameras || kind == MistakeKind::uneven_times);
  }
};

// thread-compatible; one per target. It costs some microseconds per set, and some milliseconds twice a second while
// views contradict one another.
class ViewWatch {
 public:
  ViewWatch(const calib::CameraRig& rig, const object_tracking::TargetOptions& target);

  // After the target was looked for in a set. Sets in time order. moved: per camera, that it is known otherwise to
  // stand elsewhere than the rig says: what it saw says nothing of the others. Empty: none is.
  void look(const object_tracking::ObjectEstimate& estimate, const object_trackers::ObjectTracker& tracker,
            capture::Timestamp set_at, const std::vector<bool>& moved = {});

  // By the last look(), and told once: what its tracker believes of the cameras' times cannot be so. Per camera of the
  // rig, how much later its frames are (ObjectTracker::correct_times); empty: nothing is known to be wrong.
  const std::vector<double>& late_s() const { return late_s_; }
  // In force now.
  const std::vector<Mistake>& mistakes() const { return mistakes_; }
  // Those, and what was found in the last second and is not sure enough to be named: reason enough to doubt a camera.
  const std::vector<Mistake>& suspected_mistakes() const { return suspected_mistakes_; }

 private:
  static constexpr double nothing_known_s = 1;
  struct PerCamera {
    Track track;
    struct Spot {  // where something stands still
      Eigen::Vector2d px;
      double first_s, last_s;
      int count;
    };
    std::vector<Spot> spots;
    int shared_looks = 0;  // one after the other, with too much of the colour
    double period_s = 0;   // of its frames in which it sees the target, about: the mean of so many
    int intervals = 0;
    double readout_s = 0, readout_sigma_s = 0;  // its size, as it was learnt
    double seen_s = 0;                          // the target, last
    // Its latency as it was known best since it was corrected, beside the rig's.
    int moved_looks = 0;  // one after the other, in which it was believed to be another one
    double surest_latency_s = 0, surest_sigma_s = nothing_known_s;
  };
  void keep(const object_tracking::ObjectEstimate& estimate, std::span<const object_tracking::SeenRegion> regions,
            double now_s);
  static void note_period(PerCamera& camera, double t_s);
  void forget_what_was_not_it(const object_tracking::ObjectEstimate& estimate, double now_s);
  bool is_still(PerCamera& camera, const Eigen::Vector2d& px, double now_s) const;
  void choose(const Track& all, double now_s, double shift_s, Track& chosen);
  std::optional<Mistake> of_rig(double now_s, const std::vector<bool>& moved);
  std::optional<Mistake> explained(const PairComparison::Agreement& as_is, bool is_clear, bool are_few) const;
  std::optional<Mistake> of_jump(double now_s);
  bool correct_times(Mistake& found, double now_s);
  std::optional<Mistake> of_uneven_times();
  std::optional<Mistake> of_learnt_times() const;
  std::optional<Mistake> of_radius(const object_tracking::OutlineFindings& outlines) const;
  bool has_moved() const;
  void confirm(const std::vector<Mistake>& found, double now_s);

  calib::CameraRig rig_;
  object_tracking::TargetOptions target_;
  std::vector<PerCamera> cameras_;
  std::vector<Track> tracks_;  // of cameras_, less what contradicts itself or stands still: work space
  std::vector<bool> smooth_;   // per sample of one of cameras_: work space
  TimeSigmas time_sigmas_, time_shifts_, latency_sigmas_;
  std::optional<capture::Timestamp> first_at_;
  std::optional<double> found_s_;  // since when it has been tracked
  double next_s_ = 0, next_turn_s_ = 0, next_try_s_ = 0;
  int tries_ = 0;
  bool is_wrong_ = false;  // the views contradict one another now
  // The times that would make them agree, as they were found last.
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
