#include "camera_tracking/keyframes/pose_proof.h"

namespace huetrack::keyframes {
namespace {

// Largest sigmas of a pose: as a share of the distance, and an angle that moves a 320 px wide image by 5 px.
constexpr double max_sigma_of_depth = 0.02, max_sigma_rad = 0.02;
constexpr double most_scale = 3.5;  // of the residuals, over their sigmas

// Least evidence that chance matches do not reach.
struct Enough {
  int found;         // at least
  double share;      // of sought; more than
  double spread_px;  // at an image width of 320; more than
};
constexpr Enough when_followed{15, 0.25, 11};
// A guess is one of many hypotheses without a predecessor.
constexpr Enough when_guessed{25, 0.35, 16};
// A young map has few points, and nearly all of them must be found.
constexpr Enough when_young{7, 0.6, 16};
constexpr int young_keyframes = 4, young_sought = 30;  // fewer than; at most
// Started from known points, with hardly any others in the map.
constexpr int bare_map_points = 12;  // fewer than
constexpr int fewest_given = 4;      // determine a pose
// With a grown map another rectangle of this shape may be in view: the points must support the pose, too.
constexpr int enough_to_contradict = 8;
constexpr double share_with_rectangle = 0.4;

double share_of(const PoseEvidence& e) {
  return e.sought > 0 ? static_cast<double>(e.found) / e.sought : 0;
}

bool has(const PoseEvidence& e, const Enough& enough) {
  return e.found >= enough.found && share_of(e) > enough.share &&
         e.spread_px > enough.spread_px * (e.image_width_px / 320.0);
}

bool is_sure(const PoseEvidence& e) {
  return e.position_sigma_m < max_sigma_of_depth * e.depth_m && e.rotation_sigma_rad < max_sigma_rad &&
         e.scale < most_scale;
}

bool shows_rectangle(const PoseEvidence& e) {
  if (e.corners < 4) return false;
  if (e.sought >= enough_to_contradict) return share_of(e) > share_with_rectangle;
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
