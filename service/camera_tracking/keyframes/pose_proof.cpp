#include "camera_tracking/keyframes/pose_proof.h"

namespace huetrack::keyframes {
namespace {

// A pose that leaves more open than this is none, whatever agrees with it: 2 % of the distance, and 0.02 rad, by which
// the image moves by 5 px at an image width of 320.
constexpr double most_open_of_depth = 0.02, most_open_rad = 0.02;
// Residuals so many times what they should be are not those of noise.
constexpr double most_scale = 3.5;

// Chance finds some share of points anywhere. That they agree on a pose, are many, are a fair share of what should be
// seen, and lie all over the place is not chance.
struct Enough {
  int found;         // at least
  double share;      // more than so much of what was sought
  double spread_px;  // more than that, at an image width of 320
};
constexpr Enough when_followed{15, 0.25, 11};
// Of many guesses some look right by chance, and nothing before speaks for them.
constexpr Enough when_guessed{25, 0.35, 16};
// At the beginning there are few points, but nothing is in doubt either: nearly all of them must be there.
constexpr Enough when_young{7, 0.6, 16};
constexpr int young_keyframes = 4, young_sought = 30;  // fewer key frames; at most so many points to be seen
// Started from 4 to 6 known points: while the map has hardly more than those, all of them are enough.
constexpr int bare_map_points = 12;  // fewer
constexpr int fewest_given = 4;      // leave a pose no freedom
// A rectangle alone is proof while nothing else is known; later, another one of this shape may lie about, so that a
// good share of the points must be there, too.
constexpr int points_that_can_object = 8;
constexpr double share_beside_rectangle = 0.4;

double share_of(const PoseEvidence& e) {
  return e.sought > 0 ? static_cast<double>(e.found) / e.sought : 0;
}

bool has(const PoseEvidence& e, const Enough& enough) {
  return e.found >= enough.found && share_of(e) > enough.share &&
         e.spread_px > enough.spread_px * (e.image_width_px / 320.0);
}

bool is_sure(const PoseEvidence& e) {
  return e.position_sigma_m < most_open_of_depth * e.depth_m && e.rotation_sigma_rad < most_open_rad &&
         e.scale < most_scale;
}

bool shows_rectangle(const PoseEvidence& e) {
  if (e.corners < 4) return false;
  if (e.sought >= points_that_can_object) return share_of(e) > share_beside_rectangle;
  return !e.is_guess || e.map_points < bare_map_points;
}

}  // namespace

Proof proof_of(const PoseEvidence& e) {
  if (!is_sure(e)) return Proof::none;
  if (has(e, e.is_guess ? when_guessed : when_followed)) return Proof::by_points;
  if (!e.is_guess && e.keyframes < young_keyframes && e.sought <= young_sought && has(e, when_young))
    return Proof::by_few;
  if (!e.is_guess && e.map_points < bare_map_points && e.found >= fewest_given && e.found == e.sought)
    return Proof::by_all_given;
  if (shows_rectangle(e)) return Proof::by_rectangle;
  return Proof::none;
}

}  // namespace huetrack::keyframes
