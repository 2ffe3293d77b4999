// Why something cannot be calibrated: what was found, and which fault it is. Facts only: what to do about a fault is
// said in calib/report/advice.h. Whoever shows such an error to people takes its text from there.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

namespace huetrack::solver {

// The faults that somebody can mend: one for each thing that there is to do.
enum class Fault {
  // Of a board before cameras.
  too_few_views,
  no_lens_fits,         // no lens leaves little, as for pictures of another camera
  lens_does_not_fit,    // the one lens model that was asked for
  undetermined,         // the views leave open what is to be found of them
  no_overlap,           // two groups of cameras hardly saw the board together; Reason::cameras: one of each group
  mirrored_images,      // of one of two cameras
  different_sizes,      // one camera sees the board larger than another
  contradicting_views,  // of two cameras, and nothing simple explains it
  other_rig,            // no view fits the rig that is checked
  // Of measured points.
  collinear_points,
  undecided_floor,  // as many cameras are above the points as below
  // Of an object that is waved.
  target_unseen,
  too_little_motion,
  motion_in_a_plane,
  undetermined_poses,  // by how the object moved
  unconnected_cameras,
  contradicting_motion,  // no two cameras agree on it
  unplaced_camera,
  wrong_poses,  // those that the rig has
  no_rests,     // at two places, whose distance was to set the scale
  wrong_distance,
  wrong_radius,
  wrong_scale,  // the radius contradicts a distance, and it is open which of the two is wrong
  // Nothing can be done, or the fact says it all. The last one: all that are before it have advice.
  none,
};

// One thing that was found.
struct Reason {
  std::string fact;  // a clause with names and numbers; of a later one with what joins it: "; and by the rig ..."
  Fault fault = Fault::none;
  std::vector<std::string> cameras{};  // those that have to be named where something is to be done; see Fault
};

// All the facts in one text.
std::string facts(const std::vector<Reason>& reasons);

// The same, the first fact after these words.
std::vector<Reason> after(const std::string& words, std::vector<Reason> reasons);

// The calibration cannot be done with this input. what() is one readable line that states facts: which input, and what
// is wrong with it. For people: report::with_advice().
class CalibrationError : public std::runtime_error {
 public:
  explicit CalibrationError(const std::string& fact, Fault fault = Fault::none);
  explicit CalibrationError(std::vector<Reason> reasons);

  Fault fault() const;  // the first that there is
  const std::vector<Reason>& reasons() const { return reasons_; }

 private:
  std::vector<Reason> reasons_;
};

}  // namespace huetrack::solver
