// Whether one camera still stands as it did: pieces of the still room around it are learnt at the beginning, and a few
// of them are looked for in every frame, in turn. Those that are no longer where they were say how the camera was
// turned; those that are gone, that something stands before it. Facts only; who tells people is above.
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
  learning,   // the room is being looked at for the first time
  plain,      // too little of it has texture: nothing can be said
  still,      // it stands where it stood
  moving,     // it is being turned just now
  knocked,    // it was turned at once, and stands still since
  sagging,    // it has turned slowly
  zoomed,     // the picture grew or shrank: zoom or focus
  defocused,  // the picture lost its sharpness, all over it, or gained some
  changed,    // it stands still, and a part of what it sees is another one now, which stands still as well
  blinded,    // there is no contrast any more: covered, dark, fogged
  hidden,     // there is contrast, but nothing of the room: turned far away, or something large stands before it
};
std::string_view name(RoomState state);  // "learning", ...

// Where something was seen that is no part of the room.
struct Occluder {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double radius_px = 0;
};

// That a camera was turned. Rotation vectors, radians, camera frame, now_from_learnt.
struct Turn {
  bool is_slow = false;  // sagging
  capture::Timestamp from, until;
  Eigen::Vector3d before = Eigen::Vector3d::Zero(), after = Eigen::Vector3d::Zero();
};

// That a part of the room looks otherwise, while the rest of it is where it was.
struct Change {
  int patches = 0;                                   // that show something else, which stands still
  double share = 0;                                  // of the patches
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();  // of those; as a share of the picture's width and height
  bool is_plain = false;                             // nothing has contrast there: a wall, or dirt on the lens
};

struct RoomCondition {
  RoomState state = RoomState::learning;
  capture::Timestamp since;  // of the state; of blinded and hidden since nothing is seen, a second before it is said
  // What it was turned by since the room was learnt, as seen last; radians, camera frame. A shift is a part of it, as
  // far as it moves a room of that distance alike: RotationFit::shift_to_rotation.
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d shift_to_rotation = Eigen::Matrix3d::Zero();
  double zoom = 0, zoom_sigma = 0;  // share by which the picture grew
  double blur_px = 0;               // what the focus adds to it, Gaussian sigma; below 0: it is sharper; of defocused
  std::optional<Turn> turn;         // the last one that is to be told
  int turns = 0;                    // how many there were
  double zoom_instead = 0;          // a zoom without a turn that explains the last one as well; 0: none does
  int patches = 0, held = 0;        // that are known; that agree with the rotation
  Change change;                    // of changed
};

// thread-compatible. Deterministic: the same frames, the same answers. Never throws after construction.
class CameraWatch {
 public:
  // known: the room as it was kept; empty: it is learnt from the first frames.
  explicit CameraWatch(const calib::Camera& camera, std::span<const KeptPatch> known = {});

  CameraWatch(CameraWatch&&) = default;  // and no copy

  // The camera's frames in time order; those of another size are ignored. objects: what is before the room and moves.
  void look(const capture::Frame& frame, std::span<const Occluder> objects);

  const RoomCondition& condition() const { return condition_; }
  // What is known of the room, where the camera stood when it was learnt; empty while it is being learnt.
  std::vector<KeptPatch> room() const;
  // The kept room was not found at the start, and was learnt anew.
  bool has_forgotten() const { return has_forgotten_; }

 private:
  // A patch that is being learnt: the mean of several frames.
  struct PatchMean {
    ChosenPatch where;
    std::array<float, std::size_t(seen_side) * seen_side> sum{};
    int frames = 0;
    bool is_spoilt = false;  // an object was before it
  };
  // What is seen where a patch should be, and since when it has been the same.
  struct Other {
    Eigen::Vector2i corner;  // blocks; of `seen`, border included
    SeenPatch seen;
    std::optional<Patch> patch;  // nullopt: it is plain
    float contrast = 0;          // grey levels
    capture::Timestamp since, looked_at;
    bool is_same = false;  // when it was looked at last
  };
  struct Watched {
    Patch patch;
    int cell = 0;
    Eigen::Vector3d ray = Eigen::Vector3d::UnitZ();  // of the camera as it was when the room was learnt
    std::optional<capture::Timestamp> seen_at;       // when it was found last
    Eigen::Vector2d px = Eigen::Vector2d::Zero();    // where; raw pixel
    double sigma_px = 0;
    Eigen::Vector2d expected_px = Eigen::Vector2d::Zero();  // where it was looked for last
    std::optional<capture::Timestamp> differs_since;        // it shows something else than it should
    float contrast = 0;                                     // when it was looked at last, as a share of its own
    bool is_hidden = false;                                 // by an object, or outside the image: it says nothing
    float loss = 0, loss_sigma = 0;                         // of detail, when it was found last; Found::loss
    std::optional<float> loss_at_first = {};                // Found::loss, when it was looked for first
    std::unique_ptr<Other> other = {};                      // what is in its place
  };
  struct Innovation {  // of a patch that was looked for
    bool is_found = false;
    Eigen::Vector2d off_px = Eigen::Vector2d::Zero();
    float loss = 0;
  };
  struct Snapshot {
    capture::Timestamp at;
    Eigen::Vector3d rotation;
  };

  void choose(const Luma& luma);
  void learn(const Luma& luma, capture::Timestamp at, std::span<const Occluder> objects);
  void end_learning(capture::Timestamp at);
  void watch(const Luma& luma, capture::Timestamp at, std::span<const Occluder> objects);
  bool measure(Watched& watched, const Luma& luma, capture::Timestamp at, const Aim& aim,
               std::span<const Occluder> objects);
  void note_other(Watched& watched, const Luma& luma, capture::Timestamp at);
  static bool is_same(const Other& then, const Luma& luma, const Eigen::Vector2d& centre, std::span<const float> now);
  void look_at_others(const Luma& luma, capture::Timestamp at, std::span<const Occluder> objects);
  bool is_resting(const Watched& watched, capture::Timestamp at) const;
  void judge_change(capture::Timestamp at);
  void note(const Watched& watched, capture::Timestamp at);
  void hurry(capture::Timestamp at);
  bool is_suspicious() const;
  void survey(const Luma& luma, capture::Timestamp at, std::span<const Occluder> objects);
  std::optional<RotationFit> fit_all(const Luma& luma, capture::Timestamp at, const Aim& from,
                                     std::span<const Occluder> objects, int& could_say);
  double strong_blur(const Luma& luma) const;
  std::optional<Aim> relocate(const Luma& luma, std::span<const Occluder> objects) const;
  float common_loss(capture::Timestamp since) const;
  double common_blur(capture::Timestamp since) const;
  void judge_focus(capture::Timestamp at, double blur_blocks);
  void set_focus(bool is_other);
  void fit_recent(capture::Timestamp at);
  void take(const RotationFit& full, capture::Timestamp at, bool is_fresh);
  void judge_turn(const RotationFit& fit, capture::Timestamp at, bool is_fresh);
  void tell(Turn turn, bool goes_on, bool is_small, capture::Timestamp at);
  Turn turn_since(capture::Timestamp at, const Eigen::Vector3d& before, const Eigen::Vector3d& after) const;
  void judge_nothing(capture::Timestamp at);
  void replace_changed(const Luma& luma, capture::Timestamp at);
  void set_state(RoomState state, capture::Timestamp at);
  Eigen::Vector2d block_of(const Eigen::Vector2d& px) const;
  Eigen::Vector2d pixel_of(const Eigen::Vector2d& block) const;
  Aim aim() const;
  bool has_zoomed_now() const;
  double alike_rad() const;  // rotations nearer to each other than this are one

  const calib::Camera camera_;
  const int scale_;
  const float loss_unit_;  // of the losses that are told, by the blocks' size
  RoomCondition condition_;
  std::vector<PatchMean> learning_;
  std::vector<Watched> watched_;
  std::optional<capture::Timestamp> last_at_, last_learnt_at_, last_agreed_at_;
  bool has_begun_ = false, is_kept_ = false, has_forgotten_ = false;
  std::size_t next_ = 0;  // of watched_
  double due_ = 0;        // patches to look for
  std::array<Innovation, 6> innovations_{};
  std::size_t innovation_count_ = 0;
  int off_in_a_row_ = 0;
  capture::Timestamp next_survey_{}, next_fit_{}, alert_until_{}, next_hurry_{}, hurry_until_{};
  capture::Duration survey_pause_{0};
  std::optional<capture::Timestamp> nothing_since_, zoomed_since_;
  std::optional<capture::Timestamp> blurred_since_;  // what the next looks are to confirm
  capture::Timestamp blur_agreed_since_{};
  double pending_blur_ = 0;  // blocks
  bool is_defocused_ = false;
  double zoom_instead_ = 0;  // of the fit that was taken last; RoomCondition::zoom_instead
  std::optional<capture::Timestamp> looked_around_at_, next_other_;
  capture::Timestamp rested_at_{};  // when something that was told rested last
  std::deque<Snapshot> history_;
  Eigen::Vector3d told_ = Eigen::Vector3d::Zero();  // the rotation that was told last
  std::optional<Snapshot> pending_;                 // a turn that the next look is to confirm
  std::optional<Snapshot> settled_;                 // the same, since it no longer shakes
  capture::Timestamp pending_since_{}, next_relocation_{};
  capture::Duration relocation_pause_{0};
};

}  // namespace huetrack::room_watch
