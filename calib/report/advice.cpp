#include "calib/report/advice.h"

#include <fmt/format.h>

namespace huetrack::report {

std::string advice(const solver::Reason& reason) {
  switch (reason.fault) {
    case solver::Fault::too_few_views:
      return "Some 15 with the board tilted and in all parts of the image are good";
    case solver::Fault::no_lens_fits:
      return "are all images of this camera, and not cropped or zoomed?";
    case solver::Fault::lens_does_not_fit:
      return "without --lens the model that predicts the views best is chosen";
    case solver::Fault::undetermined:
      return "show the board at more places, tilted, and out to the image's edges; or ask for a simpler lens model";
    case solver::Fault::no_overlap:
      return fmt::format("show it to {} (or to others of the two groups) together, 10 times or more",
                         fmt::join(reason.cameras, " and "));
    case solver::Fault::mirrored_images:
      return "switch mirroring off in the camera or its driver; or, if it sees the back of the board, add back: to the "
             "board "
             "file";
    case solver::Fault::different_sizes:
      return "did they see different boards, or is one camera's focal length wrong?";
    case solver::Fault::contradicting_views:
      return "were the images taken at the same time, are they in the right order, and was a camera moved?";
    case solver::Fault::other_rig:
      return "is it the rig of these cameras?";
    case solver::Fault::collinear_points:
      return "Measure one away from the line";
    case solver::Fault::undecided_floor:
      return "are the points on the floor?";
    case solver::Fault::target_unseen:
      return "Check the target's colour (hue, saturation, intensity) in this camera, or wave it in front of it";
    case solver::Fault::too_little_motion:
      return "Wave it through the whole volume";
    case solver::Fault::motion_in_a_plane:
      return "wave it through the whole volume, up and down and towards the cameras too";
    case solver::Fault::undetermined_poses:
      return "carry it through the whole volume, up and down and towards the cameras";
    case solver::Fault::unconnected_cameras:
      return "Wave it where both see it";
    case solver::Fault::contradicting_motion:
      return "is its colour seen on anything else that moves? Wave for longer, through the whole volume, or begin with "
             "a "
             "rig of approximate poses";
    case solver::Fault::unplaced_camera:
      return "Wave the ball where it and two other cameras see it at once";
    case solver::Fault::wrong_poses:
      return "Find poses and times together, with wave";
    case solver::Fault::no_rests:
      return "hold it still for two seconds at each of the two marks, in sight of two cameras";
    case solver::Fault::wrong_distance:
      return "was it measured from lens to lens, in metres? If the rig's scale was only a guess, correct it first";
    case solver::Fault::wrong_radius:
      return "measure it, and correct it";
    case solver::Fault::wrong_scale:
      return "correct the radius, or the measured distance, which is in metres";
    case solver::Fault::none:
      break;
  }
  return {};
}

std::string with_advice(const std::vector<solver::Reason>& reasons) {
  std::string text;
  for (const solver::Reason& reason : reasons) {
    text += reason.fact;
    const std::string to_do = advice(reason);
    if (to_do.empty()) continue;
    const bool is_sentence = to_do.front() >= 'A' && to_do.front() <= 'Z';
    text += (is_sentence ? ". " : ": ") + to_do;
  }
  return text;
}

std::string with_advice(const solver::CalibrationError& error) {
  return with_advice(error.reasons());
}

}  // namespace huetrack::report
