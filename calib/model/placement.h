// Where a rig's cameras are and look, for a person to recognise poses of another convention. Lens distortion aside.
#pragma once

#include <optional>
#include <span>

#include "calib/model/camera_rig.h"

namespace huetrack::calib {

// The point nearest to all optical axes, as the cameras see it.
struct Middle {
  bool is_in_all_pictures = false;
  double distance = 0;  // mean depth
  double widest = 0;    // between two cameras
};
Middle middle_of(std::span<const Camera> cameras);

// Whether there is a place that all cameras see, however far away.
bool see_a_place(std::span<const Camera> cameras);

// As if the poses were world_from_cam, which is the commonest mistake.
void invert_poses(std::span<Camera> cameras);

// Of the inverted poses, where the cameras look at one place with these, and are further apart than as they are: with
// inverted poses, cameras around a place seem to be near one point. nullopt: not so.
std::optional<Middle> better_inverted(std::span<const Camera> cameras);

// Whether the poses are probably inverted. inverted: of better_inverted(). If the world is the frame of one camera,
// inverting right poses spreads the cameras at most twice as far.
bool are_probably_inverted(std::span<const Camera> cameras, const Middle& inverted);

}  // namespace huetrack::calib
