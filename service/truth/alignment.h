// Explains the error of a track against its ground truth by another clock, another world frame or another scale, and
// removes it. Pure.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "truth/truth.h"

namespace huetrack::truth {

// One estimate of a track.
struct Estimated {
  Timestamp at;
  Eigen::Vector3d position;
  Eigen::Matrix3d covariance;
};

struct TargetTrack {
  std::string target;
  std::span<const Estimated> estimates;  // of state tracking, in any order
};

enum class Freedom : std::uint8_t { none, rigid, similarity };  // as of evo: --align, --align --correct_scale

// truth = scale * rotation * track + translation, at the track's time minus offset_s.
struct Alignment {
  Freedom freedom = Freedom::none;
  bool aligns_time = false;
  double offset_s = 0;  // the track's clock minus the truth's
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  double scale = 1;
  double shift_m = 0;  // how far the middle of the track moves
  double rms_m = 0;    // of the errors that are left

  Estimated aligned(const Estimated& estimate) const;
  // "a clock offset of 0.0333 s and a rigid transform (turns by 2.10 degrees, moves by 34.0 mm)"; given_s: of the clock
  // offset, subtracted before.
  std::string text(double given_s = 0) const;
};

// The alignment with the least rms error (Umeyama, 1991), common to these tracks; the clock offset nearest to 0 that
// has one. nullopt: fewer than 30 estimates have a truth.
std::optional<Alignment> align(const Truth& truth, std::span<const TargetTrack> tracks, Freedom freedom,
                               bool aligns_time);

// The axes of track and truth are of different handedness, as after the negation of one axis.
struct Mirrored {
  std::optional<int> axis;  // of the truth: without its sign nothing else is left; nullopt: also turned, or exchanged
  double rms_m = 0;         // with a reflection, a rigid transform and a clock offset
};

struct Explanation {
  double rms_m = 0;  // as it is
  Alignment by;      // the simplest one that explains more than half of that
  Alignment full;    // a rigid transform and a clock offset; also a scale, if that explains more than half of the rest
  std::optional<Mirrored> mirrored = {};  // if it explains more than half of what all of these leave
};
std::optional<Explanation> explanation(const Truth& truth, std::span<const TargetTrack> tracks);
// What was applied to the track before it was explained: the options that the user gave.
struct Applied {
  Freedom freedom = Freedom::none;
  bool aligns_time = false;
  double clock_offset_s = 0;  // subtracted
};
// One sentence for people, with the options that do all that: those given and what is left.
std::string to_text(const Explanation& explanation, const Applied& applied);

// A subsample of at most 4000 estimates, spread over the whole track. thread-compatible.
class EstimatedSample {
 public:
  void add(const Estimated& estimate);
  std::span<const Estimated> kept() const { return kept_; }

 private:
  std::vector<Estimated> kept_;
  std::size_t every_ = 1, seen_ = 0;
};

}  // namespace huetrack::truth
