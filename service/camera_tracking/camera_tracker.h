// The interface of the camera trackers: the 6-DoF pose of one moving, calibrated camera in the world.
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

// Where the first pose comes from. It defines the world frame and its scale. Points: world frame, metres.
struct RectangleStart {                  // a dark rectangle on a light ground, or the reverse, detected in the image
  std::vector<Eigen::Vector3d> corners;  // 4, clockwise as the camera sees them; which is first: find_rectangle()
  std::vector<Eigen::Vector2d> pixels;   // empty: detected. Else where the 4 lie in the first frame, approximately
};
struct PointsStart {                    // known points with their raw pixels in the first frame
  std::vector<Eigen::Vector3d> points;  // >= 4
  std::vector<Eigen::Vector2d> pixels;  // as many
};
// A detector from outside of this module: the configuration passes calib/board's detector of printed boards. Called
// with each frame until it returns a value, and again when the pose was lost. Never throws.
struct FoundStart {
  std::function<std::optional<PointsStart>(const capture::Image&)> find;
};
struct LedStart {                     // no initial pose: uniform over the room
  std::vector<Eigen::Vector3d> leds;  // positions; >= 4; if all lie in one plane, the pose may stay ambiguous
  // Periodic: the index of the LED that is lit in each frame or slot, -1: none. Empty: any number of unidentified LEDs.
  std::vector<int> schedule;
  // 0: one entry per frame of the camera's stream. > 0, seconds: the duration of an entry, by capture time since the
  // clock's zero. The method huetrack estimates the schedule's offset (LedOffsetSearch).
  double slot_s = 0;
  Eigen::Vector3d room_min{-3, -3, 0}, room_max{3, 3, 3};
};
using CameraStart = std::variant<RectangleStart, PointsStart, FoundStart, LedStart>;

struct CameraTrackerOptions {
  CameraMethod method = CameraMethod::huetrack;
  CameraStart start;
  int particle_count = 0;          // 0: the method's default
  std::uint64_t seed = 1;          // same seed, frames and options: the same trajectory, bit for bit
  std::filesystem::path load_map;  // empty: none
  bool as_printed = false;         // lee, pupilli: the paper's filter without our additions (design.md)
  std::vector<std::string> problems() const;
};

// Internals of a tracker, for drawing; raw pixels, world frame, metres.
struct CameraTrackerInside {
  struct Feature {
    Eigen::Vector2f px;                                // where the pose projects it
    Eigen::Vector2f found_px;                          // where it was found; NaN: not found
    Eigen::Matrix2f search = Eigen::Matrix2f::Zero();  // covariance of the search region, px^2
    Eigen::Vector3d position;                          // world
    Eigen::Matrix3d covariance;                        // m^2
    bool given = false;                                // a start point, not a mapped one
  };
  std::vector<Feature> features;
  std::vector<calib::Rigid3d> particles;  // world_from_camera, at most 300
};

// thread-compatible, one per camera. Only save_map() throws. Created by methods/make_camera_tracker.h.
class CameraTracker {
 public:
  virtual ~CameraTracker() = default;

  // Frames of this camera in time order, of the rig's image size. Camera::cam_from_world is not used.
  virtual CameraEstimate update(const capture::Frame& frame) = 0;
  // The next frame does not continue the last one: the camera is somewhere else. The map is kept.
  virtual void begin_anew() = 0;
  // The following refer to the last update.
  virtual std::string why_no_pose() const { return {}; }  // for the user; empty: there is a pose, or no known reason
  virtual CameraTrackerInside inside() const = 0;
  virtual std::vector<CameraMapPoint> map() const = 0;
  virtual void save_map(const std::filesystem::path& file) const = 0;  // throws std::runtime_error naming the file
};

}  // namespace huetrack::camera_tracking
