// WHERE IS THE CAMERA: one moving, calibrated camera; its 6-DoF pose in the world.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "calib/model/camera_rig.h"
#include "camera_tracking/camera_estimate.h"
#include "capture/frames/frame.h"

namespace huetrack::camera_tracking {

enum class CameraMethod : std::uint8_t {
  huetrack,  // ours
  pupilli,   // Pupilli and Calway 2005
  lee,       // Lee 2014 (Journal of Electronic Imaging 23(1), 013029)
  herranz,   // Herranz et al. 2014: LED markers at known positions
};
std::string_view name(CameraMethod method);  // "huetrack", ...

// How the tracker finds its first pose, and with it the world frame and metres. Points in the world frame, metres.
struct RectangleStart {  // a dark rectangle on a light ground, or the reverse, found in the view
  // 4, clockwise as the camera sees them; which one is the first is said at find_rectangle().
  std::vector<Eigen::Vector3d> corners;
  // Empty: found and ordered by itself. Else about where the 4 lie in the first frame.
  std::vector<Eigen::Vector2d> pixels;
};
struct PointsStart {                    // known points with their raw pixels in the first frame
  std::vector<Eigen::Vector3d> points;  // >= 4
  std::vector<Eigen::Vector2d> pixels;  // as many
};
// Something that is found in a view by what this module does not know: a printed board, for which the configuration
// passes calib/board's detector in. Called with frames until it answers, and again for a proof when the pose was lost.
// Never throws.
struct FoundStart {
  std::function<std::optional<PointsStart>(const capture::Image&)> find;
};
struct LedStart {                     // no pose at all: uniform over the room
  std::vector<Eigen::Vector3d> leds;  // positions; >= 4 of them not in one plane, or the pose stays ambiguous
  // Which LED is lit in which frame of the camera (index into leds, -1: none), repeated from the beginning; empty: LEDs
  // are not identified, and any number may be lit.
  std::vector<int> schedule;
  // 0: one entry of the schedule per frame of the camera (or of the recorded stream, whatever part of it is played).
  // More, seconds: each entry holds for so long, by capture time, from the clock's zero on. The method huetrack finds
  // by itself by how many slots the schedule is off (LedOffsetSearch).
  double slot_s = 0;
  Eigen::Vector3d room_min{-3, -3, 0}, room_max{3, 3, 3};
};
using CameraStart = std::variant<RectangleStart, PointsStart, FoundStart, LedStart>;

struct CameraTrackerOptions {
  CameraMethod method = CameraMethod::huetrack;
  CameraStart start;
  int particle_count = 0;          // 0: the method's own
  std::uint64_t seed = 1;          // same seed, frames and options: the same trajectory, bit for bit
  std::filesystem::path load_map;  // empty: none
  bool as_printed = false;  // lee, pupilli: the paper's filter without our additions (README.md, "Where they depart")
  std::vector<std::string> problems() const;
};

// What can be drawn of a tracker's inside; raw pixels, world frame, metres.
struct CameraTrackerInside {
  struct Feature {
    Eigen::Vector2f px;                                // where the pose projects it
    Eigen::Vector2f found_px;                          // where the image shows it; NaN: not found
    Eigen::Matrix2f search = Eigen::Matrix2f::Zero();  // covariance of the search region, px^2
    Eigen::Vector3d position;                          // world
    Eigen::Matrix3d covariance;                        // m^2
    bool given = false;                                // a start point, not one that was mapped
  };
  std::vector<Feature> features;
  std::vector<calib::Rigid3d> particles;  // world_from_camera, some hundred at most
};

// thread-compatible, one per camera. Never throws after construction. methods/make_camera_tracker.h makes one.
class CameraTracker {
 public:
  virtual ~CameraTracker() = default;

  // Frames of this camera in time order, of the rig's image size (the caller checks at start). Camera::cam_from_world
  // is not used.
  virtual CameraEstimate update(const capture::Frame& frame) = 0;
  // After the last update: why it has no pose, for the user ("the 4 known points do not fit: 37 px rms"). Empty: it has
  // one, or there is nothing to say.
  virtual std::string why_no_pose() const { return {}; }
  virtual CameraTrackerInside inside() const = 0;                      // after the last update
  virtual std::vector<CameraMapPoint> map() const = 0;                 // after the last update
  virtual void save_map(const std::filesystem::path& file) const = 0;  // throws std::runtime_error naming the file
};

}  // namespace huetrack::camera_tracking
