#include "calib/report/advice.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <string_view>
#include <utility>

namespace huetrack::report {

namespace {

using solver::Fault;

// In the order of Fault.
constexpr std::pair<Fault, std::string_view> advices[] = {
    {Fault::too_few_views, "Some 15 with the board tilted and in all parts of the image are good"},
    {Fault::no_lens_fits, "are all images of this camera, and not cropped or zoomed?"},
    {Fault::lens_does_not_fit, "without --lens the model that predicts the views best is chosen"},
    {Fault::undetermined,
     "show the board at more places, tilted, and out to the image's edges; or ask for a simpler lens model"},
    {Fault::no_overlap, "show it to {} (or to others of the two groups) together, 10 times or more"},
    {Fault::mirrored_images,
     "switch mirroring off in the camera or its driver; or, if it sees the back of the board, add back: to the board "
     "file"},
    {Fault::different_sizes, "did they see different boards, or is one camera's focal length wrong?"},
    {Fault::contradicting_views,
     "were the images taken at the same time, are they in the right order, and was a camera moved?"},
    {Fault::other_rig, "is it the rig of these cameras?"},
    {Fault::collinear_points, "Measure one away from the line"},
    {Fault::undecided_floor, "are the points on the floor?"},
    {Fault::target_unseen,
     "Check the target's colour (hue, saturation, intensity) in this camera, or wave it in front of it"},
    {Fault::too_little_motion, "Wave it through the whole volume"},
    {Fault::motion_in_a_plane, "wave it through the whole volume, up and down and towards the cameras too"},
    {Fault::undetermined_poses, "carry it through the whole volume, up and down and towards the cameras"},
    {Fault::hidden_ball, "wave it on a thin stick, or throw it"},
    {Fault::unconnected_cameras, "Wave it where both see it"},
    {Fault::contradicting_motion,
     "is its colour seen on anything else that moves? Wave for longer, through the whole volume, or begin with a rig "
     "of approximate poses"},
    {Fault::unplaced_camera, "Wave the ball where it and two other cameras see it at once"},
    {Fault::wrong_poses, "Find poses and times together, with wave"},
    {Fault::no_rests, "hold it still for two seconds at each of the two marks, in sight of two cameras"},
    {Fault::wrong_distance,
     "was it measured from lens to lens, in metres? If the rig's scale was only a guess, correct it first"},
    {Fault::wrong_radius, "measure it, and correct it"},
    {Fault::wrong_scale, "correct the radius, or the measured distance, which is in metres"},
};
static_assert(std::size(advices) == std::size_t(Fault::none));

}  // namespace

std::string advice(const solver::Reason& reason) {
  if (reason.fault == Fault::none) return {};
  const std::string_view text =
      std::ranges::find(advices, reason.fault, &std::pair<Fault, std::string_view>::first)->second;
  // Fault::no_overlap names the cameras.
  return fmt::format(fmt::runtime(text), fmt::join(reason.cameras, " and "));
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
