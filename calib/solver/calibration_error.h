// Failure of a calibration: facts and a fault code. calib/report/advice.h adds what to do, and makes the text for
// users.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

namespace huetrack::solver {

// Faults that a user can mend, one per remedy.
enum class Fault {
  // Board views.
  too_few_views,
  no_lens_fits,         // images of another camera, for instance
  lens_does_not_fit,    // the lens model that was requested
  undetermined,         // by the views
  no_overlap,           // between two groups of cameras; Reason::cameras: one of each
  mirrored_images,      // of one of two cameras
  different_sizes,      // of the board, between two cameras
  contradicting_views,  // of two cameras, for no simple reason
  other_rig,            // no view fits the checked rig
  // Measured points.
  collinear_points,
  undecided_floor,  // as many cameras are above the points as below
  // Waved ball.
  target_unseen,
  too_little_motion,
  motion_in_a_plane,
  undetermined_poses,  // by the ball's motion
  hidden_ball,         // by a hand, too much
  unconnected_cameras,
  contradicting_motion,  // no two cameras agree
  unplaced_camera,
  wrong_poses,  // of the rig
  no_rests,     // at two places, for the scale
  wrong_distance,
  wrong_radius,
  wrong_scale,  // radius and measured distance contradict each other
  // No advice. Must be last.
  none,
};

struct Reason {
  std::string fact;  // a clause with names and numbers; a later one begins with its conjunction: "; and by the rig ..."
  Fault fault = Fault::none;
  std::vector<std::string> cameras{};  // that the advice names; see Fault
};

// Concatenated.
std::string facts(const std::vector<Reason>& reasons);

// The same, with `words` before the first fact.
std::vector<Reason> after(const std::string& words, std::vector<Reason> reasons);

// The input cannot be calibrated. what(): one line of facts.
class CalibrationError : public std::runtime_error {
 public:
  explicit CalibrationError(const std::string& fact, Fault fault = Fault::none);
  explicit CalibrationError(std::vector<Reason> reasons);

  Fault fault() const;  // the first that is not none
  const std::vector<Reason>& reasons() const { return reasons_; }

 private:
  std::vector<Reason> reasons_;
};

}  // namespace huetrack::solver
