// Monitors whether one camera still stands where it did: patches of the still room are learnt at the start, and a few
// of them are registered in every frame, in turn. Displaced patches determine how the camera was turned; lost patches
// mean that something is in front of them. Facts only; reports are made elsewhere. Model: design.md.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "calib/model/camera_rig.h"
#include "capture/frames/frame.h"
#include "room_watch/kept_patch.h"
#include "room_watch/patch.h"
#include "room_watch/patch_choice.h"
#include "room_watch/rotation_fit.h"

namespace huetrack::room_watch {

enum class RoomState : std::uint8_t {
  learning,   // patches are being learnt
  plain,      // too little texture: nothing can be detected
  still,      // the camera stands where it stood
  moving,     // it is being turned
  knocked,    // it was turned at once, and stands still since
  sagging,    // it has turned slowly
  zoomed,     // the picture grew or shrank: zoom or focus
  defocused,  // the whole picture lost, or gained, sharpness
  changed,    // the camera stands still; a part of the room was replaced by something that stands still, too
  blinded,    // no contrast: covered, dark, fogged
  hidden,     // contrast, but no patch is found: turned far away, or occluded by something large
};
std::string_view name(RoomState state);  // "learning", ...

// A disc in the picture that is not part of the room.
struct Occluder {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double radius_px = 0;
};

// A rotation of the camera. Rotation vectors, radians, camera frame, now_from_learnt.
struct Turn {
  bool is_slow = false;  // sagging
  capture::Timestamp from, until;
  Eigen::Vector3d before = Eigen::Vector3d::Zero(), after = Eigen::Vector3d::Zero();
};

// A part of the room that was replaced, while the rest is where it was.
struct Change {
  int patches = 0;                                   // replaced by something that stands still
  double share = 0;                                  // of all patches
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();  // of those; as a share of the picture's width and height
  bool is_plain = false;                             // no contrast there: a plain object, or dirt on the lens
};

struct RoomCondition {
  RoomState state = RoomState::learning;
  capture::Timestamp since;  // of the state; blinded and hidden: since the last patch was found, a second before
  // Latest rotation since the room was learnt; radians, camera frame. A shift is contained in it, as
  // RotationFit::shift_to_rotation says.
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d shift_to_rotation = Eigen::Matrix3d::Zero();
  double zoom = 0, zoom_sigma = 0;  // share by which the picture grew
  double blur_px = 0;               // defocused: Gaussian sigma that the focus adds; < 0: the picture is sharper
  std::optional<Turn> turn;         // the last reported one, until it is undone
  int turns = 0;                    // reported so far
  double zoom_instead = 0;          // a zoom without rotation that explains the last turn as well; 0: none does
  int patches = 0, inliers = 0;     // learnt; that agree with the rotation
  Change change;                    // changed
};

// thread-compatible. Deterministic: the same frames, the same answers. Never throws after construction.
class CameraWatch {
 public:
  // known: patches from a room file; too few: the room is learnt from the first frames.
  explicit CameraWatch(const calib::Camera& camera, std::span<const KeptPatch> known = {});

  CameraWatch(CameraWatch&&) = default;  // and no copy

  // Frames in time order; those of another size are ignored. objects: what moves in front of the room.
  void look(const capture::Frame& frame, std::span<const Occluder> objects);

  const RoomCondition& condition() const { return condition_; }
  // The patches, with the camera where it was when they were learnt; empty while learning.
  std::vector<KeptPatch> room() const;
  // The patches from the file were not found at the start, and the room was learnt anew.
  bool has_forgotten() const { return has_forgotten_; }

 private:
  using SeenBlocks = std::array<float, std::size_t(seen_side) * seen_side>;
  // A patch being learnt: the mean of several frames.
  struct PatchMean {
    ChosenPatch where;
    SeenBlocks sum{};
    int frames = 0;
    bool is_spoilt = false;  // an object was in front of it
  };
  // What is seen in the place of a patch, and since when it has been the same.
  struct Replacement {
    Eigen::Vector2i corner;  // blocks; of `seen`, border included
    SeenPatch seen{};
    std::optional<Patch> patch = {};  // nullopt: it is plain
    float contrast = 0;               // grey levels
    capture::Timestamp since;
    bool is_same = false;  // at the last measurement
  };
  struct Watched {
    Patch patch;
    int cell = 0;
    Eigen::Vector3d ray = Eigen::Vector3d::UnitZ();  // of the camera as it was when the room was learnt
    std::optional<capture::Timestamp> seen_at = {};  // when it was found last
    Eigen::Vector2d px = Eigen::Vector2d::Zero();    // where; raw pixel
    double sigma_px = 0;
    Eigen::Vector2d expected_px = Eigen::Vector2d::Zero();  // predicted place at the last measurement
    std::optional<capture::Timestamp> differs_since = {};   // something else is there
    float contrast = 0;                                     // at the last measurement, as a share of its own
    bool is_hidden = false;                                 // by an object, or outside the image: not observable
    float loss = 0, loss_sigma = 0;                         // of detail, when it was found last; Found::loss
    std::optional<float> first_loss = {};                   // Found::loss at the first measurement
    std::unique_ptr<Replacement> replacement = {};
  };
  struct Innovation {  // of a measurement
    bool is_found = false;
    Eigen::Vector2d off_px = Eigen::Vector2d::Zero();
    float loss = 0;
  };
  struct Snapshot {
    capture::Timestamp at;
    Eigen::Vector3d rotation;
  };

  void start_learning(const Luma& luma);
  void learn(const Luma& luma, capture::Timestamp at, std::span<const Occluder> objects);
  void end_learning(capture::Timestamp at);
  void watch(const Luma& luma, capture::Timestamp at, std::span<const Occluder> objects);
  bool measure(Watched& watched, const Luma& luma, capture::Timestamp at, const Aim& aim,
               std::span<const Occluder> objects);
  void note_replacement(Watched& watched, const Luma& luma, capture::Timestamp at);
  static bool is_same(const Replacement& then, const Luma& luma, const Eigen::Vector2d& centre,
                      std::span<const float> now);
  void measure_replaced(const Luma& luma, capture::Timestamp at, std::span<const Occluder> objects);
  bool is_resting(const Watched& watched, capture::Timestamp at) const;
  void judge_change(capture::Timestamp at);
  void note_innovation(const Watched& watched, capture::Timestamp at);
  void hurry(capture::Timestamp at);
  bool is_suspicious() const;
  void survey(const Luma& luma, capture::Timestamp at, std::span<const Occluder> objects);
  std::optional<RotationFit> fit_all(const Luma& luma, capture::Timestamp at, const Aim& from,
                                     std::span<const Occluder> objects, int& observable);
  double strong_blur(const Luma& luma) const;
  std::optional<Aim> relocate(const Luma& luma, std::span<const Occluder> objects) const;
  static bool has_loss(const Watched& watched, capture::Timestamp since);
  float common_loss(capture::Timestamp since) const;
  double common_blur(capture::Timestamp since) const;
  void judge_focus(capture::Timestamp at, double blur_blocks);
  void set_focus(bool is_defocused);
  void fit_recent(capture::Timestamp at);
  void accept(const RotationFit& full, capture::Timestamp at, bool is_survey);
  void judge_turn(const RotationFit& fit, capture::Timestamp at, bool is_survey);
  void judge_no_turn(bool has_zoomed, bool is_back, capture::Timestamp at);
  void report(Turn turn, bool goes_on, bool is_small, capture::Timestamp at);
  Turn turn_since(capture::Timestamp at, const Eigen::Vector3d& before, const Eigen::Vector3d& after) const;
  void judge_lost_view(capture::Timestamp at);
  void learn_anew();
  void relearn_replaced(const Luma& luma, capture::Timestamp at);
  void set_state(RoomState state, capture::Timestamp at);
  Eigen::Vector2d block_of(const Eigen::Vector2d& px) const;
  Eigen::Vector2d pixel_of(const Eigen::Vector2d& block) const;
  Aim aim() const;
  bool has_zoomed_now() const;
  double repeat_rad() const;  // rotations nearer to each other than this are equal
  float min_patch_loss() const;

  const calib::Camera camera_;
  const int scale_;
  const float loss_unit_;  // of significant losses, by the blocks' size
  RoomCondition condition_;
  std::vector<PatchMean> learning_;
  std::vector<Watched> watched_;
  std::optional<capture::Timestamp> last_at_, last_learnt_at_, last_agreed_at_;
  bool has_begun_ = false, is_kept_ = false, has_forgotten_ = false;
  std::size_t next_ = 0;                 // of watched_
  double due_ = 0;                       // measurements
  std::vector<Innovation> innovations_;  // the last few, a ring
  std::size_t innovation_count_ = 0;
  int off_in_a_row_ = 0;
  capture::Timestamp next_survey_{}, next_fit_{}, alert_until_{}, next_hurry_{}, hurry_until_{};
  capture::Duration survey_pause_{0};
  std::optional<capture::Timestamp> lost_since_, zoomed_since_;
  std::optional<capture::Timestamp> blurred_since_;  // to be confirmed by the next surveys
  bool is_defocused_ = false;
  double zoom_instead_ = 0;  // of the last accepted fit; RoomCondition::zoom_instead
  std::optional<capture::Timestamp> looked_around_at_, next_replaced_;
  std::deque<Snapshot> history_;
  Eigen::Vector3d reported_ = Eigen::Vector3d::Zero();  // the rotation reported last
  std::optional<Snapshot> pending_;                     // a turn to be confirmed by the next survey
  std::optional<Snapshot> settled_;                     // the same, since it no longer shakes
  capture::Timestamp pending_since_{}, next_relocation_{};
  capture::Duration relocation_pause_{0};
};

}  // namespace huetrack::room_watch
